# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sensor behind the lens: from light to the photograph, with the noise of one reading."""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.kernels.camera import (
    Sensor,
    apply_curve,
    blur,
    expose,
    interpolate,
    mix_colours,
    sharpen,
    spill,
    spread_colours,
)
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.lens_effects import add_glare, illumination, point_spread
from fieldtruth.sensors.camera.lens_scatter import add_bloom
from fieldtruth.sensors.camera.raw import raw_shape, sensor_of
from fieldtruth.sensors.camera.response import FULL_SCALE, curve_of
from fieldtruth.sensors.camera.signal import IDENTITY, CameraSignal

_NONE: Float32Array = np.zeros((0, 0, 0), np.float32)


class Developer:
    """Makes photographs of light. It owns buffers, so threads must not share it."""

    def __init__(self, config: CameraConfig, signal: CameraSignal, seed: int) -> None:
        self.config, self.signal, self.seed = config, signal, seed
        h, w = config.height, config.width
        rows, columns = np.arange(h)[:, None], np.arange(w)
        vignetting = signal.vignetting_power or any(signal.vignetting_polynomial)
        self._share = illumination(config, signal, columns, rows) if vignetting else np.zeros((0, 0), np.float32)
        self._light = np.empty((h, w, 3), np.float32)
        self._shifted = np.empty_like(self._light) if any(signal.chromatic_px) else _NONE
        self._luminance = np.empty((2, h, w), np.float32) if signal.sharpening else _NONE
        shape = raw_shape(signal, h, w)
        self._raw = np.empty(shape, np.float32)
        self._is_noisy = signal.photon_noise or signal.read_noise_e > 0.0
        self._normal = np.empty(shape, np.float32) if self._is_noisy else _NONE
        self._patterns: dict[str, tuple[Float32Array, Float32Array]] = {}

    def raw(
        self, linear: Float32Array, view: str, number: int, factor: float, gain: float
    ) -> tuple[Float32Array, Sensor]:
        """Raw values (h, w, n) of light (h, w, 3), and the sensor that made them.

        Args:
            linear: light on the lens.
            view: name of the view, which with ``number`` selects the noise.
            number: of the reading.
            factor: exposure of the sensor to the light.
            gain: of its amplifier.
        """
        signal, light = self.signal, self._light
        spill(linear, self._share, factor, light)
        if signal.lens_blur_px:
            blur(light, point_spread(signal.lens_blur_px), np.empty_like(light))
        for channel, sigma_px in zip((0, 2), signal.fringe_px, strict=True):
            if sigma_px:
                own = light[..., channel : channel + 1]
                blur(own, point_spread(sigma_px), np.empty(own.shape, np.float32))
        if signal.bloom:
            add_bloom(light, signal.bloom, signal.bloom_px)
        if signal.glare:
            add_glare(light, signal.glare)
        if any(signal.chromatic_px):
            lens, corner = self.config.projection, np.hypot(*light.shape[:2]) / 2.0
            red, blue = (each / corner for each in signal.chromatic_px)
            spread_colours(light, lens.cx, lens.cy, red, blue, self._shifted)
            light = self._shifted
        if self._is_noisy:
            rng_of(self.seed, view, number).standard_normal(out=self._normal, dtype=np.float32)
        sensor = sensor_of(signal, gain)
        expose(light, sensor, self._normal, *self._pattern(view), self._raw)
        return self._raw, sensor

    def photograph(self, raw: Float32Array, sensor: Sensor, balance: Array, photo: NDArray[np.uint8]) -> None:
        """Write the photograph (h, w, 3) of raw values, with gains ``balance`` (3,) for white balance."""
        signal = self.signal
        white = FULL_SCALE[signal.response]
        own = np.ones(3) if signal.mosaic == "mono" else balance / np.array(signal.responsivity)
        gains: Float32Array = own.astype(np.float32)
        interpolate(raw, sensor, white, self._light)
        if signal.colour_matrix != IDENTITY:
            mix_colours(self._light, gains, np.array(signal.colour_matrix, np.float32).reshape(3, 3), white)
            gains = np.ones_like(gains)
        apply_curve(self._light, gains, curve_of(signal.response, signal.contrast), photo)
        if signal.sharpening:
            sharpen(photo, signal.sharpening, point_spread(signal.sharpening_px), self._luminance)

    def _pattern(self, view: str) -> tuple[Float32Array, Float32Array]:
        """Deviations of the pixels of a view in sensitivity and dark signal; empty for none."""
        if view not in self._patterns:
            rng, shape = rng_of(self.seed, view, "pattern"), self._raw.shape
            prnu, dsnu = (
                sigma * rng.standard_normal(shape, np.float32) if sigma else _NONE
                for sigma in (np.float32(self.signal.prnu), np.float32(self.signal.dsnu_e))
            )
            self._patterns[view] = prnu, dsnu
        return self._patterns[view]
