# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Solid shapes of furniture and poles, and their outlines: bevelled box, tube along a path, body of revolution, plate.

Each is a closed :class:`Mesh` of one material. Texture coordinates are in repeats: metres over ``TILE``. On boxes, u
runs along the longest side, the direction of a plank's grain. Outlines are polylines and polygons, with rounded
corners, as bars of a given thickness, and triangulated.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, make_mesh, merge_meshes


def rounded(path: ArrayLike, radius: float, *, steps: int = 5) -> Array:
    """Polyline (p, d) with every corner replaced by an arc of ``radius`` [m], or less if the sides are too short."""
    points = np.asarray(path, np.float64)
    result = [points[0]]
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        a, b = before - corner, after - corner
        to_a, to_b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        half = np.arccos(np.clip(to_a @ to_b, -1, 1)) / 2
        cut = min(radius / np.tan(half), 0.499 * float(np.linalg.norm(a)), 0.499 * float(np.linalg.norm(b)))
        middle = (to_a + to_b) / np.linalg.norm(to_a + to_b)
        centre = corner + middle * cut / np.cos(half)
        start, stop = corner + cut * to_a - centre, corner + cut * to_b - centre
        angle = np.pi - 2 * half
        for s in np.linspace(0, 1, steps + 1):
            result.append(centre + (np.sin((1 - s) * angle) * start + np.sin(s * angle) * stop) / np.sin(angle))
    return np.array([*result, points[-1]])


