# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world from maps: the ground of an elevation model, trees of an inventory or a laser scan, and what a map shows.

Ground between the data is a smooth surface through them (`maps.elevation`). What is smaller than the data's spacing
they cannot show: there the surfaces have the microrelief of their class, with the shorter wavelengths only.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import RectBivariateSpline

from fieldtruth.core.arrays import Array
from fieldtruth.core.geodesy import Origin
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.maps.elevation import OutsideError
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, rolling_hills, scatter_beyond
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.inputs import LASER, read_elevation
from fieldtruth.world.environments.site.planting import plant_hedges, plant_herbs, plant_scrub, plant_trees
from fieldtruth.world.environments.site.sources import Stem, read_features, read_stems
from fieldtruth.world.environments.site.structures import build_structures, gates
from fieldtruth.world.environments.site.surfaces import (
    CANOPY,
    cover_ground,
    distances,
    grouped,
    land_use,
    ways_of,
)
from fieldtruth.world.environments.site.water import lay_water
from fieldtruth.world.grids import (
    Line,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    noise_map,
    under_circles,
)
from fieldtruth.world.model import Mesh, World
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import FarSwarm, WorldBuilder
from fieldtruth.world.relief import Axes, with_layer, with_microrelief
from fieldtruth.world.water import add_water

RELIEF: Final = 0.25
"""Standard deviation [m] of the ground's height without an elevation model."""
_GROUNDS: Final = {"lawn": "lawn", "meadow": "meadow", "forest_floor": "forest_floor", "soil": "earth"}
REACHES: Final = (800.0, 400.0, 200.0, 100.0)
"""Distances [m] beyond the edge to which the land is the elevation model's: the first one for which it has data."""
_COARSE: Final = 10.0  # [m] between the nodes of that land


class Ground(NamedTuple):
    """Heights of the ground on the grid of hills, its origin, and the least frequency [cycles/m] of microrelief."""

    heights: Array
    origin: Origin
    lowest: float


def read_ground(config: Config, nodes: Axes, rng: np.random.Generator) -> Ground:
    """Read the heights [m] of nodes, about their median, or make gentle ones where there is no elevation model."""
    surface = read_elevation(config)
    if surface is None:
        swell = fractal_noise(*nodes, wavelength=40.0, octaves=4, rng=rng, gain=0.45)
        return Ground(RELIEF * (swell - swell.mean()), config.place, 0.0)
    height = float(np.median(surface.at(nodes[0][::16], nodes[1][::16], config.place)))
    origin = config.place._replace(height=round(height, 3))
    return Ground(surface.at(*nodes, origin), origin, 0.5 / surface.resolution)


def land_beyond(config: Config, origin: Origin, rng: np.random.Generator) -> Land:
    """Height [m] of the land outside the edge: of the elevation raster as far as it reaches, then rolling hills."""
    file = config.elevation
    for reach in REACHES if file is not None and file.path.suffix.lower() not in LASER else ():
        size = config.size[0] + 2 * reach, config.size[1] + 2 * reach
        x, y = (np.linspace(-s / 2, s / 2, int(s / _COARSE) + 2) for s in size)
        try:
            surface = read_elevation(config.model_copy(update={"size": size}), _COARSE)
            known = None if surface is None else surface.at(x, y, origin)
        except OutsideError:  # it ends there
            continue
        if known is not None:
            hills, z = rolling_hills(size, rng), RectBivariateSpline(x, y, known, kx=1, ky=1)
            return lambda px, py: hills(px, py) + z(px.clip(x[0], x[-1]), py.clip(y[0], y[-1]), grid=False)
    return rolling_hills(config.size, rng)


