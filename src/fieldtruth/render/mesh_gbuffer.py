# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The G-buffer of hits on meshes.

Their vertices and faces take 100 MB, so that most hits miss the caches. Faces and vertices are therefore fetched in
short passes of their own, in which a processor waits for several hits at once.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.atlas import sample
from fieldtruth.render.gbuffer import (
    BLUE,
    GLOSS,
    GREEN,
    LIGHT,
    MIRROR,
    NX,
    NY,
    NZ,
    RED,
    SUN,
    TRACE_SUN,
    Scratch,
    dither,
    hits_on,
    mip_level,
)
from fieldtruth.render.ground_points import patch_offset
from fieldtruth.render.land import is_steep, near_edge
from fieldtruth.render.probes import among, falling_on, read_probes
from fieldtruth.render.tables import (
    FIRST,
    MATERIAL,
    NO_SHADOW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OPEN,
    SECOND,
    TEX_U,
    TEX_V,
    THIRD,
    Shading,
    SurfaceTable,
)
from fieldtruth.render.weathering import FURROWS, PATCHES, WEATHERING, overgrown, patchy, texture_slope, tilted
from fieldtruth.sense.hits import HitTable, read_grid
from fieldtruth.sense.packets import IntArray
from fieldtruth.sense.ray_batch import RayBatch

_Barycentric = tuple[np.float32, np.float32, np.float32]
_Rows = tuple[np.uintp, np.uintp, np.uintp]

_SHADOWS_END = np.float32(90.0)
_FLATTEST = np.float32(0.4)
_PATCH = np.float32(0.7)  # side of the patches of distant land, in repeats
"""Distance [m] beyond which the backdrop's trees are drawn without shadows."""
_GRAZING = np.float32(0.05)
"""Least cosine of a surface to a ray for which the texture gets coarser."""
_PER_PI: Final = np.float32(1.0 / np.pi)
_PROBE_OFFSET: Final = np.float32(0.9)
"""[m] in front of a solid surface where its light is read: probes behind it are in its shade."""


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


