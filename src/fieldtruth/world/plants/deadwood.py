# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Dead wood: snags (standing dead trees), fallen trunks and stumps, with patches of bark and broken ends."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Collider, Mesh
from fieldtruth.world.plants.dead_trunk import DeadTrunk, Part, joined, lying, root_plate, trunk_parts
from fieldtruth.world.plants.growth import ROOT_DEPTH, Stems, extend, grow_trunks, sideways, taper
from fieldtruth.world.plants.meshing import tubes
from fieldtruth.world.plants.species import Order, Species

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
    parts.append(Part(tubes(limbs, _sides(6, detail)), "bark_dead"))
    if habit.dead is not None and habit.dead.whorl > 2:  # conifers keep dry lower twigs for years
        twigs = _stubs(stem, rng, count=round(5 * height * detail**0.5), start=0.12, longest=0.09, thickness=0.13)
        parts.append(Part(tubes(twigs, 3), species.wood))
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
        parts.append(Part(tubes(up, _sides(6, detail)), "bark_dead").moved(move))
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
    length = float(np.linalg.norm(np.diff(axis, axis=0), axis=1).sum())
    none = np.full(1, -1, np.intp)
    return Stems(
        axis=axis[None], radius=radius[None], length=np.array([length]), parent=none, joint=np.zeros(1), limb=none
    )


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
    return Stems(
        axis=extend(position, np.cos(angle) * tangent + np.sin(angle) * side, length, order, rng),
        radius=taper(np.clip(thickness * radius * rng.uniform(0.6, 1.2, count), 0.004, 0.6 * radius), order),
        length=length,
        parent=parent,
        joint=joint,
        limb=rank,
    )


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
