# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The urban park (paper, 2.2.1): almost plane ground, two trails, trees, bushes, lamps, benches, tables, bins."""

from collections.abc import Sequence
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from fieldtruth.experiment.rig import Frozen, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import make_backdrop
from fieldtruth.world.furniture import make_bench, make_lamp_post, make_table, make_trash_bin
from fieldtruth.world.model import Heightfield, Raster, Terrain, World
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint
from fieldtruth.world.plants import BUSHES, SPECIES, grow_bush, grow_tree
from fieldtruth.world.trails import Line, Trail, signed_distance

Array = NDArray[np.float64]
TREES: Final = (SPECIES["lime"], SPECIES["birch"], SPECIES["oak"])
SHRUBS: Final = (BUSHES["box"], BUSHES["hazel"])
Count = Annotated[int, Field(ge=0, le=1000)]


class ParkConfig(Frozen):
    """How the park is laid out; the counts are those of the published world."""

    size: tuple[Positive, Positive] = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    relief: float = 0.21  # [m], standard deviation of the ground's height
    trails: tuple[tuple[tuple[float, float], ...], ...] = (
        ((-58, -7), (-33, -6), (-17, -3), (0, 3.5), (12, 8.5), (26, 12), (40, 14.5), (58, 20)),
        ((-31, 34), (-22, 18), (-12, 8), (-3.5, 1.2), (4, -6), (16, -12), (32, -15), (58, -18)),
    )  # [m]
    trail_width: Positive = 2.4  # [m]
    border_width: Positive = 0.14  # [m]
    large_trees: Count = 23
    small_trees: Count = 15
    bushes: Count = 34
    benches: Count = 16
    lamp_posts: Count = 15
    tables: Count = 11
    trash_bins: Count = 11
    individuals: Annotated[int, Field(ge=1, le=32)] = 4  # of each species and size


def build_park(seed: int, corridors: Sequence[Line], config: ParkConfig | None = None) -> World:
    """Lay out a park; ``corridors`` are lines that robots drive and that stay free. Same arguments, same world."""
    config = config if config is not None else ParkConfig()
    seeds = np.random.SeedSequence(seed).spawn(8)
    relief, plants, woods, shrubs, furniture, cover, land = (np.random.default_rng(s) for s in seeds[:-1])
    trails = [Trail(Line.through(corners), config.trail_width) for corners in config.trails]
    field = _terrain(config, relief)
    site = Site(field, config.size, trails, corridors)
    _furnish(site, config, furniture)
    _plant_trees(site, config, plants, woods)
    _plant_bushes(site, config, shrubs)
    return assemble(
        site,
        _ground(site, config, cover),
        name="park",
        seed=seed,
        textures=seeds[-1],
        backdrop=make_backdrop(field, config.size, "meadow", land),
    )


def _axes(size: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Coordinates of grid nodes along x and y, both edges included."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / spacing) + 1) for s in size)
    return x, y


def _terrain(config: ParkConfig, rng: np.random.Generator) -> Heightfield:
    x, y = _axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=46.0, octaves=3, rng=rng, gain=0.35)
    bumps = fractal_noise(x, y, wavelength=2.4, octaves=2, rng=rng)
    heights = config.relief * swell + 0.008 * bumps
    return Heightfield(
        heights=(heights - heights.mean()).astype(np.float32), spacing=config.grid, x0=float(x[0]), y0=float(y[0])
    )


def _furnish(site: Site, config: ParkConfig, rng: np.random.Generator) -> None:
    """Benches and lamps line the trails, a bin stands beside a bench, tables stand in the lawn."""
    benches = [make_bench(k) for k in range(3)]
    lamps, bins = [make_lamp_post(k) for k in range(2)], [make_trash_bin(k) for k in range(2)]
    tables = [make_table(k) for k in range(2)]
    site.along_trails("lamp_post", lamps[:1], config.lamp_posts, rng=rng, offset=0.45, spacing=9.0, tint=0.03)
    seats = site.along_trails("bench", benches, config.benches, rng=rng, offset=0.95, spacing=6.0, tint=0.08)
    placed = 0
    for row in rng.permutation(len(seats)):
        pose = seats[row].world_from_object
        for side in (1.0, -1.0):
            if placed == config.trash_bins:
                break
            x, y, _, _ = pose @ [-0.05, side * 1.45, 0.0, 1.0]
            mesh = bins[placed % len(bins)]
            if site.is_free(x, y, mesh.footprint):
                yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
                site.place("trash_bin", mesh, x, y, yaw=yaw, tint=random_tint(rng, 0.06))
                placed += 1
                break
    if placed < config.trash_bins:
        site.along_trails("trash_bin", bins, config.trash_bins - placed, rng=rng, offset=0.6, spacing=5.0, tint=0.06)

    def on_lawn(places: Array) -> NDArray[np.bool_]:
        return np.abs(site.trail_distance(places) - 4.5) < 2.5

    site.scatter("table", tables, config.tables, rng=rng, allowed=on_lawn, spacing=5.0, tint=0.08)


