# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rugged hillside (paper, 2.2.4): a mountain's flank, dry and rocky, with sparse high grass, bushes and trees.

It stands for heath on granite: one rock type, and plants that avoid lime (docs/environments.md has the sources). The
mountain rises towards +y (west), the valley falls towards -y, gullies start above the world; a shoulder along x between
them can be driven.

Three grids, each finer and smaller than the one before, are eroded, and each takes its shape from the coarser one: the
region down to the horizon (10 m), the surroundings of the world (1 m), and the world itself. The cover is turf, stony
soil, scree and bare rock; the same fields decide where stones lie and plants grow: stones in the scree, grass in turf.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator, RectBivariateSpline
from scipy.ndimage import gaussian_filter, shift
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import Land, height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.classes import class_table
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.grids import (
    COVER,
    Line,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    solid_noise,
)
from fieldtruth.world.model import Heightfield, Mesh, Raster, Terrain, World, node_axes
from fieldtruth.world.objects.place import stand_objects
from fieldtruth.world.placement import Density, FarSwarm, ObjectGroup, WorldBuilder, tilted, upright_pose
from fieldtruth.world.relief import collapsed, eroded, limit_slope, slope_limit, with_layer, with_microrelief
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks

REGION: Final = 1100.0
"""Half the side length [m] of the region."""
MARGIN: Final = 90.0
"""Width [m] of the surroundings of the world."""
_PROFILE: Final = (
    (-1100, 0), (-700, -5), (-330, -11), (-190, -7), (-150, 0), (-110, 12), (-60, 21), (-25, 25), (-17, 20), (-12, 10),
    (10, 9), (15, 22), (22, 27), (32, 24), (55, 20), (150, 17), (280, 20), (370, 3), (470, -16), (1100, -6),
)  # fmt: skip
"""(y [m], slope [deg] along y): far side of the valley, its floor, lower flank, shoulder, upper flank, top."""


class Mountain(NamedTuple):
    """Ground of the world, (nx, ny) each, and the land around it."""

    heights: Array  # [m]
    drained: Array  # [m^2] that drains through each node, including the mountain above
    land: Land


def make_mountain(x: Array, y: Array, config: Config, corridor_distance: Land, rng: np.random.Generator) -> Mountain:
    """Shape the flank on nodes x, y [m] of the world.

    The slope stays below ``config.route_slope_deg`` near corridors, and about ``config.steepest_deg`` from 9 m on.
    """
    region = _region(rng)
    near_x, near_y = (np.arange(c[0] - MARGIN, c[-1] + MARGIN + 0.5) for c in (x, y))
    gx, gy = np.meshgrid(near_x, near_y, indexing="ij")
    distance = corridor_distance(gx, gy)
    h = region(near_x, near_y) + config.ruggedness * fractal_noise(near_x, near_y, wavelength=26.0, octaves=5, rng=rng)
    steep = slope_limit(
        distance, within=0.9 * config.route_slope_deg, beyond=config.steepest_deg + 4, near=2.5, far=9.0
    )
    h = limit_slope(h, 1.0, steep, rounds=60)
    away = np.clip(distance / 6.0, 0.25, 1.0)
    near = eroded(h, 1.0, strength=0.016 * config.gullies * away, creep=0.05, repose_deg=config.steepest_deg, steps=40)
    spline = RectBivariateSpline(near_x, near_y, near.heights)
    h = spline(x, y) + _fine_relief(x, y, spline, corridor_distance, rng)
    strength = 0.002 * config.gullies * np.clip(corridor_distance(*np.meshgrid(x, y, indexing="ij")) / 4.0, 0.1, 1.0)
    spacing = float(x[1] - x[0])
    h = eroded(h, spacing, strength=strength, creep=0.001, repose_deg=config.steepest_deg, steps=10).heights
    drained = np.exp(RectBivariateSpline(near_x, near_y, np.log(near.drained), kx=1, ky=1)(x, y))
    return Mountain(h, drained, _blended(spline, region, (x, y)))


def smooth_corridors(heights: Array, distance: Array, config: Config) -> Array:
    """Limit the slope of heights (nx, ny) [m] by the ``distance`` [m] from corridors; remove ribs and ledges there.

    What is shorter than about 2 m is removed; the microrelief of the ground replaces it.
    """
    spacing = hills_spacing(config.size)
    limit = slope_limit(distance, within=config.route_slope_deg, beyond=config.steepest_deg, near=1.3, far=6.0)
    h = collapsed(heights, spacing, repose_deg=config.steepest_deg, steps=10)
    h += (gaussian_filter(h, 0.6 / spacing) - h) * np.clip(1.5 - distance / 2.0, 0.0, 0.8)
    return limit_slope(h, spacing, limit, rounds=60)


