# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The image sensor: from light on its pixels to raw values, and back to light in three channels.

The model is that of EMVA Standard 1288, release 4.0, chapter 2: a raw value y has the mean K (mu_p + mu_d) and the
variance K^2 sigma_d^2 + K^2 mu_p + 1 / 12, with mu_p electrons of light, whose number has a Poisson distribution, read
noise of sigma_d electrons, and a system gain of K per electron. The Poisson distribution is replaced by the normal one
of the same variance; their skewness differs by 1 / sqrt(mu_p).
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sensors.camera.response import FULL_SCALE, LUMINANCE
from fieldtruth.sensors.camera.signal import CameraSignal, Mosaic

_FILTERS: Final[dict[Mosaic, tuple[int, int, int, int]]] = {
    "rggb": (0, 1, 1, 2),
    "grbg": (1, 0, 2, 1),
    "gbrg": (1, 2, 0, 1),
    "bggr": (2, 1, 1, 0),
}
"""Channel of the pixels at (0, 0), (0, 1), (1, 0), (1, 1)."""


class Sensor(NamedTuple):
    """An image sensor at one gain, as kernels take it."""

    channels: Array  # (values per pixel, 3) share of each channel of light in each value
    filters: tuple[int, int, int, int]
    """Row of ``channels`` of the first value in the upper left 2 x 2 pixels."""
    electrons: float  # per unit of light
    photons: float  # 1 with photon noise, else 0
    read_noise_e: float
    gain: float  # K, raw values per electron
    black: float
    top: float  # greatest raw value
    step: float  # of raw values; 0: not quantised


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


@kernel
def expose(
    light: Float32Array, sensor: Sensor, normal: Float32Array, prnu: Float32Array, dsnu: Float32Array, raw: Float32Array
) -> None:
    """Fill ``raw`` (h, w, n) from light (h, w, 3).

    ``normal`` (h, w, n) has standard normal noise; ``prnu`` and ``dsnu`` [electrons] have the deviations of each pixel
    in sensitivity and dark signal. Each of them may be empty, for none.
    """
    height, width, values = raw.shape
    channels, filters, black, top = sensor.channels, sensor.filters, np.float32(sensor.black), np.float32(sensor.top)
    per_light, photons = np.float32(sensor.electrons), np.float32(sensor.photons)
    dark, gain, whole = np.float32(sensor.read_noise_e**2), np.float32(sensor.gain), sensor.step > 0.0
    zero, half, saturated = np.float32(0.0), np.float32(0.5), np.float32((sensor.top - sensor.black) / sensor.gain)
    for v in range(height):
        for u in range(width):
            first = filters[2 * (v & 1) + (u & 1)]
            for value in range(values):
                row = first + value
                mean = np.float32(0.0)
                for channel in range(3):
                    mean += np.float32(channels[row, channel]) * light[v, u, channel]
                mean *= per_light
                if prnu.size:
                    mean *= np.float32(1.0) + prnu[v, u, value]
                electrons = mean
                if normal.size:
                    # Far above the full scale the noise does not matter, and its root would only be slow.
                    electrons += np.sqrt(photons * max(mean, zero) + dark) * normal[v, u, value]
                if dsnu.size:
                    electrons += dsnu[v, u, value]
                y = black + gain * min(electrons, saturated)
                if whole:
                    y = np.floor(y + half)
                raw[v, u, value] = min(max(y, zero), top)


@kernel
def interpolate(raw: Float32Array, sensor: Sensor, full_scale: float, light: Float32Array) -> None:
    """Fill light (h, w, 3) from raw values (h, w, n), with bilinear interpolation between pixels of a colour."""
    height, width, values = raw.shape
    black, scale = np.float32(sensor.black), np.float32(full_scale / (sensor.top - sensor.black))
    mono = values == 1 and len(sensor.channels) == 1
    if values == 3 or mono:
        for v in range(height):
            for u in range(width):
                for channel in range(3):
                    light[v, u, channel] = (raw[v, u, 0 if mono else channel] - black) * scale
        return
    filters = sensor.filters
    for v in range(height):
        up, down = v - 1 if v > 0 else 1, v + 1 if v < height - 1 else height - 2
        for u in range(width):
            left, right = u - 1 if u > 0 else 1, u + 1 if u < width - 1 else width - 2
            centre = raw[v, u, 0]
            own = filters[2 * (v & 1) + (u & 1)]
            across, along = raw[v, left, 0] + raw[v, right, 0], raw[up, u, 0] + raw[down, u, 0]
            if own == 1:
                beside = filters[2 * (v & 1) + (1 - (u & 1))]
                _set(light, v, u, beside, (np.float32(0.5) * across - black) * scale)
                _set(light, v, u, 1, (centre - black) * scale)
                _set(light, v, u, 2 - beside, (np.float32(0.5) * along - black) * scale)
            else:
                corners = raw[up, left, 0] + raw[up, right, 0] + raw[down, left, 0] + raw[down, right, 0]
                _set(light, v, u, own, (centre - black) * scale)
                _set(light, v, u, 1, (np.float32(0.25) * (across + along) - black) * scale)
                _set(light, v, u, 2 - own, (np.float32(0.25) * corners - black) * scale)


@inlined
def _set(light: Float32Array, v: int, u: int, channel: int, value: np.float32) -> None:
    light[v, u, channel] = value
