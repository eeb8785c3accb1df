# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The G-buffer: colour, normal and openness of the surface at each hit, before shading.

Tables are unpacked before the loops: Numba updates reference counts for each array that is unpacked inside, which was
measured to cost more than all the rest.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.render.atlas import sample
from fieldtruth.render.tables import Shading
from fieldtruth.sense.hits import TERRAIN, Grid
from fieldtruth.sense.kernel import inlined, kernel, light_kernel
from fieldtruth.sense.packets import IntArray
from fieldtruth.sense.ray_batch import RayBatch

RED, GREEN, BLUE, NX, NY, NZ, SKY, SUN, TRANSLUCENCY, GLOSS, MIRROR = range(11)
"""Columns: linear albedo, unit normal, share of open sky, share of the sun, translucency, gloss, mirror."""
FIELDS: Final = 11
TRACE_SUN: Final = -1.0
"""Value of SUN that requests a shadow ray; other values are the known share of the sun."""

_Corners = tuple[np.float32, np.float32, np.float32, np.float32]
_PER_PIT = np.float32(1.0 / 0.04)
"""Per radius [m] of a pit. From the middle of the bottom of a round pit, the share 1 / (1 + (depth / radius)^2) of the
sky's light is seen (the form factor of a disc above a point)."""
AIR_MIN: Final = np.float32(0.06)
"""Share of the sky's light that interreflection between leaves and soil brings everywhere."""


@inlined
def mip_level(texels: np.float32, dither: np.float32) -> int:
    """Mip level whose texels are as large as a pixel's footprint, which has a side of ``texels`` at the finest level.

    It is the integer part of log2(texels) + dither, to hide seams between levels: the exponent of a floating-point
    number; log2(1 + dither) is close enough to dither.
    """
    bits = np.float32(texels * (np.float32(1.0) + dither)).view(np.int32)
    return max((int(bits) >> 23) - 127, 0)


@inlined
def dither(u: np.float32, v: np.float32) -> np.float32:
    """Fixed pattern in [0, 1) over the image (interleaved gradient noise, Jimenez 2014)."""
    inner = np.float32(0.06711056) * u + np.float32(0.00583715) * v
    value = np.float32(52.9829189) * (inner - np.floor(inner))
    return value - np.floor(value)  # type: ignore[no-any-return]


@inlined
def _bilinear(grid: Float32Array, row: int, column: int, channel: int, weights: _Corners) -> np.float32:
    a, b, c, d = weights
    i, j, one = np.uintp(row), np.uintp(column), np.uintp(1)
    return (  # type: ignore[no-any-return]
        grid[i, j, channel] * a + grid[i, j + one, channel] * b
        + grid[i + one, j, channel] * c + grid[i + one, j + one, channel] * d
    )  # fmt: skip


@inlined
def _between(values: Float32Array, u: np.float32, v: np.float32) -> np.float32:
    """Bilinear value at node u, v; beyond the border the border's value.

    Unlike ``read_grid``, without conversions to double precision and checks for negative indices.
    """
    zero, end = np.float32(0.0), np.float32(1.001)
    u = min(max(u, zero), np.float32(values.shape[0]) - end)
    v = min(max(v, zero), np.float32(values.shape[1]) - end)
    row, column, one = int(u), int(v), np.uintp(1)  # signed numbers are converted faster than unsigned ones
    fu, fv = u - np.float32(row), v - np.float32(column)
    i, j = np.uintp(row), np.uintp(column)
    low = values[i, j] + (values[i, j + one] - values[i, j]) * fv
    high = values[i + one, j] + (values[i + one, j + one] - values[i + one, j]) * fv
    return low + (high - low) * fu  # type: ignore[no-any-return]


@inlined
def _shade_of(grid: Grid, x: np.float32, y: np.float32) -> np.float32:
    """Value of a grid of light at world x, y [m]."""
    per_metre = np.float32(grid.per_metre)
    return _between(grid.values, (x - np.float32(grid.x0)) * per_metre, (y - np.float32(grid.y0)) * per_metre)


@inlined
def _slope(surface: Grid, x: np.float32, y: np.float32, step: np.float32) -> tuple[np.float32, np.float32]:
    """Slope of the surface along x and y over ``step`` [m] to either side: as wide as a pixel sees, so that distant
    relief does not flicker.
    """
    values, per_metre, per = surface.values, np.float32(surface.per_metre), np.float32(0.5) / step
    u, v = (x - np.float32(surface.x0)) * per_metre, (y - np.float32(surface.y0)) * per_metre
    nodes = step * per_metre
    along_x = (_between(values, u + nodes, v) - _between(values, u - nodes, v)) * per
    along_y = (_between(values, u, v + nodes) - _between(values, u, v - nodes)) * per
    return along_x, along_y


