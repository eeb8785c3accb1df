# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A tuft of grass or herbs: blades of several kinds from one disc of soil, with leaves, fronds and flowers.

Blades bend like the paths of particles (see `blades`). Tufts as the unit of instancing follow Deussen et al.,
"Realistic modeling and rendering of plant ecosystems", SIGGRAPH 1998. A tuft leans as a whole, its blades differ in
length, bend and direction, and dead ones lie between the others: a meadow of equal tufts would look mown.
"""

from dataclasses import replace
from typing import assert_never

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants.blades import along, arched_leaves, discs, kites, midribs, pinnae, spindles, strips
from fieldtruth.world.plants.grass_species import Blades, Flower, Frond, GrassSpecies, Leaves, Organ, Spike
from fieldtruth.world.plants.growth import unit
from fieldtruth.world.plants.meshing import Surface, merged

ROOT_DEPTH = 0.12
"""Depth [m] of the roots in the middle of a tuft."""
ROOT_SLOPE = 0.6
"""Slope of the ground up to which the rim of a tuft still reaches into it."""
SIMPLE_BELOW = 0.6
"""Detail below which every blade is a kite."""
MIN_HEIGHT = 0.006
"""Least height [m] of blades above the soil."""


def grow_tuft(
    species: GrassSpecies, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0
) -> Mesh:
    """A tuft whose highest blade or stalk ends at ``height`` [m].

    A ``detail`` below 1 gives fewer and wider blades, below 0.6 simpler ones as well. It has no collider: a robot
    drives through. The footprint [m] is the radius of the disc it roots in. Raises ValueError for a height below half
    the least or above 1.5 times the greatest usual height, and for a ``detail`` outside (0, 4].
    """
    low, high = 0.5 * species.height[0], 1.5 * species.height[1]
    if not low <= height <= high:
        raise ValueError(f"height of {species.name} must be between {low:g} and {high:g} m, got {height}")
    if not 0 < detail <= 4:
        raise ValueError(f"detail of {species.name} must be above 0 and at most 4, got {detail}")
    scale = float(np.sqrt(2 * height / sum(species.height)))
    radius = species.radius * scale
    kinds = [_detailed(blades, detail) for blades in species.blades]
    side = rng.normal(0, 0.5 * species.lopsided, 2)
    paths = [_grown(blades, radius, side, rng) for blades in kinds]
    top = max(float(path[:, :, 2].max()) for path in paths)
    parts: list[tuple[Surface, str]] = []
    for blades, path in zip(kinds, paths, strict=True):
        fitted = path[:, :1] + (height / top) * (path - path[:, :1])
        fitted[..., 2] = np.maximum(fitted[..., 2], MIN_HEIGHT)
        parts.append((_surface(blades, fitted, scale, rng), blades.material))
        parts.extend((_organ(organ, fitted, scale, rng), organ.material) for organ in blades.organs)
    names = list(dict.fromkeys(material for _, material in parts))
    rows = np.concatenate([np.full(len(surface[3]), names.index(material)) for surface, material in parts])
    return merged(name, [surface for surface, _ in parts], rows, names, footprint=radius, species=(species.name,))


def _detailed(blades: Blades, detail: float) -> Blades:
    """The blades with about ``detail`` times as many triangles: wider, with larger leaves."""
    share = detail if not blades.organs else float(np.sqrt(detail))
    number = max(1, round(blades.number * share))
    wider = min(float(np.sqrt(blades.number / number)), 1.6)
    organs = tuple(_coarser(organ, float(np.sqrt(detail))) for organ in blades.organs)
    return replace(
        blades, number=number, width=blades.width * wider, kite=blades.kite or detail < SIMPLE_BELOW, organs=organs
    )


def _coarser(organ: Organ, share: float) -> Organ:
    match organ:
        case Leaves():
            number = max(2, round(organ.number * share))
            size = float(np.sqrt(organ.number / number))
            return replace(organ, number=number, length=organ.length * size, width=organ.width * size)
        case Frond():
            return replace(organ, pairs=max(4, round(organ.pairs * share)))
        case Flower() | Spike():
            return organ
        case _:
            assert_never(organ)


def _grown(blades: Blades, radius: float, side: Array, rng: np.random.Generator) -> Array:
    """Midribs of one kind of blades with relative lengths; they root evenly in the disc."""
    n = blades.number
    out = np.sqrt((np.arange(n) + rng.uniform(0.1, 0.9, n)) / n)
    turn = np.radians(137.5) * np.arange(n) + rng.uniform(0, 2 * np.pi) + rng.normal(0, 0.4, n)
    outward = np.stack([np.cos(turn), np.sin(turn)], 1)
    foot = np.concatenate([radius * blades.rim * out[:, None] * outward, np.zeros((n, 1))], 1)
    towards = outward * (0.35 + 0.65 * out[:, None]) + side + rng.normal(0, 0.3, (n, 2))
    lean = blades.lean[0] + (blades.lean[1] - blades.lean[0]) * out + rng.normal(0, 5, n)
    return midribs(
        foot,
        azimuth=np.arctan2(towards[:, 1], towards[:, 0]),
        length=rng.uniform(*blades.length, n),
        lean=np.radians(lean.clip(-10, 85)),
        bend=np.radians(rng.uniform(*blades.bend, n)),
        drift=np.radians(rng.normal(0, blades.drift, n)),
    )


def _surface(blades: Blades, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Blades along midribs; each shows its own band of the texture."""
    n = len(path)
    left = rng.uniform(0, 1, n)
    return strips(
        path,
        width=scale * blades.width * rng.uniform(0.75, 1.2, n),
        depth=ROOT_DEPTH + ROOT_SLOPE * np.hypot(*path[:, 0, :2].T),
        roll=np.radians(rng.normal(0, blades.roll, n)),
        twist=np.radians(rng.normal(0, blades.twist, n)),
        band=np.stack([left, left + 0.2], 1),
        kite=blades.kite,
    )


