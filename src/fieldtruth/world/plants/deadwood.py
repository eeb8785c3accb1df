# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Dead wood: snags (standing dead trees), fallen trunks, stumps, and fallen twigs on a forest's floor.

Trunks have bark that has come off in patches, moss on top, splintered ends, and uprooted root plates.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import PlantPart
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.growth import (
    ROOT_DEPTH,
    Stems,
    Surface,
    extend,
    grid_normals,
    grow_trunks,
    merged,
    sewn,
    sideways,
    spokes,
    taper,
    tubes,
    unit,
)
from fieldtruth.world.plants.species import Order, Species

Move = Callable[[Array, Array], tuple[Array, Array]]
"""Moves points (m, 3) [m] and turns unit normals (m, 3)."""
BARK_THICKNESS = 0.015  # [m]
BARE, MOSS, SOIL, TORN = "bark_dead", "bark_moss", "bark_soil", "bark_torn"


@dataclass(frozen=True)
class Part:
    """A surface with one material, or one per face, that is one part of the plant."""

    surface: Surface
    material: str | NDArray[np.str_]
    part: PlantPart = PlantPart.STEM

    def moved(self, move: Move) -> "Part":
        """The part in another frame."""
        vertices, normals, uv, faces = self.surface
        return replace(self, surface=(*move(vertices, normals), uv, faces))


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
    axis = extend(start, unit(away), length, order, rng)
    roots = Stems.alone(axis, taper(radius * rng.uniform(0.15, 0.4, count), order), length)
    soil = Part((vertices, normals, uv, quads.reshape(-1, 3).astype(np.int32)), SOIL, PlantPart.NONE)
    return [soil, Part(tubes(roots, max(4, round(6 * detail**0.3))), wood)]


def joined(name: str, parts: Sequence[Part], colliders: tuple[Collider, ...], footprint: float, species: str) -> Mesh:
    """One mesh of all parts."""
    each = [np.broadcast_to(np.asarray(p.material), len(p.surface[3])) for p in parts]
    names, rows = np.unique(np.concatenate(each), return_inverse=True)
    surfaces = [part.surface for part in parts]
    materials = [str(n) for n in names]
    own = [part.part for part in parts]
    return merged(
        name, surfaces, rows, materials, parts=own, colliders=colliders, footprint=footprint, species=(species,)
    )


SUNK: Final = 0.3  # depth of a fallen trunk in the ground, share of its radius
BOX_LENGTH: Final = 0.8  # [m] of a fallen trunk per box collider


def grow_snag(species: Species, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0) -> Mesh:
    """A standing dead tree, broken off at ``height`` [m] (1 to 20): no leaves, few broken limbs, patches of bark.

    As for a tree in a stand, the collider is the trunk, at most 2 m high, and the footprint 0.3 m more.
    """
    _check("height", height, 1.0, 20.0)
    whole = height * float(rng.uniform(1.25, 1.8))
    habit = species.stand or species.grown
    trunk = grow_trunks(habit, whole, rng)
    share = (height + ROOT_DEPTH) / trunk.length[0]
    stem = _cut(trunk, 0.0, share, max(4, round(height / 0.13 * detail**0.4)))
    body = DeadTrunk(
        stem=stem,
        wood=species.wood,
        sides=_sides(28, detail),
        bare=float(rng.uniform(0.15, 0.6)),
        bare_rise=0.5,
        moss=0.1,
        flare=habit.flare,
        top_jag=float(rng.uniform(0.6, 1.8)) * float(stem.radius[0, -1]) + 0.08,
    )
    parts = trunk_parts(body, rng)
    limbs = _stubs(stem, rng, count=round(1.1 * height * detail**0.3) + 3, start=0.3, longest=0.2, thickness=0.45)
    parts.append(Part(tubes(limbs, _sides(6, detail)), "bark_dead", PlantPart.BRANCH))
    if habit.dead is not None and habit.dead.whorl > 2:  # conifers keep dry lower twigs for years
        twigs = _stubs(stem, rng, count=round(5 * height * detail**0.5), start=0.12, longest=0.09, thickness=0.13)
        parts.append(Part(tubes(twigs, 3), species.wood, PlantPart.BRANCH))
    _, _, radius = stem.at(np.zeros(1, np.intp), np.array([min(1.3 + ROOT_DEPTH, 0.7 * height) / stem.length[0]]))
    breast = 1.1 * float(radius[0])
    collider = Collider(shape="cylinder", size=(breast, min(2.0, 0.9 * height)))
    return joined(name, parts, (collider,), breast + 0.3, species.name)


