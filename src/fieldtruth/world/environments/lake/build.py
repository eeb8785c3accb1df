# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The lake's shore (paper, 2.2.2): a lake, its shore, high grass, bushes and trees, two power poles with their wires.

The ground is a few metres above the water and descends to it over beaches and scarps.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fieldtruth.world.assembly import assemble
from fieldtruth.world.environments.lake.basin import basin_heights
from fieldtruth.world.environments.lake.beyond import ground_height, make_lake_backdrop, scatter_far_plants
from fieldtruth.world.environments.lake.config import Config
from fieldtruth.world.environments.lake.ground import cover_ground
from fieldtruth.world.environments.lake.plants import plant_bushes, plant_grass, plant_trees
from fieldtruth.world.environments.lake.power_line import string_line
from fieldtruth.world.environments.lake.shore import make_shore
from fieldtruth.world.grids import Line
from fieldtruth.world.model import Mesh, World
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_layer

WATER_TILE: Final = 30.0  # [m] of water that its texture covers


def build(seed: int, corridors: Sequence[Line], config: Config | None = None) -> World:
    """Build a lake's shore; ``corridors`` stay dry and free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    config = config if config is not None else Config()
    seeds = np.random.SeedSequence(seed).spawn(10)
    shape, wires, growth, trees, bushes, grass, cover, land = (np.random.default_rng(s) for s in seeds[:8])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[9].spawn(2))
    shore = make_shore(config, corridors, shape, microrelief)
    builder = WorldBuilder(shore.field, config.size, (), corridors)
    basin = basin_heights(config, land)
    backdrop = make_lake_backdrop(builder, basin, config.water_level, land)
    _add_water(builder, config.water_level)
    line = string_line(builder, config, ground_height(builder, backdrop), wires)
    plant_trees(builder, shore, line, config, growth, trees)
    plant_bushes(builder, shore, config, bushes)
    plant_grass(builder, shore, config, grass)
    return assemble(
        builder,
        with_layer(cover_ground(builder, shore, cover), layer),
        name="lake",
        seed=seed,
        textures=seeds[8],
        backdrop=backdrop,
        beyond=[*line.beyond, *scatter_far_plants(builder, backdrop, basin, config.water_level, line, land)],
        litter=config.litter,
    )


def _add_water(builder: WorldBuilder, level: float) -> None:
    """Add one flat sheet that extends below the land, so that the water's edge is where the ground meets it."""
    x, y = (np.linspace(low, high, 25) for low, high in ((-900.0, 900.0), (-900.0, 40.0)))
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((25, 25))], axis=-1).reshape(-1, 3)
    a = (np.arange(24)[:, None] * 25 + np.arange(24)).ravel()
    faces = np.stack([a, a + 25, a + 26, a, a + 26, a + 1], axis=-1).reshape(-1, 3)
    sheet = Mesh(
        name="lake",
        vertices=vertices.astype(np.float32),
        normals=np.tile(np.array([0, 0, 1], np.float32), (len(vertices), 1)),
        uv=(vertices[:, :2] / WATER_TILE).astype(np.float32),
        faces=faces.astype(np.int32),
        material=np.zeros(len(faces), np.int32),
        materials=("water",),
        footprint=0.0,
    )
    pose = np.eye(4)
    pose[2, 3] = level
    builder.water_level = level
    builder.add("water", sheet, pose, [])
    builder.instances[-1] = replace(builder.instances[-1], name="lake_1")
