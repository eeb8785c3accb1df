# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What covers the ground of a park: lawn in all states, litter below old crowns, mulch in beds, trails with an edge."""

from collections.abc import Sequence

import numpy as np

from fieldtruth.world.environments.park_beds import Bed, bed_distance
from fieldtruth.world.grids import grid_axes
from fieldtruth.world.model import Raster, Terrain
from fieldtruth.world.noise import fractal_noise
from fieldtruth.world.placement import Site
from fieldtruth.world.trails import signed_distance


def cover_ground(site: Site, beds: Sequence[Bed], border_width: float, rng: np.random.Generator) -> Terrain:
    """Lawn, drier and worn in places, bare below old crowns, mulch in the beds, trails with a border of setts."""
    x, y = grid_axes(site.size, 0.1)
    distance = signed_distance(site.trails, x, y)
    patch = fractal_noise(x, y, wavelength=14.0, octaves=4, rng=rng, gain=0.6)
    fine = fractal_noise(x, y, wavelength=1.6, octaves=3, rng=rng, gain=0.7)
    worn = np.clip(0.95 - distance / 0.32 + 0.75 * fine, 0.0, 1.0)
    litter, bare = np.zeros_like(patch), np.zeros_like(patch)
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    bed = np.clip(0.5 - bed_distance(beds, places).reshape(patch.shape) / 0.1, 0.0, 1.0)
    # About a trunk: last year's leaves below a large tree, mulch about a young one; about what people use, bare soil.
    for kind, radius, ragged, under in (
        ("large_tree", 1.1, (0.5, 0.35), litter), ("small_tree", 0.5, (0.12, 0.1), bed),
        ("bench", 0.85, (0.5, 0.45), bare), ("table", 1.1, (0.5, 0.5), bare),
    ):  # fmt: skip
        for thing in site.instances:
            if thing.kind != kind:
                continue
            ix, iy = thing.world_from_object[:2, 3] + (0.35 * thing.world_from_object[:2, 0] if kind == "bench" else 0)
            away = np.hypot(*np.meshgrid(x - ix, y - iy, indexing="ij"))
            here = np.clip((radius - away) / ragged[0] + ragged[1] * 3.1 * fine, 0.0, 1.0) * (away < radius + 1.0)
            under[...] = np.maximum(under, here)
    dry = np.clip(0.32 + 0.36 * patch + 0.26 * fine, 0.0, 0.95)
    trodden = np.clip(0.9 * worn * (0.5 + 0.4 * fine) + 0.55 * bare * (0.7 + 0.5 * fine), 0.0, 1.0)
    free = (1.0 - bed) * (1.0 - litter)
    cover = np.stack(
        [free * (1 - trodden) * (1 - dry), free * (1 - trodden) * dry, free * trodden, bed, litter * (1 - bed)], axis=-1
    )
    return Terrain(
        field=site.field,
        trail_distance=Raster(values=distance, spacing=0.1, x0=float(x[0]), y0=float(y[0])),
        cover=Raster(values=cover.astype(np.float32), spacing=0.1, x0=float(x[0]), y0=float(y[0])),
        ground_materials=("lawn", "lawn_dry", "soil", "mulch", "litter"),
        trail_material="gravel",
        border_material="setts",
        border_width=border_width,
    )
