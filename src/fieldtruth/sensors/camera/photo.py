# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lens and image sensor of a real camera: vignetting, glare, blur, bloom, raw values, colours.

The image sensor: from light on its pixels to raw values, and back to light in three channels. The model is that of EMVA
Standard 1288, release 4.0, chapter 2: a raw value y has the mean K (mu_p + mu_d) and the variance K^2 sigma_d^2 + K^2
mu_p + 1 / 12, with mu_p electrons of light, whose number has a Poisson distribution, read noise of sigma_d electrons,
and a system gain of K per electron. The Poisson distribution is replaced by the normal one of the same variance; their
skewness differs by 1 / sqrt(mu_p).
"""

from functools import cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core import lenses
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.random import rng_of
from fieldtruth.kernels.camera import (
    CELL,
    Sensor,
    blend_cells,
    blur,
    expose,
    fill_means,
    interpolate,
    mix_colours,
    sharpen,
    spill,
    spread_colours,
)
from fieldtruth.kernels.textures import srgb_from_linear
from fieldtruth.kernels.tone_curve import FILMIC, FILMIC_TOP, Curve, apply_curve
from fieldtruth.sensors.camera.config import IDENTITY, CameraConfig, CameraSignal, Mosaic, Response

LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear sRGB (ITU-R BT.709)."""
FULL_SCALE: Final[dict[Response, float]] = {"filmic": 7.25, "srgb": 1.0, "linear": 1.0}
"""Linear light from which a curve is white: there the sensor saturates."""
_STEPS: Final = 4096


@cache
def curve_of(response: Response, contrast: float = 0.0) -> Curve:
    """Return a response curve whose slope is 1 + ``contrast`` times as great at medium grey, and less at both ends."""
    light, top = np.linspace(0.0, 1.0, _STEPS) ** 2, FILMIC_TOP if response == "filmic" else 1.0
    values = {"filmic": FILMIC / 255.0, "srgb": srgb_from_linear(light), "linear": light}[response]
    bent = values - 2.0 * contrast * values * (1.0 - values) * (1.0 - 2.0 * values)
    return Curve(np.rint(255.0 * bent).astype(np.uint8), top)


def encoded(light: Array, response: Response, contrast: float = 0.0) -> Array:
    """Values in [0, 1] of light of any shape."""
    table, top = curve_of(response, contrast)
    row = np.sqrt(np.clip(light, 0.0, top) / top) * (len(table) - 1)
    return np.asarray(np.interp(row, np.arange(len(table)), table / 255.0))


_FILTERS: Final[dict[Mosaic, tuple[int, int, int, int]]] = {
    "rggb": (0, 1, 1, 2),
    "grbg": (1, 0, 2, 1),
    "gbrg": (1, 2, 0, 1),
    "bggr": (2, 1, 1, 0),
}
"""Channel of the pixels at (0, 0), (0, 1), (1, 0), (1, 1)."""


def sensor_of(signal: CameraSignal, gain: float) -> Sensor:
    """Return the sensor of a camera at a gain of its amplifier.

    At 0 dB the full well is at the full scale of the raw values, which is white in the photograph. Without a full well
    a unit of light is one electron.
    """
    full_scale, top = FULL_SCALE[signal.response], 1.0 if signal.bits is None else 2.0**signal.bits - 1.0
    most = full_scale if signal.full_well_e is None else signal.full_well_e / gain
    colours = np.diag(signal.responsivity)
    grey = (LUMINANCE * signal.responsivity)[None] / float(LUMINANCE @ np.array(signal.responsivity))
    return Sensor(
        channels=np.ascontiguousarray(grey if signal.mosaic == "mono" else colours, np.float64),
        filters=_FILTERS.get(signal.mosaic, (0, 0, 0, 0)),
        electrons=most / full_scale,
        photons=float(signal.photon_noise),
        read_noise_e=signal.read_noise_e,
        gain=(top - signal.black_level) / most,
        black=float(signal.black_level),
        top=top,
        step=0.0 if signal.bits is None else 1.0,
    )


def raw_shape(signal: CameraSignal, height: int, width: int) -> tuple[int, int, int]:
    """Rows, columns, values in each pixel."""
    return height, width, 3 if signal.mosaic == "none" else 1


_TAIL: Final = 4.0


def add_bloom(light: Float32Array, share: float, sigma_px: float) -> None:
    """Scatter a share of light (h, w, 3) around where it belongs: half of it four times as far as the other half.

    The glare spread function of a lens falls more slowly than a normal one (ISO 9358; McCann and Rizzi, The Art and
    Science of HDR Imaging, 2011), as a sum of two does. Light that would leave the image stays at its border.
    """
    cells = cell_means(light)
    near, far = (
        gaussian_filter(cells, (each / CELL, each / CELL, 0.0), mode="nearest") for each in (sigma_px, _TAIL * sigma_px)
    )
    blend_cells(light, np.asarray(0.5 * (near + far), np.float32), np.float32(share))


def cell_means(light: Float32Array) -> Float32Array:
    """Mean light of cells of CELL x CELL pixels, fewer at the right and lower border."""
    height, width, _ = light.shape
    cells = np.zeros((-(-height // CELL), -(-width // CELL), 3), np.float32)
    fill_means(light, cells)
    return cells


def illumination(config: CameraConfig, signal: CameraSignal, u: ArrayLike, v: ArrayLike) -> Float32Array:
    """Share of the light at image points [pixel] of any shape that vignetting leaves; 1 where the lens has no ray."""
    lens = config.projection
    share = np.ones(np.broadcast_shapes(np.shape(u), np.shape(v)))
    if signal.vignetting_power:
        cosine = np.nan_to_num(lenses.directions(lens, u, v)[..., 2], nan=1.0)
        share = share * np.clip(cosine, 0.0, 1.0) ** signal.vignetting_power
    if any(signal.vignetting_polynomial):
        a, b, c = signal.vignetting_polynomial
        corner = np.hypot(config.width / 2.0, config.height / 2.0)
        s = ((np.asarray(u) - lens.cx) ** 2 + (np.asarray(v) - lens.cy) ** 2) / corner**2
        share = share * np.clip(1.0 + s * (a + s * (b + s * c)), 0.0, None)
    return np.asarray(share, np.float32)


def point_spread(sigma_px: float) -> Float32Array:
    """Half of a normal point spread, from its middle on; its sum over both sides is 1."""
    reach = max(1, int(np.ceil(3.0 * sigma_px)))
    half = np.exp(-0.5 * (np.arange(reach + 1) / sigma_px) ** 2)
    return np.asarray(half / (2.0 * half.sum() - half[0]), np.float32)


def add_glare(light: Float32Array, share: float) -> None:
    """Spread a share of the mean of light (..., 3) evenly over the image."""
    mean = light.reshape(-1, 3).mean(axis=0, dtype=np.float64)
    light *= np.float32(1.0 - share)
    light += np.asarray(share * mean, np.float32)


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
