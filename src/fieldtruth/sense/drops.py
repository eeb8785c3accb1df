# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drops of rain and flakes of snow: how many of which size, and how bright."""

from typing import Final, NamedTuple

import numpy as np
from scipy.special import gamma

WATER_INDEX: Final = 1.33
"""Refractive index (Hale and Querry 1973)."""
_ABSORBED_NM: Final = 1400.0
"""Wavelength [nm] from which a drop of 1 mm absorbs what passes through it (Hale and Querry 1973)."""
SNOW_LIDAR_RATIO: Final = 29.0
"""[sr] of ice crystals, 29 +- 12 (Chen, Chiang and Nee 2002)."""
FLAKE_DENSITY: Final = (0.178, -0.922)
"""Density of a flake over that of water at 1 mm, and its power law of the diameter (Brandes et al. 2007)."""
FLAKE_AREA: Final = 0.5
"""Share of the circle about a flake that it covers; extinction is then between those of wet and of dry snow of ITU-R
P.1814 at 1 mm/h."""


class Drops(NamedTuple):
    """Falling particles: n(D) = per_m3_mm exp(-per_mm D) of the melted diameter D [mm]."""

    per_m3_mm: float  # [1/(m^3 mm)]
    per_mm: float  # [1/mm]
    size: tuple[float, float]
    """Diameter [mm] of a disc of its area at a melted diameter of 1 mm, and its power law of the melted diameter."""
    reflectance: float  # of a Lambert surface with the same echo

    @property
    def extinction(self) -> float:
        """[1/m]: integral of pi / 4 diameter^2 n(D)."""
        scale, power = self.size
        moment = gamma(2 * power + 1) / self.per_mm ** (2 * power + 1)
        return float(1e-6 * np.pi / 4 * scale**2 * self.per_m3_mm * moment)

    @property
    def per_m3(self) -> float:
        """Number of particles per volume [1/m^3]."""
        return self.per_m3_mm / self.per_mm


def drop_reflectance(wavelength_nm: float) -> float:
    """Reflectance of the Lambert disc that sends as much light back as a drop, in geometric optics.

    The light comes from the front, a convex mirror, and from the back, a mirror behind a lens: F / 4 and
    (1 - F)^2 F (n / (2 - n))^2 / 4, F Fresnel's reflectance (van de Hulst 1957, section 12.21). The glory of a perfect
    sphere is brighter, but within 1 mrad (wavelength over diameter), and falling drops are no perfect spheres.
    """
    n = WATER_INDEX
    fresnel = ((n - 1) / (n + 1)) ** 2
    back = 0.0 if wavelength_nm > _ABSORBED_NM else (1 - fresnel) ** 2 * fresnel * (n / (2 - n)) ** 2
    return (fresnel + back) / 4


def rain(rate_mm_h: float, wavelength_nm: float) -> Drops:
    """Raindrops (Marshall and Palmer 1948)."""
    return Drops(8000.0, 4.1 * rate_mm_h**-0.21, (1.0, 1.0), drop_reflectance(wavelength_nm))


def snow(rate_mm_h: float) -> Drops:
    """Snowflakes (Sekhon and Srivastava 1970); extinction over backscatter makes their reflectance."""
    scale, power = FLAKE_DENSITY
    size = FLAKE_AREA**0.5 * scale ** (-1 / (3 + power)), 3 / (3 + power)  # density times diameter^3 remains
    reflectance = 2 * np.pi / SNOW_LIDAR_RATIO  # the ratio's extinction includes what is diffracted
    return Drops(2500.0 * rate_mm_h**-0.94, 2.29 * rate_mm_h**-0.45, size, reflectance)
