# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The lake's surroundings beyond the world's edge: bed, far shores, groves, woods and grass."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.environments.lake.plants import BELOW_WIRES, MEADOW_TREES, WATERSIDE_TREES, make_clumps
from fieldtruth.world.environments.lake.power_line import PowerLine
from fieldtruth.world.grids import noise_map
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import (
    Density,
    FarSwarm,
    SwarmSpec,
    WorldBuilder,
    make_swarm,
    random_scales,
    upright_poses,
)
from fieldtruth.world.plants import BUSHES, TREES, grow_bush, grow_tree

FAR_DETAIL: Final = 0.02
NEAR_DETAIL: Final = 0.1
SPACING: Final = 7.0  # [m] mean distance between positions where a far tree may stand
SCRUB_DETAIL: Final = 0.1
WOODS_RADIUS: Final = 380.0  # [m] from the centre to the last trees
AREA: Final = (900.0, 900.0)  # [m] over which groves and woods vary


def make_lake_backdrop(builder: WorldBuilder, basin: Land, level: float, rng: np.random.Generator) -> Mesh:
    """The lake's bed and far shores: mud below the water where triangles are small enough, meadow elsewhere."""

    def cover(x: Array, y: Array, _slope: Array) -> Index:
        return np.asarray((basin(x, y) < level + 0.1) & (np.hypot(x, y) < 110.0), np.intp)

    return make_backdrop(builder.field, builder.size, ("meadow", "mud"), rng, land=basin, cover=cover)


def ground_height(builder: WorldBuilder, backdrop: Mesh) -> Callable[[Array], Array]:
    """Height [m] of the ground as a function of positions (n, 2), inside the world and beyond its edge."""
    beyond, half = height_beyond(builder.field, builder.size, backdrop), np.array(builder.size) / 2

    def height(xy: Array) -> Array:
        inside = np.asarray((np.abs(xy) < half).all(axis=1))
        x, y = np.where(inside[:, None], 2 * half, xy).T  # any valid position where the value is not used
        return np.where(inside, builder.field.height_at(*xy.T), beyond(x, y))

    return height


def scatter_far_plants(
    builder: WorldBuilder, backdrop: Mesh, basin: Land, level: float, line: PowerLine, rng: np.random.Generator
) -> list[FarSwarm]:
    """Groves and grass near the edge, woods along the far shore and on its hills."""
    far_trees, near_trees = (_make_trees(name, d, rng) for name, d in (("far", FAR_DETAIL), ("beyond", NEAR_DETAIL)))
    grass = make_clumps({"meadow": 0.7, "dry": 0.3}, "far_grass", 0.7, 7.0, 3, rng)
    grove, wood = noise_map(AREA, 45.0, rng), noise_map(AREA, 110.0, rng)

    def above_water(xy: Array) -> Array:
        return np.asarray(basin(*xy.T) - level)

    def near(xy: Array) -> Array:
        height, thick = above_water(xy), grove(xy)
        wooded = ((height > 0.5) & (height < 1.6) & (thick > 0.1)) | ((height > 2.0) & (thick > 0.35))
        return (wooded & (line.distance(xy) > BELOW_WIRES + 1.0)).astype(np.float64)

    def turf(xy: Array) -> Array:
        return np.asarray((above_water(xy) > 0.8) * np.clip(0.45 + 0.4 * grove(xy), 0.0, 1.0))

    def scrub(xy: Array) -> Array:
        return np.clip(0.8 * grove(xy) + 0.25 * (above_water(xy) > 0.5), 0.0, 1.0) * (above_water(xy) > 0.4)

    bushes = [
        grow_bush(BUSHES[name], name=f"far_{name}_{k}", height=height, rng=rng, detail=SCRUB_DETAIL)
        for name, height in (("hazel", 2.8), ("grey_willow", 2.4))
        for k in range(2)
    ]
    scrub_spec = SwarmSpec(name="scrub_beyond", kind="bush", meshes=bushes, per_m2=0.02, scales=(0.4, 1.5), sink=0.05)
    size, ground = builder.size, height_beyond(builder.field, builder.size, backdrop)
    grass_spec = SwarmSpec(name="high_grass_beyond", kind="high_grass", meshes=grass, per_m2=0.9, tilt=1.0)
    tree_spec = SwarmSpec(
        name="trees_beyond", kind="tree", meshes=near_trees, per_m2=0.035, scales=(0.55, 1.3), sink=0.1
    )
    return [
        scatter_beyond(size, ground, grass_spec, rng, within=14.0, margin=0.6, density=turf),
        scatter_beyond(size, ground, tree_spec, rng, within=90.0, margin=3.0, density=near),
        _far_woods(far_trees, basin, level, grove, wood, rng),
        scatter_beyond(size, ground, scrub_spec, rng, within=98.0, margin=5.0, density=scrub),
    ]


def _make_trees(name: str, detail: float, rng: np.random.Generator) -> list[Mesh]:
    """Two trees of each species."""
    return [
        grow_tree(
            TREES[species], name=f"{name}_{species}_{k}", height=float(rng.uniform(*heights)), rng=rng, detail=detail
        )
        for k in range(2)
        for species, heights in {**WATERSIDE_TREES, **MEADOW_TREES}.items()
    ]


def _far_woods(
    trees: Sequence[Mesh], basin: Land, level: float, grove: Density, wood: Density, rng: np.random.Generator
) -> FarSwarm:
    """Trees in a belt along the far water and in woods above it, outside the blend from the world's edge.

    Draws independent positions, a third of them in groups of three, a number for each, scales, yaws, meshes and tints.
    """
    xy = rng.uniform(-WOODS_RADIUS, WOODS_RADIUS, (round((2 * WOODS_RADIUS / SPACING) ** 2), 2))
    third = len(xy) // 9
    xy[: 3 * third] = np.repeat(xy[:third], 3, axis=0) + rng.normal(0.0, 2.5, (3 * third, 2))
    height = basin(*xy.T)
    above, away = height - level, np.hypot(*xy.T)
    thick = np.where(above < 3.2, 0.75 + 0.3 * grove(xy), 0.45 + 0.5 * wood(xy))
    wooded = (above > 0.3) & (away > 115.0) & (away < WOODS_RADIUS) & (rng.random(len(xy)) < np.clip(thick, 0.04, 1))
    xy, height = xy[wooded], height[wooded]
    n = len(xy)
    scale = random_scales(rng, (0.45, 1.45), n)
    poses = upright_poses(xy, rng.uniform(0.0, 2 * np.pi, n), scale)
    poses[:, 2, 3] = height - 0.4  # the land's triangles are large there
    return make_swarm("woods_beyond", "tree", trees, poses, rng, tint=0.12), trees
