# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The backdrop: rings of ground around the terrain, down to the horizon, and the swarms on it.

Height and outward slope are continuous at the world's edge; within a dozen metres they blend into the land of the
environment beyond. Class ground, no colliders; the robot never gets there.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter1d

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.classes import Label
from fieldtruth.world.grids import distance_beyond
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Mesh, make_mesh
from fieldtruth.world.placement import (
    Density,
    FarSwarm,
    SwarmSpec,
    jittered_grid,
    make_swarm,
    random_scales,
    tilted,
    upright_poses,
)

Land = Callable[[Array, Array], Array]
"""Height [m] of the land beyond the edge at world x, y [m], arrays of one shape."""
Cover = Callable[[Array, Array, Array], Index]
"""Index of the material of triangles (n,) at x, y [m] with a slope [rad]."""
RINGS: Final = (
    0.0, 0.4, 0.8, 1.3, 1.9, 2.6, 3.4, 4.3, 5.3, 6.5, 7.9, 9.5, 11.3, 13.4, 15.9, 18.7, 22.0, 25.8, 30.2, 35.2, 41.0,
    47.7, 55.4, 64.3, 74.5, 86.2, 100.0,
)  # fmt: skip
"""Distances [m] of the inner rings of vertices from the edge. The first has all nodes of the edge."""
FAR_RINGS: Final = tuple(100.0 * 9.5 ** (k / 56) for k in range(1, 57))
"""Distances [m] of the outer rings."""
NEAR_STEP: Final = 0.2
"""Distance [m] along the edge between the nodes that the inner rings after the first continue."""
COARSER: Final = 4
"""The outer rings continue each of this number of those nodes."""
HEIGHT_FADES: Final = 14.0
"""Distance [m] within which the edge's smoothed height blends into the land beyond."""
DETAIL_FADES: Final = 1.6
"""The same for the detail that smoothing removed; further out it would form ribs that all point outwards."""
SLOPE_FADES: Final = 2.5
"""The same for the edge's outward slope."""
BEND: Final = 0.3
"""Largest shift, about, of the textures of distant land, in repeats."""
FINE_REPEAT: Final = 10.0
"""Length [m] of a repeat up to which the textures of land are not shifted."""
SMOOTHING: Final = 3.0
"""Standard deviation [m] of the Gaussian along the edge."""


def make_backdrop(
    field: Heightfield,
    size: tuple[float, float],
    material: str | Sequence[str],
    rng: np.random.Generator,
    *,
    land: Land | None = None,
    cover: Cover | None = None,
) -> Mesh:
    """Rings of land around a heightfield that share the positions of its edge nodes.

    Without ``land`` there are low hills towards the horizon. ``cover`` selects one of several materials per triangle.
    The first vertices are the terrain's edge nodes, those of the other rings follow from the edge outwards, and then
    copies of vertices for further materials.
    """
    x0, y0, h0 = _edge(field)
    land = land if land is not None else rolling_hills(size, rng)
    far = np.hypot(x0, y0)
    height, slope = h0 - land(x0, y0), _slope_outwards(field, land, x0, y0, far)
    broad = gaussian_filter1d(height, SMOOTHING / field.spacing, mode="wrap")
    parts, counts = [], []
    for rings, step in _levels(field):
        distance, rows = np.array(rings)[:, None], slice(None, None, step)
        x, y = x0[rows] * (1 + distance / far[rows]), y0[rows] * (1 + distance / far[rows])
        join = broad[rows] * np.exp(-((distance / HEIGHT_FADES) ** 2))
        join = join + (height - broad)[rows] * np.exp(-((distance / DETAIL_FADES) ** 2))
        join = join + slope[rows] * distance * np.exp(-((distance / SLOPE_FADES) ** 2))
        parts.append(np.stack([x, y, land(x, y) + join], axis=-1).reshape(-1, 3))
        counts.append(x.shape)
    vertices, faces = np.concatenate(parts), _net(counts)
    normals = _vertex_normals(vertices, faces)
    names = (material,) if isinstance(material, str) else tuple(material)
    choice = np.zeros(len(faces), np.intp)
    if cover is not None:
        middle = vertices[faces].mean(axis=1)
        steepness = np.arccos(normals[faces].mean(axis=1)[:, 2].clip(-1, 1))
        choice = cover(middle[:, 0], middle[:, 1], steepness)
    return _with_materials(vertices, normals, faces, choice, names)


