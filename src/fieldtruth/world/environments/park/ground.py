# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ground of the park: gentle swells; lawn, litter below crowns, mulch in beds, trails with a border."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.environments.layout import hills_spacing
from fieldtruth.world.environments.park.beds import Bed, bed_distance
from fieldtruth.world.environments.park.config import Config
from fieldtruth.world.grids import (
    COVER,
    Trail,
    coarseness,
    fractal_noise,
    grid_axes,
    make_heightfield,
    make_raster,
    signed_distance,
)
from fieldtruth.world.model import Heightfield, Terrain
from fieldtruth.world.placement import WorldBuilder
from fieldtruth.world.relief import with_microrelief


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
