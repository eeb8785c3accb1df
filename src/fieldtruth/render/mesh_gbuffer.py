# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The G-buffer of hits on meshes.

Their vertices and faces take 100 MB, so that most hits miss the caches. Faces and vertices are therefore fetched in
short passes of their own, in which a processor waits for several hits at once.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.render.atlas import sample
from fieldtruth.render.gbuffer import (
    AIR_MIN,
    BLUE,
    GLOSS,
    GREEN,
    MIRROR,
    NX,
    NY,
    NZ,
    RED,
    SKY,
    SUN,
    TRACE_SUN,
    TRANSLUCENCY,
    dither,
    hits_on,
    mip_level,
)
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
    SurfaceTable,
)
from fieldtruth.sense.hits import HitTable
from fieldtruth.sense.kernel import inlined, light_kernel
from fieldtruth.sense.packets import IntArray
from fieldtruth.sense.ray_batch import RayBatch

_Barycentric = tuple[np.float32, np.float32, np.float32]
_Rows = tuple[np.uintp, np.uintp, np.uintp]

_PER_AIR, _PER_LAYER = np.float32(1.0 / AIR_TEXEL), np.float32(1.0 / AIR_LAYER)
_SHADOWS_END = np.float32(90.0)
"""Distance [m] beyond which the backdrop's trees are drawn without shadows."""
_AIR_GAIN: Final = np.float32(1.35)
"""Correction of air_sky: an object occludes its own air."""


@inlined
def read_air(air: Float32Array, x: np.float32, y: np.float32, above: np.float32) -> np.float32:
    """Share of open sky in the air at x and y [m] from the world's corner, ``above`` [m] an object's base."""
    zero, end = np.float32(0.0), np.float32(1.001)
    u = min(max(x * _PER_AIR, zero), np.float32(air.shape[0]) - end)
    v = min(max(y * _PER_AIR, zero), np.float32(air.shape[1]) - end)
    w = min(max((above - np.float32(AIR_BASE)) * _PER_LAYER, zero), np.float32(air.shape[2]) - end)
    row, column, layer, one = int(u), int(v), int(w), np.uintp(1)
    fu, fv, fw = u - np.float32(row), v - np.float32(column), w - np.float32(layer)
    i, j, k = np.uintp(row), np.uintp(column), np.uintp(layer)
    near = air[i, j, k] + (air[i, j, k + one] - air[i, j, k]) * fw
    left = air[i, j + one, k] + (air[i, j + one, k + one] - air[i, j + one, k]) * fw
    ahead = air[i + one, j, k] + (air[i + one, j, k + one] - air[i + one, j, k]) * fw
    far = air[i + one, j + one, k] + (air[i + one, j + one, k + one] - air[i + one, j + one, k]) * fw
    near += (left - near) * fv
    ahead += (far - ahead) * fv
    return near + (ahead - near) * fu  # type: ignore[no-any-return]


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


@light_kernel
def mesh_gbuffer(shading: Shading, batch: RayBatch, count: int, pixel: float, out: Float32Array) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on meshes; SUN requests shadow rays except on leaves."""
    rows = np.empty(count, np.int32)
    found = hits_on(batch.top, count, False, rows)
    face, texels = np.empty((found, 4), np.int32), np.empty(found, np.float32)
    _fetch_faces(shading.hits, shading.surfaces, batch, rows, found, np.float32(pixel), face, texels)
    _fetch_vertices(shading, batch, rows, found, face, out)
    _shade_surfaces(shading, batch, rows, found, face, texels, out)


@light_kernel
def _fetch_faces(
    hits: HitTable,
    surfaces: SurfaceTable,
    batch: RayBatch,
    rows: IntArray,
    found: int,
    pixel: np.float32,
    face: IntArray,
    texels: Float32Array,
) -> None:
    """Copy the rows of SurfaceTable.face, and find the width of a pixel in repeats of the texture."""
    tops, primitives, distance = batch.top, batch.primitive, batch.distance
    top_mesh, mesh_face, faces, repeats = hits.top_mesh, hits.mesh_face, surfaces.face, surfaces.face_repeat
    for m in range(found):
        k = np.uintp(rows[m])
        at = np.uintp(mesh_face[np.uintp(top_mesh[np.uintp(tops[k])])] + primitives[k])
        face[m, FIRST], face[m, SECOND], face[m, THIRD] = faces[at, FIRST], faces[at, SECOND], faces[at, THIRD]
        face[m, MATERIAL] = faces[at, MATERIAL]
        texels[m] = distance[k] * pixel / repeats[at]


@light_kernel
def _fetch_vertices(
    shading: Shading, batch: RayBatch, rows: IntArray, found: int, face: IntArray, out: Float32Array
) -> None:
    """Interpolate normals in the object's frame, texture coordinates (for now in RED and GREEN) and open sky."""
    vertices, top_leaf, leaf_sun = shading.surfaces.vertex, shading.light.top_leaf, shading.light.leaf_sun
    translucency, barycentric, tops, primitives = (
        shading.materials.translucency, batch.barycentric, batch.top, batch.primitive
    )  # fmt: skip
    for m in range(found):
        k = np.uintp(rows[m])
        corners = np.uintp(face[m, FIRST]), np.uintp(face[m, SECOND]), np.uintp(face[m, THIRD])
        fu, fv = barycentric[0, k], barycentric[1, k]
        weights = np.float32(1.0) - fu - fv, fu, fv
        out[k, NX] = _mixed(vertices, corners, weights, NORMAL_X)
        out[k, NY] = _mixed(vertices, corners, weights, NORMAL_Y)
        out[k, NZ] = _mixed(vertices, corners, weights, NORMAL_Z)
        out[k, RED] = _mixed(vertices, corners, weights, TEX_U)
        out[k, GREEN] = _mixed(vertices, corners, weights, TEX_V)
        out[k, SKY] = _mixed(vertices, corners, weights, OPEN_SKY)
        if translucency[np.uintp(face[m, MATERIAL])] > np.float32(0.0):
            out[k, SUN] = np.float32(leaf_sun[np.uintp(top_leaf[np.uintp(tops[k])] + primitives[k])])


