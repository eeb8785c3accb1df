# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grids over a world, and what lies beyond its edge: the two questions that every environment asks of its size."""

import numpy as np

from fieldtruth.core.arrays import Array


def grid_axes(size: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Coordinates [m] along x and y of a grid's nodes, both edges of the world included."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / spacing) + 1) for s in size)
    return x, y


def distance_beyond(size: tuple[float, float], x: Array, y: Array) -> Array:
    """Distance [m] of places beyond the world's edge, 0 inside."""
    return np.asarray(np.hypot(np.maximum(np.abs(x) - size[0] / 2, 0.0), np.maximum(np.abs(y) - size[1] / 2, 0.0)))
