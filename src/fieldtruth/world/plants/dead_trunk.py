# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surface of dead trunks: bark that has come off in patches, moss on top, splintered ends, uprooted root plates."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, extend, taper, unit
from fieldtruth.world.plants.meshing import Surface, grid_normals, merged, sewn, spokes, tubes
from fieldtruth.world.plants.species import Order

Move = Callable[[Array, Array], tuple[Array, Array]]
"""Moves points (m, 3) [m] and turns unit normals (m, 3)."""

BARK_THICKNESS = 0.015  # [m]
BARE, MOSS, SOIL, TORN = "bark_dead", "bark_moss", "bark_soil", "bark_torn"


@dataclass(frozen=True)
class Part:
    """A surface with one material, or one per face."""

    surface: Surface
    material: str | NDArray[np.str_]

    def moved(self, move: Move) -> "Part":
        """The part in another frame."""
        vertices, normals, uv, faces = self.surface
        return Part((*move(vertices, normals), uv, faces), self.material)


@dataclass(frozen=True, kw_only=True)
class DeadTrunk:
    """A dead trunk around one stem."""

    stem: Stems
    wood: str  # material of the bark
    sides: int
    bare: float  # share of the surface without bark
    bare_rise: float = 0.0  # increase of that share from the base to the top
    moss: float  # share of the upward-facing surface that moss covers
    moss_limit: float = 0.5  # least z of the normal where moss grows
    flare: float = 0.0  # widening at the ground relative to the radius
    base_jag: float = 0.0  # [m] length of the splinters at the base; 0: open, in the soil
    top_jag: float = 0.0  # [m] length of the splinters at the top; 0: open
    move: Move | None = None  # into the mesh's frame


def trunk_parts(trunk: DeadTrunk, rng: np.random.Generator) -> list[Part]:
    """The trunk's surface with bark, bare wood and moss, and its broken ends."""
    stem = trunk.stem
    axis, radius = stem.axis[0], stem.radius[0].copy()
    tangent, spoke = spokes(stem.axis, trunk.sides)
    turn = np.linspace(0, 2 * np.pi, trunk.sides + 1)
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(axis, axis=0), axis=1))])[:, None]
    rising = run / run[-1]
    bare = _blotches(turn, run, 1.1, rng) < np.clip(trunk.bare + trunk.bare_rise * (rising - 0.5), 0, 0.95)
    phase = rng.uniform(0, 2 * np.pi, 4)
    ridges = 0.5 * np.cos(3 * turn + phase[0]) + 0.5 * np.cos(5 * turn + phase[1])
    profile = 1 + 0.05 * np.cos(2 * turn + phase[2] + 0.7 * run) + 0.03 * np.cos(5 * turn + phase[3] - 0.6 * run)
    profile += trunk.flare * np.exp(-np.maximum(run - ROOT_DEPTH, 0) / (1.4 * radius[0])) * (1 + 0.5 * ridges)
    distance = radius[:, None] * profile - np.where(bare, min(BARK_THICKNESS, 0.1 * radius[-1]), 0.0)
    distance[:, -1] = distance[:, 0]
    vertices = axis[:, None] + distance[..., None] * spoke[0]
    for row, jag, sign in ((0, trunk.base_jag, -1.0), (-1, trunk.top_jag, 1.0)):
        out = jag * _splinters(turn, rng)
        vertices[row] += (sign * out)[:, None] * tangent[0, row]
    normals = grid_normals(vertices[None])[0]
    flat = vertices.reshape(-1, 3), normals.reshape(-1, 3)
    if trunk.move is not None:
        flat = trunk.move(*flat)
    _, _, uv, faces = sewn(vertices[None], normals[None], stem, rising[:, 0], pointed=False)
    material = np.where(bare.ravel()[faces].mean(1) > 0.5, BARE, trunk.wood)
    ragged = rng.normal(0, 0.1, len(faces))
    damp = _blotches(turn, run, 0.8, rng).ravel()[faces].mean(1) + ragged < trunk.moss
    facing = flat[1][faces, 2].mean(1) + ragged > trunk.moss_limit
    parts = [Part((*flat, uv, faces), np.where(damp & facing, MOSS, material))]
    grid = flat[0].reshape(vertices.shape)
    for row, inner, jag in ((0, 1, trunk.base_jag), (-1, -2, trunk.top_jag)):
        if jag > 0:
            parts.append(Part(_broken_end(grid[row, :-1], grid[inner, :-1].mean(0), jag, rng), TORN))
    return parts


def _blotches(turn: Array, run: Array, size: float, rng: np.random.Generator) -> Array:
    """Smooth noise around (sides + 1,) and along (rings, 1) [m] a trunk, uniform in 0 to 1, patches of ``size`` [m]."""
    field = np.zeros((len(run), len(turn)))
    for k in (0, 1, 1, 2, 2, 3):
        wave = rng.uniform(0.4, 1.6) * 2 * np.pi / size / 2 * rng.choice([-1.0, 1.0])
        field += np.cos(k * turn + wave * run + rng.uniform(0, 2 * np.pi))
    field[:, -1] = field[:, 0]
    rank = np.empty(field.size)
    rank[np.argsort(field.ravel(), kind="stable")] = np.linspace(0, 1, field.size)
    return rank.reshape(field.shape)


def _splinters(turn: Array, rng: np.random.Generator) -> Array:
    """Random lengths, about 0, of the splinters around a break, longer on one side."""
    out = 0.5 * np.cos(turn + rng.uniform(0, 2 * np.pi)) + 0.3 * rng.normal(0, 1, len(turn)).clip(-1.5, 1.5)
    out[-1] = out[0]
    return np.asarray(out)