def grow_log(
    species: Species,
    *,
    name: str,
    length: float,
    radius: float,
    rng: np.random.Generator,
    detail: float = 1.0,
    roots: bool | None = None,
) -> Mesh:
    """A fallen trunk of ``length`` [m] (1 to 20) and ``radius`` [m] (0.05 to 0.6) at its thick end.

    It lies along x from -length / 2 (thick end) to length / 2, slightly bent, sunk into the plane z = 0 by a third of
    its radius. ``roots`` rise upright at its thick end (None: on one log of three). Moss grows on its upper side.

    Colliders are boxes of 0.8 m along it; `clearance_circles` gives circles that cover them. The footprint [m]
    is that of the whole log.
    """
    _check("length", length, 1.0, 20.0)
    _check("radius", radius, 0.05, 0.6)
    roots = bool(rng.random() < 1 / 3) if roots is None else roots
    rings = max(4, round(length / 0.13 * detail**0.4))
    stem = _pole(length, radius, float(rng.uniform(0.45, 0.7)), rings, rng)
    bare, moss = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.25, 0.75))
    plate = (2.4 * radius + 0.3) * float(rng.uniform(0.9, 1.2)) if roots else 0.0
    lift = _rest_height(stem, 0.45 * plate)
    move = lying(stem, lift)
    body = DeadTrunk(
        stem=stem,
        wood=species.wood,
        sides=_sides(28, detail),
        bare=bare,
        moss=moss,
        moss_limit=0.35,
        base_jag=0.02 if roots else float(rng.uniform(0.2, 1.2)) * radius,
        top_jag=float(rng.uniform(0.5, 2.0)) * radius,
        move=move,
    )
    parts = trunk_parts(body, rng)
    stubs = _stubs(stem, rng, count=max(2, round(1.2 * length)), start=0.25, longest=min(0.9, 4.5 * radius) / length)
    tips = stubs.axis[:, -1]
    up = stubs.take(np.flatnonzero(-tips[:, 0] > -0.2 * radius))
    if len(up.length):
        parts.append(Part(tubes(up, _sides(6, detail)), "bark_dead", PlantPart.BRANCH).moved(move))
    if roots:
        parts += [part.moved(move) for part in root_plate(stem, plate, species.wood, rng, detail)]
    return joined(name, parts, _boxes(stem, lift, plate), 0.5 * length + max(radius, plate), species.name)


def grow_stump(species: Species, *, name: str, radius: float, rng: np.random.Generator, detail: float = 1.0) -> Mesh:
    """A stump of 0.2 to 0.7 m height and ``radius`` [m] (0.05 to 0.6), splintered on top, with moss at the base.

    The collider is a cylinder; the footprint [m] is 0.15 m larger.
    """
    _check("radius", radius, 0.05, 0.6)
    height = float(rng.uniform(0.2, 0.7))
    axis = np.linspace([0, 0, -ROOT_DEPTH], [0.05 * rng.normal(), 0.05 * rng.normal(), height], 8)
    stem = _single(axis, np.linspace(radius, 0.9 * radius, 8))
    body = DeadTrunk(
        stem=stem,
        wood=species.wood,
        sides=_sides(28, detail),
        bare=float(rng.uniform(0.0, 0.4)),
        moss=float(rng.uniform(0.3, 0.7)),
        moss_limit=-0.3,
        flare=0.6,
        top_jag=radius * float(rng.uniform(0.1, 1.0)),
    )
    collider = Collider(shape="cylinder", size=(1.15 * radius, height))
    return joined(name, trunk_parts(body, rng), (collider,), 1.15 * radius + 0.15, species.name)


def clearance_circles(log: Mesh) -> tuple[tuple[float, float, float], ...]:
    """Circles (x, y, radius) [m] in the log's frame that cover its boxes, to keep free of other objects."""
    return tuple((c.position[0], c.position[1], 0.5 * float(np.hypot(c.size[0], c.size[1]))) for c in log.colliders)


