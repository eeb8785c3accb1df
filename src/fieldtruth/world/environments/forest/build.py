# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The dense forest (paper, 2.2.3): trees on uneven ground, two trails, high grass, stones, bushes, fallen trunks."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import make_backdrop
from fieldtruth.world.environments.forest.beyond import canopy, far_cover, scatter_far_trees
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.environments.forest.deadwood import place_deadwood
from fieldtruth.world.environments.forest.ground import cover_ground, make_glades, make_heights, raise_roots
from fieldtruth.world.environments.forest.plants import plant_bushes, plant_herbs, plant_trees
from fieldtruth.world.environments.forest.rocks import place_rocks
from fieldtruth.world.environments.forest.understorey import plant_understorey
from fieldtruth.world.grids import Line, make_trails
from fieldtruth.world.model import World
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_layer


def build(seed: int, corridors: Sequence[Line], config: Config | None = None) -> World:
    """Build a forest; ``corridors`` stay free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    config = config if config is not None else Config()
    seeds = np.random.SeedSequence(seed).spawn(12)
    relief, growth, trees, dead, bushes, stones, herbs, cover, land = (np.random.default_rng(s) for s in seeds[:9])
    microrelief, layer, roots = (np.random.default_rng(s) for s in seeds[10].spawn(3))
    trails = make_trails(config.trails, config.trail_width)
    builder = WorldBuilder(make_heights(config, trails, relief, microrelief), config.size, trails, corridors)
    place_deadwood(builder, config, dead)
    plant_trees(builder, config, growth, trees)
    raise_roots(builder, roots)
    place_rocks(builder, config, stones)
    plant_bushes(builder, config, bushes)
    glades = make_glades(config.size, herbs)
    plant_herbs(builder, config, glades, herbs)
    plant_understorey(builder, config, glades, np.random.default_rng(seeds[11]))
    backdrop = make_backdrop(
        builder.field,
        config.size,
        ("needles", "canopy"),
        land,
        land=canopy(config.size, land),
        cover=far_cover(config.size),
    )
    return assemble(
        builder,
        with_layer(cover_ground(builder, glades, cover), layer),
        name="forest",
        seed=seed,
        textures=seeds[9],
        backdrop=backdrop,
        beyond=scatter_far_trees(builder, config, backdrop, growth, land),
        litter=config.litter,
    )
