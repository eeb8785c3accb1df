# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surface around a skeleton: tapered tubes about the stems, wider at the roots, with bark that tiles at the seam."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, unit

BARK_REPEAT: Final = 0.6  # [m] of bark per repeat of the texture on thick stems
SMALLEST_REPEAT: Final = 0.12  # [m] along thin twigs, where the repeat around is smaller than this

Surface = tuple[Array, Array, Array, NDArray[np.int32]]


def merged(
    name: str,
    surfaces: Sequence[Surface],
    rows: NDArray[np.integer],
    materials: Sequence[str],
    *,
    footprint: float,
    colliders: tuple[Collider, ...] = (),
    species: tuple[str, ...] = (),
) -> Mesh:
    """One mesh of several surfaces; ``rows`` (f,) are the rows of ``materials`` of all faces, surface by surface."""
    offsets = np.cumsum([0, *(len(s[0]) for s in surfaces[:-1])])
    vertices, normals, uv = (np.concatenate([s[k] for s in surfaces]).astype(np.float32) for k in range(3))
    return Mesh(
        name=name,
        vertices=vertices,
        normals=normals,
        uv=uv,
        faces=np.concatenate([s[3] + np.int32(o) for s, o in zip(surfaces, offsets, strict=True)]),
        material=rows.astype(np.int32),
        materials=tuple(materials),
        colliders=colliders,
        footprint=footprint,
        species=species,
    )


def tubes(stems: Stems, sides: int) -> Surface:
    """Vertices (v, 3) [m], outward unit normals, uv and faces (f, 3) of one round pointed tube per stem.

    Vertices are doubled at the seam: u runs from 0 to a whole number of repeats, v along the stem at the scale of u at
    its base.
    """
    rings = stems.axis.shape[1]
    tangent, spoke = spokes(stems.axis, sides)
    vertices = stems.axis[:, :, None] + _pointed(stems.radius)[:, :, None, None] * spoke
    slope = (stems.radius[:, 0] - stems.radius[:, -1]) / stems.length
    normals = unit(spoke + slope[:, None, None, None] * tangent[:, :, None])
    return sewn(vertices, normals, stems, np.linspace(0, 1, rings))


def trunk(stems: Stems, sides: int, flare: float, rng: np.random.Generator) -> Surface:
    """As `tubes` for a single trunk: wide at the ground with root ridges, not quite round above.

    ``flare`` is the widening at the ground relative to the radius there.
    """
    near_ground = (ROOT_DEPTH + np.array([-0.08, 0.02, 0.1, 0.2, 0.32, 0.5, 0.75])) / stems.length[0]
    nodes = np.linspace(0, 1, stems.axis.shape[1])
    apart = np.abs(near_ground[:, None] - nodes).min(1) * stems.length[0] > 0.04  # [m]; no slivers
    fraction = np.union1d(nodes, near_ground[apart])
    axis, _, radius = stems.at(np.zeros(len(fraction), np.intp), fraction)
    z = np.maximum(fraction * stems.length[0] - ROOT_DEPTH, -0.08)[:, None]
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    phase = rng.uniform(0, 2 * np.pi, 4)
    ridges = 0.5 * np.cos(3 * turn + phase[0]) + 0.5 * np.cos(5 * turn + phase[1])
    flutes = 0.05 * np.cos(2 * turn + phase[2] + 0.5 * z) + 0.03 * np.cos(5 * turn + phase[3] - 0.4 * z)
    profile = 1 + flutes + flare * np.exp(-z / (1.4 * stems.radius[0, 0])) * (1 + 0.5 * ridges)
    profile[:, -1] = profile[:, 0]

    _, spoke = spokes(axis[None], sides)
    normals = grid_normals(axis[None, :, None] + (radius[:, None] * profile)[None, ..., None] * spoke)
    vertices = axis[None, :, None] + (_pointed(radius[None])[:, :, None] * profile)[..., None] * spoke
    return sewn(vertices, normals, stems, fraction)


def _pointed(radius: Array) -> Array:
    """Radii (n, k + 1) [m] with 0 at the tip."""
    return np.concatenate([radius[:, :-1], np.zeros_like(radius[:, :1])], 1)


def spokes(axis: Array, sides: int) -> tuple[Array, Array]:
    """Unit tangents (n, k + 1, 3) and unit spokes (n, k + 1, sides + 1, 3) across them; last and first are equal."""
    tangent, across, over = _frames(axis)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0  # bit-equal ends close the seam
    return tangent, np.cos(turn)[:, None] * across[:, :, None] + np.sin(turn)[:, None] * over[:, :, None]


def sewn(vertices: Array, normals: Array, stems: Stems, fraction: Array, *, pointed: bool = True) -> Surface:
    """Surface of tubes with vertices (n, rings, sides + 1, 3), with bark uv; the last ring is a point if ``pointed``.

    ``fraction`` (rings,) of the length gives v.
    """
    n, rings, columns, _ = vertices.shape
    around = np.maximum(np.rint(2 * np.pi * stems.radius[:, 0] / BARK_REPEAT), 1)
    repeat = np.clip(2 * np.pi * stems.radius[:, 0] / around, SMALLEST_REPEAT, 1.4 * BARK_REPEAT)
    u = around[:, None, None] * np.linspace(0, 1, columns)
    v = (stems.length / repeat)[:, None, None] * fraction[:, None]
    uv = np.stack(np.broadcast_arrays(u, v), -1)

    a = np.arange(rings - 1)[:, None] * columns + np.arange(columns - 1)
    b, c = a + 1, a + columns
    # If the last ring is a point, the second triangles of its quads have no area.
    second = np.stack([b, c + 1, c], -1)[: -1 if pointed else None]
    quads = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), second.reshape(-1, 3)])
    faces = (np.arange(n) * rings * columns)[:, None, None] + quads
    return vertices.reshape(-1, 3), normals.reshape(-1, 3), uv.reshape(-1, 2), faces.reshape(-1, 3).astype(np.int32)


def _frames(axis: Array) -> tuple[Array, Array, Array]:
    """Tangents and two crosswise unit vectors per node, (n, k + 1, 3) each, transported without twist."""
    step = unit(np.diff(axis, axis=1))
    tangent = unit(np.concatenate([step[:, :1], step[:, :-1] + step[:, 1:], step[:, -1:]], 1))
    helper = np.where(np.abs(tangent[:, 0, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    across = np.empty_like(tangent)
    across[:, 0] = unit(np.cross(tangent[:, 0], helper))
    for i in range(1, axis.shape[1]):
        carried = across[:, i - 1]
        across[:, i] = unit(carried - (carried * tangent[:, i]).sum(1, keepdims=True) * tangent[:, i])
    return tangent, across, np.cross(tangent, across)


def grid_normals(vertices: Array) -> Array:
    """Normals of tubes of any cross-section by central differences on the (ring, side) grid, across the seam."""
    around = np.roll(vertices[:, :, :-1], -1, 2) - np.roll(vertices[:, :, :-1], 1, 2)
    along = np.gradient(vertices[:, :, :-1], axis=1)
    normals = unit(np.cross(around, along))
    return np.concatenate([normals, normals[:, :, :1]], 2)
