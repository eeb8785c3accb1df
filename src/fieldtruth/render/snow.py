# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Snow in photographs: it covers the ground by its depth, and what faces up to the sky on everything else.

Labels, depth and clouds do not know it, except for the height that snow adds to the ground.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.gbuffer import BLUE, GLOSS, GREEN, LIGHT, MIRROR, NZ, RED, SUN, TRACE_SUN
from fieldtruth.render.tables import SnowTable
from fieldtruth.sense.hits import TERRAIN, read_grid
from fieldtruth.sense.ray_batch import RayBatch
from fieldtruth.sense.scene import grid_of
from fieldtruth.world.model import Terrain
from fieldtruth.world.seasons.snow import hidden_share

WHITE: Final = (np.float32(0.80), np.float32(0.82), np.float32(0.85))
"""Albedo of settled snow of some days, in the visible (Wiscombe and Warren 1980, J. Atmos. Sci. 37, 2712-2745)."""
LOADS: Final = 0.05
"""Depth [m] in the open from which all that faces up is white."""
_GRASS: Final = np.float32(0.4)
"""Share of snow that blades and needles hold, relative to solid surfaces."""


def snow_table(terrain: Terrain) -> SnowTable:
    """Table of a terrain, with ``on_top`` 0 where no snow lies."""
    deep = 0.0 if terrain.snow is None else float(np.quantile(terrain.snow, 0.9))
    return SnowTable(grid_of(hidden_share(terrain)), np.float32(min(deep / LOADS, 1.0)))


@inlined
def _ragged(x: np.float32, y: np.float32, z: np.float32) -> np.float32:
    """Noise in [-1, 1] with wavelengths of 5 to 40 cm."""
    a = np.sin(np.float32(17.0) * x + np.float32(5.0) * z) * np.sin(np.float32(21.0) * y - np.float32(7.0) * z)
    b = np.sin(np.float32(61.0) * x - np.float32(23.0) * y) * np.sin(np.float32(53.0) * y + np.float32(71.0) * z)
    return np.float32(0.6) * a + np.float32(0.4) * b  # type: ignore[no-any-return]


@kernel
def cover_with_snow(snow: SnowTable, open_light: np.float32, batch: RayBatch, count: int, out: Float32Array) -> None:
    """Mix snow into the rows of a G-buffer ``out`` (n, FIELDS), whose LIGHT is ``open_light`` below the whole sky."""
    top, point, ground, on_top = batch.top, batch.point, snow.ground, snow.on_top
    zero, one, lit = np.float32(0.0), np.float32(1.0), np.float32(3.0) / open_light
    for k in range(count):
        if top[k] < 0 or out[k, MIRROR] > zero:
            continue
        x, y, z = point[0, k], point[1, k], point[2, k]
        noise = _ragged(x, y, z)
        if top[k] == TERRAIN:
            share = np.float32(read_grid(ground, x, y))
            share += np.float32(0.8) * noise * share * (one - share)
        else:
            open_sky = min(max(lit * out[k, LIGHT + 1] - np.float32(0.25), zero), one)
            share = (out[k, NZ] - np.float32(0.45) + np.float32(0.22) * noise) * np.float32(3.5)
            share = min(max(share, zero), one) * open_sky * on_top
            if out[k, SUN] != TRACE_SUN:  # leaves, whose share of the sun is known
                share *= _GRASS + (one - _GRASS) * noise * noise
        share = min(max(share, zero), one)
        bare, grain = one - share, one + np.float32(0.04) * noise
        out[k, RED] = bare * out[k, RED] + share * grain * WHITE[0]
        out[k, GREEN] = bare * out[k, GREEN] + share * grain * WHITE[1]
        out[k, BLUE] = bare * out[k, BLUE] + share * grain * WHITE[2]
        out[k, GLOSS] *= bare
