# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The land beyond a world's edge, down to the horizon: rings of ground fastened to the terrain, and what stands there.

The land goes on without a step: at the edge it has the terrain's height and its slope outwards, and within a dozen
metres it becomes the far land that the environment asks for. Class ground, no colliders; the robot never gets there.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from fieldtruth.core.arrays import Array
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Mesh, Swarm
from fieldtruth.world.placement import random_tints, rotations_to, upright_poses

Land = Callable[[Array, Array], Array]
"""Height [m] of the far land at world x, y [m], arrays of one shape."""

Cover = Callable[[Array, Array, Array], NDArray[np.intp]]
"""Row of the material for triangles (n,) at x, y [m] with a slope [rad]."""

RINGS: Final = (
    0.0, 0.4, 0.8, 1.3, 1.9, 2.6, 3.4, 4.3, 5.3, 6.5, 7.9, 9.5, 11.3, 13.4, 15.9, 18.7, 22.0, 25.8, 30.2, 35.2, 41.0,
    47.7, 55.4, 64.3, 74.5, 86.2, 100.0,
)  # fmt: skip
"""Distances [m] of the rings of vertices from the edge, one vertex on each for every node of the edge."""

FAR_RINGS: Final = tuple(100.0 * 9.5 ** (k / 56) for k in range(1, 57))
"""Distances [m] of the rings behind those; they have a vertex for every ``COARSER`` nodes."""

COARSER: Final = 4

HEIGHT_FADES: Final = 14.0
DETAIL_FADES: Final = 1.6
SLOPE_FADES: Final = 2.5
BROAD: Final = 3.0
"""Distances [m] within which the edge's own height, its detail along the edge (what a Gaussian of ``BROAD`` takes off),
and its slope outwards give way to the far land's: detail that went on would be ribs that all point outwards."""


def make_backdrop(
    field: Heightfield, size: tuple[float, float], material: str | Sequence[str], rng: np.random.Generator,
    *, land: Land | None = None, cover: Cover | None = None,
) -> Mesh:  # fmt: skip
    """Rings of land around a heightfield, fastened to its edge node by node.

    Without ``land`` there are low hills towards the horizon. ``cover`` chooses among several materials by triangle;
    each texture covers its material's ``repeat``. The first len(RINGS) x n vertices are the rings, from the edge
    outwards, n the number of the terrain's edge nodes; the far rings, and copies for further materials, follow.
    """
    x0, y0, h0 = _edge(field)
    land = land if land is not None else rolling_hills(size, rng)
    far = np.hypot(x0, y0)
    height, slope = h0 - land(x0, y0), _slope_outwards(field, land, x0, y0, far)
    broad = gaussian_filter1d(height, BROAD / field.spacing, mode="wrap")
    parts = []
    for rings, rows in ((RINGS, slice(None)), (FAR_RINGS, slice(None, None, COARSER))):
        distance = np.array(rings)[:, None]
        x, y = x0[rows] * (1 + distance / far[rows]), y0[rows] * (1 + distance / far[rows])
        join = broad[rows] * np.exp(-((distance / HEIGHT_FADES) ** 2))
        join = join + (height - broad)[rows] * np.exp(-((distance / DETAIL_FADES) ** 2))
        join = join + slope[rows] * distance * np.exp(-((distance / SLOPE_FADES) ** 2))
        parts.append(np.stack([x, y, land(x, y) + join], axis=-1).reshape(-1, 3))
    vertices, faces = np.concatenate(parts), _net(len(x0))
    normals = _vertex_normals(vertices, faces)
    names = (material,) if isinstance(material, str) else tuple(material)
    choice = np.zeros(len(faces), np.intp)
    if cover is not None:
        middle = vertices[faces].mean(axis=1)
        steepness = np.arccos(normals[faces].mean(axis=1)[:, 2].clip(-1, 1))
        choice = cover(middle[:, 0], middle[:, 1], steepness)
    return _skinned(vertices, normals, faces, choice, names)


