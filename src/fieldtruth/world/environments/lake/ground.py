# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Cover of the lake's shore: rough grass, bare earth on the scarps, mud and pebbles at the water."""

import numpy as np
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array
from fieldtruth.world.environments.lake.shore import Shore
from fieldtruth.world.grids import COVER, coarseness, fractal_noise, grid_axes, make_raster
from fieldtruth.world.model import Terrain
from fieldtruth.world.placement import WorldBuilder


def cover_ground(builder: WorldBuilder, shore: Shore, rng: np.random.Generator) -> Terrain:
    """Rough grass, drier on the swells, bare earth on the scarps; mud or pebbles at and under the water."""
    x, y = grid_axes(builder.size, node := COVER * coarseness(builder.size))
    nodes = np.meshgrid(x, y, indexing="ij")
    patch = fractal_noise(x, y, wavelength=15.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    stony = np.clip(0.5 + 1.6 * fractal_noise(x, y, wavelength=20.0, octaves=2, rng=rng) + 0.5 * fine, 0.0, 1.0)
    inland, height = shore.inland.at(*nodes), builder.field.height_at(*nodes)
    steep = np.hypot(*np.gradient(gaussian_filter(height, 0.3 / node, mode="nearest"), node))
    scarp = np.clip((steep - 0.5 + 0.12 * fine) / 0.2, 0.0, 1.0)
    wet = np.clip(1.0 - (inland - 0.9 - 1.6 * (1.0 - shore.scarp.at(*nodes)) + 0.55 * fine) / 0.7, 0.0, 1.0)
    litter = _below_crowns(builder, x, y, fine)
    dry = np.clip(0.28 + 0.3 * patch + 0.24 * fine, 0.0, 0.9)
    turf = (1.0 - wet) * (1.0 - scarp) * (1.0 - litter)
    drowned = np.clip(-inland / 3.0, 0.0, 0.85)
    cover = np.stack(
        [
            turf * (1.0 - dry),
            turf * dry,
            (1.0 - wet) * scarp * (1.0 - litter),
            (1.0 - wet) * litter,
            wet * (1.0 - stony * (1.0 - drowned)),
            wet * stony * (1.0 - drowned),
        ],
        axis=-1,
    )
    no_trail = np.full((2, 2), 1e3, np.float32)
    return Terrain(
        field=builder.field,
        trail_distance=make_raster(no_trail, max(builder.size), x, y),
        cover=make_raster(cover, node, x, y),
        ground_materials=("rough_grass", "dry_grass", "soil", "litter", "mud", "pebbles"),
        trail_material="gravel",
        border_material="gravel",
    )


def _below_crowns(builder: WorldBuilder, x: Array, y: Array, fine: Array) -> Array:
    """Share of the ground [0, 1] covered by leaves, around trunks and bushes."""
    share = np.zeros((len(x), len(y)))
    for instance in builder.instances:
        if not instance.kind.endswith(("tree", "bush")):
            continue
        at = instance.world_from_object[:2, 3]
        radius = 1.1 if instance.kind.endswith("tree") else 0.7
        i, j = (np.flatnonzero(np.abs(axis - c) < radius + 1.0) for axis, c in zip((x, y), at, strict=True))
        away = np.hypot(*np.meshgrid(x[i] - at[0], y[j] - at[1], indexing="ij"))
        block = np.ix_(i, j)
        share[block] = np.maximum(share[block], np.clip((radius - away) / 0.5 + 0.8 * fine[block], 0.0, 1.0))
    return share
