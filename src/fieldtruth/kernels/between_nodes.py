# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Values of the ground's grids between their nodes, for shading.

Unlike ``packets.read_grid``, they are of single precision, without checks for negative indices.
"""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined
from fieldtruth.kernels.packets import Grid

Weights = tuple[np.float32, np.float32, np.float32, np.float32]


@inlined
def cell_of(rows: int, columns: int, u: np.float32, v: np.float32) -> tuple[np.uintp, np.uintp, np.float32, np.float32]:
    """First corner (i, j) of the cell of a grid with u, v, and the position in it; beyond the border, at the border."""
    zero, end = np.float32(0.0), np.float32(1.001)
    u, v = min(max(u, zero), np.float32(rows) - end), min(max(v, zero), np.float32(columns) - end)
    row, column = int(u), int(v)  # signed numbers are converted faster than unsigned ones
    return np.uintp(row), np.uintp(column), u - np.float32(row), v - np.float32(column)


@inlined
def mixed_at(grid: Float32Array, row: int, column: int, channel: int, weights: Weights) -> np.float32:
    """Value of a channel by the weights of the corners of a cell (row, column), see ``corners_at``."""
    a, b, c, d = weights
    i, j, one = np.uintp(row), np.uintp(column), np.uintp(1)
    return (  # type: ignore[no-any-return]
        grid[i, j, channel] * a + grid[i, j + one, channel] * b
        + grid[i + one, j, channel] * c + grid[i + one, j + one, channel] * d
    )  # fmt: skip


@inlined
def corners_at(grid: Float32Array, u: np.float32, v: np.float32) -> tuple[int, int, Weights]:
    """Find the corner (i, j) of the cell with u, v, and the weights of its four corners."""
    zero, one = np.float32(0.0), np.float32(1.0)
    u = min(max(u, zero), np.float32(grid.shape[0] - 1.001))
    v = min(max(v, zero), np.float32(grid.shape[1] - 1.001))
    i, j = int(u), int(v)
    fu, fv = u - np.float32(i), v - np.float32(j)
    return i, j, ((one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv)


@inlined
def nearest(grain: NDArray[np.uint8], u: np.float32, v: np.float32) -> np.uintp:
    """Value at the node nearest to u, v."""
    zero, half = np.float32(0.0), np.float32(0.5)
    i = int(min(max(u + half, zero), np.float32(grain.shape[0] - 1)))
    j = int(min(max(v + half, zero), np.float32(grain.shape[1] - 1)))
    return np.uintp(grain[i, j])


@inlined
def _between(values: Float32Array, u: np.float32, v: np.float32) -> np.float32:
    """Bilinear value at node u, v; beyond the border the border's value."""
    (i, j, fu, fv), one = cell_of(values.shape[0], values.shape[1], u, v), np.uintp(1)
    low = values[i, j] + (values[i, j + one] - values[i, j]) * fv
    high = values[i + one, j] + (values[i + one, j + one] - values[i + one, j]) * fv
    return low + (high - low) * fu  # type: ignore[no-any-return]


@inlined
def value_at(grid: Grid, x: np.float32, y: np.float32) -> np.float32:
    """Value of a grid of light at world x, y [m]."""
    per_metre = np.float32(grid.per_metre)
    return _between(grid.values, (x - np.float32(grid.x0)) * per_metre, (y - np.float32(grid.y0)) * per_metre)


@inlined
def slope_at(surface: Grid, x: np.float32, y: np.float32, step: np.float32) -> tuple[np.float32, np.float32]:
    """Slope of the surface along x and y over ``step`` [m] to either side: as wide as a pixel sees, so that distant
    relief does not flicker.
    """
    values, per_metre, per = surface.values, np.float32(surface.per_metre), np.float32(0.5) / step
    u, v = (x - np.float32(surface.x0)) * per_metre, (y - np.float32(surface.y0)) * per_metre
    nodes = step * per_metre
    along_x = (_between(values, u + nodes, v) - _between(values, u - nodes, v)) * per
    along_y = (_between(values, u, v + nodes) - _between(values, u, v - nodes)) * per
    return along_x, along_y


@inlined
def mean_height(ground: Float32Array, u: np.float32, v: np.float32) -> tuple[np.float32, np.float32, np.float32]:
    """Height [m] of the ground without its relief at node u, v, and its rise per node along both axes."""
    (i, j, fu, fv), one = cell_of(ground.shape[0], ground.shape[1], u, v), np.uintp(1)
    h00, h01, h10, h11 = ground[i, j, 3], ground[i, j + one, 3], ground[i + one, j, 3], ground[i + one, j + one, 3]
    along_u = (h10 - h00) + ((h11 - h01) - (h10 - h00)) * fv
    along_v = (h01 - h00) + ((h11 - h10) - (h01 - h00)) * fu
    return h00 + (h10 - h00) * fu + along_v * fv, along_u, along_v