def rolling_hills(size: tuple[float, float], rng: np.random.Generator, *, height: float = 9.0) -> Land:
    """Land that rises gradually from a world's edge to hills of about ``height`` [m] at the horizon."""
    waves = [(k, rng.normal() / k**0.7, rng.normal() / k**0.7) for k in range(2, 18)]

    def land(x: Array, y: Array) -> Array:
        relative = np.maximum(np.maximum(np.abs(x) / size[0], np.abs(y) / size[1]) * 2, 1e-9)
        distance = np.hypot(x, y) * np.maximum(1 - 1 / relative, 0)
        angle = np.arctan2(y / size[1], x / size[0])
        hills = sum(c * np.cos(k * angle) + s * np.sin(k * angle) for k, c, s in waves)
        return np.asarray(0.01 * distance + np.maximum(hills + 1.2, 0.0) * height * (distance / FAR_RINGS[-1]) ** 0.8)

    return land


def canopy(
    size: tuple[float, float], rng: np.random.Generator, *, behind: float, roof: float = 13.0, hills: float = 16.0
) -> Land:
    """Level ground below trees up to ``behind`` [m] from the edge, then a step of about a metre more than ``roof`` [m]
    up to the canopy of a closed forest, over hills that rise to ``hills`` [m] at the horizon.
    """
    ground = rolling_hills(size, rng, height=hills)
    waves = [
        (*rng.normal(0.0, 0.5 / length, 2), rng.uniform(0, 6.3), 0.16 * length**0.7)
        for length in rng.uniform(2.0, 14.0, 24)
    ]

    def land(x: Array, y: Array) -> Array:
        outside = distance_beyond(size, x, y)
        bumps = sum(height * np.cos(6.3 * (kx * x + ky * y) + phase) for kx, ky, phase, height in waves)
        crowns = roof + 0.25 * np.minimum(outside - behind, 40.0) + bumps
        return np.asarray(ground(x, y) + np.where(outside > behind + 1.0, crowns, 0.0))

    return land


def height_beyond(field: Heightfield, size: tuple[float, float], backdrop: Mesh) -> Land:
    """Height [m] of a backdrop's ground as a function of x, y up to 100 m outside the world's edge."""
    count = len(_edge(field)[0])
    distance = np.array(RINGS)
    step = _levels(field)[1][1]
    rows = np.arange(0, count, step)
    z = backdrop.vertices[: count + (len(RINGS) - 1) * len(rows), 2].astype(np.float64)
    rings = z[count:].reshape(len(RINGS) - 1, len(rows))
    along = np.arange(count)
    heights = np.stack([z[:count], *(np.interp(along, rows, ring, period=count) for ring in rings)])
    nx, ny = field.heights.shape
    half = np.array(size) / 2

    def height(x: Array, y: Array) -> Array:
        relative = np.maximum(np.abs(x) / half[0], np.abs(y) / half[1])
        u, v = (x / relative - field.x0) / field.spacing, (y / relative - field.y0) / field.spacing
        sides = np.stack([np.abs(v), np.abs(u - (nx - 1)), np.abs(v - (ny - 1)), np.abs(u)])
        along = np.choose(
            np.argmin(sides, axis=0), [u, nx - 1 + v, nx - 1 + ny - 1 + (nx - 1 - u), 2 * nx + ny - 3 + (ny - 1 - v)]
        )
        column = np.clip(np.floor(along), 0, count - 1).astype(int)
        across = np.clip(along - column, 0, 1)
        off = (relative - 1) * np.hypot(x / relative, y / relative)
        ring = np.clip(np.searchsorted(distance, off, side="right") - 1, 0, len(distance) - 2)
        outwards = np.clip((off - distance[ring]) / (distance[ring + 1] - distance[ring]), 0, 1)
        following = (column + 1) % count
        inner = heights[ring, column] * (1 - across) + heights[ring, following] * across
        outer = heights[ring + 1, column] * (1 - across) + heights[ring + 1, following] * across
        return np.asarray(inner * (1 - outwards) + outer * outwards)

    return height


