# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images: encoding, size, colours and depth of every pixel; and the images that the cameras render again."""

import threading
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import ClassTable, Label
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.sense.robot import robot_views
from fieldtruth.sensors.camera.check_geometry import (
    CALIBRATION,
    EXTRAS,
    FLOW,
    LIDAR_AND_CAMERAS,
    NORMALS,
    PARTS,
    Agreement,
    CameraFrame,
    CameraFrameChecker,
    CameraInfos,
    Geometry,
    is_recorded,
    pixel_ray,
)
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.sensors.camera.sensing import IdealCamera
from fieldtruth.sensors.camera.sensor import photograph_jpeg
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, Sampler
from fieldtruth.validation.kind_checks import KindChecks, Pass
from fieldtruth.validation.rays import NOTHING, UNKNOWN, RayReading, RayReference, close, same_passing
from fieldtruth.validation.world import ClassComparison, ObjectClasses

FORM: Final = Rule("images have the encoding of their topic and the size of CameraInfo")
JPEG: Final = Rule("photographs can be decoded")
IMAGES: Final[Spec] = Spec("images", (FORM, JPEG), "images", "no images")
COLOUR: Final = Rule("every pixel of a tag image has the colour of a class")
TAG_COLOURS: Final[Spec] = Spec("tag colours", (COLOUR,), "pixels", "no tag images")
DEPTH_RANGE: Final = Rule("depth is infinite on the sky and within the camera's range elsewhere")
_NO_DEPTH: Final = "no depth images: generate --extras depth makes them"
DEPTH: Final[Spec] = Spec("depth", (DEPTH_RANGE,), "pixels", _NO_DEPTH)
SAME_PIXELS: Final = Rule("cameras see the same classes, depths, instance ids and extras in the rebuilt world (sample)")
EQUAL_IMAGES: Final = Rule("images made as here are equal to the last digit", minor=True)
_NO_TAGS: Final = "no tag images, or no true motion"
RETRACED_IMAGES: Final[Spec] = Spec("retraced images", (SAME_PIXELS, EQUAL_IMAGES), "pixels", _NO_TAGS)
# Mean difference in a block of 8 x 8 pixels, as JPEG packs them, and in all. On another processor rounding moves pixels
# at edges: in 50 photographs of the park the worst block differed by 3.3 (median) to 5.9, and the mean by up to 0.006.
SAME_PHOTOGRAPH: Final = Rule("photographs look the same when rendered again (with --full)", 20.0, "of 255 in a block")
SAME_MEAN: Final = Rule("photographs hardly differ from those that are rendered again", 0.1, "of 255 in the mean")
EQUAL_PHOTOGRAPHS: Final = Rule("photographs made as here are equal to the last digit", 0.0, "of 255")
_PHOTOGRAPH_RULES: Final = (SAME_PHOTOGRAPH, SAME_MEAN, EQUAL_PHOTOGRAPHS)
PHOTOGRAPHS: Final[Spec] = Spec("photographs", _PHOTOGRAPH_RULES, "photographs", _NO_TAGS)
_BLOCK: Final = 8
_NO_RAY: Final = 1e-6  # [m]
_ENCODINGS: Final = {"tag": "rgb8", "depth": "32FC1", "instances": "16UC1", "parts": "mono8", "passability": "32FC2"}
_WIDE: Final = _ENCODINGS | {"instances": "32SC1"}
"""Encodings where ids do not fit into 16 bits."""
_DECODERS: Final[dict[str, Callable[[Any], NDArray[Any]]]] = {
    "photograph": read.image,
    "tag": read.image,
    "depth": read.depth,
    "instances": read.instances,
    "parts": read.parts,
    "passability": read.passability,
}


class Images(CameraFrameChecker):
    """Form, colours and depth of every image of all cameras."""

    def __init__(self, context: Context, objects: ObjectClasses) -> None:
        super().__init__(context, PARTS)
        self._objects = objects
        self.tallies = [context.tally(spec) for spec in (IMAGES, TAG_COLOURS, DEPTH)]

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        tallies, classes = [tally.part() for tally in self.tallies], self._objects.comparison()
        info, far = self.infos.get(frame.imager.name), frame.imager.config.far
        size = None if info is None else (info.width, info.height)

        def work() -> list[Tally]:
            _check_frame(frame, size, far, tallies, classes)
            return [*tallies, classes.tally]

        self.context.jobs.append(work)


