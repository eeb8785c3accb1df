# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The hillside beyond the world's edge: bushes, few trees, grass and boulders."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.backdrop import height_beyond, scatter_beyond
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import FarSwarm, SwarmSpec, WorldBuilder
from fieldtruth.world.plants import BUSHES, TREES, grow_bush, grow_tree
from fieldtruth.world.rocks import ROCK_TYPES, make_rock


def scatter_far_plants(
    builder: WorldBuilder, backdrop: Mesh, tufts: Sequence[Mesh], rng: np.random.Generator
) -> list[FarSwarm]:
    """Bushes, few trees and grass."""
    bushes = [
        grow_bush(BUSHES[name], name=f"far_{name}_{k}", height=BUSHES[name].grown.height * share, rng=rng, detail=0.1)
        for name in ("juniper", "gorse")
        for k, share in enumerate((0.7, 1.0))
    ]
    trees = [
        grow_tree(TREES[name], name=f"far_{name}_{k}", height=float(rng.uniform(*heights)), rng=rng, detail=0.04)
        for name, heights in (("pine", (6.6, 9.5)), ("oak", (4.0, 6.0)))
        for k in range(2)
    ]
    size, ground = builder.size, height_beyond(builder.field, builder.size, backdrop)
    bush_spec = SwarmSpec(name="far_bushes", kind="bush", meshes=bushes, per_m2=0.022, scales=(0.6, 1.3), tilt=0.4)
    tree_spec = SwarmSpec(name="far_trees", kind="tree", meshes=trees, per_m2=0.0013, sink=0.1)
    grass_spec = SwarmSpec(name="far_grass", kind="high_grass", meshes=tufts, per_m2=0.5, sink=0.03)
    return [
        scatter_beyond(size, ground, bush_spec, rng),
        scatter_beyond(size, ground, tree_spec, rng, margin=3.0),
        scatter_beyond(size, ground, grass_spec, rng, within=22.0, margin=0.3),
    ]


def scatter_far_rocks(builder: WorldBuilder, backdrop: Mesh, rng: np.random.Generator) -> FarSwarm:
    """Boulders."""
    rocks = [
        make_rock(ROCK_TYPES[name], name=f"far_{name}_{k}", size=size, rng=rng, triangles=320, solid=False)
        for k, size in enumerate((0.7, 1.2, 2.2))
        for name in ("granite", "crag")
    ]
    ground = height_beyond(builder.field, builder.size, backdrop)
    spec = SwarmSpec(name="far_rocks", kind="rock", meshes=rocks, per_m2=0.016, scales=(0.5, 1.4), tilt=0.75, sink=0.1)
    return scatter_beyond(builder.size, ground, spec, rng, within=75.0, margin=1.8)
