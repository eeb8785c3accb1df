# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is on the vertical lines through the cells of a map: faces of meshes are dropped on them, in double precision.

The surface of a body is closed, so that a line enters and leaves it equally often. A line that passes exactly through
the edge of two faces meets one of them: each edge belongs to the face on its left if it rises in y, or runs along x.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.kernels.compile import inlined, kernel

SOLID, FLEXIBLE, PASSABLE, PLANT, HARD, FOOT, CAP = (1 << k for k in range(7))
"""Flags of faces: of a solid or flexible body, leaf; of a plant; ground that faces up, at any height or as a root; not
in the world, but added to close a body."""
FOOT_HEIGHT: Final = 0.165  # [m] up to which roots are ground: a wheel's axle, as in ``drive.ground``
LOW: Final = 0.1  # [m] above the bare ground, from which on a solid body is an obstacle
REACH: Final = 2.0  # [m] above the bare ground, up to which volumes and obstacles count
LAYER: Final = 0.05  # [m], of the layers in which a line has a leaf or none; ``REACH`` has at most 64
_GAP: Final = 1e-3  # [m] above the hard ground from which on an overhang counts
_STEEP: Final = 0.1  # of a wall: cosine between the vertical and its normal, about
_Point = tuple[float, float, float]


class Faces(NamedTuple):
    """Faces of all meshes of a world, one mesh after the other."""

    vertices: Float32Array  # (v, 3) [m] in the object's frame
    corners: NDArray[np.int64]  # (f, 3) rows of ``vertices``
    label: NDArray[np.uint8]  # (f,) class ids
    flags: NDArray[np.uint8]  # (f,)
    first_vertex: NDArray[np.int64]  # (meshes + 1,)
    first_face: NDArray[np.int64]  # (meshes + 1,)


class Copies(NamedTuple):
    """Objects, or the members of a swarm."""

    pose: Array  # (n, 4, 4)
    mesh: NDArray[np.int64]  # (n,)
    instance: NDArray[np.uint32]  # (n,) instance ids


class Surface(NamedTuple):
    """Heights (n, m) [m], NaN where nothing is, with class and instance ids."""

    z: Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]


class Cells(NamedTuple):
    """A tile of (n, m) cells, of which cell (0, 0) has its middle at ``x0``, ``y0`` [m]."""

    x0: float
    y0: float
    spacing: float
    ground: Array  # [m], the bare ground
    hard: Surface  # the highest that is ground
    top: Surface  # the highest of plants
    overhang: Surface  # the lowest of bodies above the hard ground
    solid: Array  # [m] of the line in solid bodies
    flexible: Array  # [m] in flexible ones and no solid one
    passable: Array  # [m], layers with leaves
    leaves: NDArray[np.uint64]  # a bit for each layer
    obstacle: NDArray[np.uint8]  # 1 where a solid body touches the cell between LOW and REACH


class Crossings(NamedTuple):
    """Faces of bodies on the lines; ``step`` is 1 where a line that rises enters the body, else -1."""

    cell: NDArray[np.int64]
    z: Array
    step: NDArray[np.int8]
    face: NDArray[np.int64]
    instance: NDArray[np.uint32]


