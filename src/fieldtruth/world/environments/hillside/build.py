# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rugged hillside (paper, 2.2.4): a mountain's flank, dry and rocky, with sparse high grass, bushes and trees.

It stands for heath on granite: one rock type, and plants that avoid lime (docs/environments.md has the sources). The
mountain rises towards +y (west), the valley falls towards -y; a shoulder along x between them can be driven.
"""

from collections.abc import Sequence

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.hillside.ground import Ground, as_terrain, make_ground
from fieldtruth.world.grids import Line, solid_noise
from fieldtruth.world.model import Heightfield, Mesh, World
from fieldtruth.world.placement import (
    Density,
    FarSwarm,
    ObjectGroup,
    WorldBuilder,
    tilted,
    upright_pose,
)
from fieldtruth.world.relief import with_layer
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks

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
    return np.clip(1 - ground.scree(xy) - ground.rock(xy), 0, 1) * (ground.slope_deg(xy) < 30)


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
        return np.clip(0.02 + 0.9 * clump * ground.turf(xy) * (1 - ground.scree(xy)), 0, 1)

    if config.grass:
        builder.scatter_swarm(config.planter.swarm("grass", tufts, per_m2=config.grass), rng, density)
    return tufts


def place_rocks(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Add rocks with colliders, large ones first."""

    def steep(xy: Array) -> Array:
        return np.clip((ground.slope_deg(xy) - 17) / 10, 0.02, 1)

    def rolled(xy: Array) -> Array:
        return np.clip(0.15 + ground.scree(xy) + 0.5 * ground.rock(xy), 0, 1)

    few = config.individuals
    crags = _make_rocks("crag", "crag", (2.2, 3.0), 2400, 2 * few, rng)
    boulders = _make_rocks("granite", "boulder", (1.1, 1.8), 1600, 2 * few, rng)
    blocks = _make_rocks("granite scree", "block", (0.45, 0.85), 720, 2 * few, rng)
    slabs = _make_rocks("slab", "slab", (0.7, 1.5), 900, few, rng)
    for kind, meshes, count, density, spacing, scales in (
        ("crag", crags, config.crags, steep, 2.6, (0.8, 1.25)),
        ("boulder", boulders, config.boulders, rolled, 3.0, (0.85, 1.2)),
        ("rock", blocks, config.blocks, rolled, 1.2, (0.75, 1.3)),
        ("slab", slabs, config.slabs, rolled, 1.5, (0.7, 1.2)),
    ):
        group = ObjectGroup(kind=kind, meshes=meshes, count=count, spacing=spacing, scales=scales, tint=0.08)
        scatter_rocks(builder, group, rng, density)


def scatter_stones(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Scatter swarms of stones, off the corridors' centre lines, and of pebbles."""

    def loose(xy: Array) -> Array:
        return np.clip(0.12 + 0.9 * ground.scree(xy) + 0.5 * ground.rock(xy), 0, 1)

    def gravel(xy: Array) -> Array:
        return np.clip(1 - 0.85 * ground.turf(xy) - 0.4 * ground.rock(xy), 0, 1)

    stones = _make_rocks("scree granite slab", "stone", (0.13, 0.2), 180, 4, rng)
    pebbles = _make_rocks("scree granite", "pebble", (0.04, 0.07), 80, 5, rng)
    if config.stones:
        builder.scatter_swarm(config.planter.swarm("stones", stones, per_m2=config.stones), rng, loose)
    if config.pebbles:
        builder.scatter_swarm(config.planter.swarm("pebbles", pebbles, per_m2=config.pebbles), rng, gravel)


def _make_rocks(
    types: str, name: str, sizes: tuple[float, float], triangles: int, count: int, rng: np.random.Generator
) -> list[Mesh]:
    """Make ``count`` rocks of each of the types (words), of sizes between two bounds [m]."""
    return [
        make_rock(
            ROCK_TYPES[rock_type],
            name=f"{name}_{rock_type}_{k}",
            size=float(rng.uniform(*sizes)),
            rng=rng,
            triangles=triangles,
            solid=sizes[1] > 0.3,
        )
        for k in range(count)
        for rock_type in types.split()
    ]


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
        beyond=scatter_beyond_edge(builder, config, backdrop, tufts, beyond),
        litter=config.litter,
    )
