# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The dense forest (paper, 2.2.3): trees on uneven ground, two trails, high grass, stones, bushes, fallen trunks.

Its soil has pits, mounds and roots, its trails are trodden and rutted; needles, leaves and moss cover it. Field stones
lie in groups, with small stones around them. Bushes and grass grow where there is light, ferns in the shade.

Each tree of the closed stand is where its crown catches most of the light that the others let pass. Crowns of real
stands grow into gaps and away from neighbours (Muth and Bazzaz 2003, from memory), so that they close the canopy;
crowns at random positions with the same leaf area leave a quarter of the ground without any.

Below the trees are natural regeneration, bilberry, brambles and fallen twigs. The forest is a woodrush beech forest
(Luzulo-Fagetum, habitat 9110) that was planted with spruce and pine and turns back: beech and spruce germinate in
groups where some light falls, thousands to the hectare; dwarf shrubs, ferns and grass cover a part of the acid soil,
needles and leaves the rest. Beyond the world's edge are some rows of trees, and behind them the canopy over the hills.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import canopy, height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.environments.layout import HILLS, hills_spacing
from fieldtruth.world.fallen import lay_log
from fieldtruth.world.grids import (
    COVER,
    Line,
    Trail,
    coarseness,
    distance_beyond,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    make_trails,
    noise_map,
    signed_distance,
)
from fieldtruth.world.model import Heightfield, Mesh, Raster, Terrain, World
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import (
    Density,
    FarSwarm,
    ObjectGroup,
    WorldBuilder,
)
from fieldtruth.world.plants import TREES, grow_log, grow_snag, grow_stump, grow_tree, grow_twigs
from fieldtruth.world.relief import (
    Axes,
    limit_slope,
    pits_and_mounds,
    root_swells,
    slope_limit,
    with_layer,
    with_microrelief,
)
from fieldtruth.world.rocks import scatter_rocks
from fieldtruth.world.stand import Stand

UPROOTED: Final = 0.006
"""Density [1/m^2] of pits and mounds."""
OFF_TRAIL: Final = 3.0
"""Distance [m] of pits and mounds from a trail's edge."""
RUT_OFF_CENTRE, RUT_WIDTH, RUT_DEPTH = 0.55, 0.12, 0.035
"""Distance [m] of ruts from a trail's centre line, the deviation of their Gaussian profile, and mean depth."""
ROOTS: Final = 0.1
"""Largest spacing [m] of the terrain's nodes on which roots can be seen."""


def make_heights(
    config: Config, trails: Sequence[Trail], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Heightfield:
    """Swells, hollows, and the pits and mounds of uprooted trees; trodden flat along the trails."""
    spacing = hills_spacing(config.size)
    (x, y), fine = grid_axes(config.size, spacing), grid_axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.45)
    off_trail = signed_distance(trails, x, y).astype(np.float64)
    heights = config.relief * swell + _uprooted((x, y), spacing, off_trail, rng)
    on_trail = 1.0 / (1.0 + np.exp((off_trail - 0.5) / 0.35))
    trodden = gaussian_filter(heights, 1.2 / spacing) - 0.05
    heights = heights * (1.0 - on_trail) + trodden * on_trail
    heights = limit_slope(heights, spacing, slope_limit(off_trail, within=10.0, beyond=32.0, near=0.6, far=5.0))
    bare = np.clip(0.5 - off_trail / 0.4, 0.0, 1.0)
    cover = [(config.roughness_of("trodden_earth"), bare), (config.roughness_of("forest_floor"), 1.0 - bare)]
    heights += _ruts((x, y), np.abs(off_trail + config.trail_width / 2), RUT_WIDTH * (spacing / HILLS), fine_rng)
    heights = with_microrelief(heights - heights.mean(), (x, y), fine, cover, fine_rng)
    return make_heightfield(heights, config.grid, *fine)


def _uprooted(nodes: Axes, spacing: float, off_trail: Array, rng: np.random.Generator) -> Array:
    """Heights [m] of pits and mounds that are ``UPROOTED`` per m^2, off the trails."""
    count = round(UPROOTED * float(np.prod([np.ptp(axis) for axis in nodes])))
    positions = rng.uniform([axis[0] for axis in nodes], [axis[-1] for axis in nodes], (count, 2))
    apart = make_raster(off_trail, spacing, *nodes).at(*positions.T) > OFF_TRAIL
    return pits_and_mounds(*nodes, positions[apart], rng)


