# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is on the vertical lines through the cells of a map: faces of meshes are dropped on them, in double precision.

The surface of a body is closed, so that a line enters and leaves it equally often. A line that passes exactly through
the edge of two faces meets one of them: each edge belongs to the face on its left if it rises in y, or runs along x.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts, Float32Array
from fieldtruth.kernels.compile import inlined, kernel

SOLID: Final = 1
"""Face of a body that stops a robot."""
FLEXIBLE: Final = 2
"""Face of a body that a robot bends."""
PASSABLE: Final = 4
"""Leaf or blade."""
PLANT: Final = 8
"""Face of a plant."""
HARD: Final = 16
"""Face that is ground where it faces up."""
FOOT: Final = 32
"""Face that is ground where it faces up, at most ``FOOT_HEIGHT`` above the soil: a root."""
FOOT_HEIGHT: Final = 0.165
"""[m], of a wheel's axle, as in ``drive.ground``."""
LOW: Final = 0.1
"""Height [m] above the bare ground from which on a solid body is an obstacle."""
REACH: Final = 2.0
"""Height [m] above the bare ground up to which volumes and obstacles count."""
LAYER: Final = 0.05
"""Height [m] of the layers in which a line has a leaf or none; ``REACH`` has at most 64."""
_GAP: Final = 1e-3
"""[m] above the ground from which on an overhang counts."""
_STEEP: Final = 0.1
"""Cosine between the vertical and the normal of a face below which it is a wall."""
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
    instance: NDArray[np.uint32]  # (n,) instance ids, or (1,) of all


class Cells(NamedTuple):
    """A tile of (n, m) cells; cell (0, 0) has its middle at ``x0``, ``y0`` [m]. Heights [m] are those in the middles.

    ``hard`` and ``top`` are the highest ground and the highest plant, with class and instance id; ``leaves`` has a bit
    for each layer with a leaf, and ``solid`` is 1 where a solid body touches the cell between LOW and REACH.
    """

    x0: float
    y0: float
    spacing: float
    ground: Array
    hard: Array
    hard_label: NDArray[np.uint8]
    hard_instance: NDArray[np.uint32]
    top: Array
    top_label: NDArray[np.uint8]
    top_instance: NDArray[np.uint32]
    leaves: NDArray[np.uint64]
    solid: NDArray[np.uint8]


class Crossings(NamedTuple):
    """Faces of bodies on the lines, in any order; ``step`` is 1 where a line that rises enters the body, else -1."""

    cell: NDArray[np.int64]
    z: Array
    step: NDArray[np.int8]
    flags: NDArray[np.uint8]
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]


class Columns(NamedTuple):
    """Lowest overhang above the hard ground, and lengths [m] of the lines in bodies and layers; (n, m) each."""

    overhang: Array
    label: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    solid: Array
    flexible: Array
    passable: Array


@inlined
def _side(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> float:
    """Twice the area of a triangle a, b, (x, y), anticlockwise positive; the opposite for b, a to the last digit."""
    if ax > bx or (ax == bx and ay > by):
        return -((ax - bx) * (y - by) - (ay - by) * (x - bx))
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax)


@inlined
def _is_in(side: float, ax: float, ay: float, bx: float, by: float) -> bool:
    return side > 0.0 or (side == 0.0 and (by > ay or (by == ay and bx > ax)))


@inlined
def _touch(cells: Cells, a: _Point, b: _Point, low: float, high: float) -> None:
    """Mark the cells that an edge, in cells, touches where it or its wall of heights ``low`` to ``high`` counts."""
    n, m = cells.ground.shape
    parts = 1 + int(2.0 * max(abs(b[0] - a[0]), abs(b[1] - a[1])))
    for k in range(parts + 1):
        share = k / parts
        i, j = int(np.rint(a[0] + share * (b[0] - a[0]))), int(np.rint(a[1] + share * (b[1] - a[1])))
        if 0 <= i < n and 0 <= j < m:
            z, soil = a[2] + share * (b[2] - a[2]), cells.ground[i, j]
            if min(z, low) <= soil + REACH and max(z, high) >= soil + LOW:
                cells.solid[i, j] = 1


@inlined
def _meet(cells: Cells, at: tuple[int, int], z: float, up: bool, flags: int, label: int, instance: int) -> None:
    """Note that the line of a cell meets a face."""
    soil = cells.ground[at]
    if up and z > cells.hard[at] and (flags & HARD or (flags & FOOT and z <= soil + FOOT_HEIGHT)):
        cells.hard[at], cells.hard_label[at], cells.hard_instance[at] = z, label, instance
    if flags & PLANT and z > soil and not z <= cells.top[at]:  # NaN: none yet
        cells.top[at], cells.top_label[at], cells.top_instance[at] = z, label, instance
    if flags & PASSABLE and soil < z < soil + REACH:
        cells.leaves[at] |= np.uint64(1) << np.uint64(int((z - soil) / LAYER))