def _plant_trees(site: Site, config: ParkConfig, rng: np.random.Generator, growth: np.random.Generator) -> None:
    """Large trees at crown's distance, small ones between them, none on a trail."""

    def off_trails(places: Array) -> NDArray[np.bool_]:
        return site.trail_distance(places) > 1.6

    for kind, heights, count, spacing in (
        ("large_tree", (9.5, 14.5), config.large_trees, 7.0),
        ("small_tree", (3.2, 5.0), config.small_trees, 4.0),
    ):
        trees = [
            grow_tree(species, name=f"{kind}_{species.name}_{k}", height=float(growth.uniform(*heights)), rng=growth)
            for k in range(config.individuals)
            for species in TREES
        ]
        site.scatter(kind, trees, count, rng=rng, allowed=off_trails, spacing=spacing, scales=(0.9, 1.12), tint=0.07)


def _plant_bushes(site: Site, config: ParkConfig, rng: np.random.Generator) -> None:
    """Bushes stand in beds of three to six of one kind."""
    shrubs = {
        kind.name: [
            grow_bush(kind, name=f"bush_{kind.name}_{k}", height=kind.grown.height * float(rng.uniform(0.6, 1.1)), rng=rng)
            for k in range(3)
        ]
        for kind in SHRUBS
    }
    remaining, kinds = config.bushes, list(shrubs)
    length, width = site.size
    for bed in range(400):
        if remaining == 0:
            break
        cx, cy = rng.uniform(-0.5, 0.5, 2) * [length - 4, width - 4]
        if site.trail_distance(np.array([[cx, cy]]))[0] < 2.2:
            continue
        meshes = shrubs[kinds[bed % len(kinds)]]
        for _ in range(int(rng.integers(3, 7))):
            angle, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 2.0)
            x, y = cx + reach * np.cos(angle), cy + reach * np.sin(angle)
            mesh, scale = meshes[int(rng.integers(len(meshes)))], float(rng.uniform(0.75, 1.2))
            clear = site.trail_distance(np.array([[x, y]]))[0] > mesh.footprint * scale + 0.2
            if remaining and clear and site.is_free(x, y, mesh.footprint * scale):
                yaw = float(rng.uniform(0, 2 * np.pi))
                site.place("bush", mesh, x, y, yaw=yaw, scale=scale, tint=random_tint(rng, 0.08))
                remaining -= 1
    if remaining:
        raise CrowdedWorldError(f"{remaining} of {config.bushes} bushes find no bed in the park; ask for fewer")


def _ground(site: Site, config: ParkConfig, rng: np.random.Generator) -> Terrain:
    """Lawn, drier and worn in places, bare below old crowns, mulch in the beds, trails with a border of setts."""
    x, y = _axes(config.size, 0.1)
    distance = signed_distance(site.trails, x, y)
    patch = fractal_noise(x, y, wavelength=14.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    worn = np.clip(1.1 - distance / 0.45 + 0.8 * fine, 0.0, 1.0)
    bed, litter = np.zeros_like(patch), np.zeros_like(patch)
    for instance in site.instances:
        ix, iy, _ = instance.world_from_object[:3, 3]
        radius = {"bush": 0.9, "large_tree": 1.1, "small_tree": 0.5}.get(instance.kind)
        if radius is None:
            continue
        away = np.hypot(*np.meshgrid(x - ix, y - iy, indexing="ij"))
        under = litter if instance.kind == "large_tree" else bed
        ragged = (0.5, 0.35) if instance.kind == "large_tree" else (0.12, 0.1)
        here = np.clip((radius - away) / ragged[0] + ragged[1] * 3.1 * fine, 0.0, 1.0) * (away < radius + 1.0)
        under[...] = np.maximum(under, here)
    dry = np.clip(0.32 + 0.36 * patch + 0.26 * fine, 0.0, 0.95)
    soil = np.clip(0.9 * worn * (0.5 + 0.4 * fine), 0.0, 1.0)
    free = (1.0 - bed) * (1.0 - litter)
    cover = np.stack(
        [free * (1 - soil) * (1 - dry), free * (1 - soil) * dry, free * soil, bed, litter * (1 - bed)], axis=-1
    )
    return Terrain(
        field=site.field,
        trail_distance=Raster(values=distance, spacing=0.1, x0=float(x[0]), y0=float(y[0])),
        cover=Raster(values=cover.astype(np.float32), spacing=0.1, x0=float(x[0]), y0=float(y[0])),
        ground_materials=("lawn", "lawn_dry", "soil", "mulch", "litter"),
        trail_material="gravel",
        border_material="setts",
        border_width=config.border_width,
    )


__all__ = ["ParkConfig", "build_park"]