def _check_frame(
    frame: CameraFrame, size: tuple[int, int] | None, far: float, tallies: list[Tally], classes: ClassComparison
) -> None:
    images, colours, depths = tallies
    encodings = _WIDE if classes.has_wide_ids else _ENCODINGS
    parts = {part: _decoded(frame, part, encodings.get(part), size, images) for part in frame.parts}
    rgb, depth, instance = (parts.get(part) for part in ("tag", "depth", "instances"))
    if rgb is None:
        return
    width, flat = rgb.shape[1], rgb.reshape(-1, 3)

    def pixel(part: str, k: int) -> str:
        return f"{frame.at(part)}, row {k // width}, column {k % width}"

    label = _labels(rgb, frame.classes).reshape(-1)
    known = label != Label.VOID
    colours[COLOUR].see_all(known, lambda k: f"{pixel('tag', k)}: {' '.join(map(str, flat[k]))}")
    if depth is not None and depth.size == label.size:
        metres, sky = depth.reshape(-1), label == Label.SKY
        right = np.where(sky, metres == np.inf, (metres > 0.0) & (metres <= far * (1.0 + 1e-6))) | ~known
        what = ("an object", "sky")
        depths[DEPTH_RANGE].see_all(right, lambda k: f"{pixel('depth', k)}: {metres[k]:g} m on {what[int(sky[k])]}")
    if instance is not None and instance.size == label.size:
        classes.see(instance.reshape(-1), label, lambda k: pixel("instances", k))


def _decoded(
    frame: CameraFrame, part: str, due: str | None, size: tuple[int, int] | None, tally: Tally
) -> NDArray[Any] | None:
    """Pixels of a part, or None if they cannot be read."""
    message, where = frame.parts[part], frame.at(part)
    try:
        image: NDArray[Any] = _DECODERS[part](message)
    except (BagError, ValueError) as error:
        tally[JPEG if part == "photograph" else FORM].see(False, f"{where}: {error}")
        return None
    if part == "photograph":
        tally[JPEG].see(True, "")
    encoding, shape = getattr(message, "encoding", None), (image.shape[1], image.shape[0])
    right = encoding == due and not getattr(message, "is_bigendian", 0)
    right = right and size in (None, shape) and image.size > 0
    tally[FORM].see(right, f"{where}: {shape[0]} x {shape[1]} {encoding or 'JPEG'}, CameraInfo has {size}")
    return image if image.size else None


def _labels(rgb: NDArray[np.uint8], classes: ClassTable) -> NDArray[np.uint8]:
    """Class ids (h, w) of a tag image; VOID where a colour belongs to no class."""
    try:
        return read.labels(rgb, classes)
    except BagError:  # slower, but it names every pixel
        radix = np.array([1, 256, 65536], np.uint32)
        labels = np.array([row.label for row in classes.coloured])
        codes = classes.palette[labels].astype(np.uint32) @ radix
        order = np.argsort(codes)
        found = rgb.astype(np.uint32) @ radix
        row = order[np.minimum(np.searchsorted(codes[order], found), len(codes) - 1)]
        return np.where(codes[row] == found, labels[row], 0).astype(np.uint8)


class _Pixels(NamedTuple):
    """Decoded parts of a frame."""

    label: NDArray[np.uint8]
    instance: NDArray[np.uint16] | NDArray[np.uint32] | None
    depth: Array | None
    part: NDArray[np.uint8] | None
    passing: NDArray[np.float32] | None
    photograph: NDArray[np.uint8] | None


