# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The part of the G-buffer that is filled for hits on meshes: plants, furniture, rocks and the backdrop.

The backdrop has one material for all that is far away, in large texels: near the world's edge, where cameras see it
close, the world's ground, mirrored at the edge, fades into it.
"""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.camera_rays import RayBatch
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.gbuffer import (
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
    hits_on,
)
from fieldtruth.kernels.light import (
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
    MaterialTable,
    Shading,
    SurfaceTable,
    among,
    falling_on,
    read_probes,
)
from fieldtruth.kernels.packets import HitTable, read_grid
from fieldtruth.kernels.textures import (
    FURROWS,
    PATCHES,
    WEATHERING,
    Colour,
    Vector,
    dither,
    flat_value,
    is_steep,
    mip_level,
    overgrown,
    patch_offset,
    patchy,
    sample,
    texture_slope,
    tilted,
)

MESH_PASSES: Final = ("meshes: faces and vertices", "meshes: textures, age, veins", "meshes: light of the volume")
FADES: Final = np.float32(40.0)
"""Distance [m] from the edge at which the world's ground has faded."""
_KEPT: Final = np.float32(4.0)  # [m] up to which it has not begun to
_PER_TONGUE: Final = np.float32(1.0 / 9.0)  # per metre, of the fade's irregular border


@inlined
def _mirrored(at: np.float32, side: np.float32) -> np.float32:
    """Position on a side [m] of a rectangle, mirrored at both ends again and again."""
    turns = at / (np.float32(2.0) * side)
    share = np.float32(2.0) * abs(turns - np.floor(turns + np.float32(0.5)))
    return share * side  # type: ignore[no-any-return]


@inlined
def near_edge(
    materials: MaterialTable, colour: Colour, x: np.float32, y: np.float32, side: np.float32, noise: np.float32
) -> Colour:
    """Blend the world's ground over the ``colour`` of land at x, y [m]; ``side`` [m] is the width of a pixel there."""
    ground, grain, zero, one = materials.ground, materials.ground_material, np.float32(0.0), np.float32(1.0)
    per, finer = np.float32(materials.per_metre_rgb), np.float32(materials.per_metre_material / materials.per_metre_rgb)
    long, wide = np.float32(ground.shape[0] - 1), np.float32(ground.shape[1] - 1)
    u, v = (x - np.float32(materials.corner[0])) * per, (y - np.float32(materials.corner[1])) * per
    du, dv = max(max(-u, u - long), zero) / per, max(max(-v, v - wide), zero) / per
    off = np.sqrt(du * du + dv * dv)
    if off >= np.float32(1.4) * FADES:
        return colour
    off *= np.float32(0.7) + np.float32(0.6) * flat_value(x * _PER_TONGUE, y * _PER_TONGUE)
    share = one - min(max((off - _KEPT) / (FADES - _KEPT), zero), one)
    if share <= zero:
        return colour
    u, v = _mirrored(u, long), _mirrored(v, wide)
    i, j = np.uintp(min(u, long)), np.uintp(min(v, wide))
    row = np.uintp(grain[np.uintp(min(u, long) * finer), np.uintp(min(v, wide) * finer)])
    texture, repeat = np.uintp(materials.texture[row]), materials.repeat[row]
    level = mip_level(side / repeat * np.float32(materials.atlas.size[texture, 0]), noise)
    red, green, blue = sample(materials.atlas, texture, x / repeat, y / repeat, level)
    mean = materials.atlas.mean
    red = colour[0] + share * (ground[i, j, 0] * red / mean[texture, 0] - colour[0])
    green = colour[1] + share * (ground[i, j, 1] * green / mean[texture, 1] - colour[1])
    blue = colour[2] + share * (ground[i, j, 2] * blue / mean[texture, 2] - colour[2])
    return red, green, blue


_Barycentric = tuple[np.float32, np.float32, np.float32]
_Rows = tuple[np.uintp, np.uintp, np.uintp]
_SHADOWS_END = np.float32(90.0)
"""Distance [m] beyond which the backdrop's trees are drawn without shadows."""
_FLATTEST = np.float32(0.4)
_PATCH = np.float32(0.7)  # side of the patches of distant land, in repeats
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
    shading: Shading, batch: RayBatch, count: int, pixel: float, scratch: Scratch, out: Float32Array, passes: int
) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on meshes by the first ``passes`` of MESH_PASSES.

    SUN requests shadow rays except on leaves.
    """
    found = hits_on(batch.top, count, False, scratch.rows) if passes > 0 else 0
    if passes > 0:
        _fetch_faces(shading.hits, shading.surfaces, batch, scratch, found, np.float32(pixel))
        _fetch_vertices(shading, batch, scratch, found, out)
    if passes > 1:
        _shade_surfaces(shading, batch, scratch, found, np.float32(pixel), out)
    if passes > 2:
        _mesh_light(shading, batch, scratch, found, out)


@kernel(inner=True)
def _fetch_faces(
    hits: HitTable, surfaces: SurfaceTable, batch: RayBatch, scratch: Scratch, found: int, pixel: np.float32
) -> None:
    """Copy the rows of SurfaceTable.face, and find the width of a pixel in repeats of the texture."""
    rows, face, texels = scratch.rows, scratch.face, scratch.texels
    tops, primitives, distance = batch.top, batch.primitive, batch.distance
    top_mesh, mesh_face, faces, repeats = hits.top_mesh, hits.mesh_face, surfaces.face, surfaces.face_repeat
    for m in range(found):
        k = np.uintp(rows[m])
        at = np.uintp(mesh_face[np.uintp(top_mesh[np.uintp(tops[k])])] + primitives[k])
        face[m, FIRST], face[m, SECOND], face[m, THIRD] = faces[at, FIRST], faces[at, SECOND], faces[at, THIRD]
        face[m, MATERIAL] = faces[at, MATERIAL]
        texels[m] = distance[k] * pixel / repeats[at]


@kernel(inner=True)
def _fetch_vertices(shading: Shading, batch: RayBatch, scratch: Scratch, found: int, out: Float32Array) -> None:
    """Interpolate normals in the object's frame, uv and the share of open air (for now in RED, GREEN and LIGHT)."""
    rows, face = scratch.rows, scratch.face
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


