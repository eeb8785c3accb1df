# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Plants of the hillside: few trees, dead ones among them, bushes in groups, dry grass where there is soil."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.hillside.config import Config
from fieldtruth.world.environments.hillside.ground import Ground
from fieldtruth.world.grids import solid_noise
from fieldtruth.world.model import Heightfield, Instance, Mesh
from fieldtruth.world.placement import (
    Density,
    ObjectGroup,
    SwarmSpec,
    WorldBuilder,
    eased,
    place_until_count,
    random_tint,
    tilted,
    upright_pose,
)
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_snag, grow_tree, grow_tuft

TRIES = 6000


def plant_trees(builder: WorldBuilder, ground: Ground, config: Config, rng: np.random.Generator) -> None:
    """Plant pines, oaks and dead pines where there is soil."""

    def soil(xy: Array) -> Array:
        return _soil(ground, xy)

    few, uniform = config.individuals, rng.uniform
    pines = [
        grow_tree(TREES["pine"], name=f"pine_{k}", height=uniform(6.6, 9.5), rng=rng, detail=0.4) for k in range(few)
    ]
    oaks = [grow_tree(TREES["oak"], name=f"oak_{k}", height=uniform(4.0, 6.2), rng=rng, detail=0.6) for k in range(few)]
    snags = [
        grow_snag(TREES["pine"], name=f"snag_{k}", height=uniform(2.5, 5.5), rng=rng, detail=0.6)
        for k in range(min(few, 3))
    ]
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

    for kind, count, low, high, spacing in (
        ("juniper", config.junipers, 0.75, 1.15, 2.2),
        ("gorse", config.gorse, 0.5, 1.0, 1.4),
        ("heather", config.cushions, 0.7, 1.3, 0.9),
    ):
        full = BUSHES[kind].grown.height
        meshes = [
            grow_bush(BUSHES[kind], name=f"{kind}_{k}", height=full * rng.uniform(low, high), rng=rng, detail=0.6)
            for k in range(config.individuals + 1)
        ]
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

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        mesh, scale = group.mesh(number), float(rng.uniform(*group.scales))
        radius = mesh.footprint * scale
        if not apart or not builder.is_free(xy, radius):
            return None
        pose = _stem_pose(builder.field, xy, float(rng.uniform(0, 2 * np.pi)), scale, tilt)
        return builder.add(group.kind, mesh, pose, [(*xy, radius)], tint=random_tint(rng, group.tint))

    group.check_complete(
        place_until_count(group.count, hits, attempt, spacings=eased(group.spacing, (1.0, 0.7, 0.4, 0.0)))
    )


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
    species = GRASSES["bent"]
    low, high = species.height
    tufts = [
        grow_tuft(species, name=f"tuft_{k}", height=float(rng.uniform(0.8 * low, high)), rng=rng) for k in range(8)
    ]

    def density(xy: Array) -> Array:
        clump = np.clip(0.5 + 0.6 * solid_noise(xy, wavelength=5.0, octaves=3, rng=rng), 0, 1)
        return np.clip(0.02 + 0.9 * clump * ground.turf(xy) * (1 - ground.scree(xy)), 0, 1)

    if config.grass:
        spec = SwarmSpec(
            name="grass",
            kind="high_grass",
            meshes=tufts,
            per_m2=config.grass,
            scales=(0.5, 1.1),
            tilt=0.2,
            lean_deg=6,
            sink=0.02,
        )
        builder.scatter_swarm(spec, rng, density)
    return tufts
