# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees of the park, at crown's distance."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.model import Instance
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, eased, place_until_count, random_tint
from fieldtruth.world.plants import TREES, grow_tree

COMMON: Final = ("lime", "birch", "oak")
RARE: Final[Mapping[str, tuple[str, ...]]] = {"large_tree": ("beech", "spruce", "pine"), "small_tree": ("beech",)}
"""Species: several individuals are grown of common ones, one of each rare one."""

ALIKE: Final = 14.0
"""Distance [m] within which two trees are not copies of one individual if another individual is available."""
OFF_TRAIL: Final = 1.6  # [m]
TRIES: Final = 6000


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant large trees, then small ones between them, none on a trail."""
    few = config.individuals
    for kind, heights, count, spacing, detail in (
        ("large_tree", (9.5, 14.5), config.large_trees, 7.0, 0.4),
        ("small_tree", (3.2, 5.0), config.small_trees, 4.0, 0.6),
    ):
        # The rare ones come second, so that each is planted even if there are few trees.
        names = [(name, 0) for name in COMMON] + [(name, 0) for name in RARE[kind] if few > 1]
        names += [(name, k) for k in range(1, few) for name in COMMON]
        trees = [
            grow_tree(
                TREES[name],
                name=f"{kind}_{name}_{k}",
                height=float(growth.uniform(*heights)),
                rng=growth,
                detail=detail,
            )
            for name, k in names
        ]
        group = ObjectGroup(kind=kind, meshes=trees, count=count, spacing=spacing, scales=(0.9, 1.12), tint=0.07)
        _scatter_varied(builder, group, rng)


def _scatter_varied(builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator) -> None:
    """Scatter trees so that neighbours are different individuals and all are used about equally often.

    Draws ``TRIES`` positions at first; then for each candidate that keeps the spacing a scale, and for a placed tree
    yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free even at about half the spacing.
    """
    darts = builder.random_positions(builder.tries(TRIES), rng)
    hits = darts[builder.trail_distance(darts) > OFF_TRAIL]
    planted: list[tuple[Array, int]] = []

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        if not apart:
            return None
        used = [row for _, row in planted]
        near = {row for other, row in planted if np.hypot(*(other - xy)) < ALIKE}
        row = min(range(len(group.meshes)), key=lambda k: (k in near, used.count(k), k))
        mesh, scale = group.meshes[row], float(rng.uniform(*group.scales))
        if not builder.is_free(xy, mesh.footprint * scale):
            return None
        planted.append((xy, row))
        yaw = float(rng.uniform(0.0, 2.0 * np.pi))
        return builder.add_upright(group.kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, group.tint))

    spacings = eased(group.spacing, (1.0, 0.85, 0.7, 0.55))
    group.check_complete(place_until_count(group.count, hits, attempt, spacings=spacings))