def _check(key: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{key} must be between {low:g} and {high:g} m, got {value}")


def _sides(full: int, detail: float) -> int:
    return max(4 if full < 10 else 6, int(full * detail**0.4 + 0.5))


def _single(axis: Array, radius: Array) -> Stems:
    """One stem through the nodes (k, 3) [m]."""
    return Stems.alone(axis[None], radius[None], np.linalg.norm(np.diff(axis, axis=0), axis=1).sum()[None])


def _cut(stem: Stems, start: float, end: float, segments: int) -> Stems:
    """The part of a stem between two fractions of its length, in equal segments."""
    axis, _, radius = stem.at(np.zeros(segments + 1, np.intp), np.linspace(start, end, segments + 1))
    return _single(axis, radius)


def _pole(length: float, radius: float, top: float, segments: int, rng: np.random.Generator) -> Stems:
    """A slightly bent trunk along z from -length / 2; ``top`` is the radius at its end relative to ``radius``."""
    s = np.linspace(0, 1, segments + 1)
    bend = length * rng.normal(0, 0.012) * np.sin(np.pi * s) + length * rng.normal(0, 0.004) * np.sin(2 * np.pi * s)
    axis = np.stack([np.zeros_like(s), bend, length * (s - 0.5)], 1)
    return _single(axis, radius * (1 + (top - 1) * s))


def _rest_height(stem: Stems, raised: float) -> Array:
    """Height [m] of the lying axis at each node: sunk into the ground, or ``raised`` at the base by the root plate."""
    rest = (1 - SUNK) * stem.radius[0]
    slope = np.clip(1 - np.linspace(0, 1, len(rest)) / 0.7, 0, 1)
    return np.asarray(np.maximum(rest, rest + (raised - rest[0]) * slope))


def _stubs(
    stem: Stems, rng: np.random.Generator, *, count: int, start: float, longest: float, thickness: float = 0.3
) -> Stems:
    """Broken limbs above ``start``, up to ``longest`` of the stem's length; most of them are short."""
    joint = rng.uniform(start, 0.97, count)
    rank = np.arange(count, dtype=np.intp)
    parent = np.zeros(count, np.intp)
    position, tangent, radius = stem.at(parent, joint)
    side = sideways(tangent, parent, rank, 137.5, 30.0, rng)
    angle = np.radians(rng.normal(72, 14, count))[:, None]
    length = stem.length[0] * longest * rng.uniform(0.12, 1.0, count) ** 1.6 + 1.3 * radius
    order = Order(number=count, length=1, angle=(0, 0), lift=(-0.1, 0.1), wander=0.5, bend=0.3, segments=4)
    axis = extend(position, np.cos(angle) * tangent + np.sin(angle) * side, length, order, rng)
    thick = np.clip(thickness * radius * rng.uniform(0.6, 1.2, count), 0.004, 0.6 * radius)
    return Stems.alone(axis, taper(thick, order), length)


def _boxes(stem: Stems, height: Array, plate: float) -> tuple[Collider, ...]:
    """Boxes from below the ground to the log's upper side, and one for the root plate."""
    length = float(np.ptp(stem.axis[0, :, 2]))
    count = max(1, round(length / BOX_LENGTH))
    nodes = (stem.axis[0, :, 2] - stem.axis[0, 0, 2]) / length
    out = []
    for k in range(count):
        middle, ends = (k + 0.5) / count, (np.array([k, k + 1]) / count)
        within = np.unique(np.concatenate([nodes[(nodes > ends[0]) & (nodes < ends[1])], ends]))
        y = np.interp(within, nodes, stem.axis[0, :, 1])
        r = np.interp(within, nodes, stem.radius[0])
        top = float((np.interp(within, nodes, height) + r).max())
        low, high = float((y - r).min()), float((y + r).max())
        size = (length / count, high - low, top + 0.1)
        out.append(Collider(shape="box", size=size, position=((middle - 0.5) * length, 0.5 * (low + high), -0.1)))
    if plate > 0:
        y0 = float(stem.axis[0, 0, 1])
        size = (0.5, 1.8 * plate, float(height[0]) + plate + 0.1)
        out.append(Collider(shape="box", size=size, position=(-0.5 * length, y0, -0.1)))
    return tuple(out)


FLAT: Final = np.array([1.0, 1.0, 0.3])
"""Shape of branches that lie, relative to those that grow."""
_BRANCH = Order(number=1, length=1, angle=(0, 0), lift=(0.05, -0.15), wander=0.7, bend=0.4, segments=4)
_TWIG = Order(number=1, length=1, angle=(0, 0), lift=(-0.1, -0.3), wander=0.5, bend=0.3, segments=2)


def grow_twigs(*, name: str, radius: float, count: int, rng: np.random.Generator) -> Mesh:
    """``count`` dry branches of 0.2 to 1.3 m that lie in a disc of ``radius`` [m], each with a few twigs.

    They are 0.6 to 2.6 cm thick and rise at most a hand's breadth above the ground z = 0. No colliders; the footprint
    [m] is the radius.
    """
    out, turn = radius * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    heading, rise = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(-1, 7, count))
    length = np.exp(rng.uniform(np.log(0.2), np.log(1.3), count))
    ahead = np.stack([np.cos(rise) * np.cos(heading), np.cos(rise) * np.sin(heading), np.sin(rise)], axis=1)
    middle = np.stack([out * np.cos(turn), out * np.sin(turn), np.full(count, 0.012)], axis=1)
    foot = middle - 0.5 * length[:, None] * ahead * [1, 1, 0]
    axis = extend(foot, ahead, length, _BRANCH, rng)
    thick = 0.01 * np.clip(length, 0.3, 1.3) * rng.uniform(0.6, 1.0, count)
    branches = Stems.alone(axis, taper(thick, _BRANCH), length)
    parent = np.repeat(np.arange(count, dtype=np.intp), 3)
    joint = rng.uniform(0.3, 0.95, len(parent))
    position, tangent, thickness = branches.at(parent, joint)
    side = sideways(tangent, parent, np.arange(len(parent), dtype=np.intp) % 3, 180.0, 25.0, rng)
    own = length[parent] * (1.1 - joint) * rng.uniform(0.3, 0.7, len(parent))
    twigs = Stems.alone(
        extend(position, 0.7 * tangent + 0.7 * side, own, _TWIG, rng), taper(0.6 * thickness, _TWIG), own
    )
    surfaces = [tubes(replace(stems, axis=stems.axis * FLAT), sides) for stems, sides in ((branches, 4), (twigs, 3))]
    rows = np.zeros(sum(len(faces) for *_, faces in surfaces), np.int32)
    return merged(name, surfaces, rows, ["bark_dead"], parts=[PlantPart.BRANCH] * 2, footprint=radius)
