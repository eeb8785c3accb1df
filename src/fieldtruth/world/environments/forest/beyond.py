# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The forest beyond the world's edge: some rows of trees, and behind them the canopy over the hills."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.backdrop import Cover, Land, height_beyond, rolling_hills, scatter_beyond
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.grids import distance_beyond
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import FarSwarm, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import TREES, grow_tree

FAR_DETAIL: Final = 0.015
FAR_TREES: Final = 12.0
"""Distance [m] from the edge within which single trees stand; behind them the canopy closes the view."""


def canopy(size: tuple[float, float], rng: np.random.Generator) -> Land:
    """Level ground below the trees, then a step of 14 m up to the canopy, over hills that rise to the horizon."""
    hills = rolling_hills(size, rng, height=16.0)
    waves = [
        (*rng.normal(0.0, 0.5 / length, 2), rng.uniform(0, 6.3), 0.16 * length**0.7)
        for length in rng.uniform(2.0, 14.0, 24)
    ]

    def land(x: Array, y: Array) -> Array:
        outside = distance_beyond(size, x, y)
        bumps = sum(height * np.cos(6.3 * (kx * x + ky * y) + phase) for kx, ky, phase, height in waves)
        roof = 13.0 + 0.25 * np.minimum(outside - FAR_TREES, 40.0) + bumps
        return np.asarray(hills(x, y) + np.where(outside > FAR_TREES + 1.0, roof, 0.0))

    return land


def far_cover(size: tuple[float, float]) -> Cover:
    """Forest floor below the trees, canopy behind them."""

    def cover(x: Array, y: Array, slope: Array) -> Index:
        return (distance_beyond(size, x, y) > FAR_TREES - 1.0).astype(np.intp)

    return cover


def scatter_far_trees(
    builder: WorldBuilder, config: Config, backdrop: Mesh, growth: np.random.Generator, rng: np.random.Generator
) -> list[FarSwarm]:
    """Trees of little detail around the world, with young ones at the edge."""
    trees = [
        grow_tree(
            TREES[name],
            name=f"far_{name}_{k}",
            height=float(growth.uniform(13.0, 24.0)),
            rng=growth,
            detail=FAR_DETAIL,
            grown_in="stand",
        )
        for name in config.species
        for k in range(2)
    ]
    young = [
        grow_tree(TREES[name], name=f"far_young_{name}", height=5.0, rng=growth, detail=4 * FAR_DETAIL)
        for name in ("spruce", "beech")
    ]
    ground = height_beyond(builder.field, config.size, backdrop)
    old_spec = SwarmSpec(name="far_trees", kind="tree", meshes=trees, per_m2=0.065)
    young_spec = SwarmSpec(name="far_young_trees", kind="tree", meshes=young, per_m2=0.055, scales=(0.5, 1.4))
    return [
        scatter_beyond(config.size, ground, old_spec, rng, within=FAR_TREES, margin=0.8),
        scatter_beyond(config.size, ground, young_spec, rng, within=10.0, margin=0.8),
    ]