def bar_outline(path: ArrayLike, thickness: ArrayLike) -> Array:
    """Anticlockwise outline (2 p, 2) of a bar along an open plane path (p, 2) [m]; one thickness, or one per point."""
    points = np.asarray(path, np.float64)
    steps = np.diff(points, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    halving = before + after
    normal = np.stack([-halving[:, 1], halving[:, 0]], axis=1)
    normal /= np.linalg.norm(halving, axis=1, keepdims=True)
    cosine = np.einsum("ij,ij->i", halving, before) / np.linalg.norm(halving, axis=1)
    half = np.broadcast_to(np.asarray(thickness, np.float64), len(points)) / 2 / cosine
    offset = half[:, None] * normal
    return np.concatenate([points - offset, (points + offset)[::-1]])


def signed_area(outline: Array) -> float:
    """Area [m2] of a polygon (n, 2), positive if anticlockwise."""
    x, y = outline[:, 0], outline[:, 1]
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def triangulate(outline: Array) -> NDArray[np.int32]:
    """Triangles (n - 2, 3) of a simple anticlockwise polygon (n, 2), by ear clipping."""
    left = list(range(len(outline)))
    triangles: list[tuple[int, int, int]] = []
    while len(left) > 3:
        for k in range(len(left)):
            ear = (left[k - 1], left[k], left[(k + 1) % len(left)])
            if _is_ear(outline, ear, left):
                triangles.append(ear)
                del left[k]
                break
        else:
            raise ValueError("outline must be simple and anticlockwise")
    return np.array([*triangles, tuple(left)], np.int32)


def _is_ear(outline: Array, ear: tuple[int, int, int], left: list[int]) -> bool:
    corners = outline[list(ear)]
    if signed_area(corners) <= 0:
        return False
    others = outline[[k for k in left if k not in ear]]
    inside = np.ones(len(others), bool)
    for a, b in pairwise([*corners, corners[0]]):
        edge, to_point = b - a, others - a
        inside &= edge[0] * to_point[:, 1] - edge[1] * to_point[:, 0] >= 0
    return not inside.any()


def at_length(path: Array, lengths: ArrayLike) -> tuple[Array, Array]:
    """Points (k, 2) at given lengths (k,) [m] along a plane path (p, 2), and the path's slope there (k,) [rad]."""
    steps = np.diff(path, axis=0)
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
    wanted = np.asarray(lengths, np.float64)
    points = np.stack([np.interp(wanted, along, path[:, k]) for k in range(2)], axis=1)
    piece = np.clip(np.searchsorted(along, wanted, side="right") - 1, 0, len(steps) - 1)
    return points, np.arctan2(steps[piece, 1], steps[piece, 0])


def path_length(path: Array) -> float:
    """Length [m] of a polyline (p, d)."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


TILE: Final = 0.5
"""Size [m] of one repeat of a furniture texture, along u and v."""
CREASE_DEG: Final = 40.0
"""Angle [deg] up to which adjacent sides share normals, so that the surface looks round; above it, edges are sharp."""


def make_part(material: str, vertices: ArrayLike, normals: ArrayLike, uv: ArrayLike, faces: ArrayLike) -> Mesh:
    """Mesh of one material from (v, 3) vertices [m], (v, 3) normals of any length, (v, 2) uv [m] and (f, 3) faces."""
    facing = np.asarray(normals, np.float64)
    facing = facing / np.linalg.norm(facing, axis=1, keepdims=True)
    return make_mesh("part", vertices, facing, np.asarray(uv, np.float64) / TILE, faces, (material,), footprint=0.0)


def placed(part: Mesh, object_from_part: Array, *, uv_shift: tuple[float, float] = (0.0, 0.0)) -> Mesh:
    """The part moved by a rigid (4, 4) transform; ``uv_shift`` [repeats] makes equal planks look different."""
    rotation, translation = object_from_part[:3, :3], object_from_part[:3, 3]
    return replace(
        part,
        vertices=(part.vertices @ rotation.T + translation).astype(np.float32),
        normals=(part.normals @ rotation.T).astype(np.float32),
        uv=(part.uv + np.array(uv_shift)).astype(np.float32),
    )


def make_box(material: str, size: Sequence[float], *, bevel: float = 0.004) -> Mesh:
    """Box about the origin with edges bevelled at 45 degrees; ``size`` (3,) and ``bevel`` [m], 44 triangles.

    Each side has its flat normal at its four corners, so the bevels are shaded like rounded edges.
    """
    half = np.asarray(size, np.float64) / 2
    if not 0 < bevel < half.min():
        raise ValueError(f"bevel must be between 0 and half the smallest side, {half.min()} m, got {bevel}")
    long_first = np.argsort(-half, kind="stable")
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    vertices, normals, uv = np.zeros((24, 3)), np.zeros((24, 3)), np.zeros((24, 2))
    for axis in range(3):
        rows = slice(8 * axis, 8 * axis + 8)
        inset = np.where(np.arange(3) == axis, half, half - bevel)
        vertices[rows] = signs * inset
        normals[rows, axis] = signs[:, axis]
        u_axis, v_axis = (a for a in long_first if a != axis)
        # Each side shows another part of the texture, like the sawn faces of one beam.
        shift = signs[:, axis] * (0.11 + half[axis])
        uv[rows] = np.stack([vertices[rows, u_axis], vertices[rows, v_axis] + shift], axis=1)
    return make_part(material, vertices, normals, uv, _outward(vertices, _box_faces(signs)))


def _box_faces(signs: NDArray[np.int_]) -> NDArray[np.int_]:
    """Six sides, twelve edges and eight corners of 3 x 8 vertices: row 8 * axis + corner."""
    quads: list[tuple[int, int, int, int]] = []
    for axis in range(3):
        first, second = (a for a in range(3) if a != axis)
        for side in (-1, 1):
            ring = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
            corners = [
                int(np.flatnonzero((signs[:, axis] == side) & (signs[:, first] == a) & (signs[:, second] == b))[0])
                for a, b in ring
            ]
            quads.append((8 * axis + corners[0], 8 * axis + corners[1], 8 * axis + corners[2], 8 * axis + corners[3]))
        for a in (-1, 1):
            for b in (-1, 1):
                low, high = (
                    int(np.flatnonzero((signs[:, axis] == e) & (signs[:, first] == a) & (signs[:, second] == b))[0])
                    for e in (-1, 1)
                )
                quads.append((8 * first + low, 8 * first + high, 8 * second + high, 8 * second + low))
    triangles = [t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))]
    triangles += [(c, 8 + c, 16 + c) for c in range(8)]
    return np.array(triangles)


def _outward(vertices: Array, faces: NDArray[np.int_]) -> NDArray[np.int_]:
    """Faces of a convex body about the origin, turned so that their normals point away from it."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) < 0
    return np.where(inward[:, None], faces[:, ::-1], faces)


def make_tube(material: str, path: ArrayLike, radius: ArrayLike, *, sides: int = 10) -> Mesh:
    """Round bar along ``path`` (p, 3) [m] with flat ends; ``radius`` [m] is one number, or one per point.

    Bends are mitred, so that the bar keeps its cross-section.
    """
    points = np.asarray(path, np.float64)
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(points))
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    directions = steps / lengths[:, None]
    angles = 2 * np.pi * np.arange(sides + 1) / sides
    offsets = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ _perpendicular(directions[0])
    rings, normals = np.zeros((len(points), sides + 1, 3)), np.zeros((len(points), sides + 1, 3))
    for i, point in enumerate(points):
        before, after = directions[max(i - 1, 0)], directions[min(i, len(directions) - 1)]
        bisector = before + after
        mitred = offsets - np.outer(offsets @ bisector / (before @ bisector), before)
        turned = mitred - np.outer(mitred @ after, after)
        rings[i], normals[i] = point + radii[i] * mitred, offsets + turned
        offsets = turned
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    uv = np.stack(np.broadcast_arrays(along[:, None], radii.mean() * angles[None, :]), axis=2)
    faces = _grid_faces(len(points), sides + 1)
    side = make_part(material, rings.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces)
    ends = [_cap(material, rings[0, :-1], -directions[0]), _cap(material, rings[-1, :-1], directions[-1])]
    return merge_meshes("part", [side, *ends], footprint=0.0)


