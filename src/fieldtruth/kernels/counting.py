# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Counting of labels: runs of equal pixels, and the voxels that meshes and the ground touch."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts, Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.packets import Grid, read_grid


@kernel
def count_runs(colours: NDArray[np.uint8], codes: Counts, counts: Counts) -> None:
    """Add pixels (n, 3) to the counts of their classes. A colour is looked up only where it changes, which is rare."""
    last, row, run = -1, 0, 0
    for k in range(colours.shape[0]):
        code = colours[k, 0] + 256 * np.int64(colours[k, 1]) + 65536 * np.int64(colours[k, 2])
        if code != last:
            counts[row] += run
            last, row, run = code, 0, 0
            for candidate in range(1, codes.shape[0]):
                if codes[candidate] == code:
                    row = candidate
        run += 1
    counts[row] += run


_GROUND, _TRAIL = int(Label.GROUND), int(Label.TRAIL)
_Triangle = tuple[float, float, float, float, float, float, float, float, float]


class VoxelMeshes(NamedTuple):
    """All meshes of a world, one after the other, and their copies."""

    vertices: Float32Array  # (v, 3) [m] in the object's frame
    faces: NDArray[np.int64]  # (f, 3)
    bits: NDArray[np.uint32]  # (f,) 1, shifted by the class id
    ends: NDArray[np.int64]  # (meshes + 1,) first face of each
    mesh: NDArray[np.int64]  # (copies,)
    pose: Array  # (copies, 4, 4)
    low: Array  # (copies, 3) [m] of a box around each, in the world frame
    high: Array


@inlined
def _separates(ax: float, ay: float, az: float, t: _Triangle, half: float) -> bool:
    """Return whether a plane across an axis has the triangle on one side and the cube about the origin on the other."""
    p = ax * t[0] + ay * t[1] + az * t[2]
    q = ax * t[3] + ay * t[4] + az * t[5]
    r = ax * t[6] + ay * t[7] + az * t[8]
    reach = half * (abs(ax) + abs(ay) + abs(az))
    return min(p, q, r) > reach or max(p, q, r) < -reach


@inlined
def _overlaps(t: _Triangle, x: float, y: float, z: float, half: float) -> bool:
    """Return whether a triangle meets the cube about a point, inside whose neighbours' range its own box is."""
    t = (t[0] - x, t[1] - y, t[2] - z, t[3] - x, t[4] - y, t[5] - z, t[6] - x, t[7] - y, t[8] - z)
    ax, ay, az = t[3] - t[0], t[4] - t[1], t[5] - t[2]
    bx, by, bz = t[6] - t[3], t[7] - t[4], t[8] - t[5]
    if _separates(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx, t, half):
        return False
    cx, cy, cz = t[0] - t[6], t[1] - t[7], t[2] - t[8]
    if _separates(0.0, -az, ay, t, half) or _separates(az, 0.0, -ax, t, half) or _separates(-ay, ax, 0.0, t, half):
        return False
    if _separates(0.0, -bz, by, t, half) or _separates(bz, 0.0, -bx, t, half) or _separates(-by, bx, 0.0, t, half):
        return False
    return not (
        _separates(0.0, -cz, cy, t, half) or _separates(cz, 0.0, -cx, t, half) or _separates(-cy, cx, 0.0, t, half)
    )


@inlined
def _range(a: float, b: float, c: float, count: int) -> tuple[int, int]:
    """First cell that three numbers [cells] span, and the one after the last, inside the grid."""
    return max(int(np.floor(min(a, b, c))), 0), min(int(np.floor(max(a, b, c))) + 1, count)


@inlined
def _mark(t: _Triangle, bit: np.uint32, grid: NDArray[np.uint32]) -> None:
    """Mark the cells that a triangle [cells] passes through."""
    nx, ny, nz = grid.shape
    x0, x1 = _range(t[0], t[3], t[6], nx)
    y0, y1 = _range(t[1], t[4], t[7], ny)
    z0, z1 = _range(t[2], t[5], t[8], nz)
    single = (x1 - x0) * (y1 - y0) * (z1 - z0) == 1
    for i in range(x0, x1):
        for j in range(y0, y1):
            for k in range(z0, z1):
                if (grid[i, j, k] & bit) != bit and (single or _overlaps(t, i + 0.5, j + 0.5, k + 0.5, 0.5)):
                    grid[i, j, k] |= bit