def build(seed: int, corridors: Sequence[Line], config: Config, progress: Progress | None = None) -> World:
    """Build a site. The same files, seed and layout give the same world; ``progress`` hears of the stages.

    Raises:
        ConfigurationError: a file that cannot be read, or that does not cover the site.
    """
    progress = Silent() if progress is None else progress
    seeds = np.random.SeedSequence(seed).spawn(8)
    relief, growth, species, herbs, cover, land_rng, micro = (np.random.default_rng(s) for s in seeds[:7])
    nodes, fine = grid_axes(config.size, hills_spacing(config.size)), grid_axes(config.size, config.grid)
    with progress.stage("read the maps"):
        ground = read_ground(config, nodes, relief)
        features = read_features(config, ground.origin)
        stems = read_stems(config, ground.origin, features, species)
        land = land_use(config, features, ground.origin)
    with progress.stage("shape the ground"):
        ways = ways_of(features, config)
        paths = distances(ways, features, nodes)
        waters = lay_water(features, ground.heights, nodes, config.size, paths.nearest)
        shade, spacing = under_circles(_crowns(stems), nodes, CANOPY), float(nodes[0][1] - nodes[0][0])
        open_ground, floor = (config.roughness_of(each) for each in (_GROUNDS[config.surface], "forest_floor"))
        rough = [(open_ground, 1.0 - shade), (floor, shade)]
        heights = with_microrelief(waters.heights, nodes, fine, rough, micro, lowest=ground.lowest)
        field = make_heightfield(heights, config.grid, *fine)
    builder = WorldBuilder(field, config.size, grouped(way.trail for way in ways), corridors)
    add_water(builder, waters.level, waters.sheets)
    with progress.stage("build what people built"):
        build_structures(builder, features, growth)
        stand_objects(builder, config.objects, class_table(config.classes), ground.origin)
    with progress.stage(f"plant {len(stems):,} trees", float(len(stems))) as advance:
        plant_trees(builder, stems, config, growth, advance)
    with progress.stage("plant bushes, grass and herbs"):
        plant_hedges(builder, features, gates(builder, features), config, growth)
        plant_scrub(builder, land, config, growth)
        light = make_raster(shade, spacing, *nodes)
        plant_herbs(builder, config, land, light, herbs)
    with progress.stage("cover the ground"):
        terrain = cover_ground(field, config, land, paths, light, builder.water_level, ground.origin, cover)
        terrain = with_layer(terrain, micro)
        around = land_beyond(config, ground.origin, land_rng)
        backdrop = make_backdrop(field, config.size, "meadow", land_rng, land=around)
    with progress.stage("draw textures"):
        far = _far(builder, config, backdrop, land_rng)
        return assemble(
            builder, terrain, name=config.name, seed=seed, textures=seeds[7], backdrop=backdrop, beyond=far,
            litter=config.litter, objects=config.objects, origin=ground.origin,
        )  # fmt: skip


def _crowns(stems: Sequence[Stem]) -> list[tuple[float, float, float]]:
    """Circles of crowns: x, y and radius [m], a sixth of the height where it is not known."""
    return [(s.x, s.y, s.height / 6.0 if np.isnan(s.crown) else s.crown) for s in stems]


def _far(builder: WorldBuilder, config: Config, backdrop: Mesh, rng: np.random.Generator) -> list[FarSwarm]:
    """Groves, bushes and grass on the land beyond the edge."""
    planter, ground = config.planter, height_beyond(builder.field, config.size, backdrop)
    grove = noise_map((config.size[0] + 200.0, config.size[1] + 200.0), 40.0, rng, nodes=8)

    def groves(xy: Array) -> Array:
        return np.clip(0.1 + 0.9 * grove(xy), 0.04, 1.0)

    trees = planter.swarm("far_trees", planter.grow("far", rng, species=list(config.species)))
    bushes = planter.swarm("far_bushes", planter.grow("far_bush", rng))
    grass = planter.swarm("far_grass", planter.grow("grass", rng, count=3))
    return [
        scatter_beyond(config.size, ground, trees, rng, margin=4.0, density=groves),
        scatter_beyond(config.size, ground, bushes, rng, margin=2.0, density=groves),
        scatter_beyond(config.size, ground, grass, rng, within=16.0, margin=0.6),
    ]