def make_lathe(material: str, profile: ArrayLike, *, sides: int = 24, faceted: bool = False) -> Mesh:
    """Body of revolution about z. ``profile`` (p, 2): radius and height [m], outside to the right of its direction.

    A profile that starts and ends on the axis, or ends at its start, gives a closed body. ``faceted`` gives flat
    ``sides``, as for a lantern with four panes.
    """
    points = np.asarray(profile, np.float64)
    steps = np.diff(points, axis=0)
    outward, along = _sides(steps)
    bands = []
    for k in range(len(steps)):
        ends = [_blend(outward, k, k - 1), _blend(outward, k, k + 1)]
        bands.append(_band(material, points[k : k + 2], np.array(ends), along[k : k + 2], sides, faceted))
    return merge_meshes("part", bands, footprint=0.0)


def _sides(steps: Array) -> tuple[Array, Array]:
    """Unit normals (n, 2) to the right of the steps (n, 2) [m] of a path, and the length [m] up to each point."""
    lengths = np.linalg.norm(steps, axis=1)
    outward = np.stack([steps[:, 1], -steps[:, 0]], axis=1) / lengths[:, None]
    return outward, np.concatenate([[0.0], np.cumsum(lengths)])


def _blend(outward: Array, k: int, neighbour: int) -> Array:
    """Normal of profile segment k at the end next to a neighbour: shared unless the edge is a crease."""
    if not 0 <= neighbour < len(outward) or outward[k] @ outward[neighbour] < np.cos(np.radians(CREASE_DEG)):
        return np.asarray(outward[k])
    return np.asarray(outward[k] + outward[neighbour])


