# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light that clear air scatters: see ``render.daylight`` for the model and its sources."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.compile import inlined, kernel

EARTH: Final = 6371.0
TOP: Final = 90.0
MOLECULE_SCALE: Final = 8.0
AEROSOL_SCALE: Final = 1.3
"""Scale heights of molecules and aerosol: their density falls by e over it."""
AEROSOL_ALBEDO: Final = 0.93
GROUND_ALBEDO: Final = 0.15
MOLECULES, AEROSOL, HIGHER = range(3)
"""Parts of the light that is scattered towards the ground: the phase function of each is applied later."""
BELOW, ABOVE = range(2)
"""Parts of a ray through the sky: up to the height of clouds, and beyond it."""
ELEVATIONS: Final = 64
AZIMUTHS: Final = 32
_STEPS: Final = 40
_SUN_STEPS: Final = 24
HEIGHTS: Final = 16
COSINES: Final = 40
_LOWEST_COSINE: Final = -0.25
SUN_RADIUS: Final = 0.00465  # [rad]


class Clear(NamedTuple):
    """Clear sky on a grid of directions, in linear sRGB; before phase functions.

    Row i is the elevation pi/2 (i / (ELEVATIONS - 1))^2, column j the azimuth pi j / (AZIMUTHS - 1) from the sun's.
    """

    scattered: Array  # (ELEVATIONS, AZIMUTHS, 2, 3, 3): part of the ray, what scatters, channel
    through: Array  # (ELEVATIONS, 3) share of light from clouds at ``ceiling`` that arrives at the ground
    sun: Array  # (3,) irradiance by the sun at the ground on a surface that faces it
    sun_above: Array  # (3,) the same at the height of clouds


@inlined
def _density(height: float, column: int) -> float:
    """Density of molecules, aerosol or ozone over its vertical column [1/km]; ozone is between 10 and 40 km."""
    if column == 0:
        return np.exp(-height / MOLECULE_SCALE) / MOLECULE_SCALE  # type: ignore[no-any-return]
    if column == 1:
        return np.exp(-height / AEROSOL_SCALE) / AEROSOL_SCALE  # type: ignore[no-any-return]
    return max(0.0, 1.0 - abs(height - 25.0) / 15.0) / 15.0


@inlined
def _length(height: float, cosine: float) -> float:
    """Distance to the top of the atmosphere along a ray that does not meet the ground."""
    r, top = EARTH + height, EARTH + TOP
    return -r * cosine + np.sqrt(max(r * r * (cosine * cosine - 1.0) + top * top, 0.0))  # type: ignore[no-any-return]


@inlined
def risen(height: float, sine: float) -> float:
    """Share of the sun's disc above the horizon of a point at ``height``; ``sine`` of the elevation of its centre."""
    dip = np.arccos(EARTH / (EARTH + height))
    share = 0.5 + 0.5 * (np.arcsin(sine) + dip) / SUN_RADIUS
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)  # type: ignore[no-any-return]


@kernel
def fill_columns(height: float, cosine: float, out: Array) -> None:
    """Amount of molecules, aerosol and ozone between a point and space, in vertical columns."""
    length, r = _length(height, cosine), EARTH + height
    out[:] = 0.0
    for step in range(_SUN_STEPS):
        near, far = step / _SUN_STEPS, (step + 1.0) / _SUN_STEPS
        near, far = length * near * near, length * far * far
        t = 0.5 * (near + far)
        h = max(np.sqrt(r * r + t * t + 2.0 * r * t * cosine) - EARTH, 0.0)
        for column in range(3):
            out[column] += (far - near) * _density(h, column)


@inlined
def _row(height: float) -> float:
    """Row of the table of higher orders."""
    return (HEIGHTS - 1) * np.sqrt(min(max(height / TOP, 0.0), 1.0))  # type: ignore[no-any-return]


@inlined
def _column(cosine: float) -> float:
    """Column of the table of higher orders: finest where the sun is at the horizon."""
    share = (cosine - _LOWEST_COSINE) / (1.0 - _LOWEST_COSINE)
    return (COSINES - 1) * np.sqrt(min(max(share, 0.0), 1.0))  # type: ignore[no-any-return]


