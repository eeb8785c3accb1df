# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rugged hillside (paper, 2.2.4): a mountain's flank, dry and rocky, with sparse high grass, bushes and trees.

It stands for heath on granite: one rock type, and plants that avoid lime (docs/environments.md has the sources). The
mountain rises towards +y (west), the valley falls towards -y; a shoulder along x between them can be driven.
"""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import make_backdrop
from fieldtruth.world.environments.hillside.beyond import (
    scatter_far_plants,
    scatter_far_rocks,
)
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.hillside.ground import as_terrain, make_ground
from fieldtruth.world.environments.hillside.plants import plant_bushes, plant_grass, plant_trees
from fieldtruth.world.environments.hillside.rocks import place_rocks, scatter_stones
from fieldtruth.world.grids import Line
from fieldtruth.world.model import World
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_layer


def build(seed: int, corridors: Sequence[Line], config: Config | None = None) -> World:
    """Build a hillside; ``corridors`` are moderately steep and free of obstacles.

    The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    config = config if config is not None else Config()
    seeds = np.random.SeedSequence(seed).spawn(9)
    relief, cover, rocks, stones, plants, grass, beyond = (np.random.default_rng(s) for s in seeds[:7])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[8].spawn(2))
    ground, land = make_ground(config, corridors, (relief, cover, microrelief))
    builder = WorldBuilder(ground.field, config.size, (), corridors, corridor_width=2.6)
    place_rocks(builder, ground, config, rocks)
    plant_trees(builder, ground, config, plants)
    plant_bushes(builder, ground, config, plants)
    scatter_stones(builder, ground, config, stones)
    tufts = plant_grass(builder, ground, config, grass)
    backdrop = make_backdrop(
        ground.field, config.size, "heath", np.random.default_rng(beyond.integers(2**63)), land=land
    )
    return assemble(
        builder,
        with_layer(as_terrain(ground, config.size), layer),
        name="hillside",
        seed=seed,
        textures=seeds[7],
        backdrop=backdrop,
        beyond=[*scatter_far_plants(builder, backdrop, tufts, beyond), scatter_far_rocks(builder, backdrop, beyond)],
        litter=config.litter,
    )
