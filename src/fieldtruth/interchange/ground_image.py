# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of the ground: its materials mixed as in photographs, in one image per tile."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.interchange.ground import GroundTile
from fieldtruth.render.atlas import LEVELS, srgb_from_linear
from fieldtruth.render.materials import material_table
from fieldtruth.render.tables import MaterialTable
from fieldtruth.world.model import Raster, World

_ROWS: Final = 256
"""Rows of an image that are made at once, which bounds the memory."""


def ground_image(
    world: World, tile: GroundTile, pixels_per_metre: float, table: MaterialTable | None = None
) -> NDArray[np.uint8]:
    """Albedo (n, n, 3) sRGB of a tile seen from above: +x to the right, +y up, as its uv.

    It is that of a photograph's hits (``render.gbuffer.terrain_gbuffer``): the colour of the mixed materials times the
    texture of one of them off the trails, and the trail's or its border's own texture on them. ``table`` is
    ``render.materials.material_table(world)``, which takes half a second: make it once for all tiles.
    """
    table = material_table(world) if table is None else table
    count = round(tile.size * pixels_per_metre)
    steps = np.asarray((np.arange(count) + 0.5) / pixels_per_metre, np.float64)
    x, y = tile.x0 + steps, tile.y0 + steps[::-1]
    image = np.empty((count, count, 3), np.uint8)
    for start in range(0, count, _ROWS):
        rows = slice(start, start + _ROWS)
        linear = _albedo(world, table, x, y[rows], pixels_per_metre)
        image[rows] = np.rint(srgb_from_linear(linear) * 255.0)
    return image


def _albedo(world: World, table: MaterialTable, x: Array, y: Array, pixels_per_metre: float) -> Array:
    """Linear albedo (h, w, 3) of the ground at world x (w,) and y (h,) [m]."""
    x, y = np.meshgrid(x, y)
    trail = world.terrain.trail_distance.at(x, y)
    (x0, y0), grain = table.corner, table.ground_material
    i, j = (
        np.clip(np.rint((value - low) * table.per_metre_material).astype(int), 0, size - 1)
        for value, low, size in zip((x, y), (x0, y0), grain.shape, strict=True)
    )
    row = np.where(trail < 0, np.where(trail > -table.border_width, table.border, table.trail), grain[i, j])
    mixed = Raster(values=table.ground[..., :3], spacing=1 / table.per_metre_rgb, x0=x0, y0=y0).at(x, y)
    linear = np.empty((*x.shape, 3))
    code = 2 * row + (trail < 0)
    for found in np.unique(code).tolist():
        (material, on_trail), here = divmod(found, 2), code == found
        texture, repeat = int(table.texture[material]), float(table.repeat[material])
        texels = _sampled(table, texture, x[here] / repeat, y[here] / repeat, repeat * pixels_per_metre)
        linear[here] = texels * (
            table.tint[material] if on_trail else mixed[here] / np.maximum(table.atlas.mean[texture], 1e-6)
        )
    return linear


def _sampled(table: MaterialTable, texture: int, u: Array, v: Array, pixels_per_repeat: float) -> Array:
    """Linear colours (n, 3) of a texture at u, v (n,) in repeats, from the mip level of one to two texels a pixel."""
    atlas, level = table.atlas, 0
    while level < LEVELS - 1 and atlas.size[texture, level] >= 2 * pixels_per_repeat:
        level += 1
    size, start = int(atlas.size[texture, level]), int(atlas.start[texture, level])
    image = atlas.texels[start : start + size * size].reshape(size, size)
    x, y = u * size - 0.5, -v * size - 0.5  # as ``render.atlas.sample``
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    fx, fy = (x - i)[:, None], (y - j)[:, None]

    def texel(column: NDArray[np.int64], line: NDArray[np.int64]) -> Array:
        packed = image[line % size, column % size][:, None] >> np.array([0, 8, 16]) & 255
        return np.asarray(atlas.linear[packed], np.float64)

    upper = texel(i, j) * (1 - fx) + texel(i + 1, j) * fx
    lower = texel(i, j + 1) * (1 - fx) + texel(i + 1, j + 1) * fx
    return np.asarray(upper * (1 - fy) + lower * fy)