def _region(rng: np.random.Generator) -> RectBivariateSpline:
    """Land of the region as a spline: a curved ridge and valley along x, with eroded spurs outside the world."""
    c = np.arange(-REGION, REGION + 1, 10.0)
    gx, gy = np.meshgrid(c, c, indexing="ij")
    away = np.hypot(np.maximum(np.abs(gx) - 50, 0), np.maximum(np.abs(gy) - 25, 0))
    far = np.clip((away - 30) / 350, 0, 1)
    bend = (4.0 + 90.0 * far) * fractal_noise(c, c, wavelength=620.0, octaves=3, rng=rng)
    knots, slopes = np.array(_PROFILE, np.float64).T
    fine = np.arange(-REGION - 600, REGION + 601, 1.0)
    profile = np.cumsum(np.tan(np.radians(PchipInterpolator(knots, slopes)(fine.clip(-REGION, REGION)))))
    profile -= np.interp(0.0, fine, profile)
    h = np.interp(gy + bend, fine, profile)
    ridged = 1.0 - np.abs(fractal_noise(c, c, wavelength=420.0, octaves=5, rng=rng, gain=0.5))
    h += far * 26.0 * ridged
    h = eroded(h, 10.0, strength=0.0035 * far, creep=1.0, repose_deg=38.0, steps=30).heights
    return RectBivariateSpline(c, c, h)


def _fine_relief(
    x: Array, y: Array, near: RectBivariateSpline, corridor_distance: Land, rng: np.random.Generator
) -> Array:
    """Hummocks away from corridors, and ribs and ledges of rock on steep slopes there [m]."""
    away = np.clip((corridor_distance(*np.meshgrid(x, y, indexing="ij")) - 0.8) / 5.0, 0.0, 1.0)
    hummocks = fractal_noise(x, y, wavelength=3.2, octaves=3, rng=rng)
    slope = np.hypot(near(x, y, dx=1), near(x, y, dy=1))
    rocky = np.clip((slope - 0.3) / 0.25 + 0.5 * fractal_noise(x, y, wavelength=9.0, octaves=2, rng=rng), 0.0, 1.0)
    ribs = 0.8 - np.abs(fractal_noise(x, y, wavelength=4.5, octaves=4, rng=rng, gain=0.55))
    return np.asarray(away * (0.05 * hummocks + 0.34 * rocky * ribs))


def _blended(near: RectBivariateSpline, far: RectBivariateSpline, axes: tuple[Array, Array]) -> Land:
    """Height of the land beyond the world: the surroundings, blended into the region at their outer edge."""
    half_x, half_y = (float(a[-1]) for a in axes)

    def land(x: Array, y: Array) -> Array:
        away = np.maximum(np.abs(x) - half_x, np.abs(y) - half_y)
        share = np.clip((away - MARGIN + 40) / 38, 0, 1)
        share = share * share * (3 - 2 * share)
        inside = near.ev(x.clip(-half_x - MARGIN, half_x + MARGIN), y.clip(-half_y - MARGIN, half_y + MARGIN))
        return np.asarray(inside * (1 - share) + far.ev(x.clip(-REGION, REGION), y.clip(-REGION, REGION)) * share)

    return land


_COVERS: Final = {"turf": "turf_dry", "soil": "soil_stony", "scree": "scree", "rock": "rock_face"}
"""Materials of the cover's channels."""


class Ground(NamedTuple):
    """The heightfield with the weights of its cover (turf, soil, scree, rock) and its slope [deg]."""

    field: Heightfield
    cover: Raster
    slope: Raster

    def share(self, cover: str, xy: Array) -> Array:
        """Share (n,) of turf, soil, scree or rock at positions (n, 2)."""
        return np.asarray(self.cover.at(xy[:, 0], xy[:, 1])[:, list(_COVERS).index(cover)])

    def slope_deg(self, xy: Array) -> Array:
        """Slope (n,) [deg] at positions (n, 2), averaged over about a metre."""
        return self.slope.at(xy[:, 0], xy[:, 1])


