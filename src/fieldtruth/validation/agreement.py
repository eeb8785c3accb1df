# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR and cameras see one place: points that fall on even parts of an image have the pixels' class, object and depth.

Clouds are projected as any user would do it: by /tf_static and CameraInfo alone. Even is where 5 x 5 pixels are of one
class and object, and of one plane: inverse depth is affine in the image of a plane. There the image is known between
its pixels. LiDAR and camera do not sit in one place, so that a point may be hidden from the camera; and what is
narrower than a pixel, a blade or a twig, may stand before what the pixels see. Neither is a fault, so shares are judged
and not points.
"""

from collections import OrderedDict
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import frames
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.validation.bundle import Bundler, Moment
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.sampler import Sampler
from fieldtruth.validation.subject import Examiner, Subject

F8 = NDArray[np.float64]

BEND: Final = 0.003
"""Of inverse depth, by which 5 x 5 pixels may depart from a plane."""
OTHER_BOUND: Final = 0.02
"""Share of points at the pixels' depth that may be another thing; up to 0.006 was seen in 360 views of four places."""
ELSEWHERE_BOUND: Final = 0.25
"""Share of points on even parts that may lie at another depth; up to 0.075 was seen there."""
BLIND_BOUND: Final = 0.15
"""Share of points on parts of one class that may have another, without depth; up to 0.048 was seen there."""
FEW: Final = 200
"""Points below which a moment's shares say nothing."""
_NEAR: Final = 0.3  # [m] in front of the camera
_KEPT: Final = 4
_AROUND: Final = np.arange(-2, 3)


class Shares(NamedTuple):
    """A moment's points: how many were compared, and the share that is otherwise."""

    place: str
    compared: int
    elsewhere: float
    """Share at another depth; 0 without depth images."""
    at_depth: int
    other: float
    """Share of other class or object, of those at the pixels' depth (or, without depth, of all)."""
    deep: bool


class Agreement(Examiner):
    """Clouds against images on a sample of moments."""

    def __init__(self, subject: Subject, sampler: Sampler) -> None:
        self._subject = subject
        self._sampler = sampler
        self._bundler = Bundler(("tag", "depth", "instances"), subject.run.counts, self._submit)
        self._infos = {table.camera_info(side): side for side in table.SIDES}
        self.topics = [*self._bundler.topics, table.POINTS, *self._infos]
        self._clouds: OrderedDict[int, Any] = OrderedDict()
        self._lens: dict[str, Any] = {}
        self._same = subject.law("points are what the pixels at their depth are", OTHER_BOUND, "of the points")
        self._depth = subject.law("points have the depth of the pixels on which they fall", ELSEWHERE_BOUND, "of them")
        self._blind = subject.law(
            "points have the class of the pixels on which they fall", BLIND_BOUND, "of the points"
        )
        self._compared = self._moments = 0
        self._why = "there are not both clouds and tag images of the same moments, or no /tf_static and CameraInfo"

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        if raw.topic == table.POINTS:
            self._clouds[raw.stamp_ns] = message
            if len(self._clouds) > _KEPT:
                self._clouds.popitem(last=False)
        elif raw.topic in self._infos:
            self._lens.setdefault(self._infos[raw.topic], message)
        else:
            self._bundler.add(raw.topic, raw.stamp_ns, message)

    def finish(self) -> None:
        """See the end of the bag."""
        self._bundler.finish()

    def results(self) -> list[Check]:
        """LiDAR and cameras."""
        worst = " and ".join(law.margin for law in (self._same, self._depth, self._blind) if law.seen)
        return [
            check_of("lidar and cameras", [self._same, self._depth, self._blind],
                     f"{self._compared:,} points of {self._moments} moments are what the pixels are; "
                     f"otherwise at most {worst}", self._why)
        ]  # fmt: skip

    def _submit(self, moment: Moment) -> None:
        cloud, lens = self._clouds.get(moment.stamp_ns), self._lens.get(moment.side)
        if cloud is None or lens is None or "tag" not in moment.parts or not self._sampler.takes(moment.stamp_ns):
            return
        if self._subject.rig.lidar.spinning:
            self._why = "the LiDAR turns while the robot moves; its points are compared by the retrace"
            return
        try:
            static = self._subject.frames
            base_from_optical = static.base_from(lens.header.frame_id)
            optical_from_lidar = frames.inverse(base_from_optical) @ static.base_from(cloud.header.frame_id)
        except FieldtruthError:
            return
        self._subject.submit(
            lambda: _compare(moment, cloud, np.reshape(lens.K, (3, 3)), optical_from_lidar), self._fold
        )

    def _fold(self, shares: Shares | None) -> None:
        if shares is None or shares.compared < FEW:
            return
        self._moments += 1
        self._compared += shares.compared
        figures = f"{shares.place}, {shares.compared:,} points"
        if shares.deep:
            self._depth.measure(shares.elsewhere, figures)
            if shares.at_depth >= FEW:
                self._same.measure(shares.other, figures)
        else:
            self._blind.measure(shares.other, figures)


