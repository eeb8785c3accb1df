# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The urban park (paper, 2.2.1): almost plane ground, two trails, trees, bushes, lamps, benches, tables, bins.

The ground has gentle swells; lawn, litter below crowns, mulch in beds, trails with a border. Trees are at crown's
distance; flowers grow in the beds, and long grass where it is not mown.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.assembly import assemble
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.environments.park.beds import Bed, bed_distance, edge_beds, lay_beds
from fieldtruth.world.environments.park.beyond import make_surroundings
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.furniture import make_bench, make_lamp_post, make_table, make_trash_bin
from fieldtruth.world.grids import (
    COVER,
    Line,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    make_trails,
    noise_map,
    signed_distance,
)
from fieldtruth.world.model import Heightfield, Instance, Terrain, World
from fieldtruth.world.placement import (
    Density,
    ObjectGroup,
    WorldBuilder,
    eased,
    place_until_count,
    random_tint,
)
from fieldtruth.world.relief import with_layer, with_microrelief


def make_heights(
    config: Config, trails: Sequence[Trail], rng: np.random.Generator, fine_rng: np.random.Generator
) -> Heightfield:
    """Low swells; fine gravel on the trails, lawn elsewhere."""
    hills, fine = grid_axes(config.size, hills_spacing(config.size)), grid_axes(config.size, config.grid)
    swell = config.relief * fractal_noise(*hills, wavelength=46.0, octaves=3, rng=rng, gain=0.35)
    on_trail = np.clip(0.5 - signed_distance(trails, *hills) / 0.2, 0.0, 1.0)
    cover = [(config.roughness_of("gravel"), on_trail), (config.roughness_of("lawn"), 1.0 - on_trail)]
    heights = with_microrelief(swell - swell.mean(), hills, fine, cover, fine_rng)
    return make_heightfield(heights, config.grid, *fine)


def cover_ground(builder: WorldBuilder, beds: Sequence[Bed], border_width: float, rng: np.random.Generator) -> Terrain:
    """Lawn, dry and worn in patches, litter below large trees, mulch in the beds, trails with a border of setts."""
    x, y = grid_axes(builder.size, cell := COVER * coarseness(builder.size))
    distance = signed_distance(builder.trails, x, y)
    patch = fractal_noise(x, y, wavelength=14.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    worn = np.clip(0.95 - distance / 0.32 + 0.75 * fine, 0.0, 1.0)
    litter, bare = np.zeros_like(patch), np.zeros_like(patch)
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    bed = np.clip(0.5 - bed_distance(beds, nodes).reshape(patch.shape) / 0.1, 0.0, 1.0)
    # Leaves below large trees, mulch around young ones, bare soil around furniture.
    for kind, radius, ragged, under in (
        ("large_tree", 1.1, (0.5, 0.35), litter),
        ("small_tree", 0.5, (0.12, 0.1), bed),
        ("bench", 0.85, (0.5, 0.45), bare),
        ("table", 1.1, (0.5, 0.5), bare),
    ):
        for instance in builder.instances:
            if instance.kind != kind:
                continue
            ix, iy = instance.world_from_object[:2, 3] + (
                0.35 * instance.world_from_object[:2, 0] if kind == "bench" else 0
            )
            near = np.ix_(*(np.flatnonzero(np.abs(axis - at) < radius + 1.0) for axis, at in ((x, ix), (y, iy))))
            away = np.hypot(x[near[0]] - ix, y[near[1]] - iy)
            here = np.clip((radius - away) / ragged[0] + ragged[1] * 3.1 * fine[near], 0.0, 1.0) * (away < radius + 1.0)
            under[near] = np.maximum(under[near], here)
    dry = np.clip(0.32 + 0.36 * patch + 0.26 * fine, 0.0, 0.95)
    trodden = np.clip(0.9 * worn * (0.5 + 0.4 * fine) + 0.55 * bare * (0.7 + 0.5 * fine), 0.0, 1.0)
    free = (1.0 - bed) * (1.0 - litter)
    cover = np.stack(
        [free * (1 - trodden) * (1 - dry), free * (1 - trodden) * dry, free * trodden, bed, litter * (1 - bed)], axis=-1
    )
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(distance, cell, x, y),
        cover=make_raster(cover, cell, x, y),
        ground_materials=("lawn", "lawn_dry", "soil", "mulch", "leaves_on_lawn"),
        trail_material="gravel",
        border_material="setts",
        border_width=border_width,
    )