@inlined
def _turned(
    rotations: Float32Array, top: np.uintp, normal: Vector, ray: Vector, thin: bool
) -> tuple[Vector, np.float32]:
    """Turn a normal of an object into the world, and find the cosine of its angle to a ray, without its sign.

    The normal has unit length then. That of a leaf, which is ``thin``, points to the camera's side.
    """
    x, y, z = normal
    wx = rotations[top, 0, 0] * x + rotations[top, 0, 1] * y + rotations[top, 0, 2] * z
    wy = rotations[top, 1, 0] * x + rotations[top, 1, 1] * y + rotations[top, 1, 2] * z
    wz = rotations[top, 2, 0] * x + rotations[top, 2, 1] * y + rotations[top, 2, 2] * z
    scale = np.float32(1.0) / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
    facing = ray[0] * wx + ray[1] * wy + ray[2] * wz
    if thin and facing > np.float32(0.0):
        scale = -scale
    return (wx * scale, wy * scale, wz * scale), abs(facing) * abs(scale)


@inlined
def _aged(
    age: Float32Array,
    row: np.uintp,
    colour: Colour,
    mean: np.float32,
    point: Vector,
    normal: Vector,
    place: tuple[np.float32, int],
) -> Colour:
    """Colour with what grows on a surface, or with patches; ``place`` is its height [m] above its base, and the top."""
    if age[row, WEATHERING] > np.float32(0.0):
        above, top = place
        own = np.float32((top * 40503) & 1023) * np.float32(1.0 / 1024.0)
        colour = overgrown(colour, colour[1] / mean, point, normal, above, own, age[row, WEATHERING])
    elif age[row, PATCHES] > np.float32(0.0):
        colour = patchy(colour, point[0], point[1], age[row, PATCHES])
    return colour


@kernel(inner=True)
def _shade_surfaces(
    shading: Shading, batch: RayBatch, scratch: Scratch, found: int, pixel: np.float32, out: Float32Array
) -> None:
    """Normals in the world's frame, share of the sun and albedo."""
    rows, face, texels = scratch.rows, scratch.face, scratch.texels
    tops, directions, distance, image, points = batch.top, batch.direction, batch.distance, batch.image, batch.point
    materials, surfaces, foreshortening = shading.materials, shading.surfaces, batch.foreshortening
    atlas, sizes, textures, tints = materials.atlas, materials.atlas.size, materials.texture, materials.tint
    glosses, throughs, mirrors, age = materials.gloss, materials.through, materials.mirror, materials.age
    rotations, own_tints, bases, steeps = surfaces.top_rotation, surfaces.top_tint, surfaces.top_base, materials.steep
    top_leaf, zero, one, lands = shading.light.top_leaf, np.float32(0.0), np.float32(1.0), materials.land
    for m in range(found):
        k, row = np.uintp(rows[m]), np.uintp(face[m, MATERIAL])
        top = np.uintp(tops[k])
        through, ray = throughs[row, 1], (directions[0, k], directions[1, k], directions[2, k])
        normal, facing = _turned(rotations, top, (out[k, NX], out[k, NY], out[k, NZ]), ray, through > zero)
        out[k, NX], out[k, NY], out[k, NZ] = normal
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
            across /= np.sqrt(max(facing, _GRAZING))
        noise = dither(image[0, k], image[1, k])
        level = mip_level(across, noise)
        red, green, blue = sample(atlas, texture, u, v, level)
        colour, bright, warmth = (np.float32(red), np.float32(green), np.float32(blue)), one, zero
        if through > zero:
            bright, warmth = _leaf_variation(face[m, FIRST] // 4, tops[k])
        else:
            if age[row, FURROWS] > zero:
                along_u, along_v = texture_slope(atlas, texture, u, v, level)
                per_metre = age[row, FURROWS] * texels[m] / (distance[k] * pixel)
                out[k, NX], out[k, NY], out[k, NZ] = tilted(normal, along_u * per_metre, along_v * per_metre)
            point, mean = (points[0, k], points[1, k], points[2, k]), atlas.mean[texture, 1]
            colour = _aged(age, row, colour, mean, point, normal, (points[2, k] - bases[top], tops[k]))
            out[k, SUN] = one if distant and distance[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        red = colour[0] * tints[row, 0] * own_tints[top, 0] * bright * (one + np.float32(0.35) * warmth)
        green = colour[1] * tints[row, 1] * own_tints[top, 1] * bright
        blue = colour[2] * tints[row, 2] * own_tints[top, 2] * bright * (one - np.float32(0.25) * warmth)
        if distant and lands[row]:
            side = distance[k] * pixel / max(foreshortening[k], _FLATTEST)
            red, green, blue = near_edge(materials, (red, green, blue), points[0, k], points[1, k], side, noise)
        out[k, RED], out[k, GREEN], out[k, BLUE] = red, green, blue


@kernel(inner=True)
def _mesh_light(shading: Shading, batch: RayBatch, scratch: Scratch, found: int, out: Float32Array) -> None:
    """Light of sky and surroundings, and what leaves let through of it and of the sun."""
    rows, face, probe = scratch.rows, scratch.face, scratch.probe
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