def scatter_beyond(
    size: tuple[float, float],
    ground: Land,
    spec: SwarmSpec,
    rng: np.random.Generator,
    *,
    within: float = 80.0,
    margin: float = 1.5,
    density: Density | None = None,
) -> FarSwarm:
    """Spread small objects over the land between ``margin`` and ``within`` [m] outside the world's edge.

    ``ground`` is the land's height (``height_beyond``). Draws a jittered grid, scales, yaws, meshes and tints.
    """

    def around(xy: Array) -> Array:
        outside = distance_beyond(size, xy[:, 0], xy[:, 1])
        return np.asarray((outside > margin) & (outside < within))

    xy = jittered_grid(2 * (np.array(size) / 2 + within), spec.per_m2, rng, density, keep=around)
    return stand_beyond(ground, spec, xy, rng)


def stand_beyond(ground: Land, spec: SwarmSpec, xy: Array, rng: np.random.Generator) -> FarSwarm:
    """Stand the small objects of a swarm at positions (n, 2) on the land. Draws scales, yaws, meshes and tints."""
    n = len(xy)
    scale = random_scales(rng, spec.scales, n)
    poses = upright_poses(xy, rng.uniform(0, 2 * np.pi, n), scale)
    x, y = xy.T
    dx, dy = ((ground(x + i, y + j) - ground(x - i, y - j)) / 1.0 for i, j in ((0.5, 0.0), (0.0, 0.5)))
    poses[:, :3, :3] = tilted(poses, dx, dy, spec.tilt)
    # Upright objects stand at the lowest ground below their footprint, estimated from the slope.
    radius = scale * np.mean([min(mesh.footprint, 0.5) for mesh in spec.meshes]) * (1 - spec.tilt)
    poses[:, 2, 3] = ground(x, y) - spec.sink * scale - radius * np.hypot(dx, dy)
    return make_swarm(spec.name, spec.kind, spec.meshes, poses, rng, tint=spec.tint), spec.meshes


def _edge(field: Heightfield) -> tuple[Array, Array, Array]:
    """x, y and height [m] of the terrain's edge nodes, anticlockwise from its first corner."""
    nx, ny = field.heights.shape
    edge = np.concatenate(
        [
            [(i, 0) for i in range(nx - 1)],
            [(nx - 1, j) for j in range(ny - 1)],
            [(i, ny - 1) for i in range(nx - 1, 0, -1)],
            [(0, j) for j in range(ny - 1, 0, -1)],
        ]
    )
    heights = field.heights[edge[:, 0], edge[:, 1]].astype(np.float64)
    return field.x0 + field.spacing * edge[:, 0], field.y0 + field.spacing * edge[:, 1], heights


def _levels(field: Heightfield) -> list[tuple[tuple[float, ...], int]]:
    """Distances [m] of the rings, and of how many of the edge's nodes they continue one."""
    near = max(1, round(NEAR_STEP / field.spacing))
    return [(RINGS[:1], 1), (RINGS[1:], near), (FAR_RINGS, near * COARSER)]


def _slope_outwards(field: Heightfield, land: Land, x: Array, y: Array, far: Array) -> Array:
    """Outward slope of the terrain minus that of the land at the edge nodes, smoothed over 2 m along the edge."""
    step = 0.6
    ux, uy = x / far, y / far
    own = (field.height_at(x, y) - field.height_at(x - step * ux, y - step * uy)) / step
    theirs = (land(x + step * ux, y + step * uy) - land(x, y)) / step
    reach = max(1, round(1.0 / field.spacing))
    window = np.hanning(2 * reach + 1)[1:-1] / np.hanning(2 * reach + 1).sum()
    return np.convolve(np.pad(own - theirs, reach - 1, mode="wrap"), window, mode="valid").clip(-1.0, 1.0)


