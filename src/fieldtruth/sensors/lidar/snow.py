# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How bright the ground below snow looks to a LiDAR; on what stands there, snow does not count."""

from typing import Final

import numpy as np

from fieldtruth.world.model import Raster, Terrain
from fieldtruth.world.seasons.snow import hidden_share

SNOW: Final = 0.85
"""Reflectance of snow at 850 to 905 nm, grains of 0.3 mm (from memory of Wiscombe and Warren 1980, figure 8)."""


def below_snow(value: float, share: float) -> float:
    """Reflectance of a ground of which snow hides a share."""
    return value + share * (SNOW - value)


def ground_below_snow(bare: Raster, terrain: Terrain) -> Raster:
    """Reflectances of a terrain's ground with its snow, on the grid of those without."""
    if terrain.snow is None:
        return bare
    x, y = _nodes(bare)
    share = hidden_share(terrain).at(x, y)
    values = bare.values + share * (SNOW - bare.values)
    return Raster(values=values.astype(np.float32), spacing=bare.spacing, x0=bare.x0, y0=bare.y0)


def snow_on_trails(terrain: Terrain) -> float:
    """Share of the trails that snow hides."""
    inside = terrain.trail_distance.values < 0
    if terrain.snow is None or not inside.any():
        return 0.0
    x, y = _nodes(terrain.trail_distance)
    return float(hidden_share(terrain).at(x[inside], y[inside]).mean())


def _nodes(raster: Raster) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    nx, ny = raster.values.shape
    axes = raster.x0 + raster.spacing * np.arange(nx), raster.y0 + raster.spacing * np.arange(ny)
    return list(np.meshgrid(*axes, indexing="ij"))
