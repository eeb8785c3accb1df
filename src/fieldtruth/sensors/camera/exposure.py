# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Exposure and white balance of a camera with a signal, from metering images."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.sensors.camera.config import CameraSignal
from fieldtruth.sensors.camera.photo import LUMINANCE, encoded

METERINGS: Final = 4
"""Metering images of a photograph with a time constant."""
_WIDEST: Final = 12.0  # stops up and down that automatic exposure searches
_GREY_LIMIT: Final = 4.0  # of gains of gray world
_RGB_FROM_XYZ: Final = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""Linear sRGB (IEC 61966-2-1)."""


class Exposure(NamedTuple):
    """Exposure of a photograph."""

    total: float
    """Light and gain together, relative to the ideal exposure of an open meadow."""
    time_s: float
    gain: float
    """Of the sensor's amplifier, 1 at 0 dB."""


def exposure_of(signal: CameraSignal, wanted: float) -> Exposure:
    """Divide a total exposure into time and gain: time first; what neither can give is missing."""
    least, most = 10.0 ** (signal.gain_db / 20.0), 10.0 ** (signal.max_gain_db / 20.0)
    reference, longest = signal.exposure_time_ms / 1e3, signal.max_exposure_time_ms / 1e3
    if not reference:
        return Exposure(wanted, 0.0, least)
    time = min(reference * wanted, longest)
    gain = min(least * wanted * reference / time, most)
    return Exposure(time / reference * gain / least, time, gain)


def metering_lags(signal: CameraSignal) -> Array:
    """Times [s] before the stamp (n,) at which the camera meters: quantiles of an exponential memory.

    Exposure that follows the light with a time constant T weighs light s seconds ago with exp(-s / T) / T. Its mean
    over METERINGS quantiles replaces the state that a camera keeps from photograph to photograph, so that none depends
    on those before it.
    """
    if not signal.metering_time_s:
        return np.array([signal.metering_delay_s])
    quantiles = (np.arange(METERINGS) + 0.5) / METERINGS
    return np.asarray(signal.metering_delay_s - signal.metering_time_s * np.log1p(-quantiles))


def metered_exposure(signal: CameraSignal, images: Sequence[Array]) -> float:
    """Factor on the light of metering images (n, 3) each: the mean in stops of what brings each to the target.

    Each of them is searched for on its own by bisection: mean luminance after the response curve, with light above
    white clipped, rises with the factor.
    """
    return float(2.0 ** np.mean([_stops_to_target(image @ LUMINANCE, signal) for image in images]))


def _stops_to_target(luminance: Array, signal: CameraSignal) -> float:
    low, high = -_WIDEST, _WIDEST
    for _ in range(40):
        middle = (low + high) / 2.0
        if encoded(2.0**middle * luminance, signal.response, signal.contrast).mean() < signal.metering_target:
            low = middle
        else:
            high = middle
    return (low + high) / 2.0


def white_balance(signal: CameraSignal, images: Sequence[Array], factor: float) -> Array:
    """Gains (3,) on light that is relative to the scene's daylight; the least is 1, so that white stays white.

    ``images`` are metering images (n, 3) whose light is to be multiplied with ``factor``.
    """
    gains = np.array(signal.white_balance_gains)
    if signal.white_balance_k is not None:
        gains = gains / daylight(signal.white_balance_k)
    if signal.gray_world and images:
        mean = np.mean([np.clip(factor * image, 0.0, 1.0).mean(axis=0) for image in images], axis=0)
        grey = np.clip(mean[1] / np.maximum(mean, 1e-9), 1.0 / _GREY_LIMIT, _GREY_LIMIT)
        gains = gains * grey**signal.gray_world
    return np.asarray(gains / gains.min())


def daylight(kelvin: float) -> Array:
    """Linear sRGB (3,) of daylight of a colour temperature, relative to that of 6504 K; green is 1.

    CIE 015:2018, 4.1.2: chromaticity of the daylight illuminants from 4000 to 25,000 K.
    """
    rgb = _daylight(kelvin) / _daylight(6504.0)
    return np.asarray(rgb / rgb[1])


def _daylight(kelvin: float) -> Array:
    t = 1e3 / kelvin
    if kelvin <= 7000.0:
        x = 0.244063 + t * (0.09911 + t * (2.9678 - 4.6070 * t))
    else:
        x = 0.237040 + t * (0.24748 + t * (1.9018 - 2.0064 * t))
    y = -3.0 * x * x + 2.870 * x - 0.275
    return np.asarray(_RGB_FROM_XYZ @ [x / y, 1.0, (1.0 - x - y) / y])