def _broken_end(ring: Array, inner: Array, jag: float, rng: np.random.Generator) -> Surface:
    """Surface of torn wood within a ring (s, 3) [m] of corners, hollow towards ``inner``."""
    sides = len(ring)
    centre = ring.mean(0)
    axis = unit(centre - inner)
    middle = centre + 0.5 * (ring - centre)
    level = ((ring - centre) @ axis)[:, None]
    middle += axis * (0.3 * jag * rng.normal(0, 1, (sides, 1)).clip(-1.5, 1.5) - 0.5 * level - 0.15 * jag)
    vertices = np.concatenate([ring, middle, (centre - 0.3 * jag * axis)[None]])
    k = np.arange(sides)
    n = (k + 1) % sides
    last = np.full(sides, 2 * sides)
    faces = np.concatenate(
        [
            np.stack([k, n, sides + k], 1),
            np.stack([n, sides + n, sides + k], 1),
            np.stack([sides + k, sides + n, last], 1),
        ]
    )
    across = unit(ring[0] - centre - axis * ((ring[0] - centre) @ axis))
    uv = np.stack([(vertices - centre) @ across, (vertices - centre) @ np.cross(axis, across)], 1) / 0.5
    corner = vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    if (normal @ axis).sum() < 0:
        faces, normal = faces[:, ::-1], -normal
    normals = np.zeros_like(vertices)
    np.add.at(normals, faces.ravel(), np.repeat(normal, 3, axis=0))
    return vertices, unit(normals + 1e-9 * axis), uv, faces.astype(np.int32)


def lying(stem: Stems, height: Array) -> Move:
    """Map from a trunk along z to one along x whose axis is at ``height`` (k,) [m] at the stem's nodes."""
    nodes = stem.axis[0, :, 2]

    def move(points: Array, normals: Array) -> tuple[Array, Array]:
        raised = np.interp(points[:, 2], nodes, height)
        moved = np.stack([points[:, 2], points[:, 1], raised - points[:, 0]], 1)
        return moved, np.stack([normals[:, 2], normals[:, 1], -normals[:, 0]], 1)

    return move


def root_plate(trunk: Stems, extent: float, wood: str, rng: np.random.Generator, detail: float) -> list[Part]:
    """Uprooted roots and the soil between them, about the base of a trunk along z (before `lying`)."""
    centre, radius = trunk.axis[0, 0], float(trunk.radius[0, 0])
    sides = max(10, round(26 * detail**0.3))
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    edge = 1 + 0.14 * np.cos(2 * turn + rng.uniform(0, 6)) + 0.12 * np.cos(3 * turn + rng.uniform(0, 6))
    edge[:-1] *= 1 + 0.09 * rng.normal(0, 1, sides).clip(-1.5, 1.5)
    edge[-1] = edge[0]
    # Rings from the middle of the underside over the rim to the trunk.
    out = np.array([0.02, 0.3, 0.55, 0.8, 0.92, 0.85, 0.5, 0.9 * radius / extent])
    level = np.array([-0.34, -0.3, -0.26, -0.16, 0.02, 0.12, 0.2, 0.34]) * (0.35 + 0.5 * extent)
    lumps = np.concatenate([0.035 * rng.normal(0, 1, (len(out) - 1, sides + 1)), np.zeros((1, sides + 1))])
    lumps[:, -1], lumps[0] = lumps[:, 0], 0.0
    around = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], 1)
    grid = centre + (extent * out[:, None] * edge)[..., None] * around
    grid[..., 2] += level[:, None] + lumps
    rings = np.arange(len(out) - 1)[:, None] * (sides + 1) + np.arange(sides)
    quads = np.stack([rings, rings + 1, rings + sides + 1, rings + 1, rings + sides + 2, rings + sides + 1], -1)
    vertices = grid.reshape(-1, 3)
    uv = (np.stack([vertices[:, 0], vertices[:, 1]], 1) + vertices[:, 2:]) / 1.5
    normals = grid_normals(grid[None])[0].reshape(-1, 3)
    count = max(6, round(18 * detail**0.5))
    angle = rng.uniform(0, 2 * np.pi, count)
    away = np.stack([np.cos(angle), np.sin(angle), rng.uniform(-0.3, 0.15, count)], 1)
    length = extent * rng.uniform(0.5, 1.1, count)
    order = Order(number=count, length=1, angle=(0, 0), bend=0.5, wander=1.0, segments=5)
    start = centre + [0, 0, -0.12 * extent] + 0.35 * extent * away * [1, 1, 0]
    none = np.zeros(count, np.intp)
    roots = Stems(
        axis=extend(start, unit(away), length, order, rng),
        radius=taper(radius * rng.uniform(0.15, 0.4, count), order),
        length=length,
        parent=none,
        joint=np.zeros(count),
        limb=none,
    )
    soil = Part((vertices, normals, uv, quads.reshape(-1, 3).astype(np.int32)), SOIL)
    return [soil, Part(tubes(roots, max(4, round(6 * detail**0.3))), wood)]


def joined(name: str, parts: Sequence[Part], colliders: tuple[Collider, ...], footprint: float, species: str) -> Mesh:
    """One mesh of all parts."""
    each = [np.broadcast_to(np.asarray(p.material), len(p.surface[3])) for p in parts]
    names, rows = np.unique(np.concatenate(each), return_inverse=True)
    surfaces = [part.surface for part in parts]
    materials = [str(n) for n in names]
    return merged(name, surfaces, rows, materials, colliders=colliders, footprint=footprint, species=(species,))