def _compare(moment: Moment, cloud: Any, k: F8, optical_from_lidar: F8) -> Shares | None:
    try:
        points = read.points(cloud)
        label = read.labels(read.image(moment.parts["tag"]))
        depth = read.depth(moment.parts["depth"]) if "depth" in moment.parts else None
        instance = read.instances(moment.parts["instances"]) if "instances" in moment.parts else None
        u, v, z, rows = _projected(points, k, optical_from_lidar, label.shape)
        row, column = np.rint(v).astype(int), np.rint(u).astype(int)
        around = row[:, None, None] + _AROUND[:, None], column[:, None, None] + _AROUND
        even = _equal(label[around])
        same = label[row, column] == points["label"][rows]
        if instance is not None:
            even &= _equal(instance[around])
            same &= instance[row, column] == points["instance"][rows]
        place = moment.place("tag")
        if depth is None:
            count = int(even.sum())
            return Shares(place, count, 0.0, count, float((~same[even]).mean()) if count else 0.0, deep=False)
        there, plane = _depth_between(depth[around], v - row, u - column)
    except (FieldtruthError, ValueError, KeyError, IndexError):
        return None  # what is wrong with the parts is told by their own laws
    even &= plane
    at = even & (np.abs(there - z) <= 0.01 + BEND * z)
    count, at_depth = int(even.sum()), int(at.sum())
    other = float((~same[at]).mean()) if at_depth else 0.0
    return Shares(place, count, 1.0 - at_depth / count if count else 0.0, at_depth, other, deep=True)


def _projected(
    points: NDArray[np.void], k: F8, optical_from_lidar: F8, shape: tuple[int, ...]
) -> tuple[F8, F8, F8, NDArray[np.intp]]:
    """Image point (u, v) [pixel], depth [m] and row of the points that fall into an image, 3 pixels inside."""
    with np.errstate(invalid="ignore"):
        xyz = frames.transform(optical_from_lidar, np.stack([points[axis] for axis in "xyz"], axis=-1))
        ahead = np.flatnonzero(np.isfinite(xyz).all(axis=1) & (xyz[:, 2] > _NEAR))
    x, y, z = xyz[ahead].T
    u, v = k[0, 2] + k[0, 0] * x / z, k[1, 2] + k[1, 1] * y / z
    inside = (u > 3) & (u < shape[1] - 4) & (v > 3) & (v < shape[0] - 4)
    return u[inside], v[inside], z[inside], ahead[inside]


def _equal(around: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether 5 x 5 values are all the same."""
    flat = around.reshape(len(around), -1)
    equal: NDArray[np.bool_] = (flat == flat[:, :1]).all(axis=1)
    return equal


def _depth_between(around: NDArray[np.float32], dv: F8, du: F8) -> tuple[F8, NDArray[np.bool_]]:
    """Depth [m] at fractions of a pixel beside the middle of 5 x 5 depths, and whether these are of one plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.isfinite(around) & (around > 0), 1.0 / around.astype(np.float64), 0.0)
    middle = inverse[:, 2, 2]
    slope_v = (inverse[:, 3, 2] - inverse[:, 1, 2]) / 2
    slope_u = (inverse[:, 2, 3] - inverse[:, 2, 1]) / 2
    plane = middle[:, None, None] + slope_v[:, None, None] * _AROUND[:, None] + slope_u[:, None, None] * _AROUND
    even = (np.abs(inverse - plane) < BEND * middle[:, None, None]).all(axis=(1, 2)) & (middle > 0)
    return 1.0 / np.maximum(middle + slope_v * dv + slope_u * du, 1e-9), even