@kernel(allocates=True)
def drop_faces(faces: Faces, copies: Copies, near: NDArray[np.intp], cells: Cells, found: Crossings, count: int) -> int:
    """Drop the faces of the copies ``near`` on the cells; append to the crossings, of which there are ``count``.

    Returns:
        The number of crossings; if it is greater than the length of ``found``, some were not written.
    """
    n, m = cells.ground.shape
    placed = np.empty((np.max(np.diff(faces.first_vertex)), 3))
    for copy in near:
        mesh, pose = copies.mesh[copy], copies.pose[copy]
        instance = copies.instance[copy if len(copies.instance) > 1 else 0]
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
            least_u, most_u = min(p[0], q[0], r[0]), max(p[0], q[0], r[0])
            least_v, most_v = min(p[1], q[1], r[1]), max(p[1], q[1], r[1])
            if most_u < -0.5 or most_v < -0.5 or least_u > n - 0.5 or least_v > m - 0.5:
                continue
            flags, label = faces.flags[face], faces.label[face]
            area = _side(p[0], p[1], q[0], q[1], r[0], r[1])
            if flags & SOLID:
                low, high = np.inf, -np.inf
                rise = max(abs(q[2] - p[2]), abs(r[2] - p[2]), abs(r[2] - q[2])) / cells.spacing
                if abs(area) <= _STEEP * rise * max(most_u - least_u, most_v - least_v):
                    low, high = min(p[2], q[2], r[2]), max(p[2], q[2], r[2])
                _touch(cells, p, q, low, high)
                _touch(cells, q, r, low, high)
                _touch(cells, r, p, low, high)
            if area == 0.0:
                continue
            up = area > 0.0
            if not up:
                q, r = r, q
            for i in range(max(0, int(np.ceil(least_u))), min(n, int(np.floor(most_u)) + 1)):
                for j in range(max(0, int(np.ceil(least_v))), min(m, int(np.floor(most_v)) + 1)):
                    e, f = _side(p[0], p[1], q[0], q[1], i, j), _side(q[0], q[1], r[0], r[1], i, j)
                    g = _side(r[0], r[1], p[0], p[1], i, j)
                    if (
                        _is_in(e, p[0], p[1], q[0], q[1])
                        and _is_in(f, q[0], q[1], r[0], r[1])
                        and _is_in(g, r[0], r[1], p[0], p[1])
                    ):
                        z = (f * p[2] + g * q[2] + e * r[2]) / (e + f + g)
                        _meet(cells, (i, j), z, up, flags, label, instance)
                        if flags & (SOLID | FLEXIBLE):
                            if count < len(found.z):
                                found.cell[count], found.z[count] = i * m + j, z
                                found.step[count], found.flags[count] = -1 if up else 1, flags
                                found.label[count], found.instance[count] = label, instance
                            count += 1
    return count


@kernel(allocates=True)
def walk_columns(cells: Cells, found: Crossings, count: int, out: Columns) -> None:
    """Go up the line of each cell through its bodies, of ``count`` crossings ``found``; fill ``out`` and ``solid``."""
    n, m = cells.ground.shape
    start, order = _by_cell(found, count, n * m)
    for i in range(n):
        for j in range(m):
            out.passable[i, j] = LAYER * _bits(cells.leaves[i, j])
            rows = order[start[i * m + j] : start[i * m + j + 1]]
            _sort(rows, found.z)
            soil, level = cells.ground[i, j], cells.hard[i, j] + _GAP
            solid, flexible, below, entered = 0, 0, -np.inf, np.int64(-1)
            for row in rows:
                z = found.z[row]
                if solid != 0 or flexible != 0:
                    length = max(0.0, min(z, soil + REACH) - max(below, soil))
                    if solid != 0:
                        out.solid[i, j] += length
                        if z >= soil + LOW and below <= soil + REACH:
                            cells.solid[i, j] = 1
                    else:
                        out.flexible[i, j] += length
                    if z > level and np.isnan(out.overhang[i, j]):
                        at = entered if below > level else row
                        out.overhang[i, j] = below if below > level else cells.hard[i, j]
                        out.label[i, j], out.instance[i, j] = found.label[at], found.instance[at]
                if found.flags[row] & SOLID:
                    solid += found.step[row]
                else:
                    flexible += found.step[row]
                below, entered = z, row


@kernel(allocates=True)
def _by_cell(found: Crossings, count: int, cells: int) -> tuple[Counts, Counts]:
    """First place of each cell (cells + 1,) in an order of the crossings, and that order (count,)."""
    start = np.zeros(cells + 1, np.int64)
    for k in range(count):
        start[found.cell[k] + 1] += 1
    for cell in range(cells):
        start[cell + 1] += start[cell]
    place, order = start.copy(), np.empty(count, np.int64)
    for k in range(count):
        order[place[found.cell[k]]] = k
        place[found.cell[k]] += 1
    return start, order


@inlined
def _sort(rows: Counts, z: Array) -> None:
    """Sort a few rows by height."""
    for k in range(1, len(rows)):
        row, at = rows[k], k
        while at > 0 and z[rows[at - 1]] > z[row]:
            rows[at] = rows[at - 1]
            at -= 1
        rows[at] = row


@inlined
def _bits(word: np.uint64) -> int:
    """Return the number of bits that are 1."""
    number = 0
    while word != np.uint64(0):
        word &= word - np.uint64(1)
        number += 1
    return number


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
                here = heights[i, j]
                _rise(heights, i, j, di, dj, ahead)
                _rise(heights, i, j, -di, -dj, behind)
                level = np.inf
                for k in range(size + 1):
                    level = min(level, max(ahead[k], behind[size - k]))
                if level > here and level - here >= drop[i, j]:
                    front, back = 1, 1
                    while ahead[front] < level:
                        front += 1
                    while behind[back] < level:
                        back += 1
                    wide = (front + back - 1) * step
                    if level - here > drop[i, j] or wide < width[i, j]:
                        drop[i, j], width[i, j] = level - here, wide


@inlined
def _rise(heights: Array, i: int, j: int, di: int, dj: int, highest: Array) -> None:
    """Fill in the greatest of the heights from a cell on, along a line that ends at the edge."""
    n, m = heights.shape
    highest[0] = heights[i, j]
    for k in range(1, len(highest)):
        i, j = i + di, j + dj
        highest[k] = highest[k - 1]
        if 0 <= i < n and 0 <= j < m:
            highest[k] = max(highest[k], heights[i, j])