def _ruts(nodes: Axes, off_centre: Array, width: float, rng: np.random.Generator) -> Array:
    """Heights [m] of two ruts along each trail, deep in parts and elsewhere worn away; shallower if they are wide."""
    depth = RUT_DEPTH * np.clip(0.5 + 0.6 * fractal_noise(*nodes, wavelength=9.0, octaves=2, rng=rng), 0.0, 1.4)
    depth *= RUT_WIDTH / width
    return np.asarray(-depth * np.exp(-0.5 * ((off_centre - RUT_OFF_CENTRE) / width) ** 2))


def raise_roots(builder: WorldBuilder, rng: np.random.Generator) -> None:
    """Raise the ground over the roots of the trees, snags and stumps, on trails as in the litter.

    Roots are narrower than the nodes of a coarse terrain; there is only the swell about a trunk.
    """
    field = builder.field
    trunks = []
    for instance in builder.instances:
        if instance.kind in TREES or instance.kind in ("snag", "stump"):
            trunk = builder.meshes[instance.mesh].colliders[0]
            scale = float(np.cbrt(np.linalg.det(instance.world_from_object[:3, :3])))
            trunks.append((*instance.world_from_object[:2, 3], scale * trunk.size[0]))
    x, y = grid_axes(builder.size, field.spacing)
    heights = field.heights + root_swells(x, y, trunks, rng if field.spacing <= ROOTS else None).astype(np.float32)
    builder.field = replace(field, heights=heights)


def make_glades(size: tuple[float, float], rng: np.random.Generator) -> Raster:
    """Light on the forest floor, about 0 on average: high in glades, low in shade."""
    x, y = grid_axes(size, 0.5)
    return make_raster(fractal_noise(x, y, wavelength=13.0, octaves=3, rng=rng), 0.5, x, y)


def cover_ground(builder: WorldBuilder, config: Config, glades: Raster, rng: np.random.Generator) -> Terrain:
    """Needles below conifers, leaves below broadleaved trees, moss in patches, humus in between."""
    x, y = grid_axes(builder.size, cell := COVER * coarseness(builder.size))
    px, py = np.meshgrid(x, y, indexing="ij")
    distance = signed_distance(builder.trails, x, y)
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    needles = [name for name in config.species if TREES[name].grown.leaf.prongs]  # sprays of needles
    broadleaves = [name for name in config.species if name not in needles]
    conifers, broad = (_crown_share(builder, (x, y), cell, species) for species in (needles, broadleaves))
    leaves = np.clip(0.5 + 0.55 * (broad - conifers) + 0.22 * patch, 0.05, 0.95)
    moss = np.clip(0.25 * patch + 0.3 * fine - 0.18 * glades.at(px, py) - 0.12, 0.0, 0.9) * (distance > 0.2)
    soil = np.clip(0.22 - 0.25 * patch + 0.2 * fine, 0.0, 0.5)
    rest = (1.0 - moss) * (1.0 - soil)
    cover = np.stack([rest * (1.0 - leaves), rest * leaves, moss, (1.0 - moss) * soil], axis=-1)
    ragged = distance + 0.16 * fine + 0.1 * patch
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(ragged, cell, x, y),
        cover=make_raster(cover, cell, x, y),
        ground_materials=("needles", "litter", "moss", "soil"),
        trail_material="path",
        border_material="path_edge",
        border_width=0.22,
    )


def _crown_share(builder: WorldBuilder, nodes: Axes, spacing: float, species: Sequence[str]) -> Array:
    """Share (nx, ny) in [0, 1] to which nodes are below crowns of some species."""
    x, y = nodes
    step = max(1, round(0.5 / spacing))
    cell = step * spacing
    marks = np.zeros((len(x[::step]), len(y[::step])))
    for instance in builder.instances:
        if instance.kind in species:
            i, j = np.round((instance.world_from_object[:2, 3] - (x[0], y[0])) / cell).astype(int)
            marks[i, j] += 1.0
    spread = gaussian_filter(marks, 1.6 / cell) * (15.0 / cell**2)
    coarse = make_raster(np.clip(spread, 0, 1), cell, x, y)
    return coarse.at(*np.meshgrid(x, y, indexing="ij"))