def _net(levels: Sequence[tuple[int, ...]]) -> Index:
    """Triangles (f, 3) of rings whose vertices are numbered ring by ring, given (rings, vertices of each) by level.

    Fans join the last ring of a level with the first one of the next, which has fewer vertices.
    """
    faces, start = [], 0
    for k, (rings, n) in enumerate(levels):
        first = start + n * np.arange(rings)
        a, b = ((first[:-1, None] + m).ravel() for m in (np.arange(n), np.roll(np.arange(n), -1)))
        faces += [np.stack([a, a + n, b + n], axis=-1), np.stack([a, b + n, b], axis=-1)]
        start += rings * n
        if k + 1 < len(levels):
            faces += _fans(int(first[-1]), n, start, levels[k + 1][1])
    return np.concatenate(faces)


def _fans(inner: int, count: int, outer: int, few: int) -> list[Index]:
    """Triangles between a ring of ``count`` vertices and one of ``few``, given the number of the first of each."""
    k, step = np.arange(count), -(-count // few)
    near = np.minimum((k + step // 2) // step, few) % few
    fans = np.stack([inner + k, outer + near, inner + (k + 1) % count], axis=-1)
    turn = np.flatnonzero(near != np.roll(near, -1))  # the next node has the next outer vertex
    following = (turn + 1) % count
    return [fans, np.stack([inner + following, outer + near[turn], outer + near[following]], axis=-1)]


def _with_materials(vertices: Array, normals: Array, faces: Index, rows: Index, names: tuple[str, ...]) -> Mesh:
    """Mesh in which each material after the first has copies of its vertices with its own uv scale."""
    parts, shares, moved, total = [np.arange(len(vertices))], [np.full(len(vertices), 0)], faces.copy(), len(vertices)
    for row in range(1, len(names)):
        own = rows == row
        used, number = np.unique(faces[own], return_inverse=True)
        moved[own] = number.reshape(-1, 3) + total
        total += len(used)
        parts.append(used)
        shares.append(np.full(len(used), row))
    order, share = np.concatenate(parts), np.concatenate(shares)
    repeat = np.array([MATERIALS[n].repeat for n in names])[share]
    upright = np.array([MATERIALS[n].label == Label.TREETOP for n in names])[share]
    return make_mesh(
        "backdrop", vertices[order], normals[order], _laid_out(vertices[order], repeat, upright), moved, names, rows
    )


def _laid_out(vertices: Array, repeat: Array, upright: Mask) -> Array:
    """Texture coordinates (n, 2) of land, with repeats that bend where they are large, so that they form no rows.

    Walls of leaves, ``upright``, are laid outwards with their height: seen from above they would be stretched.
    """
    x, y, z = vertices.T
    flat = vertices[:, :2] * (1 + np.where(upright, z / np.maximum(np.hypot(x, y), 1.0), 0.0))[:, None]
    uv = flat / repeat[:, None]
    u, v = uv.T
    bent = np.stack([np.sin(1.7 * v + 0.9 * u) + 0.7 * np.sin(0.61 * v - 1.3 * u + 2.0),
                     np.sin(1.5 * u - 1.1 * v + 1.0) + 0.7 * np.sin(0.67 * u + 0.9 * v + 4.0)], axis=-1)  # fmt: skip
    return np.asarray(uv + BEND * (repeat > FINE_REPEAT)[:, None] * bent)


def _vertex_normals(vertices: Array, triangles: Index) -> Array:
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across *= np.sign(across[:, 2:])
    normals = np.zeros_like(vertices)
    for axis in range(3):
        for corner in range(3):
            normals[:, axis] += np.bincount(triangles[:, corner], across[:, axis], len(vertices))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
