# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ruts on a grid of depths that is kept in blocks: what a wheel presses, and the depth at a position.

A wheel of the radius R that has sunk by z is lower than the ground around it by z - R + sqrt(R^2 - s^2) at the distance
s ahead of its contact or behind it. Beside the tyre the wall of the rut rises with the slope of the soil. The rut is
the deepest that any wheel pressed at a node, from one of its positions to the next.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel

CELLS: Final = 16
"""Cells on a side of a block; neighbours share the nodes of their border."""
_FLATTEST: Final = 0.05  # slope of a wall


class RutTable(NamedTuple):
    """Depths [m] of ruts at nodes in square blocks, which lie where wheels may pass."""

    block: NDArray[np.int32]
    """(i, j) Row of ``depth``; -1 without one."""
    depth: Float32Array
    """(blocks, CELLS + 1, CELLS + 1)"""
    x0: float
    y0: float
    per_metre: float
    """Cells per metre; x and y [m] are those of the first node."""


NO_RUTS: Final = RutTable(np.full((1, 1), -1, np.int32), np.zeros((0, CELLS + 1, CELLS + 1), np.float32), 0.0, 0.0, 1.0)


@kernel
def press_ruts(table: RutTable, wheels: Array, half_width: float, radius: float) -> None:
    """Deepen ``table.depth`` to what wheels press.

    Args:
        table: the ruts.
        wheels: (n, 7) of each: x, y [m] of the contact, its horizontal heading as a unit vector, the distance [m] that
            it moved along it since its position before, sinkage [m], and slope of the walls.
        half_width: of a tyre [m].
        radius: of a wheel [m].
    """
    cell = 1.0 / table.per_metre
    rows, columns = table.block.shape
    for n in range(len(wheels)):
        x, y, along_x, along_y, moved, sinkage, slope = wheels[n]
        slope = max(slope, _FLATTEST)
        low, high = min(-moved, 0.0), max(-moved, 0.0)
        ahead = math.sqrt(2.0 * radius * sinkage)
        reach = math.hypot(half_width + sinkage / slope, ahead + abs(moved))
        side = CELLS * cell
        first_i, last_i = int((x - reach - table.x0) // side), int((x + reach - table.x0) // side)
        first_j, last_j = int((y - reach - table.y0) // side), int((y + reach - table.y0) // side)
        for i in range(max(first_i, 0), min(last_i, rows - 1) + 1):
            for j in range(max(first_j, 0), min(last_j, columns - 1) + 1):
                row = table.block[i, j]
                if row < 0:
                    continue
                for k in range(CELLS + 1):
                    dx = table.x0 + (i * CELLS + k) * cell - x
                    for m in range(CELLS + 1):
                        dy = table.y0 + (j * CELLS + m) * cell - y
                        s, across = dx * along_x + dy * along_y, abs(dy * along_x - dx * along_y)
                        s = max(s - high, low - s, 0.0)
                        if s < radius:
                            sag = radius - math.sqrt(radius * radius - s * s)
                            depth = np.float32(sinkage - sag - slope * max(across - half_width, 0.0))
                            table.depth[row, k, m] = max(table.depth[row, k, m], depth)


@inlined
def rut_depth(table: RutTable, x: np.float32, y: np.float32) -> np.float32:
    """Depth [m] at world x, y [m], bilinear; 0 outside the blocks."""
    u, v = (x - table.x0) * table.per_metre, (y - table.y0) * table.per_metre
    if u < 0.0 or v < 0.0:
        return np.float32(0.0)
    i, j = int(u), int(v)
    block_i, block_j = i // CELLS, j // CELLS
    if block_i >= table.block.shape[0] or block_j >= table.block.shape[1]:
        return np.float32(0.0)
    row = table.block[block_i, block_j]
    if row < 0:
        return np.float32(0.0)
    u, v, i, j = u - i, v - j, i - block_i * CELLS, j - block_j * CELLS
    low = table.depth[row, i, j] * (1.0 - v) + table.depth[row, i, j + 1] * v
    high = table.depth[row, i + 1, j] * (1.0 - v) + table.depth[row, i + 1, j + 1] * v
    return np.float32(low * (1.0 - u) + high * u)
