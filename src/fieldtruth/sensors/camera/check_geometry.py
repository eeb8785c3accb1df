# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of images with the same stamp: CameraInfo, normals, optical flow, single rays, and LiDAR against cameras.

Rays of single pixels, found without the tables and the code by which the cameras find theirs. A direction is searched
whose image point is the pixel's centre: a search in one or two dimensions, with the formulas of the models written out
a second time (ROS's CameraInfo; OpenCV's calib3d and fisheye).

LiDAR against cameras: points that fall on flat parts of an image have the pixels' class, instance and depth. Clouds are
projected by /tf_static and CameraInfo alone. A part is flat where 5 x 5 pixels are of one class and instance, and of
one plane: the inverse depth of a plane is affine in the image, so that it is known between the pixels. LiDAR and camera
have different viewpoints, and blades or twigs narrower than a pixel may hide what the pixels show; so shares of points
are checked, not single points. What hides a point from the camera is in front of it, so that from any viewpoint hardly
a point is in front of what its pixel shows. How many are behind depends on the distance between the two and on the
grass about them: this share is checked only where they are close together and above the grass.
"""

import math
import threading
from collections import Counter, OrderedDict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, root

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import ClassTable
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.lenses import Lens
from fieldtruth.experiment.imaging_config import Imager
from fieldtruth.sense.robot import robot_views
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensor import camera_matrix, distortion, projection_matrix
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, Sampler, at
from fieldtruth.validation.kind_checks import LabelledPoints

EXTRAS: Final = ("parts", "passability")
"""Streams that are retraced with the classes."""
PARTS: Final = ("photograph", "tag", "depth", "instances", *EXTRAS)
"""Streams of which a frame consists."""
WAITING: Final = 3
"""Frames of each view of which parts are awaited; each has some megabytes."""


@dataclass
class CameraFrame:
    """One view of a camera at one stamp: messages by part (``PARTS``)."""

    imager: Imager
    stamp_ns: int
    classes: ClassTable
    parts: dict[str, Any] = field(default_factory=dict)

    def at(self, part: str) -> str:
        """Topic and stamp of a part, for messages."""
        return f"{self.imager.topic_of(part)} at {self.stamp_ns} ns"


class CameraFrameChecker(Checker):
    """Collects parts and checks each frame when it is complete, or when its other parts are no longer awaited.

    ``infos`` holds the first CameraInfo of each view by its name.
    """

    def __init__(self, context: Context, parts: Collection[str]) -> None:
        self.context = context
        self.infos: dict[str, Any] = {}
        imagers = context.rig.imagers
        pairs = {imager.topic_of(part): (part, imager) for part in parts for imager in imagers}
        self._parts = {topic: pair for topic, pair in pairs.items() if topic in context.run.counts}
        self._due = Counter(imager.name for _, imager in self._parts.values())
        self._names = {imager.topic_of("camera_info"): imager.name for imager in imagers}
        self.topics = [*self._parts, *self._names]
        self._open: OrderedDict[tuple[str, int], CameraFrame] = OrderedDict()

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        raise NotImplementedError

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic in self._names:
            self.infos.setdefault(self._names[raw.topic], message)
        if raw.topic not in self._parts:
            return
        part, imager = self._parts[raw.topic]
        key = (imager.name, raw.stamp_ns)
        frame = self._open.setdefault(key, CameraFrame(imager, raw.stamp_ns, self.context.run.classes))
        frame.parts[part] = message
        if len(frame.parts) == self._due[imager.name]:
            self.check_frame(self._open.pop(key))
        elif len(self._open) > WAITING * len(self._due):
            self.check_frame(self._open.popitem(last=False)[1])

    def finish(self) -> None:
        """Finish the checks after the last message."""
        while self._open:
            self.check_frame(self._open.popitem(last=False)[1])


UNIT: Final = Rule("normals are 32FC3, and of every pixel 1 or 0 long")
SAME_NORMALS: Final = Rule("normals are those of the rebuilt world (sample)", 1e-3, "of an image's pixels")
NORMALS: Final[Spec] = Spec("normals", (UNIT, SAME_NORMALS), "images", "no images of normals")
INSIDE: Final = Rule("flow is 32FC2, and ends inside the next image or is NaN")
SAME_FLOW: Final = Rule("flow is that of the rebuilt world and the true motion (sample)", 1e-3, "of an image's pixels")
FLOW: Final[Spec] = Spec("optical flow", (INSIDE, SAME_FLOW), "images", "no images of optical flow")
_ANGLED: Final = ("normals", "flow")
_LENGTH: Final = 1e-5
_NORMAL: Final = 1e-3  # difference of a component
_FLOW: Final = 0.02  # [pixel]


class _Seen(NamedTuple):
    """A frame and the pose (4, 4) of its view."""

    frame: CameraFrame
    pose: Array


def is_recorded(context: Context) -> bool:
    """Return whether a view of the run has normals or flow."""
    return any(imager.topic_of(part) in context.run.counts for imager in context.rig.imagers for part in _ANGLED)


class Geometry(CameraFrameChecker):
    """Form of all images of normals and flow; a sample is made again in the rebuilt world, if there is one."""

    def __init__(self, context: Context, rebuilt: SensorWorld | None, sampler: Sampler) -> None:
        super().__init__(context, _ANGLED)
        self._rebuilt, self._sampler = rebuilt, sampler
        self._own, self._robot = threading.local(), robot_views(context.rig)
        self._last: dict[str, _Seen] = {}
        self.tallies = [context.tally(NORMALS), context.tally(FLOW)]

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        tallies = [tally.part() for tally in self.tallies]
        self.context.jobs.append(lambda: _check_form(frame, tallies))
        if self._rebuilt is not None:
            self.context.motion.when_known(frame.stamp_ns, lambda: self._follow(frame))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        super().finish()
        for seen in self._last.values():
            self._submit(seen, None)

    def _follow(self, frame: CameraFrame) -> None:
        """Compare the view's previous frame, whose next pose is now known."""
        pose = self.context.motion.state(frame.stamp_ns).world_from_base @ frame.imager.base_from_optical
        if frame.imager.name in self._last:
            self._submit(self._last[frame.imager.name], _Seen(frame, pose))
        self._last[frame.imager.name] = _Seen(frame, pose)

    def _submit(self, seen: _Seen, following: _Seen | None) -> None:
        if self._sampler.takes(seen.frame.stamp_ns, seen.frame.imager.name) or following is None:
            self.context.jobs.append(lambda: self._compare(seen, following))

    def _compare(self, seen: _Seen, following: _Seen | None) -> Sequence[Tally]:
        (frame, pose), tallies = seen, [tally.part() for tally in self.tallies]
        camera, robot = self._camera(frame.imager), self._robot.get(frame.imager.name)
        images = camera.label(pose, robot, frame.stamp_ns)
        due: dict[str, NDArray[Any]] = {"normals": images.normal}
        if "flow" in frame.parts:
            still = np.full((*images.depth.shape, 2), np.nan, np.float32)
            if following is not None:
                stamps = frame.stamp_ns, following.frame.stamp_ns
                still = camera.flow(images, pose, following.pose, robot, stamps)
            due["flow"] = still
        rules = (("normals", SAME_NORMALS, _NORMAL), ("flow", SAME_FLOW, _FLOW))
        for tally, (part, rule, limit) in zip(tallies, rules, strict=True):
            found = _pixels(frame, part)
            if found is not None and found.shape == due[part].shape:
                tally[rule].measure(float(_differs(found, due[part], limit).mean()), frame.at(part))
        return tallies

    def _camera(self, imager: Imager) -> LabelCamera:
        """Return this thread's camera."""
        assert self._rebuilt is not None
        own = vars(self._own)
        if imager.config.name not in own:
            own[imager.config.name] = LabelCamera(imager.config, self._rebuilt.scene, reuse=True)
        camera: LabelCamera = own[imager.config.name]
        return camera