def rolling_hills(size: tuple[float, float], rng: np.random.Generator, *, height: float = 9.0) -> Land:
    """Land that rises gently from a world's edge to hills of about ``height`` [m] at the horizon."""
    waves = [(k, rng.normal() / k**0.7, rng.normal() / k**0.7) for k in range(2, 18)]

    def land(x: Array, y: Array) -> Array:
        reach = np.maximum(np.maximum(np.abs(x) / size[0], np.abs(y) / size[1]) * 2, 1e-9)
        distance = np.hypot(x, y) * np.maximum(1 - 1 / reach, 0)
        angle = np.arctan2(y / size[1], x / size[0])
        hills = sum(c * np.cos(k * angle) + s * np.sin(k * angle) for k, c, s in waves)
        return np.asarray(0.01 * distance + np.maximum(hills + 1.2, 0.0) * height * (distance / FAR_RINGS[-1]) ** 0.8)

    return land


def height_beyond(field: Heightfield, size: tuple[float, float], backdrop: Mesh) -> Land:
    """Height [m] of a backdrop's own ground at places up to 100 m beyond the world's edge."""
    count = len(_edge(field)[0])
    distance = np.array(RINGS)
    heights = backdrop.vertices[: len(RINGS) * count, 2].reshape(len(RINGS), count).astype(np.float64)
    nx, ny = field.heights.shape
    half = np.array(size) / 2

    def height(x: Array, y: Array) -> Array:
        reach = np.maximum(np.abs(x) / half[0], np.abs(y) / half[1])
        u, v = (x / reach - field.x0) / field.spacing, (y / reach - field.y0) / field.spacing
        sides = np.stack([np.abs(v), np.abs(u - (nx - 1)), np.abs(v - (ny - 1)), np.abs(u)])
        along = np.choose(
            np.argmin(sides, axis=0), [u, nx - 1 + v, nx - 1 + ny - 1 + (nx - 1 - u), 2 * nx + ny - 3 + (ny - 1 - v)]
        )
        column = np.clip(np.floor(along), 0, count - 1).astype(int)
        across = np.clip(along - column, 0, 1)
        off = (reach - 1) * np.hypot(x / reach, y / reach)
        ring = np.clip(np.searchsorted(distance, off, side="right") - 1, 0, len(distance) - 2)
        outwards = np.clip((off - distance[ring]) / (distance[ring + 1] - distance[ring]), 0, 1)
        following = (column + 1) % count
        inner = heights[ring, column] * (1 - across) + heights[ring, following] * across
        outer = heights[ring + 1, column] * (1 - across) + heights[ring + 1, following] * across
        return np.asarray(inner * (1 - outwards) + outer * outwards)

    return height


def strew_beyond(
    field: Heightfield, size: tuple[float, float], backdrop: Mesh, name: str, kind: str, meshes: Sequence[Mesh],
    *, per_m2: float, rng: np.random.Generator, within: float = 80.0, margin: float = 1.5,
    density: Callable[[Array], Array] | None = None, scales: tuple[float, float] = (0.8, 1.25), tint: float = 0.1,
    tilt: float = 0.0, sink: float = 0.0,
) -> tuple[Swarm, tuple[Mesh, ...]]:  # fmt: skip
    """Strew things over the land between ``margin`` and ``within`` [m] beyond the edge: a swarm, and its meshes.

    As ``Site.strew``, but outside: ``density`` gives for places (n, 2) the share [0, 1] of ``per_m2`` that stands
    there; trees keep ``sink`` [m] times their scale in the soil. Hand the result to ``assemble(beyond=...)``.
    """
    half = np.array(size) / 2
    span = 2 * (half + within)
    cells = np.maximum(1, np.round(span * np.sqrt(per_m2))).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 2)
    places = (grid + rng.random(grid.shape)) / cells * span - span / 2
    chance = rng.random(len(places))
    off = np.maximum(np.abs(places) - half, 0)
    outside = np.hypot(off[:, 0], off[:, 1])
    keep = (outside > margin) & (outside < within)
    places, chance = places[keep], chance[keep]
    if density is not None:
        places = places[chance < density(places)]
    n = len(places)
    scale = np.exp(rng.uniform(np.log(scales[0]), np.log(scales[1]), n))
    poses = upright_poses(places, rng.uniform(0, 2 * np.pi, n), scale)
    height = height_beyond(field, size, backdrop)
    x, y = places.T
    dx, dy = ((height(x + i, y + j) - height(x - i, y - j)) / 1.0 for i, j in ((0.5, 0.0), (0.0, 0.5)))
    poses[:, :3, :3] = rotations_to(np.column_stack([-tilt * dx, -tilt * dy, np.ones(n)])) @ poses[:, :3, :3]
    # Upright things stand where the lowest ground below them is, as well as it is known here.
    reach = scale * np.mean([min(mesh.footprint, 0.5) for mesh in meshes]) * (1 - tilt)
    poses[:, 2, 3] = height(x, y) - sink * scale - reach * np.hypot(dx, dy)
    swarm = Swarm(
        name=name,
        kind=kind,
        object_id=0,  # known when all objects are
        meshes=tuple(mesh.name for mesh in meshes),
        mesh=rng.integers(len(meshes), size=n).astype(np.int32),
        world_from_object=poses,
        tint=random_tints(rng, tint, n),
    )
    return swarm, tuple(meshes)


