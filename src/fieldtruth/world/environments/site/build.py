# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world from maps: the ground of an elevation model, trees of an inventory or a laser scan, paths and surfaces.

Ground between the data is a smooth surface through them (`maps.elevation`). What is smaller than the data's spacing
they cannot show: there the surfaces have the microrelief of their class, with the shorter wavelengths only.

A tree stands where the map has it, with its height; of some individuals of its species the one is taken whose crown is
nearest in width for its height, so that a thousand trees are a few meshes.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.osm import Feature
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import height_beyond, make_backdrop, rolling_hills, scatter_beyond
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.sources import Stem, area_mask, read_elevation, read_features, read_stems
from fieldtruth.world.grids import (
    COVER,
    Line,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    signed_distance,
)
from fieldtruth.world.model import Mesh, Raster, Terrain, World
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import FarSwarm, WorldBuilder, random_tint
from fieldtruth.world.plants import TREES, grow_tree
from fieldtruth.world.plants.species import GrownIn, heights_of
from fieldtruth.world.relief import Axes, with_layer, with_microrelief

RELIEF: Final = 0.25
"""Standard deviation [m] of the ground's height without an elevation model."""
HEIGHTS: Final = 1.3
"""Ratio of the heights of a species' meshes, of which a tree takes the nearest."""
SURFACES: Final[Mapping[str, str]] = {
    "lawn": "lawn", "meadow": "rough_grass", "forest_floor": "litter", "soil": "soil",
}  # fmt: skip
"""Material by surface."""
_GROUNDS: Final[Mapping[str, str]] = {
    "lawn": "lawn", "meadow": "meadow", "forest_floor": "forest_floor", "soil": "earth",
}  # fmt: skip
TRAILS: Final = ("path", "track", "road")
"""Kinds of lines of the map that are trails."""
AREAS: Final[Mapping[str, str]] = {
    "grass": "lawn", "meadow": "rough_grass", "farmland": "soil", "heath": "dry_grass", "scrub": "rough_grass",
    "wood": "litter", "orchard": "lawn", "sand": "soil", "bare_rock": "rock_face", "scree": "scree", "wetland": "mud",
}  # fmt: skip
"""Material of areas of the map by kind."""
AREA_EDGE: Final = 0.4
"""Standard deviation [m] of the transition between areas."""
CANOPY: Final = 1.6
"""Distance [m] beyond a trunk's crown over which litter gives way to grass."""


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


def plant_trees(builder: WorldBuilder, stems: Sequence[Stem], config: Config, rng: np.random.Generator) -> list[Stem]:
    """Plant the trees of the map that are within the world; return those that stand."""
    half, planted = np.array(config.size) / 2 - 0.5, []
    meshes: dict[tuple[str, int], list[Mesh]] = {}
    for stem in sorted(stems, key=lambda stem: -stem.height):
        if (np.abs([stem.x, stem.y]) > half).any():
            continue
        step = round(np.log(stem.height) / np.log(HEIGHTS))
        key = stem.species, step
        if key not in meshes:
            meshes[key] = _individuals(stem.species, HEIGHTS**step, config.individuals, rng)
        choice = _best(meshes[key], stem)
        scale = stem.height / _height(choice)
        pose = {"yaw": float(rng.uniform(0.0, 2.0 * np.pi)), "scale": scale}
        builder.add_upright(stem.species, choice, (stem.x, stem.y), **pose, tint=random_tint(rng, 0.1))
        planted.append(stem)
    return planted


def _individuals(species: str, height: float, count: int, rng: np.random.Generator) -> list[Mesh]:
    """Trees of a species and about a height [m], grown in the open and in a stand."""
    kind, grown = TREES[species], []
    for surroundings in ("open", "stand"):
        way: GrownIn = "open" if surroundings == "open" else "stand"
        low, high = heights_of(kind, height, way)
        own = min(max(height, low), high)
        for k in range(count):
            name = f"{species}_{surroundings}_{height:.0f}m_{k}"
            detail = float(np.clip(3.0 / height, 0.14, 1.0))
            grown.append(grow_tree(kind, name=name, height=own, rng=rng, detail=detail, grown_in=way))
    return grown