def _check_form(frame: CameraFrame, tallies: Sequence[Tally]) -> Sequence[Tally]:
    for tally, part, rule in zip(tallies, _ANGLED, (UNIT, INSIDE), strict=True):
        if part in frame.parts:
            pixels, goes_round = _pixels(frame, part), frame.imager.config.lens.model == "equirectangular"
            if pixels is None:
                tally[rule].see(False, frame.at(part))
                continue
            met = _unit(pixels) if part == "normals" else _inside(pixels, goes_round=goes_round)
            tally[rule].see(bool(met.all()), frame.at(part))
    return tallies


def _pixels(frame: CameraFrame, part: str) -> NDArray[np.float32] | None:
    """Decode a part; None if it cannot be decoded, or is missing."""
    try:
        return (
            None if part not in frame.parts else (read.normals if part == "normals" else read.flow)(frame.parts[part])
        )
    except (BagError, ValueError):
        return None


def _unit(normal: NDArray[np.float32]) -> Mask:
    length = np.linalg.norm(normal, axis=-1)
    return np.asarray((np.abs(length - 1.0) < _LENGTH) | (length == 0.0))


def _inside(flow: NDArray[np.float32], *, goes_round: bool) -> Mask:
    height, width = flow.shape[:2]
    u, v = flow[..., 0] + np.arange(width), flow[..., 1] + np.arange(height)[:, None]
    if goes_round:
        u = (u + 0.5) % width - 0.5
    with np.errstate(invalid="ignore"):
        across, down = np.abs(u - (width - 1) / 2) - width / 2, np.abs(v - (height - 1) / 2) - height / 2
        inside = (across <= _FLOW) & (down <= _FLOW)
    return np.asarray(np.isnan(flow).all(axis=-1) | inside)


