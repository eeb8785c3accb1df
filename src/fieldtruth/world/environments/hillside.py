# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rugged hillside (paper, 2.2.4): a mountain's flank, dry and rocky, with sparse high grass, bushes and trees.

The mountain rises towards +y (west), the valley falls towards -y; a shoulder between them, along x, can be driven.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import Field

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Frozen, Number, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Land, make_backdrop
from fieldtruth.world.environments.hillside_flora import plant, strew_grass, vegetate_beyond
from fieldtruth.world.environments.hillside_ground import FAR_MATERIALS, Ground, far_cover, look_at, terrain
from fieldtruth.world.environments.hillside_rocks import lay_rocks, rocks_beyond, strew_stones
from fieldtruth.world.environments.layout import Count, Density, Individuals, Size
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Heightfield, World
from fieldtruth.world.placement import Site
from fieldtruth.world.relief.mountain import along_routes, mountain
from fieldtruth.world.trails import Line


class HillsideConfig(Frozen):
    """How the hillside lies, and what lies and grows on it."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    roughness: Annotated[Number, Field(ge=0, le=3)] = 1.3  # [m], deviation of the noise from which erosion starts
    gullies: Annotated[Number, Field(ge=0, le=4)] = 1.0  # what streams cut, 1 is usual
    steepest_deg: Annotated[Number, Field(ge=15, le=40)] = 36.0  # anywhere
    route_slope_deg: Annotated[Number, Field(ge=5, le=15)] = 13.0  # on the routes
    crags: Count = 26  # outcrops of 2 to 3 m
    boulders: Count = 34  # 1 to 2 m
    blocks: Count = 44  # 0.4 to 1 m
    slabs: Count = 16
    stones: Density = 3.0  # per m^2 at most, 10 to 25 cm
    pebbles: Density = 5.0  # per m^2 at most, 3 to 9 cm
    junipers: Count = 18
    gorse: Count = 40
    cushions: Count = 60  # heather
    pines: Count = 6
    oaks: Count = 6
    snags: Count = 3
    grass: Density = 7.0  # tufts per m^2 at most
    individuals: Individuals = 3  # of each kind and size


def build_hillside(seed: int, corridors: Sequence[Line], config: HillsideConfig | None = None) -> World:
    """Lay out a hillside; ``corridors`` are lines that robots drive: gentle, and free. Same arguments, same world."""
    config = config if config is not None else HillsideConfig()
    seeds = np.random.SeedSequence(seed).spawn(8)
    relief, cover, rocks, stones, flora, grass, beyond = (np.random.default_rng(s) for s in seeds[:-1])
    ground, land = _flank(config, corridors, relief, cover)
    site = Site(ground.field, config.size, (), corridors, corridor_width=2.6)
    lay_rocks(site, ground, rocks, crags=config.crags, boulders=config.boulders, blocks=config.blocks,
              slabs=config.slabs, individuals=config.individuals)  # fmt: skip
    plant(site, ground, flora, pines=config.pines, oaks=config.oaks, snags=config.snags, junipers=config.junipers,
          gorse=config.gorse, cushions=config.cushions, individuals=config.individuals)  # fmt: skip
    strew_stones(site, ground, stones, stones=config.stones, pebbles=config.pebbles)
    tufts = strew_grass(site, ground, grass, per_m2=config.grass)
    rng = np.random.default_rng(beyond.integers(2**63))
    backdrop = make_backdrop(
        ground.field, config.size, FAR_MATERIALS, rng, land=land, cover=far_cover(config.size, rng)
    )
    return assemble(
        site,
        terrain(ground, config.size),
        name="hillside",
        seed=seed,
        textures=seeds[-1],
        backdrop=backdrop,
        beyond=[
            *vegetate_beyond(ground.field, config.size, backdrop, tufts, beyond),
            rocks_beyond(ground.field, config.size, backdrop, beyond),
        ],
    )


def _flank(
    config: HillsideConfig, corridors: Sequence[Line], relief: np.random.Generator, cover: np.random.Generator
) -> tuple[Ground, Land]:
    """The ground of the world and the land beyond it."""
    x, y = grid_axes(config.size, config.grid)
    distance = _route_distance(corridors)
    shape = mountain(
        x, y, route_distance=distance, rng=relief, roughness=config.roughness, gullies=config.gullies,
        route_slope_deg=config.route_slope_deg, steepest_deg=config.steepest_deg,
    )  # fmt: skip
    heights = along_routes(
        shape.heights, config.grid, distance(*np.meshgrid(x, y, indexing="ij")),
        route_slope_deg=config.route_slope_deg, steepest_deg=config.steepest_deg,
    )  # fmt: skip
    field = Heightfield(heights=heights.astype(np.float32), spacing=config.grid, x0=float(x[0]), y0=float(y[0]))
    return look_at(field, shape.drained, distance, cover), shape.land


def _route_distance(corridors: Sequence[Line]) -> Land:
    """Distance [m] of places to the nearest corridor's middle, to 3 cm; infinite beyond 20 m."""
    if not corridors:
        return lambda x, _: np.full(np.shape(x), np.inf)
    from scipy.spatial import cKDTree  # late: a list of environments needs no trees

    tree = cKDTree(np.concatenate([line.points for line in corridors]))

    def distance(x: Array, y: Array) -> Array:
        return np.asarray(tree.query(np.stack([x, y], axis=-1), distance_upper_bound=20.0)[0])

    return distance


__all__ = ["HillsideConfig", "build_hillside"]