def _best(meshes: Sequence[Mesh], stem: Stem) -> Mesh:
    """Mesh whose crown at the height of a tree is the nearest in width."""
    if np.isnan(stem.crown):
        return meshes[int(abs(hash_of(stem)) % len(meshes))]
    widths = np.array([_crown(mesh) * stem.height / _height(mesh) for mesh in meshes])
    return meshes[int(np.argmin(np.abs(np.log(widths / max(stem.crown, 0.3)))))]


def hash_of(stem: Stem) -> int:
    """A number that depends on the position of a tree, to the centimetre, and on nothing else."""
    return round(100 * stem.x) * 73_856_093 ^ round(100 * stem.y) * 19_349_663


def _height(mesh: Mesh) -> float:
    return float(mesh.vertices[:, 2].max())


def _crown(mesh: Mesh) -> float:
    """Radius [m] about the trunk that holds 95 % of the vertices."""
    return float(np.quantile(np.hypot(*mesh.vertices[:, :2].T), 0.95))


def under_crowns(stems: Iterable[Stem], nodes: Axes, spacing: float) -> Array:
    """Share (nx, ny) to which nodes are below crowns; radii that are not known are a sixth of the height."""
    x, y = nodes
    clear = np.ones((len(x), len(y)))
    for stem in stems:
        radius = stem.height / 6.0 if np.isnan(stem.crown) else stem.crown
        reach = radius + CANOPY
        i, j = (slice(*np.searchsorted(axis, (c - reach, c + reach))) for axis, c in ((x, stem.x), (y, stem.y)))
        away = np.hypot(x[i, None] - stem.x, y[j] - stem.y)
        clear[i, j] *= np.clip((away - radius) / CANOPY, 0.0, 1.0)
    return gaussian_filter(1.0 - clear, 0.3 / spacing)


def cover_ground(
    builder: WorldBuilder, config: Config, features: Sequence[Feature], shade: Raster, rng: np.random.Generator
) -> Terrain:
    """The areas of the map, else the site's surface, in the open; litter and moss below crowns; bare patches."""
    x, y = grid_axes(config.size, cell := COVER * coarseness(config.size))
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    below = np.clip(shade.at(*np.meshgrid(x, y, indexing="ij")) + 0.15 * fine, 0.0, 1.0)
    moss = below * np.clip(0.25 * patch + 0.3 * fine - 0.1, 0.0, 0.7)
    bare = (1.0 - below) * np.clip(0.2 * patch + 0.25 * fine - 0.25, 0.0, 0.5)
    names, number = surfaces(config, features, (x, y))
    open_ground = 1.0 - below - bare
    shares = {"litter": below - moss, "moss": moss, "soil": bare}
    for row, name in enumerate(names):
        edge = gaussian_filter((number == row).astype(np.float32), AREA_EDGE / cell)
        shares[name] = shares.get(name, 0.0) + open_ground * edge
    trails = builder.trails
    distance = signed_distance(trails, x, y) if trails else np.full((len(x), len(y)), 1e3, np.float32)
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(distance + 0.12 * fine + 0.06 * patch, cell, x, y),
        cover=make_raster(np.clip(np.stack(list(shares.values()), axis=-1), 0.0, 1.0), cell, x, y),
        ground_materials=tuple(shares),
        trail_material="path",
        border_material="path_edge",
        border_width=0.2,
    )


def surfaces(config: Config, features: Sequence[Feature], nodes: Axes) -> tuple[list[str], NDArray[np.int8]]:
    """Materials in the open, the site's own first, and the number of that of each node (nx, ny).

    Areas come with the largest first, so that one in another covers it.
    """
    names = [SURFACES[config.surface]]
    number = np.zeros((len(nodes[0]), len(nodes[1])), np.int8)
    for each in features:
        if each.closed and each.kind in AREAS:
            name = AREAS[each.kind]
            if name not in names:
                names.append(name)
            number[area_mask([each], nodes)] = names.index(name)
    return names, number