@kernel(allocates=True)
def mark_meshes(
    meshes: VoxelMeshes, copies: NDArray[np.int64], start: Array, voxel_m: float, grid: NDArray[np.uint32]
) -> None:
    """Mark the voxels that faces of some copies of meshes touch, with the bits of their classes."""
    corner, scale = np.empty((3, 3)), 1.0 / voxel_m
    for copy in copies:
        pose, mesh = meshes.pose[copy], meshes.mesh[copy]
        for face in range(meshes.ends[mesh], meshes.ends[mesh + 1]):
            for n in range(3):
                v = meshes.faces[face, n]
                x, y, z = meshes.vertices[v, 0], meshes.vertices[v, 1], meshes.vertices[v, 2]
                for axis in range(3):
                    world = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z + pose[axis, 3]
                    corner[n, axis] = (world - start[axis]) * scale
            t = (
                corner[0, 0], corner[0, 1], corner[0, 2], corner[1, 0], corner[1, 1], corner[1, 2],
                corner[2, 0], corner[2, 1], corner[2, 2],
            )  # fmt: skip
            _mark(t, meshes.bits[face], grid)


@kernel
def mark_ground(nodes: Float32Array, trail: Grid, start: Array, voxel_m: float, grid: NDArray[np.uint32]) -> None:
    """Mark the ground; then replace its bit by the classes that it has in the column."""
    rows, columns, _ = nodes.shape
    nx, ny, nz = grid.shape
    x0, y0, z0 = start[0], start[1], start[2]
    first_x, first_y = np.float64(nodes[0, 0, 0]), np.float64(nodes[0, 0, 1])
    step, scale = np.float64(nodes[1, 0, 0]) - first_x, 1.0 / voxel_m
    i0, i1 = int((x0 - first_x) / step) - 1, int((x0 + nx * voxel_m - first_x) / step) + 2
    j0, j1 = int((y0 - first_y) / step) - 1, int((y0 + ny * voxel_m - first_y) / step) + 2
    bit = np.uint32(1 << _GROUND)
    for i in range(max(i0, 0), min(i1, rows - 1)):
        for j in range(max(j0, 0), min(j1, columns - 1)):
            ax, ay, az = (nodes[i, j, 0] - x0) * scale, (nodes[i, j, 1] - y0) * scale, (nodes[i, j, 2] - z0) * scale
            p, q = nodes[i + 1, j], nodes[i, j + 1]
            bx, by, bz = (p[0] - x0) * scale, (p[1] - y0) * scale, (p[2] - z0) * scale
            cx, cy, cz = (q[0] - x0) * scale, (q[1] - y0) * scale, (q[2] - z0) * scale
            r = nodes[i + 1, j + 1]
            dx, dy, dz = (r[0] - x0) * scale, (r[1] - y0) * scale, (r[2] - z0) * scale
            _mark((ax, ay, az, bx, by, bz, dx, dy, dz), bit, grid)
            _mark((ax, ay, az, cx, cy, cz, dx, dy, dz), bit, grid)
    for i in range(nx):
        for j in range(ny):
            low, high = np.inf, -np.inf
            for a in range(3):
                for b in range(3):
                    distance = read_grid(trail, x0 + (i + 0.5 * a) * voxel_m, y0 + (j + 0.5 * b) * voxel_m)
                    low, high = min(low, distance), max(high, distance)
            bits = (np.uint32(1 << _TRAIL) if low < 0.0 else np.uint32(0)) | (bit if high >= 0.0 else np.uint32(0))
            for k in range(nz):
                if grid[i, j, k] != 0:
                    grid[i, j, k] = bits