def _differs(found: NDArray[np.float32], due: NDArray[np.float32], limit: float) -> Mask:
    with np.errstate(invalid="ignore"):
        return np.asarray(((np.abs(found - due) > limit) | (np.isnan(found) != np.isnan(due))).any(axis=-1))


class PixelRay(NamedTuple):
    """Direction of a pixel's ray in the optical frame, and its length where the image's depth is 1."""

    direction: Array
    """(3,) of unit length."""
    length: float


def pixel_ray(lens: Lens, u: float, v: float) -> PixelRay | None:
    """Ray through an image point [pixel]; None where the lens has none."""
    a, b = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    if lens.model == "equirectangular":
        if abs(a) > math.pi or abs(b) > math.pi / 2:
            return None
        return PixelRay(np.array([math.cos(b) * math.sin(a), math.sin(b), math.cos(b) * math.cos(a)]), 1.0)
    if lens.model == "equidistant":
        ray = _fisheye(lens, a, b)
        length = 1.0
    else:
        ray = _plane(lens, a, b) if lens.coefficients else np.array([a, b, 1.0])
        length = float(np.linalg.norm(ray))
    ray = ray / np.linalg.norm(ray)
    angle = float(np.arctan2(np.hypot(ray[0], ray[1]), ray[2]))  # NaN where the search found nothing
    return PixelRay(ray, length) if angle <= lens.circle else None


def _fisheye(lens: Lens, a: float, b: float) -> Array:
    height = math.hypot(a, b)
    if height == 0.0:
        return np.array([0.0, 0.0, 1.0])
    powers = (1.0, *lens.coefficients)

    def too_far(angle: float) -> float:
        return sum(factor * angle ** (2 * n + 1) for n, factor in enumerate(powers)) - height

    last = min(lens.circle + 0.01, math.pi)
    if too_far(last) < 0.0:
        return np.full(3, np.nan)
    angle = float(brentq(too_far, 0.0, last, xtol=1e-15))
    return np.array([a / height * math.sin(angle), b / height * math.sin(angle), math.cos(angle)])


def _plane(lens: Lens, a: float, b: float) -> Array:
    k1, k2, p1, p2, k3, k4, k5, k6 = (*lens.coefficients, *[0.0] * (8 - len(lens.coefficients)))

    def apart(point: Array) -> Array:
        x, y = float(point[0]), float(point[1])
        r2 = x**2 + y**2
        stretch = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        across = x * stretch + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        down = y * stretch + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
        return np.array([across - a, down - b])

    def nearer(rest: Array, point: Array) -> Array:
        return apart(point) + rest

    point = np.zeros(2)  # followed from the middle outwards, so that the search stays on the branch of the lens
    for share in np.linspace(0.05, 1.0, 20):
        rest = (1.0 - share) * np.array([a, b])
        point = root(partial(nearer, rest), point).x
    found = root(apart, point, tol=1e-13)
    return np.array([*found.x, 1.0]) if np.hypot(*apart(found.x)) < 1e-9 else np.full(3, np.nan)


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
        lowest = min(base_from_optical[2, 3], base_from_points[2, 3]) - self.context.rig.robot.footprint.xyz[2]
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
    """Return why points and pixels of a camera with this CameraInfo cannot be compared; empty if they can."""
    if (lens.distortion_model, any(lens.D)) != ("plumb_bob", False):
        return f"the lens {lens.distortion_model} bends planes; its pixels are checked by retracing"
    return source.not_comparable