def make_ground(
    config: Config,
    corridors: Sequence[Line],
    rngs: tuple[np.random.Generator, np.random.Generator, np.random.Generator],
) -> tuple[Ground, Land]:
    """Ground of the world, and the height of the land beyond it; generators of relief, cover and microrelief."""
    x, y = grid_axes(config.size, spacing := hills_spacing(config.size))
    distance = _corridor_distance(corridors)
    mountain = make_mountain(x, y, config, distance, rngs[0])
    hills = smooth_corridors(mountain.heights, distance(*np.meshgrid(x, y, indexing="ij")), config)
    ground = cover_ground(make_heightfield(hills, spacing, x, y), mountain.drained, distance, rngs[1])
    # Shares are averaged over about a metre: relief does not change from stone to stone.
    shares = np.moveaxis(ground.cover.at(*np.meshgrid(x, y, indexing="ij")), -1, 0)
    smooth = [gaussian_filter(share, 0.4 / spacing, mode="nearest") for share in shares]
    cover = list(zip(map(config.roughness_of, config.grounds), smooth, strict=True))
    fine = grid_axes(config.size, config.grid)
    heights = with_microrelief(hills, (x, y), fine, cover, rngs[2])
    return ground._replace(field=make_heightfield(heights, config.grid, *fine)), mountain.land


def _corridor_distance(corridors: Sequence[Line]) -> Land:
    """Distance [m] to the nearest corridor's centre line as a function of x, y, to 3 cm; infinite beyond 20 m."""
    if not corridors:
        return lambda x, _: np.full(np.shape(x), np.inf)
    tree = cKDTree(np.concatenate([line.points for line in corridors]))

    def distance(x: Array, y: Array) -> Array:
        return np.asarray(tree.query(np.stack([x, y], axis=-1), distance_upper_bound=20.0)[0])

    return distance


