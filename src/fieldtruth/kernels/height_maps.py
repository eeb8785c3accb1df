# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of heights and of path lengths around a robot that moves: read where it is, and raised by the points it sees."""

import math

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.packets import Grid


@kernel
def crop_heights(grid: Grid, pose: Array, spacing: float, limit: float, height: Float32Array, known: Mask) -> None:
    """Fill square images of the heights around a robot, and of where they are known; NaN in ``grid`` is unknown.

    ``pose`` is the robot's x, y [m], heading [rad] and height [m] of what is 0. Rows go from ahead to behind, columns
    from left to right; pixels are ``spacing`` [m] apart. Heights [m] are cut at ``limit``, unknown ones are 0.
    """
    values, count = grid.values, len(height)
    cos, sin, middle = math.cos(pose[2]), math.sin(pose[2]), 0.5 * (count - 1)
    for i in range(count):
        for j in range(count):
            ahead, left = (middle - i) * spacing, (middle - j) * spacing
            x = pose[0] + cos * ahead - sin * left
            y = pose[1] + sin * ahead + cos * left
            u, v = round((x - grid.x0) * grid.per_metre), round((y - grid.y0) * grid.per_metre)
            height[i, j], known[i, j] = 0.0, False
            if 0 <= u < values.shape[0] and 0 <= v < values.shape[1]:
                value = values[u, v]
                if value == value:  # no NaN
                    height[i, j] = min(max(value - pose[3], -limit), limit)
                    known[i, j] = True


@kernel
def raise_to_points(grid: Grid, pose: Array, points: Float32Array, top: float) -> None:
    """Raise the cells of ``grid`` to the points (n, 3) [m] of a sensor at a pose (4, 4) that are below ``top`` [m]."""
    values = grid.values
    for k in range(len(points)):
        a, b, c = points[k, 0], points[k, 1], points[k, 2]
        z = pose[2, 0] * a + pose[2, 1] * b + pose[2, 2] * c + pose[2, 3]
        if z > top:
            continue
        x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
        y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
        u, v = round((x - grid.x0) * grid.per_metre), round((y - grid.y0) * grid.per_metre)
        if 0 <= u < values.shape[0] and 0 <= v < values.shape[1] and not (values[u, v] >= z):
            values[u, v] = z


@kernel
def mark_seen(wanted: Mask, corner: Array, spacing: float, pose: Array, points: Float32Array) -> int:
    """Clear the cells of ``wanted`` in which a point (n, 3) [m] of a sensor at a pose (4, 4) is; returns how many."""
    count = 0
    for k in range(len(points)):
        a, b, c = points[k, 0], points[k, 1], points[k, 2]
        x = pose[0, 0] * a + pose[0, 1] * b + pose[0, 2] * c + pose[0, 3]
        y = pose[1, 0] * a + pose[1, 1] * b + pose[1, 2] * c + pose[1, 3]
        u, v = round((x - corner[0]) / spacing), round((y - corner[1]) / spacing)
        if 0 <= u < wanted.shape[0] and 0 <= v < wanted.shape[1] and wanted[u, v]:
            wanted[u, v] = False
            count += 1
    return count


@kernel
def path_left(lengths: Float32Array, corner: Array, spacing: float, x: float, y: float) -> tuple[float, int, int]:
    """Length [m] of the shortest path from x, y over a node near it, infinite without one, and that node.

    ``lengths`` (n, m) [m] are those from each node, NaN without a path.
    """
    u, v = round((x - corner[0]) / spacing), round((y - corner[1]) / spacing)
    best, row, column = np.inf, -1, -1
    for i in range(max(u - 1, 0), min(u + 2, lengths.shape[0])):
        for j in range(max(v - 1, 0), min(v + 2, lengths.shape[1])):
            length = lengths[i, j] + math.hypot(corner[0] + i * spacing - x, corner[1] + j * spacing - y)
            if length < best:  # false of NaN
                best, row, column = length, i, j
    return best, row, column


@kernel
def least_along(following: NDArray[np.int32], values: Array, starts: NDArray[np.int64], least: Array) -> None:
    """Set the least of the ``values`` of nodes on the path from each start to where ``following`` is below 0."""
    for k in range(len(starts)):
        node = starts[k]
        least[k] = values[node]
        while following[node] >= 0:
            node = np.int64(following[node])
            least[k] = min(least[k], values[node])