def _compare(tally: Tally, view: _View) -> Tally:
    frame = view.frame
    try:
        points = view.source.decode(view.cloud, frame.stamp_ns)
        label = read.labels(read.image(frame.parts["tag"]), frame.classes)
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
    """Return whether 5 x 5 values (n, 5, 5) are all the same."""
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


# Focal lengths, centres and the product with the baseline are up to some thousands of pixels.
LENS: Final = Rule("size, K and P follow from the rig's image size and field of view", 1e-6, "pixel")
PINHOLE: Final = Rule("model and D are those of the rig's lens, R is the identity, P[:, :3] is K, no binning, no ROI")
BASELINE: Final = Rule("the baseline in P is the one in /tf_static", 1e-6, "pixel")
CONSTANT: Final = Rule("CameraInfo does not change")
CALIBRATION: Final = (LENS, PINHOLE, BASELINE, CONSTANT)


class CameraInfos(Checker):
    """Calibration of all cameras; ``tally`` has the rules ``CALIBRATION``."""

    def __init__(self, context: Context, tally: Tally) -> None:
        self._context, self._tally = context, tally
        self._infos = {imager.topic_of("camera_info"): imager for imager in context.rig.imagers}
        self.topics = tuple(self._infos)
        self._first: dict[str, tuple[bytes, Any]] = {}

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        imager, body = self._infos[raw.topic], raw.data[16 + len(message.header.frame_id.encode()) :]
        if imager.name not in self._first:
            self._first[imager.name] = (body, message)
            self._check_lens(imager, message)
        self._tally[CONSTANT].see(body == self._first[imager.name][0], at(raw))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        for camera in self._context.rig.enabled(CameraConfig):
            imagers = camera.imagers()
            if len(imagers) == 2 and all(imager.name in self._first for imager in imagers):
                self._check_baseline(*imagers)

    def _check_lens(self, imager: Imager, info: Any) -> None:
        k, p, roi = np.reshape(info.K, (3, 3)), np.reshape(info.P, (3, 4)), info.roi
        cut = (info.binning_x, info.binning_y, roi.x_offset, roi.y_offset, roi.height, roi.width, int(roi.do_rectify))
        config, where = imager.config, f"camera {imager.name}"
        model, coefficients = distortion(config)
        plain = np.array_equal(np.reshape(info.R, (3, 3)), np.eye(3)) and not any(cut) and np.array_equal(p[:, :3], k)
        plain = plain and info.distortion_model == model and np.array_equal(info.D, coefficients)
        self._tally[PINHOLE].see(plain, where)
        size = (info.width, info.height)
        if self._context.experiment is not None:
            self._tally[LENS].see(size == (config.width, config.height), f"{where}: {size[0]} x {size[1]} pixels")
        else:  # the field of view of the default camera, at any size
            config = config.model_copy(update={"width": info.width, "height": info.height})
        expected = camera_matrix(config), projection_matrix(imager._replace(config=config))
        residual = max(float(np.abs(k - expected[0]).max()), float(np.abs(p - expected[1]).max()))
        self._tally[LENS].measure(residual, where)

    def _check_baseline(self, *pair: Imager) -> None:
        p_left, p_right = (np.reshape(self._first[imager.name][1].P, (3, 4)) for imager in pair)
        try:
            left, right = (self._context.frames.base_from(imager.optical_frame) for imager in pair)
        except FieldtruthError:
            return  # missing frames are reported by the mounts
        baseline = float((transforms.inverse(left) @ right)[0, 3])
        residual = p_right[0, 3] + p_right[0, 0] * baseline, p_left[0, 3]
        where = f"{baseline:.6f} m between the cameras {' and '.join(imager.name for imager in pair)}"
        self._tally[BASELINE].measure(float(np.abs(residual).max()), where)
