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
from fieldtruth.render.tables import (
    AIR_BASE,
    AIR_LAYER,
    AIR_TEXEL,
    FIRST,
    MATERIAL,
    NO_SHADOW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OPEN_SKY,
    SECOND,
    TEX_U,
    TEX_V,
    THIRD,
    Shading,
)
from fieldtruth.sense.hits import TERRAIN, Grid, read_grid
from fieldtruth.sense.kernel import inlined, kernel
from fieldtruth.sense.ray_batch import RayBatch

RED, GREEN, BLUE, NX, NY, NZ, SKY, SUN, TRANSLUCENCY, GLOSS, MIRROR = range(11)
"""Columns: linear albedo, unit normal, share of open sky, share of the sun, translucency, gloss, mirror."""
FIELDS: Final = 11
TRACE_SUN: Final = -1.0
"""Value of SUN that requests a shadow ray; other values are the known share of the sun."""

_Corners = tuple[np.float32, np.float32, np.float32, np.float32]
_Barycentric = tuple[np.float32, np.float32, np.float32]
_Rows = tuple[np.uintp, np.uintp, np.uintp]

_PER_AIR, _PER_LAYER = np.float32(1.0 / AIR_TEXEL), np.float32(1.0 / AIR_LAYER)
_PER_PIT = np.float32(1.0 / 0.04)
"""Per radius [m] of a pit. From the middle of the bottom of a round pit, the share 1 / (1 + (depth / radius)^2) of the
sky's light is seen (the form factor of a disc above a point)."""
_SHADOWS_END = np.float32(90.0)
"""Distance [m] beyond which the backdrop's trees are drawn without shadows."""
_AIR_GAIN, _AIR_MIN = np.float32(1.35), np.float32(0.06)
"""Corrections of air_sky: an object occludes its own air, which the gain makes up for, and interreflection between
leaves and soil reaches everywhere."""


@inlined
def _level(texels: np.float32, dither: float) -> int:
    """Mip level whose texels are as large as a pixel's footprint, which has a side of ``texels`` at the finest level.

    It is the integer part of log2(texels) + dither, to hide seams between levels: the exponent of a floating-point
    number; log2(1 + dither) is close enough to dither.
    """
    bits = np.float32(texels * (np.float32(1.0) + np.float32(dither))).view(np.int32)
    return max((int(bits) >> 23) - 127, 0)


@inlined
def _dither(u: float, v: float) -> float:
    """Fixed pattern in [0, 1) over the image (interleaved gradient noise, Jimenez 2014)."""
    inner = np.float32(0.06711056) * u + np.float32(0.00583715) * v
    value = np.float32(52.9829189) * (inner - np.floor(inner))
    return float(value - np.floor(value))


@inlined
def read_air(air: Float32Array, x: float, y: float, above: float) -> np.float32:
    """Share of open sky in the air at x and y [m] from the world's corner, ``above`` [m] an object's base."""
    u = min(max(x * _PER_AIR, 0.0), air.shape[0] - 1.001)
    v = min(max(y * _PER_AIR, 0.0), air.shape[1] - 1.001)
    w = min(max((above - AIR_BASE) * _PER_LAYER, 0.0), air.shape[2] - 1.001)
    i, j, k = int(u), int(v), int(w)
    fu, fv, fw = np.float32(u - i), np.float32(v - j), np.float32(w - k)
    near = air[i, j, k] + (air[i, j, k + 1] - air[i, j, k]) * fw
    left = air[i, j + 1, k] + (air[i, j + 1, k + 1] - air[i, j + 1, k]) * fw
    ahead = air[i + 1, j, k] + (air[i + 1, j, k + 1] - air[i + 1, j, k]) * fw
    far = air[i + 1, j + 1, k] + (air[i + 1, j + 1, k + 1] - air[i + 1, j + 1, k]) * fw
    near += (left - near) * fv
    ahead += (far - ahead) * fv
    return near + (ahead - near) * fu  # type: ignore[no-any-return]


@inlined
def _bilinear(grid: Float32Array, i: int, j: int, channel: int, weights: _Corners) -> np.float32:
    a, b, c, d = weights
    return (  # type: ignore[no-any-return]
        grid[i, j, channel] * a + grid[i, j + 1, channel] * b
        + grid[i + 1, j, channel] * c + grid[i + 1, j + 1, channel] * d
    )  # fmt: skip