def furnish(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Add benches and lamps along the trails, bins beside benches, tables on the lawn."""
    lamps = ObjectGroup(kind="lamp_post", meshes=[make_lamp_post(0)], count=config.lamp_posts, spacing=9.0, tint=0.03)
    builder.along_trails(lamps, rng, offset=0.45)
    benches = ObjectGroup(
        kind="bench", meshes=[make_bench(k) for k in range(3)], count=config.benches, spacing=6.0, tint=0.08
    )
    seats = builder.along_trails(benches, rng, offset=0.95)
    _place_bins(builder, config.trash_bins, seats, rng)

    def on_lawn(xy: Array) -> Mask:
        return np.abs(builder.trail_distance(xy) - 4.5) < 2.5

    tables = ObjectGroup(
        kind="table", meshes=[make_table(k) for k in range(2)], count=config.tables, spacing=5.0, tint=0.08
    )
    builder.scatter(tables, rng, on_lawn)


def _place_bins(builder: WorldBuilder, count: int, benches: Sequence[Instance], rng: np.random.Generator) -> None:
    """Add at most one bin beside each bench, the rest along the trails.

    Draws the order of the benches at first, then the tint of each placed bin.
    """
    bins = [make_trash_bin(k) for k in range(2)]
    candidates = []
    for row in rng.permutation(len(benches)):
        pose = benches[row].world_from_object
        for side in (1.0, -1.0):
            x, y, _, _ = pose @ [-0.05, side * 1.45, 0.0, 1.0]
            candidates.append(np.array([x, y, np.arctan2(pose[1, 0], pose[0, 0]), row]))
    served: set[float] = set()

    def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
        x, y, yaw, row = candidate
        mesh = bins[number % len(bins)]
        if row in served or not builder.is_free((x, y), mesh.footprint):
            return None
        served.add(row)
        return builder.add_upright("trash_bin", mesh, (x, y), yaw=float(yaw), tint=random_tint(rng, 0.06))

    placed = len(place_until_count(count, candidates, attempt))
    if placed < count:
        rest = ObjectGroup(kind="trash_bin", meshes=bins, count=count - placed, spacing=5.0, tint=0.06)
        builder.along_trails(rest, rng, offset=0.6)


ALIKE: Final = 14.0
"""Distance [m] within which two trees are not copies of one individual if another individual is available."""

OFF_TRAIL: Final = 1.6  # [m]
TRIES: Final = 6000


def plant_trees(builder: WorldBuilder, config: Config, growth: np.random.Generator, rng: np.random.Generator) -> None:
    """Plant large trees, then small ones between them, none on a trail."""
    planter, few = config.planter, config.individuals
    for kind, count, spacing in (("large_tree", config.large_trees, 7.0), ("small_tree", config.small_trees, 4.0)):
        common, rare = planter.species(kind), planter.species(f"rare_{kind}")
        # The rare ones come second, so that each is planted even if there are few trees.
        names = [(kind, name, 0) for name in common] + [(f"rare_{kind}", name, 0) for name in rare if few > 1]
        names += [(kind, name, k) for k in range(1, few) for name in common]
        trees = [planter.individual(group, name, k, growth) for group, name, k in names]
        group = ObjectGroup(kind=kind, meshes=trees, count=count, spacing=spacing, scales=(0.9, 1.12), tint=0.07)
        _scatter_varied(builder, group, rng)


def _scatter_varied(builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator) -> None:
    """Scatter trees so that neighbours are different individuals and all are used about equally often.

    Draws ``TRIES`` positions at first; then for each candidate that keeps the spacing a scale, and for a placed tree
    yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free even at about half the spacing.
    """
    darts = builder.random_positions(builder.tries(TRIES), rng)
    hits = darts[builder.trail_distance(darts) > OFF_TRAIL]
    planted: list[tuple[Array, int]] = []

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        if not apart:
            return None
        used = [row for _, row in planted]
        near = {row for other, row in planted if np.hypot(*(other - xy)) < ALIKE}
        row = min(range(len(group.meshes)), key=lambda k: (k in near, used.count(k), k))
        mesh, scale = group.meshes[row], float(rng.uniform(*group.scales))
        if not builder.is_free(xy, mesh.footprint * scale):
            return None
        planted.append((xy, row))
        yaw = float(rng.uniform(0.0, 2.0 * np.pi))
        return builder.add_upright(group.kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, group.tint))

    spacings = eased(group.spacing, (1.0, 0.85, 0.7, 0.55))
    group.check_complete(place_until_count(group.count, hits, attempt, spacings=spacings))


def plant_herbs(builder: WorldBuilder, beds: Sequence[Bed], config: Config, rng: np.random.Generator) -> None:
    """Scatter flowers and ornamental grass in the beds, long grass at trunks, posts and edges, and patches of meadow.

    ``config.herbs`` scales all densities; 0 plants none.
    """
    planter, share = config.planter, config.herbs
    patch = noise_map(builder.size, 11.0, rng, nodes=10)
    base_distance = _base_distance(builder)

    def open_ground(xy: Array, clear: float) -> Mask:
        lines = [line.distance(xy) > clear + 0.6 for line in builder.corridors]
        return np.asarray(np.logical_and.reduce([builder.trail_distance(xy) > clear, *lines]))

    def unmown(xy: Array) -> Array:
        by_base = np.clip(1.25 - base_distance(xy) / 0.26, 0.0, 1.0)
        edge = bed_distance(beds, xy)
        by_edge = 0.75 * ((edge > 0.05) & (edge < 0.19)) * np.clip(0.5 + patch(xy), 0.0, 1.0)
        keep = (edge > 0.05) & (builder.trail_distance(xy) > 0.08)
        return np.asarray(np.maximum(by_base, by_edge) * keep * min(share, 1.0))

    def meadow(xy: Array) -> Array:
        middle = np.clip(3.0 * (patch(xy) - 1.25), 0.0, 1.0)
        free = open_ground(xy, 2.2) & (bed_distance(beds, xy) > 1.0) & (base_distance(xy) > 1.0)
        return np.asarray(middle * free * min(share, 1.0))

    rough = planter.grow("rough_meadow", rng) + planter.grow("rough_forest", rng)
    builder.scatter_swarm(planter.swarm("rough_grass", rough), rng, unmown)
    builder.scatter_swarm(planter.swarm("meadow_islands", planter.grow("meadow_island", rng)), rng, meadow)
    _plant_beds(builder, beds, config, rng)


def _plant_beds(builder: WorldBuilder, beds: Sequence[Bed], config: Config, rng: np.random.Generator) -> None:
    """Scatter flowers of one species along each bed's border, and a few high tufts among its bushes."""
    planter, share = config.planter, config.herbs
    flowers = planter.species("bed_flower")
    for k, name in enumerate(flowers):
        own = beds[k :: len(flowers)]
        if own:
            spec = planter.swarm(f"bed_{name}", planter.grow("bed_flower", rng, species=[name]), form="bed_flower")
            builder.scatter_swarm(spec, rng, _border(own, share, noise_map(builder.size, 1.7, rng, nodes=10)))

    def among_bushes(xy: Array) -> Array:
        return np.asarray((bed_distance(beds, xy) < -0.45) * min(share, 1.0))

    builder.scatter_swarm(planter.swarm("bed_grass", planter.grow("bed_grass", rng)), rng, among_bushes)


def _border(beds: Sequence[Bed], share: float, patch: Callable[[Array], Array]) -> Density:
    def density(xy: Array) -> Array:
        inside = bed_distance(beds, xy)
        return np.asarray(((inside < -0.16) & (inside > -0.75)) * np.clip(0.45 + 0.5 * patch(xy), 0.0, share))

    return density


def _base_distance(builder: WorldBuilder) -> Callable[[Array], Array]:
    """Distance [m] to the nearest trunk, post or leg of furniture as a function of positions (n, 2)."""
    cells = [np.full((1, 2), 1e6)]
    for instance in builder.instances:
        if instance.kind == "bush":
            continue
        mesh, pose = builder.meshes[instance.mesh], instance.world_from_object
        low = mesh.vertices[mesh.vertices[:, 2] < mesh.vertices[:, 2].min() + 0.15].astype(np.float64)
        cells.append(np.unique(np.round((low @ pose[:3, :3].T + pose[:3, 3])[:, :2] / 0.08), axis=0) * 0.08)
    tree = cKDTree(np.concatenate(cells))
    return lambda xy: np.asarray(tree.query(xy)[0])


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
    beds = lay_beds(builder, config, bushes)
    edge_beds(builder, beds, herbs)
    plant_herbs(builder, beds, config, herbs)
    terrain = with_layer(cover_ground(builder, beds, config.border_width, cover), layer)
    backdrop, beyond = make_surroundings(builder, terrain, config, land)
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
