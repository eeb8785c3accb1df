# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""LiDAR against cameras: points that fall on flat parts of an image have the pixels' class, instance and depth.

Clouds are projected by /tf_static and CameraInfo alone. A part is flat where 5 x 5 pixels are of one class and
instance, and of one plane: the inverse depth of a plane is affine in the image, so that it is known between the pixels.
LiDAR and camera have different viewpoints, and blades or twigs narrower than a pixel may hide what the pixels show; so
shares of points are checked, not single points. What hides a point from the camera is in front of it, so that from any
viewpoint hardly a point is in front of what its pixel shows. How many are behind depends on the distance between the
two and on the grass about them: this share is checked only where they are close together and above the grass.
"""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.sensors.camera.check_frames import CameraFrame, CameraFrameChecker
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Context, Sampler
from fieldtruth.validation.kind_checks import LabelledPoints

# Shares in 360 views of four environments were up to 0.006, 0.075 and 0.048; in 446 views of pairs of sensors that are
# 0.05 to 1.5 m apart, 0.15 to 1.6 m above base_link, up to 0.006 for objects, 0.010 in front, and 0.9 behind.
SAME_OBJECT: Final = Rule("points at the depth of their pixel have its class and instance id", 0.02, "of the points")
IN_FRONT: Final = Rule("points are not in front of what their pixel shows", 0.03, "of the points")
SAME_DEPTH: Final = Rule("points have the depth of their pixel, if the sensors are neighbours", 0.25, "of the points")
SAME_CLASS: Final = Rule(
    "without depth images, points of neighbours have the class of their pixel", 0.15, "of the points"
)
_NO_VIEWS: Final = "no clouds and tag images with the same stamps, or no /tf_static and CameraInfo"
_RULES: Final = (SAME_OBJECT, SAME_DEPTH, SAME_CLASS, IN_FRONT)
LIDAR_AND_CAMERAS: Final[Spec] = Spec("lidar and cameras", _RULES, "views", _NO_VIEWS)

BEND: Final = 0.003
"""Share of inverse depth by which 5 x 5 pixels may differ from a plane."""
FEW: Final = 200
"""Points below which the shares of a frame are not compared."""
_APART: Final = 0.3  # [m] between neighbours, at most; the paper's LiDAR and cameras are 0.14 m apart
_ABOVE: Final = 0.7  # [m] from the ground to neighbours, at least
_NEAR: Final = 0.3  # [m] in front of the camera
_KEPT: Final = 4  # clouds of each LiDAR
_AROUND: Final = np.arange(-2, 3)


class _View(NamedTuple):
    """A cloud and the images with the same stamp."""

    cloud: Any
    frame: CameraFrame
    k: Array
    optical_from_points: Array
    neighbours: bool
    where: str
    source: LabelledPoints


class Agreement(CameraFrameChecker):
    """Points of every sensor that has any against images of every camera, on a sample of their common stamps."""

    def __init__(self, context: Context, points: Sequence[LabelledPoints], sampler: Sampler) -> None:
        super().__init__(context, ("tag", "depth", "instances"))
        self._sampler, self._tally = sampler, context.tally(LIDAR_AND_CAMERAS)
        self._sources = {source.topic: source for source in points}
        self.topics = [*self.topics, *self._sources]
        self._clouds: OrderedDict[tuple[str, int], Any] = OrderedDict()
        self.tallies = [self._tally]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic in self._sources:
            self._clouds[raw.topic, raw.stamp_ns] = message
            if len(self._clouds) > _KEPT * len(self._sources):
                self._clouds.popitem(last=False)
        super().see(raw, message)

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        for source in self._sources.values():
            self._check_pair(frame, source)

    def _check_pair(self, frame: CameraFrame, source: LabelledPoints) -> None:
        cloud, lens = self._clouds.get((source.topic, frame.stamp_ns)), self.infos.get(frame.imager.name)
        if cloud is None or lens is None or "tag" not in frame.parts:
            return
        if not self._sampler.takes(frame.stamp_ns, source.sensor, frame.imager.config.name):
            return
        if reason := _not_comparable(lens, source):
            self._skip(reason)
            return
        try:
            base_from_optical = self.context.frames.base_from(lens.header.frame_id)
            base_from_points = self.context.frames.base_from(cloud.header.frame_id)
        except FieldtruthError:
            return
        optical_from_points, k = transforms.inverse(base_from_optical) @ base_from_points, np.reshape(lens.K, (3, 3))
        lowest = min(base_from_optical[2, 3], base_from_points[2, 3]) - self.context.rig.base_footprint.xyz[2]
        neighbours = bool(np.linalg.norm(optical_from_points[:3, 3]) < _APART and lowest > _ABOVE)
        if not neighbours and "depth" not in frame.parts:
            self._skip(f"{source.sensor} and {frame.imager.name} are no neighbours, and there are no depth images")
            return
        self._tally.skipped = f"fewer than {FEW} points of a cloud are on flat parts of an image"
        part = self._tally.part()
        view = _View(cloud, frame, k, optical_from_points, neighbours, f"{frame.at('tag')}, {source.topic}", source)
        self.context.jobs.append(lambda: [_compare(part, view)])

    def _skip(self, reason: str) -> None:
        """Note why views are not compared; the first reason counts."""
        if self._tally.skipped == _NO_VIEWS:
            self._tally.skipped = reason


def _not_comparable(lens: Any, source: LabelledPoints) -> str:
    """Why points and pixels of a camera with this CameraInfo cannot be compared; empty if they can."""
    if (lens.distortion_model, any(lens.D)) != ("plumb_bob", False):
        return f"the lens {lens.distortion_model} bends planes; its pixels are checked by retracing"
    return source.not_comparable


def _compare(tally: Tally, view: _View) -> Tally:
    frame = view.frame
    try:
        points = view.source.decode(view.cloud, frame.stamp_ns)
        label = read.labels(read.image(frame.parts["tag"]))
        depth = read.depth(frame.parts["depth"]) if "depth" in frame.parts else None
        instance = read.instances(frame.parts["instances"]) if "instances" in frame.parts else None
        u, v, z, rows = _projected(points, view.k, view.optical_from_points, label.shape)
        row, column = np.rint(v).astype(int), np.rint(u).astype(int)
        around = row[:, None, None] + _AROUND[:, None], column[:, None, None] + _AROUND
        flat, same = _equal(label[around]), label[row, column] == points["label"][rows]
        if instance is not None:
            flat &= _equal(instance[around])
            same &= instance[row, column] == points["instance"][rows]
        beyond = np.zeros(len(z))  # [m] from a point to what its pixel shows
        if depth is not None:
            metres, plane = _depth_between(depth[around], v - row, u - column)
            flat, beyond = flat & plane, metres - z
    except (FieldtruthError, ValueError, KeyError, IndexError):
        return tally  # errors of the parts are reported by their own checks
    limit = 0.01 + BEND * z
    at_depth = flat & (np.abs(beyond) <= limit)
    count, near = int(flat.sum()), int(at_depth.sum())
    if count < FEW:
        return tally
    where = f"{view.where}, {count:,} points"
    if depth is not None:
        tally[IN_FRONT].measure(float((flat & (beyond > limit)).sum()) / count, where)
        if view.neighbours:
            tally[SAME_DEPTH].measure(1.0 - near / count, where)
    if near >= FEW:
        other = float((~same[at_depth]).mean())
        tally[SAME_CLASS if depth is None else SAME_OBJECT].measure(other, where)
    return tally


def _projected(
    points: NDArray[np.void], k: Array, optical_from_points: Array, shape: tuple[int, ...]
) -> tuple[Array, Array, Array, NDArray[np.intp]]:
    """Image point (u, v) [pixel], depth [m] and row of the points that fall into an image, 3 pixels inside."""
    with np.errstate(invalid="ignore"):
        xyz = transforms.transform(optical_from_points, np.stack([points[axis] for axis in "xyz"], axis=-1))
        ahead = np.flatnonzero(np.isfinite(xyz).all(axis=1) & (xyz[:, 2] > _NEAR))
    x, y, z = xyz[ahead].T
    u, v = k[0, 2] + k[0, 0] * x / z, k[1, 2] + k[1, 1] * y / z
    inside = (u > 3) & (u < shape[1] - 4) & (v > 3) & (v < shape[0] - 4)
    return u[inside], v[inside], z[inside], ahead[inside]


def _equal(around: NDArray[Any]) -> Mask:
    """Whether 5 x 5 values (n, 5, 5) are all the same."""
    flat = around.reshape(len(around), -1)
    return np.asarray((flat == flat[:, :1]).all(axis=1))


def _depth_between(around: NDArray[np.float32], dv: Array, du: Array) -> tuple[Array, Mask]:
    """Depth [m] at fractions of a pixel beside the middle of 5 x 5 depths, and whether these are of one plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.isfinite(around) & (around > 0), 1.0 / around.astype(np.float64), 0.0)
    middle = inverse[:, 2, 2]
    slope_v, slope_u = (inverse[:, 3, 2] - inverse[:, 1, 2]) / 2, (inverse[:, 2, 3] - inverse[:, 2, 1]) / 2
    plane = middle[:, None, None] + slope_v[:, None, None] * _AROUND[:, None] + slope_u[:, None, None] * _AROUND
    flat = (np.abs(inverse - plane) < BEND * middle[:, None, None]).all(axis=(1, 2)) & (middle > 0)
    return 1.0 / np.maximum(middle + slope_v * dv + slope_u * du, 1e-9), flat