@inlined
def _between(values: Float32Array, u: np.float32, v: np.float32) -> np.float32:
    """Bilinear value at node u, v; beyond the border the border's value.

    Unlike ``read_grid``, without conversions to double precision and checks for negative indices.
    """
    zero, end = np.float32(0.0), np.float32(1.001)
    u = min(max(u, zero), np.float32(values.shape[0]) - end)
    v = min(max(v, zero), np.float32(values.shape[1]) - end)
    i, j, one = np.uintp(u), np.uintp(v), np.uintp(1)
    fu, fv = u - np.float32(i), v - np.float32(j)
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


@kernel
def terrain_gbuffer(shading: Shading, batch: RayBatch, count: int, pixel: float, out: Float32Array) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on the terrain; ``pixel`` is the angle [rad] of one pixel."""
    tops, points, distance, image = batch.top, batch.point, batch.distance, batch.image
    materials, light, foreshortening = shading.materials, shading.light, batch.foreshortening
    atlas, ground, grain, sizes = materials.atlas, materials.ground, materials.ground_material, materials.atlas.size
    textures, tints, repeats, glosses = materials.texture, materials.tint, materials.repeat, materials.gloss
    means, open_sky, sunlit, edge = atlas.mean, light.ground_sky, light.ground_sun, shading.hits.trail_distance
    per_rgb, per_material, border_width = materials.per_metre_rgb, materials.per_metre_material, materials.border_width
    border_row, trail_row = materials.border, materials.trail
    surface, half_cell = materials.surface, np.float32(0.5 / materials.surface.per_metre)
    per_repeat, per_mean = np.float32(1.0) / repeats, np.float32(1.0) / means
    x0, y0 = materials.corner
    zero, one = np.float32(0.0), np.float32(1.0)
    for k in range(count):
        if tops[k] != TERRAIN:
            continue
        x, y = points[0, k], points[1, k]
        u = min(max((x - x0) * per_rgb, 0.0), ground.shape[0] - 1.001)
        v = min(max((y - y0) * per_rgb, 0.0), ground.shape[1] - 1.001)
        i, j = int(u), int(v)
        fu, fv = np.float32(u - i), np.float32(v - j)
        weights = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
        footprint = distance[k] * np.float32(pixel) / np.sqrt(max(foreshortening[k], np.float32(0.05)))
        sx, sy = _slope(surface, x, y, max(half_cell, footprint))
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        out[k, NX], out[k, NY], out[k, NZ] = -sx * scale, -sy * scale, scale
        depth = max(_bilinear(ground, i, j, 3, weights) - points[2, k], zero) * _PER_PIT
        pit = one / (one + depth * depth)
        out[k, SKY] = (_AIR_MIN + (one - _AIR_MIN) * _shade_of(open_sky, x, y)) * pit
        out[k, SUN] = _shade_of(sunlit, x, y) * pit
        trail = read_grid(edge, x, y)
        if trail < 0.0:
            row = border_row if trail > -border_width else trail_row
        else:
            gi = min(max(int((x - x0) * per_material + 0.5), 0), grain.shape[0] - 1)
            gj = min(max(int((y - y0) * per_material + 0.5), 0), grain.shape[1] - 1)
            row = int(grain[gi, gj])
        texture, per_metre = textures[row], per_repeat[row]
        texels = footprint * np.float32(sizes[texture, 0]) * per_metre
        level = _level(texels, _dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, x * per_metre, y * per_metre, level)
        out[k, TRANSLUCENCY], out[k, GLOSS], out[k, MIRROR] = 0.0, glosses[row], 0.0
        if trail < 0.0:
            out[k, RED], out[k, GREEN], out[k, BLUE] = red * tints[row, 0], green * tints[row, 1], blue * tints[row, 2]
        else:
            out[k, RED] = _bilinear(ground, i, j, 0, weights) * red * per_mean[texture, 0]
            out[k, GREEN] = _bilinear(ground, i, j, 1, weights) * green * per_mean[texture, 1]
            out[k, BLUE] = _bilinear(ground, i, j, 2, weights) * blue * per_mean[texture, 2]


@inlined
def _mixed(vertices: Float32Array, rows: _Rows, weights: _Barycentric, column: int) -> np.float32:
    a, b, c = rows
    fw, fu, fv = weights
    return vertices[a, column] * fw + vertices[b, column] * fu + vertices[c, column] * fv  # type: ignore[no-any-return]


@inlined
def _leaf_variation(leaf: int, top: int) -> tuple[np.float32, np.float32]:
    """Pseudo-random brightness and warmth of a leaf."""
    key = np.uint32(leaf + 7919 * top) * np.uint32(2654435761)
    bright = np.float32(0.78) + np.float32(0.44 / 255.0) * np.float32((key >> np.uint32(8)) & np.uint32(255))
    warmth = np.float32((key >> np.uint32(16)) & np.uint32(255)) / np.float32(255.0) - np.float32(0.5)
    return bright, warmth


@kernel
def mesh_gbuffer(shading: Shading, batch: RayBatch, count: int, pixel: float, out: Float32Array) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on meshes; SUN requests shadow rays except on leaves."""
    tops, directions, distance, image, points = batch.top, batch.direction, batch.distance, batch.image, batch.point
    primitives, barycentric = batch.primitive, batch.barycentric
    hits, materials, surfaces, light = shading.hits, shading.materials, shading.surfaces, shading.light
    atlas, sizes, textures, tints = materials.atlas, materials.atlas.size, materials.texture, materials.tint
    glosses, translucency, mirrors = materials.gloss, materials.translucency, materials.mirror
    top_mesh, mesh_face, rotations, own_tints = hits.top_mesh, hits.mesh_face, surfaces.top_rotation, surfaces.top_tint
    vertices, faces, repeats = surfaces.vertex, surfaces.face, surfaces.face_repeat
    leaf_sun, top_leaf, air, bases = light.leaf_sun, light.top_leaf, light.air_sky, light.top_base
    ax0, ay0, one = np.float32(light.ground_sky.x0), np.float32(light.ground_sky.y0), np.float32(1.0)
    for k in range(count):
        top = tops[k]
        if top <= TERRAIN:
            continue
        face = np.uintp(mesh_face[top_mesh[top]] + primitives[k])
        corners = np.uintp(faces[face, FIRST]), np.uintp(faces[face, SECOND]), np.uintp(faces[face, THIRD])
        row = np.uintp(faces[face, MATERIAL])
        fu, fv = barycentric[0, k], barycentric[1, k]
        weights = one - fu - fv, fu, fv
        nx = _mixed(vertices, corners, weights, NORMAL_X)
        ny = _mixed(vertices, corners, weights, NORMAL_Y)
        nz = _mixed(vertices, corners, weights, NORMAL_Z)
        wx = rotations[top, 0, 0] * nx + rotations[top, 0, 1] * ny + rotations[top, 0, 2] * nz
        wy = rotations[top, 1, 0] * nx + rotations[top, 1, 1] * ny + rotations[top, 1, 2] * nz
        wz = rotations[top, 2, 0] * nx + rotations[top, 2, 1] * ny + rotations[top, 2, 2] * nz
        scale = one / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
        through = translucency[row]
        facing = directions[0, k] * wx + directions[1, k] * wy + directions[2, k] * wz
        if through > 0.0 and facing > 0.0:  # the normal of a leaf points to the camera's side
            scale = -scale
        out[k, NX], out[k, NY], out[k, NZ] = wx * scale, wy * scale, wz * scale
        around = read_air(air, points[0, k] - ax0, points[1, k] - ay0, points[2, k] - bases[top])
        out[k, SKY] = min(_mixed(vertices, corners, weights, OPEN_SKY), _AIR_GAIN * around + _AIR_MIN)
        out[k, TRANSLUCENCY], out[k, GLOSS], out[k, MIRROR] = through, glosses[row], mirrors[row]
        texture = textures[row]
        u, v = _mixed(vertices, corners, weights, TEX_U), _mixed(vertices, corners, weights, TEX_V)
        texels = distance[k] * np.float32(pixel) * np.float32(sizes[texture, 0]) / repeats[face]
        level = _level(texels, _dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, u, v, level)
        bright, warmth = one, np.float32(0.0)
        if through > 0.0:
            out[k, SUN] = np.float32(leaf_sun[top_leaf[top] + primitives[k]])
            bright, warmth = _leaf_variation(int(corners[0]) // 4, top)
        else:
            out[k, SUN] = one if top_leaf[top] == NO_SHADOW and distance[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        out[k, RED] = red * tints[row, 0] * own_tints[top, 0] * bright * (one + np.float32(0.35) * warmth)
        out[k, GREEN] = green * tints[row, 1] * own_tints[top, 1] * bright
        out[k, BLUE] = blue * tints[row, 2] * own_tints[top, 2] * bright * (one - np.float32(0.25) * warmth)
