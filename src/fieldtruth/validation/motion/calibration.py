# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Mounts and cameras: /tf_static and CameraInfo against the rig and against each other."""

from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import matrix
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.robot_messages import fixed_transforms
from fieldtruth.core import frames
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.sensors.camera.message import camera_matrix, distortion, projection_matrix
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at

MOUNTS: Final = Rule("frames of /tf_static are mounted as in the rig", 1e-9, "m or of a rotation")
UNIT: Final = Rule("rotations of /tf_static are unit quaternions", 1e-6, "from length 1", minor=True)
ONCE: Final = Rule("/tf_static is published once", minor=True)
# Focal lengths, centres and the product with the baseline are up to some thousands of pixels.
LENS: Final = Rule("size, K and P follow from the rig's image size and field of view", 1e-6, "pixel")
PINHOLE: Final = Rule("model and D are those of the rig's lens, R is the identity, P[:, :3] is K, no binning, no ROI")
BASELINE: Final = Rule("the baseline in P is the one in /tf_static", 1e-6, "pixel")
CONSTANT: Final = Rule("CameraInfo does not change")
_RULES: Final = (MOUNTS, UNIT, ONCE, LENS, PINHOLE, BASELINE, CONSTANT)
CALIBRATION: Final[Spec] = Spec("calibration", _RULES, "items", "neither /tf_static nor CameraInfo")


class Calibration(Checker):
    """Fixed frames and cameras."""

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(CALIBRATION)
        self.tallies = [self._tally]
        self._infos = {imager.topic_of("camera_info"): imager for imager in context.rig.imagers}
        self.topics = [name for name in (table.TF_STATIC, *self._infos) if name in context.run.counts]
        self._first: dict[str, tuple[bytes, Any]] = {}
        self._published = 0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if raw.topic == table.TF_STATIC:
            self._published += 1
            for each in message.transforms:
                q, child = each.transform.rotation, each.child_frame_id
                length = float(np.linalg.norm([q.w, q.x, q.y, q.z]))
                if self._tally[UNIT].measure(length - 1.0, f"{at(raw)}: {child!r}"):
                    self._context.parents[child] = (each.header.frame_id, matrix(each.transform))
            return
        imager, body = self._infos[raw.topic], raw.data[16 + len(message.header.frame_id.encode()) :]
        if imager.name not in self._first:
            self._first[imager.name] = (body, message)
            self._check_lens(imager, message)
        self._tally[CONSTANT].see(body == self._first[imager.name][0], at(raw))

    def finish(self) -> None:
        """Finish the checks after the last message."""
        if self._context.experiment is not None and table.TF_STATIC in self.topics:
            self._tally[ONCE].see(self._published == 1, f"{self._published} messages of {table.TF_STATIC}")
        if parents := self._context.parents:
            for (parent, child), true in fixed_transforms(self._context.rig).items():
                found_parent, found = parents.get(child, ("", true))
                residual = float(np.abs(found - true).max()) if found_parent == parent else np.nan
                self._tally[MOUNTS].measure(residual, f"{child!r} in {parent!r}")
        for camera in self._context.rig.cameras:
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
        baseline = float((frames.inverse(left) @ right)[0, 3])
        residual = p_right[0, 3] + p_right[0, 0] * baseline, p_left[0, 3]
        where = f"{baseline:.6f} m between the cameras {' and '.join(imager.name for imager in pair)}"
        self._tally[BASELINE].measure(float(np.abs(residual).max()), where)
