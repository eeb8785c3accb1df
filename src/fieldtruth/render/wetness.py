# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wet ground is darker, because a film of water reflects part of the light back onto the ground, which absorbs it.

Angstrom, "The albedo of various surfaces of ground" (1925); Lekner and Dorf, Applied Optics 27, 1278
(1988).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear

WATER: Final = 1.33
"""Refractive index of water."""
WET_GLOSS: Final = 0.35
"""Gloss of soaked ground, that of mud."""


def mean_reflectance(n: float) -> float:
    """Share of isotropic light from a thin medium that the surface of one ``n`` times as dense reflects.

    It is the mean of Fresnel's equations over directions and polarisations (Duntley 1942; 0.066 for water).
    """
    m, k = n * n, n**4 - 1
    return float(
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + m * (m - 1) ** 2 / (m + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (m + 2 * n - 1) / ((m + 1) * k)
        + 8 * m * m * (m * m + 1) / ((m + 1) * k**2) * np.log(n)
    )


def wet_albedo(albedo: NDArray[np.floating], wetness: float) -> Array:
    """Albedo of ground that is ``wetness``, 0 (dry) to 1 (below a film of water), wet.

    Of the light that the ground scatters up, the film returns the share p, again and again:
    A = (1 - R) (1 - p) a / (1 - p a), with p = 1 - (1 - R) / n^2 for isotropic light.
    """
    outside = mean_reflectance(WATER)
    returned = 1.0 - (1.0 - outside) / WATER**2
    dry = np.asarray(albedo, np.float64)
    wet = (1.0 - outside) * (1.0 - returned) * dry / (1.0 - returned * dry)
    return np.asarray(dry + wetness * (wet - dry))


def wet_texture(texture: NDArray[np.uint8], wetness: float) -> NDArray[np.uint8]:
    """A texture (n, n, 3 or 4) sRGB with the albedo of wet ground; heights stay."""
    table = np.rint(srgb_from_linear(wet_albedo(linear_from_srgb(np.arange(256) / 255.0), wetness)) * 255.0)
    return np.concatenate([table.astype(np.uint8)[texture[..., :3]], texture[..., 3:]], axis=-1)