@inlined
def _mean_height(ground: Float32Array, u: np.float32, v: np.float32) -> np.float32:
    """Height [m] of the ground without its relief at node u, v."""
    zero, one, end = np.float32(0.0), np.float32(1.0), np.float32(1.001)
    u = min(max(u, zero), np.float32(ground.shape[0]) - end)
    v = min(max(v, zero), np.float32(ground.shape[1]) - end)
    i, j = int(u), int(v)
    fu, fv = u - np.float32(i), v - np.float32(j)
    return _bilinear(ground, i, j, 3, ((one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv))


@kernel
def hits_on(top: IntArray, count: int, on_terrain: bool, rows: IntArray) -> int:
    """List the rows of a batch that hit the terrain, or a mesh; returns their number."""
    found = 0
    for k in range(count):  # without a branch, because hits alternate at edges
        rows[found] = k
        found += (top[k] == TERRAIN) if on_terrain else (top[k] > TERRAIN)
    return found


@light_kernel
def terrain_gbuffer(shading: Shading, batch: RayBatch, count: int, pixel: float, out: Float32Array) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on the terrain; ``pixel`` is the angle [rad] of one pixel."""
    rows, footprint = np.empty(count, np.int32), np.empty(count, np.float32)
    found = hits_on(batch.top, count, True, rows)
    _terrain_normals(shading.materials.surface, batch, rows, found, np.float32(pixel), footprint, out)
    _terrain_light(shading, batch, rows, found, out)
    _terrain_colours(shading, batch, rows, found, footprint, out)


@light_kernel
def _terrain_normals(
    surface: Grid,
    batch: RayBatch,
    rows: IntArray,
    found: int,
    pixel: np.float32,
    footprint: Float32Array,
    out: Float32Array,
) -> None:
    """Normals over the ``footprint`` (n,) [m] of a pixel, which is filled, too."""
    points, distance, foreshortening = batch.point, batch.distance, batch.foreshortening
    half_cell, one, flattest = np.float32(0.5 / surface.per_metre), np.float32(1.0), np.float32(0.05)
    for m in range(found):
        k = np.uintp(rows[m])
        side = distance[k] * pixel / np.sqrt(max(foreshortening[k], flattest))
        footprint[m] = side
        sx, sy = _slope(surface, points[0, k], points[1, k], max(half_cell, side))
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        out[k, NX], out[k, NY], out[k, NZ] = -sx * scale, -sy * scale, scale


@light_kernel
def _terrain_light(shading: Shading, batch: RayBatch, rows: IntArray, found: int, out: Float32Array) -> None:
    """Shares of sky and sun, which pits of the relief see less of."""
    points, materials = batch.point, shading.materials
    ground, open_sky, sunlit = materials.ground, shading.light.ground_sky, shading.light.ground_sun
    x0, y0 = np.float32(materials.corner[0]), np.float32(materials.corner[1])
    per_rgb = np.float32(materials.per_metre_rgb)
    zero, one = np.float32(0.0), np.float32(1.0)
    for m in range(found):
        k = np.uintp(rows[m])
        x, y = points[0, k], points[1, k]
        depth = max(_mean_height(ground, (x - x0) * per_rgb, (y - y0) * per_rgb) - points[2, k], zero) * _PER_PIT
        pit = one / (one + depth * depth)
        out[k, SKY] = (AIR_MIN + (one - AIR_MIN) * _shade_of(open_sky, x, y)) * pit
        out[k, SUN] = _shade_of(sunlit, x, y) * pit


@light_kernel
def _terrain_colours(
    shading: Shading, batch: RayBatch, rows: IntArray, found: int, footprint: Float32Array, out: Float32Array
) -> None:
    """Albedo from the texture of the material, and on the ground from the mixed colour of its surroundings."""
    points, image, materials = batch.point, batch.image, shading.materials
    atlas, ground, grain, sizes = materials.atlas, materials.ground, materials.ground_material, materials.atlas.size
    textures, tints, glosses = materials.texture, materials.tint, materials.gloss
    edge, border, border_row, trail_row = (
        shading.hits.trail_distance, np.float32(-materials.border_width), materials.border, materials.trail
    )  # fmt: skip
    per_rgb, per_material = np.float32(materials.per_metre_rgb), np.float32(materials.per_metre_material)
    per_repeat, per_mean = np.float32(1.0) / materials.repeat, np.float32(1.0) / materials.atlas.mean
    x0, y0 = np.float32(materials.corner[0]), np.float32(materials.corner[1])
    last_i, last_j = np.float32(grain.shape[0] - 1), np.float32(grain.shape[1] - 1)
    end_u, end_v = np.float32(ground.shape[0] - 1.001), np.float32(ground.shape[1] - 1.001)
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    for m in range(found):
        k = np.uintp(rows[m])
        x, y = points[0, k], points[1, k]
        trail = _shade_of(edge, x, y)
        if trail < zero:
            row = np.uintp(border_row if trail > border else trail_row)
        else:
            gi = int(min(max((x - x0) * per_material + half, zero), last_i))
            gj = int(min(max((y - y0) * per_material + half, zero), last_j))
            row = np.uintp(grain[gi, gj])
        texture, per_metre = np.uintp(textures[row]), per_repeat[row]
        texels = footprint[m] * np.float32(sizes[texture, 0]) * per_metre
        level = mip_level(texels, dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, x * per_metre, y * per_metre, level)
        out[k, TRANSLUCENCY], out[k, GLOSS], out[k, MIRROR] = zero, glosses[row], zero
        if trail < zero:
            out[k, RED], out[k, GREEN], out[k, BLUE] = red * tints[row, 0], green * tints[row, 1], blue * tints[row, 2]
            continue
        u, v = min(max((x - x0) * per_rgb, zero), end_u), min(max((y - y0) * per_rgb, zero), end_v)
        i, j = int(u), int(v)
        fu, fv = u - np.float32(i), v - np.float32(j)
        weights = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
        out[k, RED] = _bilinear(ground, i, j, 0, weights) * red * per_mean[texture, 0]
        out[k, GREEN] = _bilinear(ground, i, j, 1, weights) * green * per_mean[texture, 1]
        out[k, BLUE] = _bilinear(ground, i, j, 2, weights) * blue * per_mean[texture, 2]
