# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""CameraInfo of every view against the rig and /tf_static."""

from typing import Any, Final

import numpy as np

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core import transforms
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.sensors.camera.message import camera_matrix, distortion, projection_matrix
from fieldtruth.validation.check import Rule, Tally
from fieldtruth.validation.context import Checker, Context, at

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
        baseline = float((transforms.inverse(left) @ right)[0, 3])
        residual = p_right[0, 3] + p_right[0, 0] * baseline, p_left[0, 3]
        where = f"{baseline:.6f} m between the cameras {' and '.join(imager.name for imager in pair)}"
        self._tally[BASELINE].measure(float(np.abs(residual).max()), where)
