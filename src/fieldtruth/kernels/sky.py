# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of the dome's image: clear air, clouds and layers; see ``render.daylight``."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.atmosphere import (
    ABOVE,
    AEROSOL,
    AZIMUTHS,
    BELOW,
    ELEVATIONS,
    MOLECULES,
    Clear,
    aerosol_phase,
    molecule_phase,
)
from fieldtruth.kernels.clouds import CloudLight, Clouds, Layer, Shade, layer_light, march
from fieldtruth.kernels.compile import inlined, kernel

EDGE: Final = 0.998
_LOWEST: Final = 0.012
"""Sine of the elevation below which haze hides clouds."""


@inlined
def _ray(row: int, column: int, size: int) -> tuple[float, float, float]:
    """Unit vector of a texel; outside the disc, that of the horizon."""
    p = (row - (size - 1) / 2) / (size / 2 * EDGE)
    q = (column - (size - 1) / 2) / (size / 2 * EDGE)
    radius = p * p + q * q
    if radius > 1.0:
        length = np.sqrt(radius)
        return p / length, q / length, 0.0
    scale = 1.0 / (1.0 + radius)
    return 2.0 * p * scale, 2.0 * q * scale, (1.0 - radius) * scale


@inlined
def _grid(ray: tuple[float, float, float], sun: Array) -> tuple[float, float]:
    """Row and column of a direction in the tables of the clear sky."""
    row = np.sqrt(np.arcsin(min(ray[2], 1.0)) * (2.0 / np.pi)) * (ELEVATIONS - 1)
    along = ray[0] * sun[0] + ray[1] * sun[1]
    across = ray[0] * sun[1] - ray[1] * sun[0]
    return row, np.arctan2(abs(across), along) / np.pi * (AZIMUTHS - 1)


@kernel
def add_air(clear: Clear, sun: Array, ray: tuple[float, float, float], part: int, gain: float, out: Array) -> None:
    """Add ``gain`` times the light (3,) that the air below or above clouds scatters along a ray."""
    row, column = _grid(ray, sun)
    i, j = min(int(row), ELEVATIONS - 2), min(int(column), AZIMUTHS - 2)
    u, v = row - i, column - j
    cosine = min(max(ray[0] * sun[0] + ray[1] * sun[1] + ray[2] * sun[2], -1.0), 1.0)
    table = clear.scattered
    for what in range(3):
        phase = gain
        if what == MOLECULES:
            phase *= molecule_phase(cosine)
        elif what == AEROSOL:
            phase *= aerosol_phase(cosine)
        for channel in range(3):
            near = table[i, j, part, what, channel] * (1.0 - v) + table[i, j + 1, part, what, channel] * v
            far = table[i + 1, j, part, what, channel] * (1.0 - v) + table[i + 1, j + 1, part, what, channel] * v
            out[channel] += phase * (near + (far - near) * u)


@kernel(allocates=True)
def clear_rows(clear: Clear, sun: Array, haze: float, start: int, rgb: Float32Array) -> None:
    """Fill rows from ``start`` on with the clear sky."""
    out = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            ray = _ray(start + i, j, rgb.shape[1])
            out[:] = 0.0
            add_air(clear, sun, ray, BELOW, haze, out)
            add_air(clear, sun, ray, ABOVE, 1.0, out)
            rgb[i, j, 0], rgb[i, j, 1], rgb[i, j, 2] = out[0], out[1], out[2]


@kernel
def _through(clear: Clear, z: float, channel: int) -> float:
    """Share of the light of clouds that the air lets through."""
    row = np.sqrt(np.arcsin(min(z, 1.0)) * (2.0 / np.pi)) * (ELEVATIONS - 1)
    i = min(int(row), ELEVATIONS - 2)
    return clear.through[i, channel] * (1.0 - row + i) + clear.through[i + 1, channel] * (row - i)  # type: ignore[no-any-return]


@kernel(allocates=True)
def _cover(
    clear: Clear,
    sun: Array,
    haze: float,
    ray: tuple[float, float, float],
    cloud: Array,
    left: float,
    pixel: Float32Array,
) -> None:
    """Replace a pixel (3,) by clouds with light ``cloud``, of which ``left`` of the light from beyond passes."""
    air = np.zeros(3)
    add_air(clear, sun, ray, BELOW, haze, air)
    for channel in range(3):
        beyond = pixel[channel] - air[channel]
        pixel[channel] = air[channel] + _through(clear, ray[2], channel) * cloud[channel] + left * beyond


@kernel(allocates=True)
def march_rows(
    clouds: Clouds, shade: Shade, light: CloudLight, start: int, chosen: NDArray[np.bool_], seen: Float32Array
) -> None:
    """Fill the chosen texels of rows of ``seen`` (.., size, 4): light of clouds, and the share that they stop."""
    cloud = np.zeros(3)
    for i in range(seen.shape[0]):
        for j in range(seen.shape[1]):
            ray = _ray(start + i, j, seen.shape[1])
            if ray[2] < _LOWEST or not chosen[i, j]:
                continue
            cloud[:] = 0.0
            seen[i, j, 3] = 1.0 - march(clouds, shade, light, ray, cloud)
            seen[i, j, 0], seen[i, j, 1], seen[i, j, 2] = cloud[0], cloud[1], cloud[2]


@kernel(allocates=True)
def cloud_rows(clear: Clear, sun: Array, haze: float, start: int, seen: Float32Array, rgb: Float32Array) -> None:
    """Draw clouds with volume over rows of the dome."""
    cloud = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            if seen[i, j, 3] > 0.0:
                ray = _ray(start + i, j, rgb.shape[1])
                fade = min(max(ray[2] - _LOWEST, 0.0) / 0.03, 1.0)
                for channel in range(3):
                    cloud[channel] = fade * seen[i, j, channel]
                _cover(clear, sun, haze, ray, cloud, 1.0 - fade * seen[i, j, 3], rgb[i, j])


@kernel(allocates=True)
def layer_rows(
    clear: Clear, layer: Layer, light: CloudLight, haze: float, level: Array, start: int, rgb: Float32Array
) -> None:
    """Draw a layer of clouds over rows of the dome."""
    cloud = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            ray = _ray(start + i, j, rgb.shape[1])
            cloud[:] = 0.0
            left = layer_light(layer, light, level, ray, cloud)
            _cover(clear, light.sun, haze, ray, cloud, left, rgb[i, j])
