# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A tuft of grass or herbs from its recipe: sorts of blades from one disc of soil, and what grows on them.

Blades are bent as the paths of particles are (see `blades`). Tufts as the unit that is instanced follow Deussen et al.,
"Realistic modeling and rendering of plant ecosystems", SIGGRAPH 1998. A tuft leans as a whole, its blades differ in
length, bend and turn, and dead ones lie between the living: a meadow of equal tufts would look mown.
"""

from dataclasses import replace
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants.blades import along, discs, kites, midribs, pinnae, spindles, strips
from fieldtruth.world.plants.grass_species import Blades, Flower, Frond, GrassSpecies, Leaves, Organ, Spike
from fieldtruth.world.plants.growth import unit
from fieldtruth.world.plants.meshing import Surface

ROOT_DEPTH = 0.12
"""[m] by which the middle of a tuft reaches into the soil."""
ROOT_SLOPE = 0.6
"""Slope of the ground up to which the rim of a tuft reaches into it, too."""
SIMPLE_BELOW = 0.6
"""Detail below which every blade is a kite."""
LIE = 0.006
"""[m] above the soil at which a blade that has sunk lies."""


def grow_tuft(kind: GrassSpecies, *, name: str, height: float, rng: np.random.Generator, detail: float = 1.0) -> Mesh:
    """A tuft whose highest blade or stalk ends at ``height`` [m].

    ``detail`` below 1 takes fewer and wider blades, below 0.6 simpler ones as well. There are no colliders: a robot
    drives through. The footprint [m] is the radius of the disc it roots in. Raises ValueError below half the least and
    above 1.5 times the greatest usual height, and for a ``detail`` outside (0, 4].
    """
    low, high = 0.5 * kind.height[0], 1.5 * kind.height[1]
    if not low <= height <= high:
        raise ValueError(f"height of {kind.name} = {height} m: must be from {low:g} to {high:g} m")
    if not 0 < detail <= 4:
        raise ValueError(f"detail of {kind.name} = {detail}: must be above 0 and at most 4")
    scale = float(np.sqrt(2 * height / sum(kind.height)))
    radius = kind.radius * scale
    sorts = [_detailed(sort, detail) for sort in kind.blades]
    side = rng.normal(0, 0.5 * kind.lopsided, 2)
    paths = [_grown(sort, radius, side, rng) for sort in sorts]
    top = max(float(path[:, :, 2].max()) for path in paths)
    parts: list[tuple[Surface, str]] = []
    for sort, path in zip(sorts, paths, strict=True):
        fitted = path[:, :1] + (height / top) * (path - path[:, :1])
        fitted[..., 2] = np.maximum(fitted[..., 2], LIE)
        parts.append((_skin(sort, fitted, scale, rng), sort.material))
        parts.extend((_organ(organ, fitted, scale, rng), organ.material) for organ in sort.organs)
    return _assembled(name, parts, radius)


def _detailed(sort: Blades, detail: float) -> Blades:
    """The sort with about ``detail`` times as many triangles, wider blades and larger leaves."""
    share = detail if not sort.organs else float(np.sqrt(detail))
    number = max(1, round(sort.number * share))
    wider = min(float(np.sqrt(sort.number / number)), 1.6)
    organs = tuple(_coarser(organ, float(np.sqrt(detail))) for organ in sort.organs)
    return replace(
        sort, number=number, width=sort.width * wider, kite=sort.kite or detail < SIMPLE_BELOW, organs=organs
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


def _grown(sort: Blades, radius: float, side: Array, rng: np.random.Generator) -> Array:
    """Midribs of a sort, in the tuft's own measure of length; they root evenly in the disc."""
    n = sort.number
    out = np.sqrt((np.arange(n) + rng.uniform(0.1, 0.9, n)) / n)
    turn = np.radians(137.5) * np.arange(n) + rng.uniform(0, 2 * np.pi) + rng.normal(0, 0.4, n)
    outward = np.stack([np.cos(turn), np.sin(turn)], 1)
    foot = np.concatenate([radius * sort.rim * out[:, None] * outward, np.zeros((n, 1))], 1)
    towards = outward * (0.35 + 0.65 * out[:, None]) + side + rng.normal(0, 0.3, (n, 2))
    lean = sort.lean[0] + (sort.lean[1] - sort.lean[0]) * out + rng.normal(0, 5, n)
    return midribs(
        foot,
        azimuth=np.arctan2(towards[:, 1], towards[:, 0]),
        length=rng.uniform(*sort.length, n),
        lean=np.radians(lean.clip(-10, 85)),
        bend=np.radians(rng.uniform(*sort.bend, n)),
        drift=np.radians(rng.normal(0, sort.drift, n)),
    )