def _edge(field: Heightfield) -> tuple[Array, Array, Array]:
    """x, y, height of the terrain's edge nodes, around it anticlockwise from its first corner."""
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


def _slope_outwards(field: Heightfield, land: Land, x: Array, y: Array, far: Array) -> Array:
    """Slope of the terrain beyond that of the land, away from the middle, at the edge; smooth along it."""
    step = 0.6
    ux, uy = x / far, y / far
    own = (field.height_at(x, y) - field.height_at(x - step * ux, y - step * uy)) / step
    theirs = (land(x + step * ux, y + step * uy) - land(x, y)) / step
    window = np.hanning(11)[1:-1] / np.hanning(11).sum()
    around = np.concatenate([(own - theirs)[-4:], own - theirs, (own - theirs)[:4]])
    return np.convolve(around, window, mode="valid").clip(-1.0, 1.0)


def _net(count: int) -> NDArray[np.intp]:
    """Triangles (f, 3) of the rings, whose vertices are numbered ring by ring; a band of fans joins near and far."""
    few = -(-count // COARSER)
    starts = np.concatenate([count * np.arange(len(RINGS)), count * len(RINGS) + few * np.arange(len(FAR_RINGS))])
    faces = []
    for rings, n in ((starts[: len(RINGS)], count), (starts[len(RINGS) :], few)):
        k = np.arange(n)
        a, b = ((rings[:-1, None] + m).ravel() for m in (k, (k + 1) % n))
        faces += [np.stack([a, a + n, b + n], axis=-1), np.stack([a, b + n, b], axis=-1)]
    inner, outer = starts[len(RINGS) - 1], starts[len(RINGS)]
    k = np.arange(count)
    near = np.minimum((k + COARSER // 2) // COARSER, few) % few
    faces.append(np.stack([inner + k, outer + near, inner + (k + 1) % count], axis=-1))
    turn = np.flatnonzero(near != np.roll(near, -1))  # where the next node belongs to the next far vertex
    following = (turn + 1) % count
    faces.append(np.stack([inner + following, outer + near[turn], outer + near[following]], axis=-1))
    return np.concatenate(faces)


def _skinned(
    vertices: Array, normals: Array, faces: NDArray[np.intp], rows: NDArray[np.intp], names: tuple[str, ...]
) -> Mesh:
    """Mesh in which each further material has copies of its vertices, with uv in its own repeats."""
    parts, shares, moved, total = [np.arange(len(vertices))], [np.full(len(vertices), 0)], faces.copy(), len(vertices)
    for row in range(1, len(names)):
        own = rows == row
        used, number = np.unique(faces[own], return_inverse=True)
        moved[own] = number.reshape(-1, 3) + total
        total += len(used)
        parts.append(used)
        shares.append(np.full(len(used), row))
    order, repeat = np.concatenate(parts), np.array([MATERIALS[n].repeat for n in names])[np.concatenate(shares)]
    return Mesh(
        name="backdrop",
        vertices=vertices[order].astype(np.float32),
        normals=normals[order].astype(np.float32),
        uv=(vertices[order, :2] / repeat[:, None]).astype(np.float32),
        faces=moved.astype(np.int32),
        material=rows.astype(np.int32),
        materials=names,
    )


def _vertex_normals(vertices: Array, triangles: NDArray[np.intp]) -> Array:
    corners = vertices[triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across *= np.sign(across[:, 2:])
    normals = np.zeros_like(vertices)
    for axis in range(3):
        for corner in range(3):
            normals[:, axis] += np.bincount(triangles[:, corner], across[:, axis], len(vertices))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))