@kernel(allocates=True)
def fill_higher_orders(depths: Array, directions: Array, out: Array) -> None:
    """Light of second and higher orders (heights, cosines of the sun, wavelengths) per irradiance of the sun.

    Each point gets in all directions the mean of what the directions about it send (Hillaire 2020, equation 5).
    """
    count, waves, steps, uniform = len(directions), depths.shape[1], 16, 1.0 / (4.0 * np.pi)
    column, passed, second, again = np.zeros(3), np.zeros(waves), np.zeros(waves), np.zeros(waves)
    for i in range(HEIGHTS):
        height = max(TOP * (i / (HEIGHTS - 1.0)) ** 2, 0.001)
        r = EARTH + height
        for j in range(COSINES):
            cosine = _LOWEST_COSINE + (1.0 - _LOWEST_COSINE) * (j / (COSINES - 1.0)) ** 2
            sx, sz = np.sqrt(1.0 - cosine * cosine), cosine
            second[:], again[:] = 0.0, 0.0
            for k in range(count):
                dx, dz = directions[k, 0], directions[k, 2]
                to_ground = r * r * (dz * dz - 1.0) + EARTH * EARTH
                down = dz < 0.0 and to_ground > 0.0
                length = -r * dz - np.sqrt(to_ground) if down else _length(height, dz)
                passed[:] = 1.0
                for step in range(steps):
                    near, far = length * (step / steps) ** 2, length * ((step + 1.0) / steps) ** 2
                    t = 0.5 * (near + far)
                    x, y, z = t * dx, t * directions[k, 1], r + t * dz
                    distance = np.sqrt(x * x + y * y + z * z)
                    h, sun = max(distance - EARTH, 0.0), (x * sx + z * sz) / distance
                    lit = risen(h, sun)
                    if lit > 0.0:
                        fill_columns(h, sun, column)
                    for w in range(waves):
                        molecules, aerosol = depths[0, w] * _density(h, 0), depths[1, w] * _density(h, 1)
                        scatter = molecules + AEROSOL_ALBEDO * aerosol
                        all_lost = (molecules + aerosol + depths[2, w] * _density(h, 2)) * (far - near)
                        left = np.exp(-all_lost)
                        share = passed[w] * scatter * (far - near) * (1.0 - left) / max(all_lost, 1e-12)
                        again[w] += share / count
                        if lit > 0.0:
                            light = column[0] * depths[0, w] + column[1] * depths[1, w] + column[2] * depths[2, w]
                            second[w] += share * uniform * lit * np.exp(-light) / count
                        passed[w] *= left
                if down:
                    x, y, z = length * dx, length * directions[k, 1], r + length * dz
                    sun = (x * sx + z * sz) / EARTH
                    if sun > 0.0:
                        fill_columns(0.0, sun, column)
                        for w in range(waves):
                            light = column[0] * depths[0, w] + column[1] * depths[1, w] + column[2] * depths[2, w]
                            second[w] += passed[w] * np.exp(-light) * sun * GROUND_ALBEDO / np.pi / count
            for w in range(waves):
                out[i, j, w] = second[w] / (1.0 - again[w])


@kernel(allocates=True)
def scatter(depths: Array, higher: Array, elevation: float, ceiling: float, out: Array, through: Array) -> None:
    """Integrate what is scattered along each ray from the ground, per irradiance of the sun above the air."""
    waves = depths.shape[1]
    sx, sz, r = np.cos(elevation), np.sin(elevation), EARTH + 0.002
    column, passed = np.zeros(3), np.zeros(waves)
    for i in range(ELEVATIONS):
        angle = 0.5 * np.pi * (i / (ELEVATIONS - 1.0)) ** 2
        level, dz = np.cos(angle), np.sin(angle)
        end = _length(0.002, dz)
        split = -r * dz + np.sqrt(r * r * (dz * dz - 1.0) + (EARTH + ceiling) ** 2)
        for j in range(AZIMUTHS):
            azimuth = np.pi * j / (AZIMUTHS - 1.0)
            dx, dy = level * np.cos(azimuth), level * np.sin(azimuth)
            passed[:] = 1.0
            for step in range(2 * _STEPS):
                part, k = step // _STEPS, step % _STEPS
                start, stop = (0.0, split) if part == BELOW else (split, end)
                near, far = (k / _STEPS) ** 2, ((k + 1.0) / _STEPS) ** 2
                near, far = start + (stop - start) * near, start + (stop - start) * far
                t = 0.5 * (near + far)
                x, y, z = t * dx, t * dy, r + t * dz
                distance = np.sqrt(x * x + y * y + z * z)
                h, sun = distance - EARTH, (x * sx + z * sz) / distance
                lit = risen(h, sun)
                if lit > 0.0:
                    fill_columns(h, sun, column)
                row, slot = _row(h), _column(sun)
                m, n = min(int(row), HEIGHTS - 2), min(int(slot), COSINES - 2)
                fm, fn = row - m, slot - n
                for w in range(waves):
                    molecules, aerosol = depths[0, w] * _density(h, 0), depths[1, w] * _density(h, 1)
                    lost = (molecules + aerosol + depths[2, w] * _density(h, 2)) * (far - near)
                    left = np.exp(-lost)
                    share = passed[w] * (far - near) * (1.0 - left) / max(lost, 1e-12)
                    if lit > 0.0:
                        light = column[0] * depths[0, w] + column[1] * depths[1, w] + column[2] * depths[2, w]
                        direct = share * lit * np.exp(-light)
                        out[i, j, part, MOLECULES, w] += direct * molecules
                        out[i, j, part, AEROSOL, w] += direct * AEROSOL_ALBEDO * aerosol
                    upper = (1.0 - fn) * higher[m, n, w] + fn * higher[m, n + 1, w]
                    lower = (1.0 - fn) * higher[m + 1, n, w] + fn * higher[m + 1, n + 1, w]
                    more = (1.0 - fm) * upper + fm * lower
                    out[i, j, part, HIGHER, w] += share * (molecules + AEROSOL_ALBEDO * aerosol) * more
                    passed[w] *= left
                if step == _STEPS - 1:
                    for w in range(waves):
                        through[i, w] = passed[w]


@inlined
def molecule_phase(cosine: float) -> float:
    """Phase function of molecules [1/sr]: Rayleigh's."""
    return 3.0 / (16.0 * np.pi) * (1.0 + cosine * cosine)


@inlined
def forward_phase(cosine: float, asymmetry: float) -> float:
    """Phase function of Henyey and Greenstein (1941) [1/sr]."""
    g = asymmetry
    return (1.0 - g * g) / (4.0 * np.pi * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)  # type: ignore[no-any-return]


@inlined
def aerosol_phase(cosine: float) -> float:
    """Phase function of aerosol [1/sr]: mean cosine 0.69, with the narrow peak that makes the sun's aureole."""
    return 0.86 * forward_phase(cosine, 0.65) + 0.14 * forward_phase(cosine, 0.94)