def _organ(organ: Organ, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Leaves, pinnae, flowers or spikes on midribs."""
    n = len(path)
    rows = np.arange(n, dtype=np.intp)
    match organ:
        case Leaves():
            return _leaves(organ, path, scale, rng)
        case Frond():
            length = np.linalg.norm(np.diff(path, axis=1), axis=2).sum(1) * organ.length * rng.uniform(0.85, 1.15, n)
            return pinnae(path, organ.pairs, length, organ.start, rng)
        case Flower():
            top, tangent = along(path, rows, np.ones(n))
            return discs(top, unit(tangent + rng.normal(0, 0.25, (n, 3))), organ.radius * rng.uniform(0.7, 1.2, n))
        case Spike():
            low, _ = along(path, rows, np.full(n, organ.start))
            high, _ = along(path, rows, np.full(n, organ.end))
            return spindles(low, high, organ.radius * scale * rng.uniform(0.8, 1.2, n))
        case _:
            assert_never(organ)


def _leaves(organ: Leaves, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """Leaves along midribs, turned out from them, their upper sides up."""
    n, k = len(path), organ.number
    row = np.arange(n, dtype=np.intp).repeat(k)
    rank = np.tile(np.arange(k), n)
    step = rank // 2 * 2 if organ.arrangement == "pairs" else rank
    s = (step + 0.5 + rng.uniform(-0.2, 0.2, n * k)) / k
    base, tangent = along(path, row, organ.start + (organ.end - organ.start) * s)
    turn = np.radians(rng.uniform(0, 360, n)[row] + rng.normal(0, 15, n * k) + _divergence(organ, rank))
    across = unit(np.cross(tangent, np.broadcast_to([0.31, 0.95, 0.02], tangent.shape)))
    out = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(tangent, across)
    angle = np.radians(organ.angle + rng.normal(0, 10, n * k))[:, None]
    direction = unit(np.cos(angle) * tangent + np.sin(angle) * out - [0, 0, organ.droop])
    size = scale * (1 - (1 - organ.smallest) * s) * np.exp(rng.normal(0, 0.15, n * k))
    upper = np.array([0.0, 0.0, 1.0]) + 0.3 * tangent + rng.normal(0, 0.25, (n * k, 3))
    shape = arched_leaves if organ.broad else kites
    return shape(base, direction, upper, organ.length * size, organ.width * size, organ.widest)


def _divergence(organ: Leaves, rank: Index) -> Array:
    """Angle [deg] about the stalk of each leaf."""
    if organ.arrangement == "pairs":  # each pair at right angles to the one before
        return np.asarray(90.0 * (rank // 2) + 180.0 * (rank % 2))
    return np.asarray(137.5 * rank) if organ.arrangement == "spiral" else np.zeros(len(rank))