GROUPS: Final = 14 / 5000  # per m^2


def place_rocks(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Add field stones with colliders and a swarm of small stones."""
    groups = cKDTree(builder.random_positions(round(builder.size[0] * builder.size[1] * GROUPS), rng))

    def near_centres(xy: Array) -> Array:
        away, _ = groups.query(xy)
        return np.asarray((0.12 + 0.88 * np.exp(-((away / 2.6) ** 2))) * (builder.trail_distance(xy) > 0.3))

    rocks = config.planter.grow("rock", rng)
    group = ObjectGroup(kind="rock", meshes=rocks, count=config.rocks, spacing=0.6, scales=(0.85, 1.2), tint=0.08)
    scatter_rocks(builder, group, rng, near_centres)
    stones = config.planter.grow("stone", rng)
    spec = config.planter.swarm("small_stones", stones, per_m2=config.stones_per_m2 * 3)
    builder.scatter_swarm(spec, rng, lambda xy: np.clip(1.4 * near_centres(xy), 0.0, 1.0))


def place_deadwood(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Lay fallen trunks off the trails; stand snags and stumps between the trees."""

    def off_trails(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.5

    trees = [TREES[name] for name in config.species]
    logs = [
        grow_log(
            trees[k % len(trees)],
            name=f"log_{k}",
            length=float(rng.uniform(3.0, 10.0)),
            radius=float(rng.uniform(0.1, 0.21)),
            rng=rng,
            detail=0.6,
        )
        for k in range(min(config.fallen_trunks, 8))
    ]

    def clear_of_trails(circles: Array) -> Mask:
        return builder.trail_distance(circles[:, :2]) > circles[:, 2] + 0.2

    for k in range(config.fallen_trunks):
        lay_log(builder, logs[k % len(logs)], rng, clear_of_trails)
    snags = [
        grow_snag(trees[k % len(trees)], name=f"snag_{k}", height=float(rng.uniform(2.5, 13.0)), rng=rng, detail=0.5)
        for k in range(min(config.snags, 8))
    ]
    group = ObjectGroup(kind="snag", meshes=snags, count=config.snags, spacing=5.0, tint=0.1)
    builder.scatter(group, rng, off_trails)
    stumps = [
        grow_stump(trees[k % len(trees)], name=f"stump_{k}", radius=float(rng.uniform(0.1, 0.24)), rng=rng, detail=0.5)
        for k in range(min(config.stumps, 4))
    ]
    group = ObjectGroup(kind="stump", meshes=stumps, count=config.stumps, spacing=4.0, tint=0.1)
    builder.scatter(group, rng, off_trails)


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant old trees, then younger ones between them, each where some light is left, none on a trail."""
    stand = Stand(builder)
    counts = {"old": config.old_trees, "grown": config.grown_trees, "young": config.young_trees}
    total = sum(config.species.values())

    def off_trails(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.55

    for age, left in counts.items():
        for k, (name, share) in enumerate(config.species.items()):
            count = left if k == len(config.species) - 1 else min(left, round(counts[age] * share / total))
            left -= count
            trees = config.planter.grow(age, growth, count=min(config.individuals, count), species=[name])
            if trees:
                group = ObjectGroup(kind=name, meshes=trees, count=count, scales=(0.88, 1.15), tint=0.1)
                stand.plant(group, rng, off_trails)


def plant_bushes(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Plant hazel and bramble where trails and glades let light in."""

    def allowed(xy: Array) -> Mask:
        away = builder.trail_distance(xy)
        return (away > 0.9) & (rng.random(len(xy)) < np.exp(-away / 6.0))

    names = config.planter.species("bush")
    for k, name in enumerate(names):
        bushes = config.planter.grow("bush", rng, species=[name])
        count = config.bushes // len(names) + (k < config.bushes % len(names))
        group = ObjectGroup(kind="bush", meshes=bushes, count=count, spacing=1.2, scales=(0.7, 1.15), tint=0.1)
        builder.scatter(group, rng, allowed)


def plant_herbs(builder: WorldBuilder, config: Config, glades: Raster, rng: np.random.Generator) -> None:
    """Scatter grass in the light, mostly along the trails, ferns in the shade, and some nettles."""

    def grass(xy: Array) -> Array:
        away = builder.trail_distance(xy)
        light = 0.75 * np.exp(-np.maximum(away, 0.0) / 1.6) + 0.42 * glades.at(*xy.T)
        return np.asarray(np.clip(light, 0.06, 0.9) * (away > -0.1))

    def ferns(xy: Array) -> Array:
        shade = np.clip(0.55 - 0.9 * glades.at(*xy.T), 0.0, 1.0)
        return shade * (builder.trail_distance(xy) > 0.25)

    def nettles(xy: Array) -> Array:
        return np.clip(glades.at(*xy.T) - 0.9, 0.0, 1.0) * (builder.trail_distance(xy) > 0.2)

    planter = config.planter
    clumps = {group: planter.grow(group, rng) for group in ("grass", "nettles", "ferns")}
    grass_per_m2, ferns_per_m2 = config.grass_per_m2 / TUFTS_PER_M2, config.ferns_per_m2 / planter.tufts("ferns")
    builder.scatter_swarm(planter.swarm("forest_grass", clumps["grass"], per_m2=grass_per_m2), rng, grass)
    builder.scatter_swarm(planter.swarm("ferns", clumps["ferns"], per_m2=ferns_per_m2), rng, ferns)
    builder.scatter_swarm(planter.swarm("nettles", clumps["nettles"]), rng, nettles)


TUFTS_PER_M2: Final = 8.0
"""Density of tufts in a clump of grass."""
SEEDLINGS_PER_TUFT: Final = 3
"""Of ``beech_seedling`` and ``spruce_seedling``."""
SAPLINGS: Final[Mapping[str, int]] = {"beech": 4, "spruce": 2, "oak": 1}
"""Individuals of each species; members of the swarm are copies of them in equal numbers."""
SAPLING_HEIGHT: Final = 2.2  # [m] of the habit
SAPLING_SCALES: Final = (0.28, 0.7)
"""Of the smallest and the largest individual. The share of the leaves is the scale squared, so that they have their
real size in each."""
GROUP: Final = 7.0  # [m], wavelength of the groups of seedlings and dwarf shrubs
TWIGS_PER_CLUMP: Final = 6


def plant_understorey(builder: WorldBuilder, config: Config, glades: Raster, rng: np.random.Generator) -> None:
    """Scatter seedlings and saplings in groups, bilberries and brambles in the light, and twigs everywhere."""
    young, dwarf = noise_map(config.size, GROUP, rng), noise_map(config.size, GROUP, rng)

    def off_trails(xy: Array, clear: float) -> Array:
        return (builder.trail_distance(xy) > clear).astype(np.float64)

    def groups(xy: Array) -> Array:
        return np.clip(0.3 * young(xy) + 0.15 * glades.at(*xy.T) + 0.05, 0.0, 1.0) * off_trails(xy, 0.25)

    def mats(xy: Array) -> Array:
        return np.clip(0.5 * dwarf(xy) + 0.2 * glades.at(*xy.T) - 0.3, 0.0, 1.0) * off_trails(xy, 0.2)

    def light(xy: Array) -> Array:
        beside = np.exp(-np.maximum(builder.trail_distance(xy), 0.0) / 2.5)
        return np.clip(0.5 * beside + 0.3 * glades.at(*xy.T), 0.0, 1.0) * off_trails(xy, 0.4)

    planter = config.planter
    grown: dict[str, Sequence[Mesh]] = {name: planter.grow(name, rng) for name in ("seedlings", "bilberries")}
    grown["brambles"] = [replace(mesh, colliders=()) for mesh in planter.grow("brambles", rng)]  # a robot drives over
    grown["twigs"] = [grow_twigs(name=f"twigs_{k}", radius=0.8, count=TWIGS_PER_CLUMP, rng=rng) for k in range(6)]
    swarms: tuple[tuple[str, float, Density], ...] = (
        ("seedlings", config.seedlings_per_m2 / SEEDLINGS_PER_TUFT / planter.tufts("seedlings"), groups),
        ("bilberries", config.bilberries_per_m2 / planter.tufts("bilberries"), mats),
        ("brambles", config.brambles_per_m2, light),
        ("twigs", config.twigs_per_m2 / TWIGS_PER_CLUMP, lambda xy: off_trails(xy, 0.1)),
    )
    for name, wanted, density in swarms:
        per_m2 = _before_thinning(wanted, density, builder)
        builder.scatter_swarm(planter.swarm(name, grown[name], per_m2=per_m2), rng, density)
    saplings, per_m2 = _saplings(rng), _before_thinning(config.saplings_per_m2, groups, builder)
    builder.scatter_swarm(planter.swarm("saplings", saplings, per_m2=per_m2), rng, groups)


def _before_thinning(per_m2: float, density: Density, builder: WorldBuilder) -> float:
    """Density of positions of which ``density`` leaves about ``per_m2`` in the mean over the world; at most 20."""
    axes = (np.arange(-s / 2 + 0.5, s / 2, 1.0) for s in builder.size)
    mean = float(density(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)).mean())
    return min(per_m2 / max(mean, 1e-3), 20.0)


def _saplings(rng: np.random.Generator) -> list[Mesh]:
    names = [f"{species}_{k}" for species, count in SAPLINGS.items() for k in range(count)]
    scales = rng.permutation(np.geomspace(*SAPLING_SCALES, len(names)))
    return [_sapling(name, float(scale), rng) for name, scale in zip(names, scales, strict=True)]


def _sapling(name: str, scale: float, rng: np.random.Generator) -> Mesh:
    species = TREES[name.rpartition("_")[0]]
    tree = grow_tree(species, name=f"sapling_{name}", height=SAPLING_HEIGHT, rng=rng, detail=scale**2)
    vertices = np.float32(scale) * tree.vertices
    return replace(tree, vertices=vertices, footprint=scale * tree.footprint, colliders=())


FAR_TREES: Final = 12.0
"""Distance [m] from the edge within which single trees stand; behind them the canopy closes the view."""


def scatter_far_trees(
    builder: WorldBuilder, config: Config, backdrop: Mesh, growth: np.random.Generator, rng: np.random.Generator
) -> list[FarSwarm]:
    """Trees of little detail around the world, with young ones at the edge."""
    planter = config.planter
    trees = planter.swarm("far_trees", planter.grow("far", growth, species=config.species))
    young = planter.swarm("far_young_trees", planter.grow("far_young", growth))
    ground = height_beyond(builder.field, config.size, backdrop)
    return [
        scatter_beyond(config.size, ground, trees, rng, within=FAR_TREES, margin=0.8),
        scatter_beyond(config.size, ground, young, rng, within=10.0, margin=0.8),
    ]


def build(seed: int, corridors: Sequence[Line], config: Config) -> World:
    """Build a forest; ``corridors`` stay free of obstacles. The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    seeds = np.random.SeedSequence(seed).spawn(12)
    relief, growth, trees, dead, bushes, stones, herbs, cover, land = (np.random.default_rng(s) for s in seeds[:9])
    microrelief, layer, roots = (np.random.default_rng(s) for s in seeds[10].spawn(3))
    trails = make_trails(config.trails, config.trail_width)
    builder = WorldBuilder(make_heights(config, trails, relief, microrelief), config.size, trails, corridors)
    stand_objects(builder, config.objects, class_table(config.classes))
    place_deadwood(builder, config, dead)
    plant_trees(builder, config, growth, trees)
    raise_roots(builder, roots)
    place_rocks(builder, config, stones)
    plant_bushes(builder, config, bushes)
    glades = make_glades(config.size, herbs)
    plant_herbs(builder, config, glades, herbs)
    plant_understorey(builder, config, glades, np.random.default_rng(seeds[11]))
    hills = canopy(config.size, land, behind=FAR_TREES)

    def behind_trees(x: Array, y: Array, _slope: Array) -> Index:
        return (distance_beyond(config.size, x, y) > FAR_TREES - 1.0).astype(np.intp)

    backdrop = make_backdrop(builder.field, config.size, ("needles", "canopy"), land, land=hills, cover=behind_trees)
    terrain = with_layer(cover_ground(builder, config, glades, cover), layer)
    far = scatter_far_trees(builder, config, backdrop, growth, land)
    return assemble(
        builder,
        terrain,
        name="forest",
        seed=seed,
        textures=seeds[9],
        backdrop=backdrop,
        beyond=far,
        litter=config.litter,
        objects=config.objects,
    )
