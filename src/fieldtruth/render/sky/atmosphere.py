# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A clear atmosphere: how much sunlight passes through it, and how much it scatters towards the ground.

Scattering is integrated numerically along each ray through a spherical atmosphere of molecules, aerosol and ozone
(Nishita et al. 1993; Bruneton and Neyret 2008): the first order exactly, with the Earth's shadow, the higher orders
with the isotropic approximation of Hillaire (2020), equations 5 to 10. Lengths in this module are in kilometres.
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
from fieldtruth.render.sky.spectrum import OZONE, RGB_FROM_SPECTRUM, SOLAR, WAVELENGTHS

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
    fill_higher_orders(depths, _directions(64), higher)
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


def _directions(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly over the sphere (spherical Fibonacci)."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
