# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The urban park (paper, 2.2.1): almost plane ground, two trails, trees, bushes, lamps, benches, tables, bins."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.assembly import assemble
from fieldtruth.world.environments.park.beds import edge_beds, lay_beds
from fieldtruth.world.environments.park.beyond import make_surroundings
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.environments.park.furniture import furnish
from fieldtruth.world.environments.park.ground import cover_ground, make_heights
from fieldtruth.world.environments.park.herbs import plant_herbs
from fieldtruth.world.environments.park.plants import plant_trees
from fieldtruth.world.grids import Line, make_trails
from fieldtruth.world.model import World
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_layer


def build(seed: int, corridors: Sequence[Line], config: Config | None = None) -> World:
    """Build a park; ``corridors`` stay free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    config = config if config is not None else Config()
    seeds = np.random.SeedSequence(seed).spawn(10)
    relief, plants, trees, bushes, furniture, cover, land, herbs = (np.random.default_rng(s) for s in seeds[:8])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[9].spawn(2))
    trails = make_trails(config.trails, config.trail_width)
    builder = WorldBuilder(make_heights(config, trails, relief, microrelief), config.size, trails, corridors)
    furnish(builder, config, furniture)
    plant_trees(builder, config, trees, plants)
    beds = lay_beds(builder, config.bushes, bushes)
    edge_beds(builder, beds, herbs)
    plant_herbs(builder, beds, config.herbs, herbs)
    terrain = with_layer(cover_ground(builder, beds, config.border_width, cover), layer)
    backdrop, beyond = make_surroundings(builder, terrain, config.beyond, land)
    return assemble(
        builder,
        terrain,
        name="park",
        seed=seed,
        textures=seeds[8],
        backdrop=backdrop,
        beyond=beyond,
        litter=config.litter,
    )