def cover_ground(field: Heightfield, drained: Array, corridor_distance: Land, rng: np.random.Generator) -> Ground:
    """Cover a heightfield by slope, by the area ``drained`` (nx, ny) [m^2] through its nodes, and by noise."""
    (nx, ny), (x, y) = field.heights.shape, node_axes(field)
    cell = COVER * coarseness((field.spacing * nx, field.spacing * ny))
    fine_x, fine_y = (np.asarray(np.arange(c[0], c[-1] + cell / 2, cell), np.float64) for c in (x, y))
    smooth = gaussian_filter(field.heights.astype(np.float64), 0.5 / field.spacing)
    steep = np.degrees(np.arctan(np.hypot(*np.gradient(smooth, field.spacing))))
    slope = make_raster(steep, field.spacing, x, y)
    # Scree lies below breaking rock: the mean of the rock within some metres uphill (towards +y).
    breaking = np.clip((steep - 27) / 6, 0, 1)
    fallen = gaussian_filter(shift(breaking, (0, -4.0 / field.spacing), order=1, mode="nearest"), 2.0 / field.spacing)
    gully = np.clip((np.log10(drained) - 2.3) / 0.7, 0, 1)
    patch = fractal_noise(fine_x, fine_y, wavelength=11.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(fine_x, fine_y, wavelength=1.3, octaves=4, rng=rng, gain=0.7)
    gx, gy = np.meshgrid(fine_x, fine_y, indexing="ij")
    steep, fallen, gully = (make_raster(v, field.spacing, x, y).at(gx, gy) for v in (steep, fallen, gully))
    # Turf is worn off in the corridors, and loose stones are pressed into the soil: firm ground, as on mountain trails.
    trodden = np.clip(1.3 - corridor_distance(gx, gy) / 1.6, 0, 0.5)
    rock = np.clip((steep - 29) / 5 + 0.5 * patch + 0.45 * fine - 0.25, 0, 1)
    scree = np.clip(1.5 * fallen + 0.7 * gully + 0.45 * patch + 0.35 * fine - 0.5 - 2 * trodden, 0, 1)
    turf = np.clip(0.52 - np.clip(steep - 18, 0, 30) / 30 - 0.38 * patch + 0.4 * fine - trodden, 0, 1)
    free = 1 - rock
    weights = [free * (1 - scree) * turf, free * (1 - scree) * (1 - turf), free * scree, rock]
    return Ground(field, make_raster(np.stack(weights, axis=-1), cell, fine_x, fine_y), slope)


def as_terrain(ground: Ground, size: tuple[float, float]) -> Terrain:
    """Terrain without trails: the distance to one is 1 km everywhere."""
    nodes = tuple(int(s) + 1 for s in size)
    return Terrain(
        field=ground.field,
        trail_distance=Raster(values=np.full(nodes, 1000.0, np.float32), spacing=1.0, x0=-size[0] / 2, y0=-size[1] / 2),
        cover=ground.cover,
        ground_materials=tuple(_COVERS.values()),
        trail_material="soil_stony",
        border_material="soil_stony",
    )


TRIES = 6000


def plant_trees(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Plant pines, oaks and dead pines where there is soil."""

    def soil(xy: Array) -> Array:
        return _soil(ground, xy)

    planter, few = config.planter, config.individuals
    counts = {"pine": few, "oak": few, "snag": min(few, 3)}
    pines, oaks, snags = (planter.grow(group, rng, count=count) for group, count in counts.items())
    for kind, meshes, count, spacing, tilt in (
        ("pine", pines, config.pines, 8.0, 0.0),
        ("oak", oaks, config.oaks, 6.0, 0.0),
        ("snag", snags, config.snags, 8.0, 0.1),
    ):
        _scatter(builder, _group(kind, meshes, count, spacing), rng, soil, tilt)


def plant_bushes(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Plant junipers, gorse and heather in groups."""

    def thicket(xy: Array) -> Array:
        noise = solid_noise(xy, wavelength=14, octaves=2, rng=rng)
        return np.asarray(_soil(ground, xy) * np.clip(0.25 + 0.7 * noise, 0.03, 1))

    for kind, count, spacing in (
        ("juniper", config.junipers, 2.2),
        ("gorse", config.gorse, 1.4),
        ("heather", config.cushions, 0.9),
    ):
        meshes = config.planter.grow(kind, rng, count=config.individuals + 1)
        _scatter(builder, _group(kind, meshes, count, spacing), rng, thicket, tilt=0.5)


def _soil(ground: Ground, xy: Array) -> Array:
    """Share (n,) of soil that is not too steep."""
    return np.clip(1 - ground.share("scree", xy) - ground.share("rock", xy), 0, 1) * (ground.slope_deg(xy) < 30)


def _group(kind: str, meshes: list[Mesh], count: int, spacing: float) -> ObjectGroup:
    return ObjectGroup(kind=kind, meshes=meshes, count=count, spacing=spacing, scales=(0.85, 1.15), tint=0.07)


def _scatter(
    builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator, density: Density, tilt: float
) -> None:
    """Scatter plants that lean by a share ``tilt`` of the slope.

    Draws ``TRIES`` positions and a number for each at first; then for each candidate a scale, and for a placed plant
    yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free, even without spacing.
    """
    darts = builder.random_positions(TRIES, rng)
    hits = darts[rng.random(TRIES) < density(darts)]

    def pose(xy: Array, yaw: float, scale: float) -> Array:
        return _stem_pose(builder.field, xy, yaw, scale, tilt)

    builder.place(group, rng, hits, eases=(1.0, 0.7, 0.4, 0.0), pose=pose)


def _stem_pose(field: Heightfield, xy: Array, yaw: float, scale: float, tilt: float) -> Array:
    """Pose (4, 4) of a plant whose stem meets the slope."""
    x, y = xy
    dx, dy = field.slope_at(x, y)
    pose = upright_pose(x, y, yaw, scale)
    pose[:3, :3] = tilted(pose[None], dx, dy, tilt)[0]
    # Roots reach below the stem; its base, a few decimetres wide, must not show on the downhill side.
    pose[2, 3] = float(field.height_at(x, y)) - 0.12 * float(np.hypot(dx, dy)) * (1 - tilt)
    return pose


def plant_grass(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> list[Mesh]:
    """Scatter tufts of bristle bent, dense in the turf and sparse elsewhere; return the meshes."""
    tufts = config.planter.grow("grass", rng)

    def density(xy: Array) -> Array:
        clump = np.clip(0.5 + 0.6 * solid_noise(xy, wavelength=5.0, octaves=3, rng=rng), 0, 1)
        return np.clip(0.02 + 0.9 * clump * ground.share("turf", xy) * (1 - ground.share("scree", xy)), 0, 1)

    if config.grass:
        builder.scatter_swarm(config.planter.swarm("grass", tufts, per_m2=config.grass), rng, density)
    return tufts


def place_rocks(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Add rocks with colliders, large ones first."""

    def steep(xy: Array) -> Array:
        return np.clip((ground.slope_deg(xy) - 17) / 10, 0.02, 1)

    def rolled(xy: Array) -> Array:
        return np.clip(0.15 + ground.share("scree", xy) + 0.5 * ground.share("rock", xy), 0, 1)

    few = config.individuals
    counts = {"crag": 2 * few, "boulder": 2 * few, "block": 2 * few, "slab": few}
    rocks = {group: config.planter.grow(group, rng, count=count) for group, count in counts.items()}
    for kind, made, count, density, spacing, scales in (
        ("crag", "crag", config.crags, steep, 2.6, (0.8, 1.25)),
        ("boulder", "boulder", config.boulders, rolled, 3.0, (0.85, 1.2)),
        ("rock", "block", config.blocks, rolled, 1.2, (0.75, 1.3)),
        ("slab", "slab", config.slabs, rolled, 1.5, (0.7, 1.2)),
    ):
        group = ObjectGroup(kind=kind, meshes=rocks[made], count=count, spacing=spacing, scales=scales, tint=0.08)
        scatter_rocks(builder, group, rng, density)


def scatter_stones(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Scatter swarms of stones, off the corridors' centre lines, and of pebbles."""

    def loose(xy: Array) -> Array:
        return np.clip(0.12 + 0.9 * ground.share("scree", xy) + 0.5 * ground.share("rock", xy), 0, 1)

    def gravel(xy: Array) -> Array:
        return np.clip(1 - 0.85 * ground.share("turf", xy) - 0.4 * ground.share("rock", xy), 0, 1)

    stones, pebbles = (config.planter.grow(group, rng) for group in ("stone", "pebble"))
    if config.stones:
        builder.scatter_swarm(config.planter.swarm("stones", stones, per_m2=config.stones), rng, loose)
    if config.pebbles:
        builder.scatter_swarm(config.planter.swarm("pebbles", pebbles, per_m2=config.pebbles), rng, gravel)


def scatter_beyond_edge(
    builder: WorldBuilder, config: Config, backdrop: Mesh, tufts: Sequence[Mesh], rng: np.random.Generator
) -> list[FarSwarm]:
    """Scatter bushes, few trees, grass and boulders over the land beyond the edge."""
    planter, size = config.planter, builder.size
    ground = height_beyond(builder.field, size, backdrop)
    bushes = planter.swarm("far_bushes", planter.grow("far_bush", rng))
    trees = planter.swarm("far_trees", planter.grow("far_tree", rng))
    plants = [
        scatter_beyond(size, ground, bushes, rng),
        scatter_beyond(size, ground, trees, rng, margin=3.0),
        scatter_beyond(size, ground, planter.swarm("far_grass", tufts), rng, within=22.0, margin=0.3),
    ]
    rocks = [
        make_rock(ROCK_TYPES[name], name=f"far_{name}_{k}", size=length, rng=rng, triangles=320, solid=False)
        for k, length in enumerate((0.7, 1.2, 2.2))
        for name in ("granite", "crag")
    ]
    return [*plants, scatter_beyond(size, ground, planter.swarm("far_rocks", rocks), rng, within=75.0, margin=1.8)]


def build(seed: int, corridors: Sequence[Line], config: Config) -> World:
    """Build a hillside; ``corridors`` are moderately steep and free of obstacles.

    The same arguments give the same world.

    Raises:
        CrowdedWorldError: the layout has more objects than fit into the world.
    """
    seeds = np.random.SeedSequence(seed).spawn(9)
    relief, cover, rocks, stones, plants, grass, beyond = (np.random.default_rng(s) for s in seeds[:7])
    microrelief, layer = (np.random.default_rng(s) for s in seeds[8].spawn(2))
    ground, land = make_ground(config, corridors, (relief, cover, microrelief))
    builder = WorldBuilder(ground.field, config.size, (), corridors, corridor_width=2.6)
    stand_objects(builder, config.objects, class_table(config.classes))
    place_rocks(builder, ground, config, rocks)
    plant_trees(builder, ground, config, plants)
    plant_bushes(builder, ground, config, plants)
    scatter_stones(builder, ground, config, stones)
    tufts = plant_grass(builder, ground, config, grass)
    hills = np.random.default_rng(beyond.integers(2**63))
    backdrop = make_backdrop(ground.field, config.size, "heath", hills, land=land)
    terrain = with_layer(as_terrain(ground, config.size), layer)
    far = scatter_beyond_edge(builder, config, backdrop, tufts, beyond)
    return assemble(
        builder,
        terrain,
        name="hillside",
        seed=seed,
        textures=seeds[7],
        backdrop=backdrop,
        beyond=far,
        litter=config.litter,
        objects=config.objects,
    )