class RetracedImages(CameraFrameChecker):
    """Images, rendered again in the rebuilt world and compared pixel by pixel: a sample, or all."""

    def __init__(
        self, context: Context, rebuilt: SensorWorld, reference: RayReference, sampler: Sampler, *, full: bool
    ) -> None:
        super().__init__(context, ("tag", "depth", "instances", *EXTRAS, *["photograph"] * full))
        self._rebuilt, self._reference, self._sampler, self._full = rebuilt, reference, sampler, full
        self.tallies = [context.tally(RETRACED_IMAGES), context.tally(PHOTOGRAPHS)]
        notes = "all images" if full else "a sample of the images", context.made_elsewhere
        self.tallies[0].note = "; ".join(filter(None, notes))
        if not full:
            self.tallies[1].skipped = "photographs are rendered again with --full"
        elif noisy := [camera.name for camera in context.run.rig.enabled(CameraConfig) if camera.signal is not None]:
            self.tallies[1].note = f"not those of {', '.join(noisy)}, which have the signal of a real camera"
            self.tallies[1].skipped = "every camera has the signal of a real one; their other images are compared"
        self._own, self._robot = threading.local(), robot_views(context.rig)

    def check_frame(self, frame: CameraFrame) -> None:
        """Check a frame."""
        if "tag" in frame.parts:
            self.context.motion.when_known(frame.stamp_ns, lambda: self._submit(frame))

    def _submit(self, frame: CameraFrame) -> None:
        sampled = self._sampler.takes(frame.stamp_ns, frame.imager.config.name)
        if not (sampled or self._full):
            return
        pose = self.context.motion.state(frame.stamp_ns).world_from_base @ frame.imager.base_from_optical
        self.context.jobs.append(lambda: self._compare(frame, pose, frame.stamp_ns if sampled else None))

    def _compare(self, frame: CameraFrame, pose: Array, seed: int | None) -> list[Tally]:
        config, mount = frame.imager.config, frame.imager.base_from_optical
        lens = config.projection
        bag = _pixels(frame, (config.height, config.width))
        if bag is None:
            return []
        own, difference = self._render(frame, pose, bag.photograph if config.signal is None else None)

        def reading(k: int) -> RayReading:
            v, u = divmod(k, config.width)
            ray = pixel_ray(lens, u, v)
            # Where the lens has no ray nothing may be seen, on a ray that is too short to hit anything.
            along, length, far = ((0.0, 0.0, 1.0), 1.0, _NO_RAY) if ray is None else (*ray, config.far)
            range_m = float("nan") if bag.depth is None else float(bag.depth[v, u]) * length
            return RayReading(
                f"{frame.at('tag')}, row {v}, column {u}", pose[:3, 3], pose[:3, :3] @ along,
                NOTHING if bag.label[v, u] == Label.SKY else range_m, int(bag.label[v, u]),
                UNKNOWN if bag.instance is None else int(bag.instance[v, u]), 0.0, far, pulsed=False,
                in_base=(mount[:3, 3], mount[:3, :3] @ along), stamp_ns=frame.stamp_ns,
                part=UNKNOWN if bag.part is None else int(bag.part[v, u]),
                passing=None if bag.passing is None else bag.passing[v, u],
            )  # fmt: skip

        passing = None if bag.passing is None else self._rebuilt.passability.of(own.top, own.label)
        same, equal = _same(bag, own, passing)
        retraced, photographs = (tally.part() for tally in self.tallies)
        if not self.context.made_elsewhere:
            retraced[EQUAL_IMAGES].see(equal, frame.at("tag"))
        if difference is not None:
            rules = _PHOTOGRAPH_RULES[: 2 if self.context.made_elsewhere else 3]
            for rule, residual in zip(rules, (*difference, difference[0]), strict=False):
                photographs[rule].measure(residual, frame.at("photograph"))
        differing = np.flatnonzero(~same)
        sample = self._reference.compare(retraced[SAME_PIXELS], differing, same.size, reading, seed)
        return [retraced, photographs, sample]

    def _render(
        self, frame: CameraFrame, pose: Array, photograph: NDArray[np.uint8] | None
    ) -> tuple[LabelImages, tuple[float, float] | None]:
        """Render with this thread's camera; returns the images, and the difference of the photographs."""
        config, robot = frame.imager.config, self._robot.get(frame.imager.name)
        own = vars(self._own)
        if photograph is None:
            if config.name not in own.setdefault("label", {}):
                own["label"][config.name] = LabelCamera(config, self._rebuilt.scene, reuse=True)
            return own["label"][config.name].label(pose, robot, frame.stamp_ns), None
        if config.name not in own.setdefault("photograph", {}):
            own["photograph"][config.name] = IdealCamera(config, self._rebuilt.baked, reuse=True)
        images = own["photograph"][config.name].render(pose, robot, frame.stamp_ns)
        return images, _difference(photograph, images.photo, config.jpeg_quality)


