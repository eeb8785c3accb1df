# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The dense forest (paper, 2.2.3): trees on uneven ground, two trails, high grass, stones, bushes, fallen trunks."""

from collections.abc import Mapping, Sequence

import numpy as np
from pydantic import Field, field_validator
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Frozen, Positive
from fieldtruth.world.assembly import assemble
from fieldtruth.world.backdrop import make_backdrop
from fieldtruth.world.environments.forest_beyond import canopy, far_cover, wood_beyond
from fieldtruth.world.environments.forest_floor import lay_rocks, lay_trunks
from fieldtruth.world.environments.forest_flora import plant_bushes, plant_trees, strew_herbs
from fieldtruth.world.environments.layout import Count, Density, Individuals, Share, Size, Trails
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Heightfield, Raster, Terrain, World
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import Site
from fieldtruth.world.plants import TREES
from fieldtruth.world.relief import gentled, slope_limit
from fieldtruth.world.trails import Line, Trail, signed_distance


class ForestConfig(Frozen):
    """How the forest is laid out; at most 500 things have names, so that a message of all poses stays small."""

    size: Size = (100.0, 50.0)  # [m] along x (north) and y (west)
    grid: Positive = 0.2  # [m] between the terrain's nodes
    relief: Positive = 0.55  # [m], standard deviation of the ground's height
    trails: Trails = (
        ((-60, -15), (-42, -9), (-31, -11), (-19, -4), (-8, -5), (4, 1), (15, 7), (27, 4), (38, 8), (60, 2)),
        ((-27, 36), (-19, 20), (-13, 13), (-9, 4), (-8, -5), (-1, -12), (10, -14), (21, -10), (29, -16), (34, -36)),
    )  # [m]
    trail_width: Positive = 1.7  # [m]
    old_trees: Count = 102
    grown_trees: Count = 140
    young_trees: Count = 110
    snags: Count = 14
    fallen_trunks: Count = 13
    stumps: Count = 8
    bushes: Count = 38
    rocks: Count = 36
    stones_per_m2: Density = 0.35
    grass_per_m2: Density = 5.0
    ferns_per_m2: Density = 0.75
    individuals: Individuals = 4  # of each species and age
    species: Mapping[str, Share] = Field(
        default={"spruce": 0.36, "beech": 0.26, "pine": 0.16, "birch": 0.1, "oak": 0.12},
        description="shares by species, each from 0 up to 1",
    )
    """Shares of the trees."""

    @field_validator("species")
    @classmethod
    def _known(cls, species: Mapping[str, float]) -> Mapping[str, float]:
        unknown = [name for name in species if name not in TREES]
        if unknown or not sum(species.values()) > 0:
            what = f"no species {unknown[0]!r}" if unknown else "no share above 0"
            raise ValueError(f"{what}; there is: {', '.join(sorted(TREES))}")
        return species


def build_forest(seed: int, corridors: Sequence[Line], config: ForestConfig | None = None) -> World:
    """Grow a forest; ``corridors`` are lines that robots drive and that stay free. Same arguments, same world."""
    config = config if config is not None else ForestConfig()
    seeds = np.random.SeedSequence(seed).spawn(10)
    relief, growth, woods, dead, shrubs, stones, herbs, cover, land = (np.random.default_rng(s) for s in seeds[:-1])
    trails = [Trail(Line.through(corners), config.trail_width) for corners in config.trails]
    field = _terrain(config, trails, relief)
    site = Site(field, config.size, trails, corridors)
    lay_trunks(site, config, dead)
    plant_trees(site, config, growth, woods)
    lay_rocks(site, config, stones)
    plant_bushes(site, config, shrubs)
    light = fractal_noise(*grid_axes(config.size, 0.5), wavelength=13.0, octaves=3, rng=herbs)
    glade = Raster(values=light.astype(np.float32), spacing=0.5, x0=-config.size[0] / 2, y0=-config.size[1] / 2)
    strew_herbs(site, config, glade, herbs)
    backdrop = make_backdrop(
        field, config.size, ("needles", "canopy"), land, land=canopy(config.size, land), cover=far_cover(config.size)
    )
    return assemble(
        site,
        _ground(site, config, glade, cover),
        name="forest",
        seed=seed,
        textures=seeds[-1],
        backdrop=backdrop,
        beyond=wood_beyond(site, config, backdrop, growth, land),
    )