def plant_herbs(builder: WorldBuilder, config: Config, shade: Raster, rng: np.random.Generator) -> None:
    """Scatter grass in the open, ferns and nettles in half shade, brambles along the edges of woods."""

    def off(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.1

    def grass(xy: Array) -> Array:
        clumps = np.clip(0.55 + 0.5 * np.sin(0.9 * xy[:, 0]) * np.cos(0.7 * xy[:, 1]), 0.15, 1.0)
        return np.asarray(clumps * (1.0 - 0.9 * shade.at(*xy.T)) * off(xy))

    def herbs(xy: Array) -> Array:
        return np.asarray((0.15 + 0.7 * shade.at(*xy.T)) * (shade.at(*xy.T) > 0.1) * off(xy))

    def edges(xy: Array) -> Array:
        dark = shade.at(*xy.T)
        return np.asarray(np.clip(4.0 * dark * (1.0 - dark), 0.0, 1.0) * off(xy))

    planter = config.planter
    if config.grass_per_m2:
        meshes = planter.grow("grass", rng)
        builder.scatter_swarm(planter.swarm("grass", meshes, per_m2=config.grass_per_m2 / 8.0), rng, grass)
    builder.scatter_swarm(planter.swarm("herbs", planter.grow("herbs", rng)), rng, herbs)
    builder.scatter_swarm(planter.swarm("brambles", planter.grow("brambles", rng)), rng, edges)


def trails_of(features: Sequence[Feature], config: Config) -> list[Trail]:
    """Paths, tracks and roads of the map."""
    trails = []
    for each in features:
        if each.kind in TRAILS and not each.closed and len(each.geometry) > 1:
            corners = [(float(x), float(y)) for x, y in each.geometry]
            width = config.trail_width if each.width is None or each.kind == "path" else each.width
            trails.append(Trail(Line.through(corners), width))
    return trails


def build(seed: int, corridors: Sequence[Line], config: Config) -> World:
    """Build a site. The same files, seed and layout give the same world.

    Raises:
        ConfigurationError: a file that cannot be read, or that does not cover the site.
    """
    seeds = np.random.SeedSequence(seed).spawn(8)
    relief, growth, species, herbs, cover, land, micro = (np.random.default_rng(s) for s in seeds[:7])
    nodes, fine = grid_axes(config.size, hills_spacing(config.size)), grid_axes(config.size, config.grid)
    ground = read_ground(config, nodes, relief)
    features = read_features(config, ground.origin)
    stems = read_stems(config, ground.origin, features, species)
    spacing = float(nodes[0][1] - nodes[0][0])
    shade = under_crowns(stems, nodes, spacing)
    rough = [(config.roughness_of(_GROUNDS[config.surface]), 1.0 - shade), (config.roughness_of("forest_floor"), shade)]
    heights = with_microrelief(ground.heights, nodes, fine, rough, micro, lowest=ground.lowest)
    trails = trails_of(features, config)
    builder = WorldBuilder(make_heightfield(heights, config.grid, *fine), config.size, trails, corridors)
    stand_objects(builder, config.objects, ground.origin)
    plant_trees(builder, stems, config, growth)
    crowns = make_raster(shade, spacing, *nodes)
    plant_herbs(builder, config, crowns, herbs)
    backdrop = make_backdrop(builder.field, config.size, "meadow", land, land=rolling_hills(config.size, land))
    terrain = with_layer(cover_ground(builder, config, features, crowns, cover), micro)
    return assemble(
        builder,
        terrain,
        name=config.name,
        seed=seed,
        textures=seeds[7],
        backdrop=backdrop,
        beyond=_far(builder, config, backdrop, land),
        litter=config.litter,
        objects=config.objects,
        origin=ground.origin,
    )


def _far(builder: WorldBuilder, config: Config, backdrop: Mesh, rng: np.random.Generator) -> list[FarSwarm]:
    planter = config.planter
    trees = planter.swarm("far_trees", planter.grow("far", rng, species=list(config.species)))
    return [scatter_beyond(config.size, height_beyond(builder.field, config.size, backdrop), trees, rng, margin=4.0)]