def _band(material: str, ends: Array, outward: Array, along: Array, sides: int, faceted: bool) -> Mesh:
    """Frustum between two profile points; each facet has its own vertices and normal."""
    turn = 2 * np.pi * np.arange(sides + 1) / sides
    start, stop = np.arange(sides), np.arange(1, sides + 1)
    columns = np.stack([start, stop], axis=1).ravel() if faceted else np.arange(sides + 1)
    facing = np.repeat((turn[start] + turn[stop]) / 2, 2) if faceted else turn
    angles = turn[columns]
    vertices = np.array([(r * np.cos(angles), r * np.sin(angles), np.full_like(angles, z)) for r, z in ends])
    # The flat sides of a prism are less inclined than its profile: their middles are nearer to the axis.
    lean = np.cos(np.pi / sides) if faceted else 1.0
    normals = np.array([(r * np.cos(facing), r * np.sin(facing), np.full_like(facing, z * lean)) for r, z in outward])
    vertices, normals = vertices.transpose(0, 2, 1).reshape(-1, 3), normals.transpose(0, 2, 1).reshape(-1, 3)
    level = abs(outward[:, 1].mean()) > abs(outward[:, 0].mean())
    uv = (
        vertices[:, :2]
        if level
        else np.stack([np.tile(ends[:, 0].max() * angles, 2), np.repeat(along, len(angles))], 1)
    )
    faces = _grid_faces(2, len(columns))
    if faceted:
        faces = faces[(np.arange(len(faces)) // 2) % 2 == 0]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    solid = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12
    used, renumbered = np.unique(faces[solid], return_inverse=True)
    return make_part(material, vertices[used], normals[used], uv[used], renumbered.reshape(-1, 3))


def make_extrusion(material: str, outline: ArrayLike, width: float) -> Mesh:
    """Plate from -width/2 to width/2 in y with an outline (n, 2) of x and z [m], anticlockwise seen from -y."""
    points = np.asarray(outline, np.float64)
    count = len(points)
    steps = np.roll(points, -1, axis=0) - points
    outward, along = _sides(steps)
    vertices, normals, uv = np.zeros((count, 4, 3)), np.zeros((count, 4, 3)), np.zeros((count, 4, 2))
    sharp = np.cos(np.radians(CREASE_DEG))
    for k in range(count):
        for end, neighbour in ((0, k - 1), (1, (k + 1) % count)):
            point = points[(k + end) % count]
            normal = outward[k] if outward[k] @ outward[neighbour] < sharp else outward[k] + outward[neighbour]
            for row, y in ((2 * end, -width / 2), (2 * end + 1, width / 2)):
                vertices[k, row], normals[k, row] = (point[0], y, point[1]), (normal[0], 0, normal[1])
                uv[k, row] = along[k + end], y
    quad = np.array([(0, 3, 2), (0, 1, 3)])
    faces = (4 * np.arange(count)[:, None, None] + quad).reshape(-1, 3)
    side = make_part(material, vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces)
    ears = triangulate(points)
    flat = np.insert(points, 1, -width / 2, axis=1)
    near = make_part(material, flat, np.tile((0.0, -1.0, 0.0), (count, 1)), points, ears)
    far = make_part(material, flat * (1, -1, 1), np.tile((0.0, 1.0, 0.0), (count, 1)), points, ears[:, ::-1])
    return merge_meshes("part", [side, near, far], footprint=0.0)


def _perpendicular(direction: Array) -> Array:
    """Two unit vectors (2, 3) that form a right-handed frame with ``direction`` as the third."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    first = np.cross(helper, direction)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(direction, first)])


def _grid_faces(rows: int, columns: int) -> NDArray[np.int_]:
    """Two triangles per cell of a grid of vertices that are numbered row by row."""
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    cell = np.array([(0, 1, columns), (1, columns + 1, columns)])
    return np.asarray((corner[:, None, None] + cell).reshape(-1, 3))


def _cap(material: str, ring: Array, normal: Array) -> Mesh:
    """Flat fan over a ring (n, 3)."""
    count = len(ring)
    fan = np.stack([np.zeros(count - 2, int), np.arange(1, count - 1), np.arange(2, count)], axis=1)
    facing = np.cross(ring[1] - ring[0], ring[2] - ring[0]) @ normal
    axes = _perpendicular(normal)
    return make_part(material, ring, np.tile(normal, (count, 1)), ring @ axes.T, fan if facing > 0 else fan[:, ::-1])
