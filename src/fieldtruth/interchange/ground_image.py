# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of the ground: its materials mixed as in photographs, in one image per tile."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.parallel import cpu_count, in_order
from fieldtruth.interchange.ground import GroundTile
from fieldtruth.interchange.images import encode_image
from fieldtruth.kernels.light import MaterialTable
from fieldtruth.kernels.textures import LEVELS, patch_offsets, srgb_from_linear
from fieldtruth.render.materials import material_table
from fieldtruth.world.model import Raster, World

GROUND_PIXELS: Final = 2048
"""Side of a tile's image in scenes: 12 mm a pixel on tiles of 25 m."""
_ROWS: Final = 128
"""Rows of an image that are made at once, which bounds the memory."""
_CODES: Final = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint8)
"""The byte of sRGB for linear values in steps of 1 / 65535."""


def ground_images(world: World, tiles: Sequence[GroundTile]) -> Iterator[bytes]:
    """JPEG of each tile with ``GROUND_PIXELS`` on a side, made in threads."""
    table = material_table(world)

    def jpeg(tile: GroundTile) -> bytes:
        return encode_image(ground_image(world, tile, GROUND_PIXELS / tile.size, table))

    return in_order(tiles, jpeg, cpu_count())


def ground_image(
    world: World, tile: GroundTile, pixels_per_metre: float, table: MaterialTable | None = None
) -> NDArray[np.uint8]:
    """Albedo (n, n, 3) sRGB of a tile seen from above: +x to the right, +y up, as its uv.

    It is that of a photograph's hits (``kernels.gbuffer.terrain_gbuffer``): the colour of the mixed materials times the
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
        image[rows] = _CODES[np.rint(linear.clip(0, 1) * (len(_CODES) - 1)).astype(np.uint16)]
    return image


def _albedo(world: World, table: MaterialTable, x: Array, y: Array, pixels_per_metre: float) -> Float32Array:
    """Linear albedo (h, w, 3) of the ground at world x (w,) and y (h,) [m]."""
    (x0, y0), grain = table.corner, table.ground_material
    i, j = (
        np.clip(np.rint((value - low) * table.per_metre_material).astype(int), 0, size - 1)
        for value, low, size in zip((x, y), (x0, y0), grain.shape, strict=True)
    )
    x, y = np.meshgrid(x, y)
    trail = world.terrain.trail_distance.at(x, y)
    border = np.where(trail > -table.border_width, table.border, table.trail)
    row = np.where(trail < 0, border, grain[np.ix_(i, j)].T)
    mixed = Raster(values=table.ground[..., :3], spacing=1 / table.per_metre_rgb, x0=x0, y0=y0)
    wear = replace(mixed, values=table.ground[..., 4])
    linear = np.empty((*x.shape, 3), np.float32)
    code = 2 * row + (trail < 0)
    for found in np.unique(code).tolist():
        (material, on_trail), here = divmod(found, 2), code == found
        texture, repeat = int(table.texture[material]), float(table.repeat[material])
        shift = np.empty((np.count_nonzero(here), 2), np.float32)
        patch_offsets(x[here].astype(np.float32), y[here].astype(np.float32), table.patch[material], shift)
        u, v = x[here] / repeat + shift[:, 0], y[here] / repeat + shift[:, 1]
        texels = _sampled(table, texture, u, v, repeat * pixels_per_metre)
        if on_trail:
            linear[here] = texels * table.tint[material] * wear.at(x[here], y[here])[:, None]
        else:
            linear[here] = texels * (mixed.at(x[here], y[here]) / np.maximum(table.atlas.mean[texture], 1e-6))
    return linear


def _sampled(table: MaterialTable, texture: int, u: Array, v: Array, pixels_per_repeat: float) -> Float32Array:
    """Linear colours (n, 3) of a texture at u, v (n,) in repeats, from the mip level of one to two texels a pixel."""
    atlas, level = table.atlas, 0
    while level < LEVELS - 1 and atlas.size[texture, level] >= 2 * pixels_per_repeat:
        level += 1
    size, start = int(atlas.size[texture, level]), int(atlas.start[texture, level])
    packed = atlas.texels[start : start + size * size, None] >> np.array([0, 8, 16], np.uint32) & 255
    texels = atlas.linear[packed]
    x, y = u * size - 0.5, -v * size - 0.5  # as ``render.atlas.sample``
    i, j = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    fx, fy = (x - i).astype(np.float32)[:, None], (y - j).astype(np.float32)[:, None]
    left, right, upper, lower = i % size, (i + 1) % size, j % size * size, (j + 1) % size * size
    above = texels[upper + left] * (1 - fx) + texels[upper + right] * fx
    below = texels[lower + left] * (1 - fx) + texels[lower + right] * fx
    return np.asarray(above * (1 - fy) + below * fy)
