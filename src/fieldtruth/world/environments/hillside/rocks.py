# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks of the hillside, all of granite: outcrops on steep slopes, boulders below them, stones in scree and gullies."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.hillside.ground import Ground
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import ObjectGroup, SwarmSpec, WorldBuilder
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks


def place_rocks(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Add rocks with colliders, large ones first."""

    def steep(xy: Array) -> Array:
        return np.clip((ground.slope_deg(xy) - 17) / 10, 0.02, 1)

    def rolled(xy: Array) -> Array:
        return np.clip(0.15 + ground.scree(xy) + 0.5 * ground.rock(xy), 0, 1)

    few = config.individuals
    crags = _make_rocks("crag", "crag", (2.2, 3.0), 2400, 2 * few, rng)
    boulders = _make_rocks("granite", "boulder", (1.1, 1.8), 1600, 2 * few, rng)
    blocks = _make_rocks("granite scree", "block", (0.45, 0.85), 720, 2 * few, rng)
    slabs = _make_rocks("slab", "slab", (0.7, 1.5), 900, few, rng)
    for kind, meshes, count, density, spacing, scales in (
        ("crag", crags, config.crags, steep, 2.6, (0.8, 1.25)),
        ("boulder", boulders, config.boulders, rolled, 3.0, (0.85, 1.2)),
        ("rock", blocks, config.blocks, rolled, 1.2, (0.75, 1.3)),
        ("slab", slabs, config.slabs, rolled, 1.5, (0.7, 1.2)),
    ):
        group = ObjectGroup(kind=kind, meshes=meshes, count=count, spacing=spacing, scales=scales, tint=0.08)
        scatter_rocks(builder, group, rng, density)


def scatter_stones(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Scatter swarms of stones, off the corridors' centre lines, and of pebbles."""

    def loose(xy: Array) -> Array:
        return np.clip(0.12 + 0.9 * ground.scree(xy) + 0.5 * ground.rock(xy), 0, 1)

    def gravel(xy: Array) -> Array:
        return np.clip(1 - 0.85 * ground.turf(xy) - 0.4 * ground.rock(xy), 0, 1)

    stones = _make_rocks("scree granite slab", "stone", (0.13, 0.2), 180, 4, rng)
    pebbles = _make_rocks("scree granite", "pebble", (0.04, 0.07), 80, 5, rng)
    if config.stones:
        spec = SwarmSpec(
            name="stones",
            kind="rock",
            meshes=stones,
            per_m2=config.stones,
            scales=(0.65, 1.4),
            tilt=0.9,
            lean_deg=8,
            clear=0.9,
            aside=1.45,
        )
        builder.scatter_swarm(spec, rng, loose)
    if config.pebbles:
        spec = SwarmSpec(
            name="pebbles",
            kind="rock",
            meshes=pebbles,
            per_m2=config.pebbles,
            scales=(0.6, 1.5),
            tint=0.12,
            tilt=0.9,
            lean_deg=12,
        )
        builder.scatter_swarm(spec, rng, gravel)


def _make_rocks(
    types: str, name: str, sizes: tuple[float, float], triangles: int, count: int, rng: np.random.Generator
) -> list[Mesh]:
    """Make ``count`` rocks of each of the types (words), of sizes between two bounds [m]."""
    return [
        make_rock(
            ROCK_TYPES[rock_type],
            name=f"{name}_{rock_type}_{k}",
            size=float(rng.uniform(*sizes)),
            rng=rng,
            triangles=triangles,
            solid=sizes[1] > 0.3,
        )
        for k in range(count)
        for rock_type in types.split()
    ]
