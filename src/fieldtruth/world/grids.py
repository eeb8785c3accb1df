# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grid axes over a world, and the distance from its edge."""

import numpy as np

from fieldtruth.core.arrays import Array


def grid_axes(size: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Coordinates [m] along x and along y of a grid's nodes, from edge to edge of the world."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / spacing) + 1) for s in size)
    return x, y


def distance_beyond(size: tuple[float, float], x: Array, y: Array) -> Array:
    """Distance [m] of positions to the world's edge, 0 inside."""
    return np.asarray(np.hypot(np.maximum(np.abs(x) - size[0] / 2, 0.0), np.maximum(np.abs(y) - size[1] / 2, 0.0)))
