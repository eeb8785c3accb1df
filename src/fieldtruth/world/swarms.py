# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Swarms: their specification, positions spread over an area, and assembly."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh, Swarm
from fieldtruth.world.poses import random_tints

Density = Callable[[Array], Array]
"""Share [0, 1] of the objects that are kept at positions (n, 2)."""

FarSwarm = tuple[Swarm, Sequence[Mesh]]
"""A swarm outside the world's edge, with its meshes."""


@dataclass(frozen=True, kw_only=True)
class SwarmSpec:
    """Many small objects to spread over an area."""

    name: str
    kind: str
    meshes: Sequence[Mesh]
    per_m2: float
    """Density before it is thinned."""
    scales: tuple[float, float] = (0.8, 1.25)
    tint: float = 0.1
    """Spread of the brightness, see ``random_tint``."""
    tilt: float = 0.0
    """Share of the ground's slope by which they lean: 0 is upright, 1 at right angles to the ground."""
    lean_deg: float = 0.0
    """Standard deviation [deg] of a random lean, inside the world only."""
    sink: float = 0.0
    """Depth [m] below the ground, times the scale."""
    clear: float = 0.0
    """Distance [m] kept from obstacles and from the corridors' centre lines, inside the world only."""
    aside: float = 0.0
    """Distance [m] kept from the corridors' centre lines by stones that a robot cannot drive over."""


def jittered_grid(
    span: Array, per_m2: float, rng: np.random.Generator, density: Density | None = None, keep: Density | None = None
) -> Array:
    """Positions (n, 2) about the origin, stratified so that they neither clump nor line up.

    One position is drawn uniformly in each cell of a grid over ``span`` (x, y) [m], in rows along y, then a number in
    [0, 1) for each. Positions where ``keep`` is 0 and those whose number is not below ``density`` are dropped.
    """
    cells = np.maximum(1, np.round(span * np.sqrt(per_m2))).astype(int)
    grid = np.stack(np.meshgrid(*(np.arange(c) for c in cells), indexing="ij"), axis=-1).reshape(-1, 2)
    xy = (grid + rng.random(grid.shape)) / cells * span - span / 2
    chance = rng.random(len(xy))
    if keep is not None:
        inside = keep(xy).astype(np.bool_)
        xy, chance = xy[inside], chance[inside]
    return np.asarray(xy if density is None else xy[chance < density(xy)])


def random_scales(rng: np.random.Generator, scales: tuple[float, float], count: int) -> Array:
    """Scales (count,) whose logarithm is uniform between those of the two ``scales``."""
    return np.exp(rng.uniform(np.log(scales[0]), np.log(scales[1]), count))


def make_swarm(
    name: str, kind: str, meshes: Sequence[Mesh], poses: Array, rng: np.random.Generator | None, *, tint: float = 0.1
) -> Swarm:
    """Assemble a swarm at poses (n, 4, 4); ``assemble`` sets its instance id when all objects are known.

    Draws the mesh of each pose, then the tints. Without a generator meshes are used in turn, untinted.
    """
    n = len(poses)
    if rng is None:
        rows, tints = np.arange(n) % len(meshes), np.ones((n, 3), np.float32)
    else:
        rows, tints = rng.integers(len(meshes), size=n), random_tints(rng, tint, n)
    return Swarm(
        name=name,
        kind=kind,
        object_id=0,
        meshes=tuple(mesh.name for mesh in meshes),
        mesh=rows.astype(np.int32),
        world_from_object=poses,
        tint=tints,
    )