@inlined
def _side(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Twice the area of a triangle a, b, (x, y), anticlockwise positive; the opposite for b, a to the last digit."""
    if ax > bx or (ax == bx and ay > by):
        return -((ax - bx) * (y - by) - (ay - by) * (x - bx))
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@inlined
def _is_in(side: float, a: _Point, b: _Point) -> bool:
    return side > 0.0 or (side == 0.0 and (b[1] > a[1] or (b[1] == a[1] and b[0] > a[0])))


@inlined
def _put(surface: Surface, at: tuple[int, int], z: float, label: int, instance: int) -> None:
    surface.z[at], surface.label[at], surface.instance[at] = z, label, instance


@inlined
def _touch(cells: Cells, a: _Point, b: _Point, low: float, high: float) -> None:
    """Mark the cells in which an edge, in cells, or its wall of heights ``low`` to ``high`` is an obstacle."""
    n, m = cells.ground.shape
    parts = 1 + int(2.0 * max(abs(b[0] - a[0]), abs(b[1] - a[1])))
    for k in range(parts + 1):
        share = k / parts
        i, j = int(np.rint(a[0] + share * (b[0] - a[0]))), int(np.rint(a[1] + share * (b[1] - a[1])))
        if 0 <= i < n and 0 <= j < m:
            z, soil = a[2] + share * (b[2] - a[2]), cells.ground[i, j]
            if min(z, low) <= soil + REACH and max(z, high) >= soil + LOW:
                cells.obstacle[i, j] = 1


@inlined
def _meet(cells: Cells, at: tuple[int, int], z: float, up: bool, flags: int, label: int, instance: int) -> None:
    """Note that the line of a cell meets a face."""
    soil = cells.ground[at]
    if up and z > cells.hard.z[at] and (flags & HARD or (flags & FOOT and z <= soil + FOOT_HEIGHT)):
        _put(cells.hard, at, z, label, instance)
    if flags & PLANT and z > soil and not z <= cells.top.z[at]:  # NaN: none yet
        _put(cells.top, at, z, label, instance)
    if flags & PASSABLE and soil < z < soil + REACH:
        bit = np.uint64(1) << np.uint64(int((z - soil) / LAYER))
        if cells.leaves[at] & bit == np.uint64(0):
            cells.leaves[at] |= bit
            cells.passable[at] += LAYER


@kernel(allocates=True)
def drop_faces(faces: Faces, copies: Copies, near: Index, cells: Cells, found: Crossings, count: int) -> int:
    """Drop the faces of the copies ``near`` on the cells; append to the crossings, of which there are ``count``.

    Returns:
        The number of crossings; if it is greater than the length of ``found``, some were not written.
    """
    n, m = cells.ground.shape
    placed = np.empty((np.max(np.diff(faces.first_vertex)), 3))
    for copy in near:
        mesh, pose, instance = copies.mesh[copy], copies.pose[copy], copies.instance[copy]
        start = faces.first_vertex[mesh]
        for k in range(faces.first_vertex[mesh + 1] - start):
            x, y, z = faces.vertices[start + k, 0], faces.vertices[start + k, 1], faces.vertices[start + k, 2]
            for axis in range(3):
                placed[k, axis] = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z + pose[axis, 3]
            placed[k, 0] = (placed[k, 0] - cells.x0) / cells.spacing
            placed[k, 1] = (placed[k, 1] - cells.y0) / cells.spacing
        for face in range(faces.first_face[mesh], faces.first_face[mesh + 1]):
            a, b, c = faces.corners[face, 0] - start, faces.corners[face, 1] - start, faces.corners[face, 2] - start
            p = placed[a, 0], placed[a, 1], placed[a, 2]
            q = placed[b, 0], placed[b, 1], placed[b, 2]
            r = placed[c, 0], placed[c, 1], placed[c, 2]
            u0, u1 = min(p[0], q[0], r[0]), max(p[0], q[0], r[0])
            v0, v1 = min(p[1], q[1], r[1]), max(p[1], q[1], r[1])
            if u1 < -0.5 or v1 < -0.5 or u0 > n - 0.5 or v0 > m - 0.5:
                continue
            flags, label = faces.flags[face], faces.label[face]
            area = _side(p[0], p[1], q[0], q[1], r[0], r[1])
            if flags & SOLID:
                low, high = min(p[2], q[2], r[2]), max(p[2], q[2], r[2])
                if abs(area) * cells.spacing > _STEEP * (high - low) * max(u1 - u0, v1 - v0):
                    low, high = np.inf, -np.inf
                for one, other in ((p, q), (q, r), (r, p)):
                    _touch(cells, one, other, low, high)
            if area == 0.0:
                continue
            if area < 0.0:
                q, r = r, q
            for i in range(max(0, int(np.ceil(u0))), min(n, int(np.floor(u1)) + 1)):
                for j in range(max(0, int(np.ceil(v0))), min(m, int(np.floor(v1)) + 1)):
                    e, f = _side(p[0], p[1], q[0], q[1], i, j), _side(q[0], q[1], r[0], r[1], i, j)
                    g = _side(r[0], r[1], p[0], p[1], i, j)
                    if _is_in(e, p, q) and _is_in(f, q, r) and _is_in(g, r, p):
                        z = (f * p[2] + g * q[2] + e * r[2]) / (e + f + g)
                        _meet(cells, (i, j), z, area > 0.0, flags, label, instance)
                        if flags & (SOLID | FLEXIBLE):
                            if count < len(found.z):
                                found.cell[count], found.z[count], found.face[count] = i * m + j, z, face
                                found.step[count], found.instance[count] = -1 if area > 0.0 else 1, instance
                            count += 1
    return count


@kernel
def walk_columns(faces: Faces, cells: Cells, found: Crossings, order: Index) -> None:
    """Go up the lines through the bodies; ``order`` sorts the crossings by cell, and then by height."""
    last, below, solid, flexible = np.int64(-1), -np.inf, 0, 0
    for row in order:
        z, at = found.z[row], (found.cell[row] // cells.ground.shape[1], found.cell[row] % cells.ground.shape[1])
        flags, label, instance = faces.flags[found.face[row]], faces.label[found.face[row]], found.instance[row]
        soil, level = cells.ground[at], cells.hard.z[at] + _GAP
        if found.cell[row] != last:
            last, below, solid, flexible = found.cell[row], -np.inf, 0, 0
        inside = solid != 0 or flexible != 0
        length = max(0.0, min(z, soil + REACH) - max(below, soil))
        if solid != 0:
            cells.solid[at] += length
            if z >= soil + LOW and below <= soil + REACH:
                cells.obstacle[at] = 1
        elif inside:
            cells.flexible[at] += length
        if z > level and np.isnan(cells.overhang.z[at]):
            if inside and below <= level:  # it begins at the ground
                _put(cells.overhang, at, cells.hard.z[at], label, instance)
            elif flags & CAP == 0:
                _put(cells.overhang, at, z, label, instance)
        if flags & SOLID:
            solid += found.step[row]
        else:
            flexible += found.step[row]
        below = z


@kernel(allocates=True)
def find_drops(heights: Array, spacing: float, longest: float, drop: Array, width: Array) -> None:
    """Fill drop [m] and width [m] (n, m) of the gaps in ``heights``, along rows, columns and both diagonals.

    Along a line, the closing of the heights by a segment of ``longest`` [m] is the least of the greatest heights of all
    such segments that hold a cell: it fills what is narrower. The drop is the greatest of closing minus height over the
    four lines, the width that of the cells around that are below the closing, on the line where this is least.
    """
    n, m = heights.shape
    for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
        step = spacing * np.sqrt(np.float64(di * di + dj * dj))
        size = int(longest / step + 1e-6)
        ahead, behind = np.empty(size + 1), np.empty(size + 1)
        for i in range(n):
            for j in range(m):
                _rise(heights, i, j, di, dj, ahead)
                _rise(heights, i, j, -di, -dj, behind)
                level = np.inf
                for k in range(size + 1):
                    level = min(level, max(ahead[k], behind[size - k]))
                deep = level - heights[i, j]
                if deep > 0.0 and deep >= drop[i, j]:
                    front, back = 1, 1
                    while ahead[front] < level:
                        front += 1
                    while behind[back] < level:
                        back += 1
                    wide = (front + back - 1) * step
                    if deep > drop[i, j] or wide < width[i, j]:
                        drop[i, j], width[i, j] = deep, wide


@inlined
def _rise(heights: Array, i: int, j: int, di: int, dj: int, highest: Array) -> None:
    """Fill in the greatest of the heights from a cell on, along a line that ends at the edge."""
    highest[0] = heights[i, j]
    for k in range(1, len(highest)):
        i, j = i + di, j + dj
        highest[k] = highest[k - 1]
        if 0 <= i < heights.shape[0] and 0 <= j < heights.shape[1]:
            highest[k] = max(highest[k], heights[i, j])
