# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grids over a world, and the distance from its edge."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Heightfield, Raster

BUILT_IN: Final = (100.0, 50.0)
"""Length and width [m] of the built-in worlds, for which the default counts are."""
FINE_AREA: Final = 40_000.0
"""Area [m^2] up to which grids have their full resolution: 16 million nodes of the terrain."""

COVER: Final = 0.1
"""Spacing [m] of the grid of a world's cover at full resolution."""


def coarseness(size: tuple[float, float]) -> int:
    """By how much the spacing of grids over a world of a size [m] is larger, so that their nodes stay about as many."""
    return max(1, int(np.ceil(np.sqrt(size[0] * size[1] / FINE_AREA))))


def grid_axes(size: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Coordinates [m] along x and along y of a grid's nodes, from edge to edge of the world."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / spacing) + 1) for s in size)
    return x, y


def distance_beyond(size: tuple[float, float], x: Array, y: Array) -> Array:
    """Distance [m] of positions to the world's edge, 0 inside."""
    return np.asarray(np.hypot(np.maximum(np.abs(x) - size[0] / 2, 0.0), np.maximum(np.abs(y) - size[1] / 2, 0.0)))


def make_heightfield(heights: Array, spacing: float, x: Array, y: Array) -> Heightfield:
    """Heightfield of heights (nx, ny) [m] on nodes x (nx,), y (ny,), which are ``spacing`` [m] apart."""
    return Heightfield(heights=heights.astype(np.float32), spacing=spacing, x0=float(x[0]), y0=float(y[0]))


def make_raster(values: ArrayLike, spacing: float, x: Array, y: Array) -> Raster:
    """Raster of values (nx, ny) or (nx, ny, channels) on nodes x (nx,), y (ny,), which are ``spacing`` [m] apart."""
    return Raster(values=np.asarray(values, np.float32), spacing=spacing, x0=float(x[0]), y0=float(y[0]))
