# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A camera with the signal of a real one. Its labels, instances and depth are those of an ideal one at the stamp."""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import lenses
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.camera_config import CameraConfig, Imager
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.camera import Camera, CameraImages
from fieldtruth.render.photograph import render_linear
from fieldtruth.render.shutter import STRIP, offsets_of, render_mean, render_points, render_strips, strips_of
from fieldtruth.sense.hits import LabelBuffers
from fieldtruth.sense.label_camera import LabelImages
from fieldtruth.sensors.camera.exposure import Exposure, exposure_of, metered_exposure, metering_lags, white_balance
from fieldtruth.sensors.camera.lens_effects import illumination
from fieldtruth.sensors.camera.photo import Developer
from fieldtruth.sensors.camera.signal import CameraSignal

PoseAt = Callable[[int | NDArray[np.int64]], Array]
"""``world_from_base`` (4, 4) at a stamp [ns], or (n, 4, 4) at n."""

METERING: Final = (32, 16)
"""Columns and rows of rays of a metering image."""
_STEPS: Final = (32, 16)  # columns and rows of pixels whose motion is examined
_SWIFT: Final = 0.95  # quantile of their motion
_FAR: Final = 1e6  # [m], of the sky


class _Metered(NamedTuple):
    exposure: Exposure
    balance: Array  # (3,)


class SignalCamera(Camera):
    """A ``Camera`` whose photographs have the signal of a real one.

    Rows are exposed around the stamp: the middle of the exposure of the image's middle row is at the stamp. A
    photograph depends on its number, the view's name, the seed, and poses; not on photographs before it.
    """

    def __init__(self, config: CameraConfig, baked: BakedScene, seed: int, *, reuse: bool = False) -> None:
        signal = config.signal
        if not isinstance(signal, CameraSignal):
            raise TypeError(f"the camera {config.name} has no signal")
        super().__init__(config, baked, reuse=reuse)
        self.signal = signal
        self._developer = Developer(config, signal, seed)
        h, w = config.height, config.width
        self._scratch = LabelBuffers(
            np.empty((h, w), np.uint8), np.empty((h, w), np.uint32), np.empty((h, w), np.float32)
        )
        u, v = _grid(w, h, *METERING)
        self._meter_points = np.stack([u, v]).astype(np.float32)
        self._meter_share = illumination(config, signal, u, v)[:, None]
        self._last: tuple[int, _Metered] | None = None

    def capture(self, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt) -> CameraImages:
        """Photograph ``number`` of a view at a stamp, with the label, instance and depth images of the pose there."""
        if self.signal.is_ideal:
            return self.render(world_from_base(stamp_ns) @ imager.base_from_optical)
        metered = self.metered(stamp_ns, world_from_base)
        images, moves = self._expose(imager, stamp_ns, world_from_base, metered.exposure.time_s)
        world = float(self._shading.exposure)
        raw, sensor = self._developer.raw(
            self._framebuffer.linear, imager.name, number, metered.exposure.total / world, metered.exposure.gain
        )
        self._developer.photograph(raw, sensor, metered.balance, images.photo)
        return images
