# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The urban park (paper, 2.2.1): almost plane ground, two trails, trees, bushes, lamps, benches, tables, bins."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Frozen, Number, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.environments.layout import Count, Individuals, Share, Size, Trails
from fieldtruth.world.environments.park_beds import edge_beds, lay_beds
from fieldtruth.world.environments.park_beyond import grow_beyond
from fieldtruth.world.environments.park_garden import plant_trees, sow_herbs
from fieldtruth.world.environments.park_ground import cover_ground
from fieldtruth.world.furniture import make_bench, make_lamp_post, make_table, make_trash_bin
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Heightfield, World
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import Site, random_tint
from fieldtruth.world.trails import Line, Trail

BUSH_INDIVIDUALS: Final = 3  # of each kind


class ParkConfig(Frozen):
    """How the park is laid out; the counts are those of the published world."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    relief: Number = 0.21  # [m], standard deviation of the ground's height
    trails: Trails = (
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
    individuals: Individuals = 4  # of each common species and size
    herbs: Share = 1.0  # of the flowers and the long grass
    beyond: Share = 0.7  # of the trees and bushes on the land outside


def build_park(seed: int, corridors: Sequence[Line], config: ParkConfig | None = None) -> World:
    """Lay out a park; ``corridors`` are lines that robots drive and that stay free. Same arguments, same world."""
    config = config if config is not None else ParkConfig()
    seeds = np.random.SeedSequence(seed).spawn(9)
    relief, plants, woods, shrubs, furniture, cover, land, herbs = (np.random.default_rng(s) for s in seeds[:-1])
    trails = [Trail(Line.through(corners), config.trail_width) for corners in config.trails]
    field = _terrain(config, relief)
    site = Site(field, config.size, trails, corridors)
    _furnish(site, config, furniture)
    plant_trees(site, config.large_trees, config.small_trees, config.individuals, woods, plants)
    beds = lay_beds(site, config.bushes, BUSH_INDIVIDUALS, shrubs)
    edge_beds(site, beds, herbs)
    sow_herbs(site, beds, config.herbs, herbs)
    terrain = cover_ground(site, beds, config.border_width, cover)
    backdrop, beyond = grow_beyond(site, terrain, config.beyond, land)
    return assemble(
        site,
        terrain,
        name="park",
        seed=seed,
        textures=seeds[-1],
        backdrop=backdrop,
        beyond=beyond,
    )


def _terrain(config: ParkConfig, rng: np.random.Generator) -> Heightfield:
    x, y = grid_axes(config.size, config.grid)
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


__all__ = ["ParkConfig", "build_park"]
