# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of normals and of optical flow: their form, and the same images of the rebuilt world."""

import threading
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag.file import BagError
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.sense.robot import robot_views
from fieldtruth.sensors.camera.check_frames import CameraFrame, CameraFrameChecker
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Context, Sampler

UNIT: Final = Rule("normals are 32FC3, and of every pixel 1 or 0 long")
SAME_NORMALS: Final = Rule("normals are those of the rebuilt world (sample)", 1e-3, "of an image's pixels")
NORMALS: Final[Spec] = Spec("normals", (UNIT, SAME_NORMALS), "images", "no images of normals")

INSIDE: Final = Rule("flow is 32FC2, and ends inside the next image or is NaN")
SAME_FLOW: Final = Rule("flow is that of the rebuilt world and the true motion (sample)", 1e-3, "of an image's pixels")
FLOW: Final[Spec] = Spec("optical flow", (INSIDE, SAME_FLOW), "images", "no images of optical flow")

PARTS: Final = ("normals", "flow")
_LENGTH: Final = 1e-5
_NORMAL: Final = 1e-3  # difference of a component
_FLOW: Final = 0.02  # [pixel]


class _Seen(NamedTuple):
    """A frame and the pose (4, 4) of its view."""

    frame: CameraFrame
    pose: Array


def is_recorded(context: Context) -> bool:
    """Whether a view of the run has normals or flow."""
    return any(imager.topic_of(part) in context.run.counts for imager in context.rig.imagers for part in PARTS)


class Geometry(CameraFrameChecker):
    """Form of all images of normals and flow; a sample is made again in the rebuilt world, if there is one."""

    def __init__(self, context: Context, rebuilt: SensorWorld | None, sampler: Sampler) -> None:
        super().__init__(context, PARTS)
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
            self._submit(self._last[frame.imager.name], pose)
        self._last[frame.imager.name] = _Seen(frame, pose)

    def _submit(self, seen: _Seen, following: Array | None) -> None:
        if self._sampler.takes(seen.frame.stamp_ns, seen.frame.imager.name) or following is None:
            self.context.jobs.append(lambda: self._compare(seen, following))

    def _compare(self, seen: _Seen, following: Array | None) -> Sequence[Tally]:
        (frame, pose), tallies = seen, [tally.part() for tally in self.tallies]
        camera, robot = self._camera(frame.imager), self._robot.get(frame.imager.name)
        images = camera.label(pose, robot)
        due: dict[str, NDArray[Any]] = {"normals": images.normal}
        if "flow" in frame.parts:
            still = np.full((*images.depth.shape, 2), np.nan, np.float32)
            due["flow"] = still if following is None else camera.flow(images, pose, following, robot)
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
    for tally, part, rule in zip(tallies, PARTS, (UNIT, INSIDE), strict=True):
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