def _pixels(frame: CameraFrame, shape: tuple[int, int]) -> _Pixels | None:
    """Decode a frame; None if a part is invalid, which its own check reports."""
    parts = frame.parts
    try:
        with np.errstate(invalid="ignore"):
            found = _Pixels(
                read.labels(read.image(parts["tag"]), frame.classes),
                read.instances(parts["instances"]) if "instances" in parts else None,
                read.depth(parts["depth"]).astype(np.float64) if "depth" in parts else None,
                read.parts(parts["parts"]) if "parts" in parts else None,
                read.passability(parts["passability"]) if "passability" in parts else None,
                read.image(parts["photograph"]) if "photograph" in parts else None,
            )
    except (FieldtruthError, ValueError):
        return None
    return found if all(part is None or part.shape[:2] == shape for part in found) else None


def _same(bag: _Pixels, own: LabelImages, passing: NDArray[np.float32] | None) -> tuple[Mask, bool]:
    """Return the mask (h, w) of pixels that are the same, and whether all of them are to the last digit."""
    same = bag.label == own.label
    if bag.instance is not None:
        same &= bag.instance == own.instance
    if bag.part is not None:
        same &= bag.part == own.part
    if bag.passing is not None and passing is not None:
        same &= same_passing(bag.passing, passing)
    equal = bool(same.all())
    if bag.depth is not None:
        depth = np.where(own.depth > 0, own.depth, np.inf).astype(np.float64)
        equal = equal and np.array_equal(bag.depth, depth)
        with np.errstate(invalid="ignore"):
            same &= np.where(own.depth > 0, close(bag.depth, depth), bag.depth == np.inf)
    return np.asarray(same), equal


def _difference(bag: NDArray[np.uint8], own: NDArray[np.uint8], quality: int) -> tuple[float, float]:
    """Return the largest mean difference of a block of two photographs (h, w, 3), and that of all pixels.

    The second one is compressed as the first was.
    """
    packed = photograph_jpeg(own, quality)
    difference = np.abs(bag.astype(np.int16) - simplejpeg.decode_jpeg(packed, "RGB")).mean(axis=2)
    rows, columns = (length // _BLOCK for length in difference.shape)
    blocks = difference[: rows * _BLOCK, : columns * _BLOCK].reshape(rows, _BLOCK, columns, _BLOCK)
    return float(blocks.mean(axis=(1, 3)).max(initial=0.0)), float(difference.mean())


def _checkers(shared: Pass) -> list[Checker]:
    context, rays = shared.context, shared.rays
    checkers: list[Checker] = [
        CameraInfos(context, shared.calibration), Images(context, shared.objects),
        Agreement(context, shared.points, shared.sampler()),
    ]  # fmt: skip
    if is_recorded(context):
        checkers.append(Geometry(context, context.rebuilt, shared.sampler()))
    if context.rebuilt is not None and rays is not None:
        checkers.append(RetracedImages(context, context.rebuilt, rays, shared.sampler(), full=shared.full))
    return checkers


CHECKS: Final = KindChecks(
    make=_checkers,
    calibration=CALIBRATION,
    form=(IMAGES, TAG_COLOURS, DEPTH),
    between=(LIDAR_AND_CAMERAS,),
    retraced=(RETRACED_IMAGES, PHOTOGRAPHS),
    extras=(NORMALS, FLOW),
    extras_of=lambda context: (NORMALS, FLOW) * is_recorded(context),
)
