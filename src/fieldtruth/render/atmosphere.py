# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A clear atmosphere: spectra of daylight, how much sunlight passes, and how much is scattered towards the ground.

Wavelengths, the sun's irradiance above the air, ozone, and their linear sRGB are tables. Scattering is integrated
numerically along each ray through a spherical atmosphere of molecules, aerosol and ozone (Nishita et al. 1993; Bruneton
and Neyret 2008): the first order exactly, with the Earth's shadow, the higher orders with the isotropic approximation
of Hillaire (2020), equations 5 to 10. Lengths in this module are in kilometres.
"""

from functools import lru_cache
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.atmosphere import (
    AZIMUTHS,
    COSINES,
    EARTH,
    ELEVATIONS,
    HEIGHTS,
    SUN_RADIUS,
    Clear,
    fill_columns,
    fill_higher_orders,
    risen,
    scatter,
)

WAVELENGTHS: Final = np.arange(380.0, 741.0, 20.0)
"""[nm], (19,): each stands for the 20 nm about it."""
SOLAR: Final = np.array([
    1.079, 1.583, 1.680, 1.868, 2.024, 1.962, 1.905, 1.865, 1.862, 1.838, 1.811, 1.746, 1.677, 1.594, 1.536, 1.477,
    1.409, 1.341, 1.287,
])  # fmt: skip
"""Irradiance [W/m^2/nm] outside the air at the mean distance (reference spectrum of ASTM G173-03)."""
OZONE: Final = 1e-25 * np.array([
    0.0036, 0.0162, 0.0556, 0.158, 0.364, 0.736, 1.37, 2.16, 3.11, 4.18, 4.54, 4.76, 3.75, 2.69, 1.85, 1.21, 0.773,
    0.523, 0.396,
])  # fmt: skip
"""Absorption cross-section [m^2] of an ozone molecule in the Chappuis band (Serdyuchenko et al. 2014)."""
LUX_PER_UNIT: Final = 100_000.0
"""Illuminance [lx] of an irradiance of 1: that of the sun high in a clear sky, about."""
_LUMENS_PER_WATT: Final = 683.0
_SRGB_FROM_XYZ: Final = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)
"""IEC 61966-2-1, white point D65."""
LUMINANCE: Final = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear sRGB."""


def _matching() -> Array:
    """CIE 1931 colour matching functions (19, 3), fits of Wyman, Sloan and Shirley (2013, Journal of CGT 2)."""
    lobes = (
        ((1.056, 599.8, 37.9, 31.0), (0.362, 442.0, 16.0, 26.7), (-0.065, 501.1, 20.4, 26.2)),
        ((0.821, 568.8, 46.9, 40.5), (0.286, 530.9, 16.3, 31.1)),
        ((1.217, 437.0, 11.8, 36.0), (0.681, 459.0, 26.0, 13.8)),
    )
    columns = []
    for function in lobes:
        total = np.zeros(len(WAVELENGTHS))
        for height, middle, below, above in function:
            deviation = np.where(middle > WAVELENGTHS, below, above)
            total += height * np.exp(-0.5 * ((WAVELENGTHS - middle) / deviation) ** 2)
        columns.append(total)
    return np.stack(columns, axis=-1)


RGB_FROM_SPECTRUM: Final = _matching() @ _SRGB_FROM_XYZ.T * (20.0 * _LUMENS_PER_WATT / LUX_PER_UNIT)
"""(19, 3): linear sRGB in units of LUX_PER_UNIT from [W/m^2/nm]."""
ANGSTROM: Final = 1.3
"""Exponent of wavelength with which the optical depth of aerosol falls (Angstrom 1929; continental air)."""
OZONE_COLUMN: Final = 300.0
"""[Dobson units]; one is 2.687e20 molecules per square metre."""


@lru_cache(4)  # many worlds have the same sun
def clear_sky(elevation: float, turbidity: float, ceiling: float) -> Clear:
    """Compute the clear sky.

    Args:
        elevation: of the sun's centre above the horizon [rad].
        turbidity: optical depth of all air over that of its molecules, at 550 nm.
        ceiling: height of clouds [km].
    """
    depths = optical_depths(turbidity)
    higher = np.zeros((HEIGHTS, COSINES, len(WAVELENGTHS)))
    fill_higher_orders(depths, sphere(64, 0.0), higher)
    scattered = np.zeros((ELEVATIONS, AZIMUTHS, 2, 3, len(WAVELENGTHS)))
    passed = np.zeros((ELEVATIONS, len(WAVELENGTHS)))
    scatter(depths, higher, elevation, ceiling, scattered, passed)
    suns = [transmittance(depths, height, elevation) * SOLAR @ RGB_FROM_SPECTRUM for height in (0.0, ceiling)]
    weight = SOLAR[:, None] * RGB_FROM_SPECTRUM
    share = passed @ weight / weight.sum(axis=0)
    rgb = np.maximum(scattered * SOLAR @ RGB_FROM_SPECTRUM, 0.0)
    return Clear(rgb, np.clip(share, 0.0, 1.0), np.maximum(suns[0], 0.0), np.maximum(suns[1], 0.0))


def optical_depths(turbidity: float) -> Array:
    """Vertical optical depth (3, 19) of molecules (Hansen and Travis 1974, equation 2.30), aerosol and ozone."""
    micron = WAVELENGTHS / 1000.0
    molecules = 0.008569 * micron**-4 * (1.0 + 0.0113 * micron**-2 + 0.00013 * micron**-4)
    at_550 = 0.008569 * 0.55**-4 * (1.0 + 0.0113 * 0.55**-2 + 0.00013 * 0.55**-4)
    aerosol = (turbidity - 1.0) * at_550 * (micron / 0.55) ** -ANGSTROM
    return np.stack([molecules, aerosol, OZONE * OZONE_COLUMN * 2.687e20])


def transmittance(depths: Array, height: float, elevation: float) -> Array:
    """Share (19,) of the sun's light that arrives at ``height`` [km], with the part of its disc that has risen."""
    column = np.zeros(3)
    dip = -np.arccos(EARTH / (EARTH + height))
    fill_columns(height, np.sin(max(elevation, dip + 0.5 * SUN_RADIUS)), column)
    return np.asarray(np.exp(-column @ depths) * risen(height, np.sin(elevation)))


def sphere(count: int, turn: float) -> Array:
    """Directions (count, 3) spread evenly over the sphere (spherical Fibonacci), turned about z by ``turn`` [rad]."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0)) + turn
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
