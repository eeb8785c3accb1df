# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Straight ways through the cells of a grid, from border to border: what rays have seen, and how far a way is free."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts, Float32Array
from fieldtruth.kernels.compile import inlined, kernel


class SeenCells(NamedTuple):
    """Cells of a map, and the stamps at which rays first came into them."""

    x0: float
    y0: float
    resolution: float
    ground: Float32Array
    """(n, m) [m] height of the bare ground."""
    passed: Counts
    """(n, m) [ns] when a ray first passed over the ground, low enough."""
    hit: Counts
    """(n, m) [ns] when a ray first ended there."""


@inlined
def _axis(start: float, way: float) -> tuple[int, float, float]:
    """Return, along one axis: step of the cell, and shares of the way to the first border and from border to border."""
    if way > 0.0:
        return 1, (math.floor(start) + 1.0 - start) / way, 1.0 / way
    if way < 0.0:
        return -1, (math.floor(start) - start) / way, -1.0 / way
    return 0, math.inf, math.inf


@kernel
def see_cells(origins: Array, ends: Array, stamp_ns: int, top: float, cells: SeenCells) -> None:
    """Note the stamp of rays (n, 3) [m], from origin to end, in the cells that they are in for the first time.

    A ray passes a cell if it is, somewhere in it, from the ground to ``top`` [m] above it.
    """
    n, m = cells.ground.shape
    scale = 1.0 / cells.resolution
    for k in range(len(ends)):
        x, y, z = (origins[k, 0] - cells.x0) * scale, (origins[k, 1] - cells.y0) * scale, origins[k, 2]
        way_x, way_y, way_z = (ends[k, 0] - cells.x0) * scale - x, (ends[k, 1] - cells.y0) * scale - y, ends[k, 2] - z
        step_x, next_x, across_x = _axis(x, way_x)
        step_y, next_y, across_y = _axis(y, way_y)
        i, j, here = math.floor(x), math.floor(y), 0.0
        while 0 <= i < n and 0 <= j < m:
            there = min(next_x, next_y, 1.0)
            low, high = z + here * way_z, z + there * way_z
            low, high = min(low, high), max(low, high)
            ground = cells.ground[i, j]
            if high >= ground and low <= ground + top:
                cells.passed[i, j] = min(cells.passed[i, j], stamp_ns)
            if there == 1.0:
                cells.hit[i, j] = min(cells.hit[i, j], stamp_ns)
                break
            here = there
            if next_x <= next_y:
                i, next_x = i + step_x, next_x + across_x
            else:
                j, next_y = j + step_y, next_y + across_y


@kernel
def free_ways(free: NDArray[np.uint8], x: float, y: float, angles: Array, distances: Array) -> None:
    """Shorten distances (n,) [cells] from a point [cells] at angles [rad] to where a cell begins that is not free.

    Beyond the grid nothing is free.
    """
    n, m = free.shape
    for k in range(len(angles)):
        step_x, next_x, across_x = _axis(x, math.cos(angles[k]))
        step_y, next_y, across_y = _axis(y, math.sin(angles[k]))
        i, j, here = math.floor(x), math.floor(y), 0.0
        while here < distances[k]:
            if not (0 <= i < n and 0 <= j < m and free[i, j]):
                distances[k] = here
                break
            here = min(next_x, next_y)
            if next_x <= next_y:
                i, next_x = i + step_x, next_x + across_x
            else:
                j, next_y = j + step_y, next_y + across_y


@kernel
def hide_voxels(solid: NDArray[np.uint8], first: Array, size: float, hidden: NDArray[np.uint8]) -> None:
    """Mark the voxels (nx, ny, nz) whose way from their middle to the origin leads through another, solid one.

    ``first`` (3,) [m] is the lower corner of the first voxel, ``size`` [m] their side.
    """
    nx, ny, nz = solid.shape
    x, y, z = -first[0] / size, -first[1] / size, -first[2] / size
    for a in range(nx):
        for b in range(ny):
            for c in range(nz):
                step_x, next_x, across_x = _axis(a + 0.5, x - a - 0.5)
                step_y, next_y, across_y = _axis(b + 0.5, y - b - 0.5)
                step_z, next_z, across_z = _axis(c + 0.5, z - c - 0.5)
                i, j, k = a, b, c
                while min(next_x, next_y, next_z) < 1.0:
                    if next_x <= min(next_y, next_z):
                        i, next_x = i + step_x, next_x + across_x
                    elif next_y <= next_z:
                        j, next_y = j + step_y, next_y + across_y
                    else:
                        k, next_z = k + step_z, next_z + across_z
                    if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
                        break
                    if solid[i, j, k]:
                        hidden[a, b, c] = 1
                        break