@light_kernel
def _shade_surfaces(
    shading: Shading,
    batch: RayBatch,
    rows: IntArray,
    found: int,
    face: IntArray,
    texels: Float32Array,
    out: Float32Array,
) -> None:
    """Normals in the world's frame, light and albedo."""
    tops, directions, distance, image, points = batch.top, batch.direction, batch.distance, batch.image, batch.point
    materials, surfaces, light = shading.materials, shading.surfaces, shading.light
    atlas, sizes, textures, tints = materials.atlas, materials.atlas.size, materials.texture, materials.tint
    glosses, translucency, mirrors = materials.gloss, materials.translucency, materials.mirror
    rotations, own_tints = surfaces.top_rotation, surfaces.top_tint
    top_leaf, air, bases = light.top_leaf, light.air_sky, light.top_base
    ax0, ay0 = np.float32(light.ground_sky.x0), np.float32(light.ground_sky.y0)
    zero, one = np.float32(0.0), np.float32(1.0)
    for m in range(found):
        k, row = np.uintp(rows[m]), np.uintp(face[m, MATERIAL])
        top = np.uintp(tops[k])
        nx, ny, nz = out[k, NX], out[k, NY], out[k, NZ]
        wx = rotations[top, 0, 0] * nx + rotations[top, 0, 1] * ny + rotations[top, 0, 2] * nz
        wy = rotations[top, 1, 0] * nx + rotations[top, 1, 1] * ny + rotations[top, 1, 2] * nz
        wz = rotations[top, 2, 0] * nx + rotations[top, 2, 1] * ny + rotations[top, 2, 2] * nz
        scale = one / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
        through = translucency[row]
        facing = directions[0, k] * wx + directions[1, k] * wy + directions[2, k] * wz
        if through > zero and facing > zero:  # the normal of a leaf points to the camera's side
            scale = -scale
        out[k, NX], out[k, NY], out[k, NZ] = wx * scale, wy * scale, wz * scale
        around = read_air(air, points[0, k] - ax0, points[1, k] - ay0, points[2, k] - bases[top])
        out[k, SKY] = min(out[k, SKY], _AIR_GAIN * around + AIR_MIN)
        out[k, TRANSLUCENCY], out[k, GLOSS], out[k, MIRROR] = through, glosses[row], mirrors[row]
        texture = np.uintp(textures[row])
        level = mip_level(texels[m] * np.float32(sizes[texture, 0]), dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, out[k, RED], out[k, GREEN], level)
        bright, warmth = one, zero
        if through > zero:
            bright, warmth = _leaf_variation(face[m, FIRST] // 4, tops[k])
        else:
            out[k, SUN] = one if top_leaf[top] == NO_SHADOW and distance[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        out[k, RED] = red * tints[row, 0] * own_tints[top, 0] * bright * (one + np.float32(0.35) * warmth)
        out[k, GREEN] = green * tints[row, 1] * own_tints[top, 1] * bright
        out[k, BLUE] = blue * tints[row, 2] * own_tints[top, 2] * bright * (one - np.float32(0.25) * warmth)