def _skin(sort: Blades, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """The blades about fitted midribs; each takes a band of its own from the texture."""
    n = len(path)
    left = rng.uniform(0, 1, n)
    return strips(
        path,
        width=scale * sort.width * rng.uniform(0.75, 1.2, n),
        depth=ROOT_DEPTH + ROOT_SLOPE * np.hypot(*path[:, 0, :2].T),
        roll=np.radians(rng.normal(0, sort.roll, n)),
        twist=np.radians(rng.normal(0, sort.twist, n)),
        band=np.stack([left, left + 0.2], 1),
        kite=sort.kite,
    )


def _organ(organ: Organ, path: Array, scale: float, rng: np.random.Generator) -> Surface:
    """What grows on fitted midribs."""
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
    place = rank // 2 * 2 if organ.arrangement == "pairs" else rank
    s = (place + 0.5 + rng.uniform(-0.2, 0.2, n * k)) / k
    base, tangent = along(path, row, organ.start + (organ.end - organ.start) * s)
    turn = np.radians(rng.uniform(0, 360, n)[row] + rng.normal(0, 15, n * k) + _divergence(organ, rank))
    across = unit(np.cross(tangent, np.broadcast_to([0.31, 0.95, 0.02], tangent.shape)))
    out = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(tangent, across)
    angle = np.radians(organ.angle + rng.normal(0, 10, n * k))[:, None]
    direction = unit(np.cos(angle) * tangent + np.sin(angle) * out - [0, 0, organ.droop])
    size = scale * (1 - (1 - organ.smallest) * s) * np.exp(rng.normal(0, 0.15, n * k))
    upper = np.array([0.0, 0.0, 1.0]) + 0.3 * tangent + rng.normal(0, 0.25, (n * k, 3))
    return kites(base, direction, upper, organ.length * size, organ.width * size, organ.widest)


def _divergence(organ: Leaves, rank: NDArray[np.intp]) -> Array:
    """Angle [deg] about the stalk of each leaf."""
    if organ.arrangement == "pairs":  # each pair across the one before
        return np.asarray(90.0 * (rank // 2) + 180.0 * (rank % 2))
    return np.asarray(137.5 * rank) if organ.arrangement == "spiral" else np.zeros(len(rank))


def _assembled(name: str, parts: list[tuple[Surface, str]], radius: float) -> Mesh:
    """One mesh of surfaces with their materials' names."""
    names = tuple(dict.fromkeys(material for _, material in parts))
    offsets = np.cumsum([0, *(len(s[0]) for s, _ in parts)])
    return Mesh(
        name=name,
        vertices=np.concatenate([s[0] for s, _ in parts]).astype(np.float32),
        normals=np.concatenate([s[1] for s, _ in parts]).astype(np.float32),
        uv=np.concatenate([s[2] for s, _ in parts]).astype(np.float32),
        faces=np.concatenate([s[3] + np.int32(o) for (s, _), o in zip(parts, offsets, strict=False)]),
        material=np.concatenate([np.full(len(s[3]), names.index(material), np.int32) for s, material in parts]),
        materials=names,
        footprint=radius,
    )