@kernel(inner=True)
def mesh_gbuffer(
    shading: Shading, batch: RayBatch, count: int, pixel: float, scratch: Scratch, out: Float32Array
) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on meshes; SUN requests shadow rays except on leaves."""
    rows, face, texels = scratch.rows, scratch.face, scratch.texels
    found = hits_on(batch.top, count, False, rows)
    _fetch_faces(shading.hits, shading.surfaces, batch, rows, found, np.float32(pixel), face, texels)
    _fetch_vertices(shading, batch, rows, found, face, out)
    _shade_surfaces(shading, batch, rows, found, np.float32(pixel), face, texels, out)
    _mesh_light(shading, batch, rows, found, face, scratch.probe, out)


@kernel(inner=True)
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


@kernel(inner=True)
def _fetch_vertices(
    shading: Shading, batch: RayBatch, rows: IntArray, found: int, face: IntArray, out: Float32Array
) -> None:
    """Interpolate normals in the object's frame, uv and the share of open air (for now in RED, GREEN and LIGHT)."""
    vertices, top_leaf, leaf_sun = shading.surfaces.vertex, shading.light.top_leaf, shading.light.leaf_sun
    through, barycentric, tops, primitives = (
        shading.materials.through, batch.barycentric, batch.top, batch.primitive
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
        out[k, LIGHT] = _mixed(vertices, corners, weights, OPEN)
        if through[np.uintp(face[m, MATERIAL]), 1] > np.float32(0.0):
            out[k, SUN] = np.float32(leaf_sun[np.uintp(top_leaf[np.uintp(tops[k])] + primitives[k])])


@kernel(inner=True)
def _shade_surfaces(
    shading: Shading,
    batch: RayBatch,
    rows: IntArray,
    found: int,
    pixel: np.float32,
    face: IntArray,
    texels: Float32Array,
    out: Float32Array,
) -> None:
    """Normals in the world's frame, share of the sun and albedo."""
    age, means, bases = shading.materials.age, shading.materials.atlas.mean, shading.surfaces.top_base
    tops, directions, distance, image, points = batch.top, batch.direction, batch.distance, batch.image, batch.point
    materials, surfaces, light = shading.materials, shading.surfaces, shading.light
    foreshortening = batch.foreshortening
    atlas, sizes, textures, tints = materials.atlas, materials.atlas.size, materials.texture, materials.tint
    glosses, throughs, mirrors = materials.gloss, materials.through, materials.mirror
    steeps, lands = materials.steep, materials.land
    rotations, own_tints = surfaces.top_rotation, surfaces.top_tint
    top_leaf, zero, one = light.top_leaf, np.float32(0.0), np.float32(1.0)
    for m in range(found):
        k, row = np.uintp(rows[m]), np.uintp(face[m, MATERIAL])
        top = np.uintp(tops[k])
        nx, ny, nz = out[k, NX], out[k, NY], out[k, NZ]
        wx = rotations[top, 0, 0] * nx + rotations[top, 0, 1] * ny + rotations[top, 0, 2] * nz
        wy = rotations[top, 1, 0] * nx + rotations[top, 1, 1] * ny + rotations[top, 1, 2] * nz
        wz = rotations[top, 2, 0] * nx + rotations[top, 2, 1] * ny + rotations[top, 2, 2] * nz
        scale = one / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
        through = throughs[row, 1]
        facing = directions[0, k] * wx + directions[1, k] * wy + directions[2, k] * wz
        if through > zero and facing > zero:  # the normal of a leaf points to the camera's side
            scale = -scale
        out[k, NX], out[k, NY], out[k, NZ] = wx * scale, wy * scale, wz * scale
        out[k, GLOSS], out[k, MIRROR] = glosses[row], mirrors[row]
        texture = np.uintp(textures[row])
        across = texels[m] * np.float32(sizes[texture, 0])
        u, v, distant = out[k, RED], out[k, GREEN], top_leaf[top] == NO_SHADOW
        if distant:  # repetition, and detail finer than a pixel's long side, would show as stripes
            shift_u, shift_v = patch_offset(u, v, _PATCH)
            u, v = u + shift_u, v + shift_v
            across /= max(foreshortening[k], _FLATTEST)
            if steeps[row] >= 0 and is_steep(points[0, k], points[1, k], out[k, NZ]):
                texture = np.uintp(steeps[row])
        elif through == zero:  # a pixel sees more of a surface that it grazes
            across /= np.sqrt(max(abs(facing) * abs(scale), _GRAZING))
        noise = dither(image[0, k], image[1, k])
        level = mip_level(across, noise)
        red, green, blue = sample(atlas, texture, u, v, level)
        colour = np.float32(red), np.float32(green), np.float32(blue)
        bright, warmth = one, zero
        if through > zero:
            bright, warmth = _leaf_variation(face[m, FIRST] // 4, tops[k])
        else:
            normal = out[k, NX], out[k, NY], out[k, NZ]
            if age[row, FURROWS] > zero:
                along_u, along_v = texture_slope(atlas, texture, u, v, level)
                per_metre = age[row, FURROWS] * texels[m] / (distance[k] * pixel)
                out[k, NX], out[k, NY], out[k, NZ] = tilted(normal, along_u * per_metre, along_v * per_metre)
            if age[row, WEATHERING] > zero:
                above, own = points[2, k] - bases[top], np.float32((tops[k] * 40503) & 1023) * np.float32(1.0 / 1024.0)
                point = points[0, k], points[1, k], points[2, k]
                colour = overgrown(
                    colour, colour[1] / means[texture, 1], point, normal, above, own, age[row, WEATHERING]
                )
            elif age[row, PATCHES] > zero:
                colour = patchy(colour, points[0, k], points[1, k], age[row, PATCHES])
            out[k, SUN] = one if distant and distance[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        red = colour[0] * tints[row, 0] * own_tints[top, 0] * bright * (one + np.float32(0.35) * warmth)
        green = colour[1] * tints[row, 1] * own_tints[top, 1] * bright
        blue = colour[2] * tints[row, 2] * own_tints[top, 2] * bright * (one - np.float32(0.25) * warmth)
        if distant and lands[row]:
            side = distance[k] * pixel / max(foreshortening[k], _FLATTEST)
            red, green, blue = near_edge(materials, (red, green, blue), points[0, k], points[1, k], side, noise)
        out[k, RED], out[k, GREEN], out[k, BLUE] = red, green, blue


@kernel(inner=True)
def _mesh_light(
    shading: Shading,
    batch: RayBatch,
    rows: IntArray,
    found: int,
    face: IntArray,
    probe: Float32Array,
    out: Float32Array,
) -> None:
    """Light of sky and surroundings, and what leaves let through of it and of the sun."""
    points, light, throughs = batch.point, shading.light, shading.materials.through
    volume, base, sun_rgb = light.volume, light.volume_base, light.sun_rgb
    vx, vy = np.float32(light.volume_corner[0]), np.float32(light.volume_corner[1])
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    per, zero, one = np.float32(light.volume_per_metre), np.float32(0.0), np.float32(1.0)
    clouds, cloud_sun = light.has_cloud_shadow, light.cloud_sun
    for m in range(found):
        k, row = np.uintp(rows[m]), np.uintp(face[m, MATERIAL])
        nx, ny, nz, share = out[k, NX], out[k, NY], out[k, NZ], out[k, LIGHT]
        through = throughs[row, 1] > zero
        off = zero if through else _PROBE_OFFSET
        x, y, z = points[0, k] + off * nx, points[1, k] + off * ny, points[2, k] + off * nz
        read_probes(volume, base, (x - vx) * per, (y - vy) * per, z, probe)
        behind = max(-(nx * sx + ny * sy + nz * sz), zero) * out[k, SUN] * _PER_PI
        if clouds and through and behind > zero:
            behind *= read_grid(cloud_sun, points[0, k], points[1, k])
        for channel in range(3):
            albedo, falling = out[k, RED + channel], falling_on(probe, channel, nx, ny, nz)
            if through:
                passed = throughs[row, channel]
                near = among(share, albedo * (one + passed))
                back = falling_on(probe, channel, -nx, -ny, -nz) * near + sun_rgb[channel] * behind
                out[k, LIGHT + channel] = falling * near + passed * back
            else:
                out[k, LIGHT + channel] = falling * among(share, albedo)
