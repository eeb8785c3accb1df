# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The forest beyond the world's edge: some rows of trees, and behind them its roof over the hills."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.backdrop import Cover, Land, rolling_hills, strew_beyond
from fieldtruth.world.grids import distance_beyond
from fieldtruth.world.model import Mesh, Swarm
from fieldtruth.world.placement import Site
from fieldtruth.world.plants import TREES, grow_tree

if TYPE_CHECKING:
    from fieldtruth.world.environments.forest import ForestConfig


FAR_DETAIL: Final = 0.05
FAR_TREES: Final = 12.0
"""Distance [m] from the edge within which the forest goes on as trees; behind it its roof closes the view."""


def canopy(size: tuple[float, float], rng: np.random.Generator) -> Land:
    """Level ground below the trees, then the forest's roof, 10 m up at once, over hills that rise to the horizon."""
    hills = rolling_hills(size, rng, height=16.0)
    waves = [(*rng.normal(0.0, 0.5 / length, 2), rng.uniform(0, 6.3), 0.16 * length**0.7) for length in
             rng.uniform(2.0, 14.0, 24)]  # fmt: skip

    def land(x: Array, y: Array) -> Array:
        off = distance_beyond(size, x, y)
        bumps = sum(height * np.cos(6.3 * (kx * x + ky * y) + phase) for kx, ky, phase, height in waves)
        roof = 9.0 + 0.25 * np.minimum(off - FAR_TREES, 40.0) + bumps
        return np.asarray(hills(x, y) + np.where(off > FAR_TREES + 1.0, roof, 0.0))

    return land


def far_cover(size: tuple[float, float]) -> Cover:
    """The forest's floor below the trees, its roof behind them."""

    def cover(x: Array, y: Array, slope: Array) -> NDArray[np.intp]:
        return (distance_beyond(size, x, y) > FAR_TREES - 1.0).astype(np.intp)

    return cover


def wood_beyond(
    site: Site, config: "ForestConfig", backdrop: Mesh, growth: np.random.Generator, rng: np.random.Generator
) -> list[tuple[Swarm, Sequence[Mesh]]]:
    """The forest goes on beyond the world's edge: trees of little detail, and bushes at the edge itself."""
    trees = [
        grow_tree(
            TREES[name], name=f"far_{name}_{k}", height=float(growth.uniform(9.0, 20.0)), rng=growth,
            detail=FAR_DETAIL, grown_in="stand",
        )
        for name in config.species
        for k in range(2)
    ]  # fmt: skip
    young = [
        grow_tree(TREES[name], name=f"far_young_{name}", height=5.0, rng=growth, detail=4 * FAR_DETAIL)
        for name in ("spruce", "beech")
    ]
    return [
        strew_beyond(
            site.field, config.size, backdrop, "far_trees", "tree", trees, per_m2=0.06, rng=rng, within=FAR_TREES,
            margin=0.8,
        ),
        strew_beyond(
            site.field, config.size, backdrop, "far_young_trees", "tree", young, per_m2=0.05, rng=rng, within=9.0,
            margin=0.8, scales=(0.5, 1.3),
        ),
    ]  # fmt: skip
