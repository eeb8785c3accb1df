# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of the forest: uneven soil, trodden flat along the trails; needles, leaves, moss and humus."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.grids import grid_axes, make_heightfield, make_raster
from fieldtruth.world.model import Heightfield, Raster, Terrain
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import limit_slope, slope_limit
from fieldtruth.world.trails import Trail, signed_distance

CONIFERS = ("spruce", "pine")
BROADLEAVES = ("beech", "birch", "oak")


def make_heights(config: Config, trails: Sequence[Trail], rng: np.random.Generator) -> Heightfield:
    """Swells, hollows, and the pits and mounds of uprooted trees; trodden flat along the trails."""
    x, y = grid_axes(config.size, config.grid)
    swell = fractal_noise(x, y, wavelength=34.0, octaves=4, rng=rng, gain=0.45)
    mounds = np.abs(fractal_noise(x, y, wavelength=6.5, octaves=3, rng=rng, gain=0.5))
    bumps = fractal_noise(x, y, wavelength=1.7, octaves=3, rng=rng, gain=0.6)
    heights = config.relief * swell + 0.17 * mounds
    off_trail = signed_distance(trails, x, y).astype(np.float64)
    on_trail = 1.0 / (1.0 + np.exp((off_trail - 0.5) / 0.35))
    trodden = gaussian_filter(heights, 1.2 / config.grid) - 0.05
    heights = heights * (1.0 - on_trail) + trodden * on_trail
    heights = limit_slope(heights, config.grid, slope_limit(off_trail, within=10.0, beyond=32.0, near=0.6, far=5.0))
    heights += bumps * (0.028 - 0.018 * on_trail)
    return make_heightfield(heights - heights.mean(), config.grid, x, y)


def make_glades(size: tuple[float, float], rng: np.random.Generator) -> Raster:
    """Light on the forest floor, about 0 on average: high in glades, low in shade."""
    x, y = grid_axes(size, 0.5)
    return make_raster(fractal_noise(x, y, wavelength=13.0, octaves=3, rng=rng), 0.5, x, y)


def cover_ground(builder: WorldBuilder, glades: Raster, rng: np.random.Generator) -> Terrain:
    """Needles below conifers, leaves below broadleaved trees, moss in patches, humus in between."""
    x, y = grid_axes(builder.size, 0.1)
    px, py = np.meshgrid(x, y, indexing="ij")
    distance = signed_distance(builder.trails, x, y)
    fine = fractal_noise(x, y, wavelength=1.3, octaves=3, rng=rng, gain=0.7)
    patch = fractal_noise(x, y, wavelength=7.0, octaves=4, rng=rng, gain=0.6)
    conifers, broad = (_crown_share(builder, x, y, species) for species in (CONIFERS, BROADLEAVES))
    leaves = np.clip(0.5 + 0.55 * (broad - conifers) + 0.22 * patch, 0.05, 0.95)
    moss = np.clip(0.25 * patch + 0.3 * fine - 0.18 * glades.at(px, py) - 0.12, 0.0, 0.9) * (distance > 0.2)
    soil = np.clip(0.22 - 0.25 * patch + 0.2 * fine, 0.0, 0.5)
    rest = (1.0 - moss) * (1.0 - soil)
    cover = np.stack([rest * (1.0 - leaves), rest * leaves, moss, (1.0 - moss) * soil], axis=-1)
    ragged = distance + 0.16 * fine + 0.1 * patch
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(ragged, 0.1, x, y),
        cover=make_raster(cover, 0.1, x, y),
        ground_materials=("needles", "litter", "moss", "soil"),
        trail_material="path",
        border_material="path_edge",
        border_width=0.22,
    )


def _crown_share(builder: WorldBuilder, x: Array, y: Array, species: Sequence[str]) -> Array:
    """Share (len(x), len(y)) in [0, 1] to which nodes are below crowns of some species."""
    step = round(0.5 / (x[1] - x[0]))
    marks = np.zeros((len(x[::step]), len(y[::step])))
    for instance in builder.instances:
        if instance.kind in species:
            i, j = np.round((instance.world_from_object[:2, 3] - (x[0], y[0])) / 0.5).astype(int)
            marks[i, j] += 1.0
    spread = gaussian_filter(marks, 1.6 / 0.5) * 60.0
    coarse = make_raster(np.clip(spread, 0, 1), 0.5, x, y)
    return coarse.at(*np.meshgrid(x, y, indexing="ij"))
