# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks of the forest: field stones in groups, small stones scattered around them."""

from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.placement import ObjectGroup, SwarmSpec, WorldBuilder
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks

GROUPS: Final = 14 / 5000  # per m^2


def place_rocks(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Add field stones with colliders and a swarm of small stones."""
    groups = cKDTree(builder.random_positions(round(builder.size[0] * builder.size[1] * GROUPS), rng))

    def near_centres(xy: Array) -> Array:
        away, _ = groups.query(xy)
        return np.asarray((0.12 + 0.88 * np.exp(-((away / 2.6) ** 2))) * (builder.trail_distance(xy) > 0.3))

    fieldstone = ROCK_TYPES["fieldstone"]
    rocks = [
        make_rock(fieldstone, name=f"rock_{k}", size=float(size), rng=rng, triangles=700)
        for k, size in enumerate(np.geomspace(0.35, 1.5, 8))
    ]
    group = ObjectGroup(kind="rock", meshes=rocks, count=config.rocks, spacing=0.6, scales=(0.85, 1.2), tint=0.08)
    scatter_rocks(builder, group, rng, near_centres)
    stones = [
        make_rock(fieldstone, name=f"stone_{k}", size=float(size), rng=rng, triangles=80, solid=False)
        for k, size in enumerate(np.geomspace(0.06, 0.22, 8))
    ]
    spec = SwarmSpec(
        name="small_stones",
        kind="stone",
        meshes=stones,
        per_m2=config.stones_per_m2 * 3,
        scales=(0.7, 1.3),
        tint=0.12,
        tilt=1.0,
        clear=0.45,
        aside=1.15,
    )
    builder.scatter_swarm(spec, rng, lambda xy: np.clip(1.4 * near_centres(xy), 0.0, 1.0))
