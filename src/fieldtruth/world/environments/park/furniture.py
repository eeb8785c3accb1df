# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Furniture of the park: lamp posts, benches, trash bins and tables."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.furniture import make_bench, make_lamp_post, make_table, make_trash_bin
from fieldtruth.world.model import Instance
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, place_until_count, random_tint


def furnish(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Add benches and lamps along the trails, bins beside benches, tables on the lawn."""
    lamps = ObjectGroup(kind="lamp_post", meshes=[make_lamp_post(0)], count=config.lamp_posts, spacing=9.0, tint=0.03)
    builder.along_trails(lamps, rng, offset=0.45)
    benches = ObjectGroup(
        kind="bench", meshes=[make_bench(k) for k in range(3)], count=config.benches, spacing=6.0, tint=0.08
    )
    seats = builder.along_trails(benches, rng, offset=0.95)
    _place_bins(builder, config.trash_bins, seats, rng)

    def on_lawn(xy: Array) -> Mask:
        return np.abs(builder.trail_distance(xy) - 4.5) < 2.5

    tables = ObjectGroup(
        kind="table", meshes=[make_table(k) for k in range(2)], count=config.tables, spacing=5.0, tint=0.08
    )
    builder.scatter(tables, rng, on_lawn)


def _place_bins(builder: WorldBuilder, count: int, benches: Sequence[Instance], rng: np.random.Generator) -> None:
    """Add at most one bin beside each bench, the rest along the trails.

    Draws the order of the benches at first, then the tint of each placed bin.
    """
    bins = [make_trash_bin(k) for k in range(2)]
    candidates = []
    for row in rng.permutation(len(benches)):
        pose = benches[row].world_from_object
        for side in (1.0, -1.0):
            x, y, _, _ = pose @ [-0.05, side * 1.45, 0.0, 1.0]
            candidates.append(np.array([x, y, np.arctan2(pose[1, 0], pose[0, 0]), row]))
    served: set[float] = set()

    def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
        x, y, yaw, row = candidate
        mesh = bins[number % len(bins)]
        if row in served or not builder.is_free((x, y), mesh.footprint):
            return None
        served.add(row)
        return builder.add_upright("trash_bin", mesh, (x, y), yaw=float(yaw), tint=random_tint(rng, 0.06))

    placed = len(place_until_count(count, candidates, attempt))
    if placed < count:
        rest = ObjectGroup(kind="trash_bin", meshes=bins, count=count - placed, spacing=5.0, tint=0.06)
        builder.along_trails(rest, rng, offset=0.6)