def _terrain(config: ForestConfig, trails: Sequence[Trail], rng: np.random.Generator) -> Heightfield:
    """Swells, hollows and the mounds and pits that uprooted trees leave; trodden flat along the trails."""
    x, y = grid_axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.45)
    mounds = np.abs(fractal_noise(x, y, wavelength=6.5, octaves=3, rng=rng, gain=0.5))
    bumps = fractal_noise(x, y, wavelength=1.7, octaves=3, rng=rng, gain=0.6)
    heights = config.relief * swell + 0.17 * mounds
    off_trail = signed_distance(trails, x, y).astype(np.float64)
    on_trail = 1.0 / (1.0 + np.exp((off_trail - 0.5) / 0.35))
    trodden = gaussian_filter(heights, 1.2 / config.grid) - 0.05
    heights = heights * (1.0 - on_trail) + trodden * on_trail
    heights = gentled(heights, config.grid, slope_limit(off_trail, within=10.0, beyond=32.0, near=0.6, far=5.0))
    heights += bumps * (0.028 - 0.018 * on_trail)
    return Heightfield(
        heights=(heights - heights.mean()).astype(np.float32), spacing=config.grid, x0=float(x[0]), y0=float(y[0])
    )


def _ground(site: Site, config: ForestConfig, glade: Raster, rng: np.random.Generator) -> Terrain:
    """Needles below conifers, leaves below broadleaved trees, moss in patches, humus between."""
    x, y = grid_axes(config.size, 0.1)
    px, py = np.meshgrid(x, y, indexing="ij")
    distance = signed_distance(site.trails, x, y)
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    conifers, broad = _crown_share(site, x, y)
    leaves = np.clip(0.5 + 0.55 * (broad - conifers) + 0.22 * patch, 0.05, 0.95)
    moss = np.clip(0.25 * patch + 0.3 * fine - 0.18 * glade.at(px, py) - 0.12, 0.0, 0.9) * (distance > 0.2)
    soil = np.clip(0.22 - 0.25 * patch + 0.2 * fine, 0.0, 0.5)
    rest = (1.0 - moss) * (1.0 - soil)
    cover = np.stack([rest * (1.0 - leaves), rest * leaves, moss, (1.0 - moss) * soil], axis=-1)
    ragged = distance + 0.16 * fine + 0.1 * patch
    x0, y0 = float(x[0]), float(y[0])
    return Terrain(
        field=site.field,
        trail_distance=Raster(values=ragged.astype(np.float32), spacing=0.1, x0=x0, y0=y0),
        cover=Raster(values=cover.astype(np.float32), spacing=0.1, x0=x0, y0=y0),
        ground_materials=("needles", "litter", "moss", "soil"),
        trail_material="path",
        border_material="path_edge",
        border_width=0.22,
    )


def _crown_share(site: Site, x: Array, y: Array) -> tuple[Array, Array]:
    """How far nodes lie below conifers and below broadleaved trees, 0 to 1, on the grid (len(x), len(y))."""
    step = round(0.5 / (x[1] - x[0]))
    shares = []
    for names in (("spruce", "pine"), ("beech", "birch", "oak")):
        marks = np.zeros((len(x[::step]), len(y[::step])))
        for instance in site.instances:
            if instance.kind in names:
                i, j = np.round((instance.world_from_object[:2, 3] - (x[0], y[0])) / 0.5).astype(int)
                marks[i, j] += 1.0
        spread = gaussian_filter(marks, 1.6 / 0.5) * 60.0
        coarse = Raster(values=np.clip(spread, 0, 1).astype(np.float32), spacing=0.5, x0=float(x[0]), y0=float(y[0]))
        shares.append(coarse.at(*np.meshgrid(x, y, indexing="ij")))
    return shares[0], shares[1]


__all__ = ["ForestConfig", "build_forest"]
