# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The G-buffer: colour, normal and openness of the surface at each hit, before shading.

Tables are unpacked before the loops: Numba updates reference counts for each array that is unpacked inside, which was
measured to cost more than all the rest. The backdrop has one material for all that is far away, in large texels: near
the world's edge, where cameras see it close, the world's ground, mirrored at the edge, fades into it.
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.between_nodes import corners_at, mean_height, mixed_at, nearest, slope_at, value_at
from fieldtruth.kernels.camera_rays import RayBatch
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.light import (
    FIRST,
    MATERIAL,
    NO_SHADOW,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OPEN,
    READ,
    SECOND,
    TEX_U,
    TEX_V,
    THIRD,
    LightTable,
    MaterialTable,
    Shading,
    SurfaceTable,
    among,
    falling_on,
    read_lowest,
    read_probes,
)
from fieldtruth.kernels.packets import TERRAIN, Grid, HitTable, IntArray, mover_normal, read_grid
from fieldtruth.kernels.robot import in_reach, sun_past_robot
from fieldtruth.kernels.ruts import RutTable, rut_depth
from fieldtruth.kernels.textures import (
    FURROWS,
    PATCHES,
    WEATHERING,
    Atlas,
    Colour,
    Relief,
    Texels,
    Vector,
    corked,
    dither,
    flat_value,
    ground_texels,
    is_steep,
    mip_level,
    overgrown,
    patch_offset,
    patchy,
    sample,
    sample_lit,
    texture_slope,
    tilted,
    view_terms,
)

RED, GREEN, BLUE, NX, NY, NZ, SUN, GLOSS, MIRROR, LIGHT = range(10)
"""Columns: linear albedo, unit normal, share of the sun, gloss, mirror, and three of light: irradiance over pi from
sky and surroundings, with what a leaf lets through of all light from behind it, relative to its albedo."""
FIELDS: Final = 12
TERRAIN_PASSES: Final = (
    "ground: normals",
    "ground: shares of sun and open air, contact shadows",
    "ground: relief along the ray, textures, wear, puddles",
    "ground: light of the volume",
)
MESH_PASSES: Final = ("meshes: faces and vertices", "meshes: textures, age, veins", "meshes: light of the volume")
TRACE_SUN: Final = -1.0
"""Value of SUN that requests a shadow ray; other values are the known share of the sun."""
_PER_PIT = np.float32(1.0 / 0.04)
"""Per radius [m] of a pit. From the middle of the bottom of a round pit, the share 1 / (1 + (depth / radius)^2) of the
sky's light is seen (the form factor of a disc above a point)."""
PUDDLE: Final = np.float32(0.004)
"""Depth [m] below the ground's mean height at which water stands on soaked trails; twice as much on drier ones."""


class Scratch(NamedTuple):
    """Working memory for the hits of one batch. Threads must not share it."""

    rows: IntArray  # (n,) rows of the batch that hit the terrain, or a mesh
    face: IntArray  # (n, 4) rows of ``SurfaceTable.face``
    texels: Float32Array  # (n,) width of a pixel in repeats of the texture
    descent: Float32Array  # (n,) of rays towards the ground without its relief, per unit length
    hollow: Float32Array  # (n,) depth [m] below that ground
    probe: Float32Array  # (READ,)
    robot: Array  # (4, 4) of `place_robot`, at the time of the rays


def new_scratch(count: int) -> Scratch:
    """Allocate memory for batches of ``count`` rays."""
    return Scratch(
        rows=np.zeros(count, np.int32),
        face=np.zeros((count, 4), np.int32),
        texels=np.zeros(count, np.float32),
        descent=np.zeros(count, np.float32),
        hollow=np.zeros(count, np.float32),
        probe=np.zeros(READ, np.float32),
        robot=np.zeros((4, 4)),
    )


@kernel
def hits_on(top: IntArray, count: int, on_terrain: bool, rows: IntArray) -> int:
    """List the rows of a batch that hit the terrain, or a mesh; returns their number."""
    found = 0
    for k in range(count):  # without a branch, because hits alternate at edges
        rows[found] = k
        found += (top[k] == TERRAIN) if on_terrain else (top[k] > TERRAIN)
    return found


@kernel(inner=True)
def terrain_gbuffer(
    shading: Shading, batch: RayBatch, count: int, pixel: float, scratch: Scratch, out: Float32Array, passes: int
) -> None:
    """Fill rows of ``out`` (n, FIELDS) for hits on the terrain by the first ``passes`` of TERRAIN_PASSES.

    ``pixel`` is the angle [rad] of one pixel.
    """
    found = hits_on(batch.top, count, True, scratch.rows) if passes > 0 else 0
    if passes > 0:
        _terrain_normals(shading.materials.surface, batch, scratch, found, np.float32(pixel), out)
        if shading.scene.ground != np.uint64(0):
            _rut_normals(shading.scene.ruts, batch, scratch, found, np.float32(pixel), out)
    if passes > 1:
        _terrain_shares(shading, batch, scratch, found, out)
    if passes > 2:
        _terrain_colours(shading, batch, scratch, found, np.float32(pixel), out)
    if passes > 3:
        _terrain_light(shading.light, batch, scratch, found, out)


@kernel(inner=True)
def _terrain_normals(
    surface: Grid, batch: RayBatch, scratch: Scratch, found: int, pixel: np.float32, out: Float32Array
) -> None:
    """Normals over the footprint of a pixel."""
    rows, points, distance, foreshortening = scratch.rows, batch.point, batch.distance, batch.foreshortening
    half_cell, one, flattest = np.float32(0.5 / surface.per_metre), np.float32(1.0), np.float32(0.05)
    for m in range(found):
        k = np.uintp(rows[m])
        side = distance[k] * pixel / np.sqrt(max(foreshortening[k], flattest))
        sx, sy = slope_at(surface, points[0, k], points[1, k], max(half_cell, side))
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        out[k, NX], out[k, NY], out[k, NZ] = -sx * scale, -sy * scale, scale


@kernel(inner=True)
def _rut_normals(
    ruts: RutTable, batch: RayBatch, scratch: Scratch, found: int, pixel: np.float32, out: Float32Array
) -> None:
    """Tilt normals by the slope of ruts over the footprint of a pixel."""
    rows, points, distance, foreshortening = scratch.rows, batch.point, batch.distance, batch.foreshortening
    half_cell, one, flattest = np.float32(0.5 / ruts.per_metre), np.float32(1.0), np.float32(0.05)
    for m in range(found):
        k = np.uintp(rows[m])
        x, y, side = points[0, k], points[1, k], distance[k] * pixel / np.sqrt(max(foreshortening[k], flattest))
        step = max(half_cell, side)
        sx = (rut_depth(ruts, x + step, y) - rut_depth(ruts, x - step, y)) * (np.float32(0.5) / step)
        sy = (rut_depth(ruts, x, y + step) - rut_depth(ruts, x, y - step)) * (np.float32(0.5) / step)
        nx, ny = out[k, NX] + sx * out[k, NZ], out[k, NY] + sy * out[k, NZ]  # a depth that rises is ground that falls
        scale = one / np.sqrt(nx * nx + ny * ny + out[k, NZ] * out[k, NZ])
        out[k, NX], out[k, NY], out[k, NZ] = nx * scale, ny * scale, out[k, NZ] * scale


@kernel(inner=True)
def _terrain_shares(shading: Shading, batch: RayBatch, scratch: Scratch, found: int, out: Float32Array) -> None:
    """Share of the sun, and of what is not near (in LIGHT), which pits of the relief see less of.

    Also what a ray descends towards the ground without its relief, per unit length, and how deep [m] the hit lies
    below that ground.
    """
    rows, descent, hollow = scratch.rows, scratch.descent, scratch.hollow
    points, directions, materials = batch.point, batch.direction, shading.materials
    ground, near, sunlit = materials.ground, shading.light.ground_near, shading.light.ground_sun
    x0, y0 = np.float32(materials.corner[0]), np.float32(materials.corner[1])
    per_rgb, zero, one = np.float32(materials.per_metre_rgb), np.float32(0.0), np.float32(1.0)
    for m in range(found):
        k = np.uintp(rows[m])
        x, y = points[0, k], points[1, k]
        height, slope_x, slope_y = mean_height(ground, (x - x0) * per_rgb, (y - y0) * per_rgb)
        descent[m] = per_rgb * (slope_x * directions[0, k] + slope_y * directions[1, k]) - directions[2, k]
        hollow[m] = height - points[2, k]
        depth = max(hollow[m], zero) * _PER_PIT
        pit = one / (one + depth * depth)
        out[k, LIGHT] = value_at(near, x, y) * pit
        out[k, SUN] = value_at(sunlit, x, y) * pit


@kernel(inner=True)
def _terrain_light(light: LightTable, batch: RayBatch, scratch: Scratch, found: int, out: Float32Array) -> None:
    """Light of sky and surroundings."""
    rows, probe, points, volume = scratch.rows, scratch.probe, batch.point, light.volume
    vx, vy = np.float32(light.volume_corner[0]), np.float32(light.volume_corner[1])
    per = np.float32(light.volume_per_metre)
    for m in range(found):
        k = np.uintp(rows[m])
        read_lowest(volume, (points[0, k] - vx) * per, (points[1, k] - vy) * per, probe)
        nx, ny, nz, share = out[k, NX], out[k, NY], out[k, NZ], out[k, LIGHT]
        for channel in range(3):
            falling = falling_on(probe, channel, nx, ny, nz)
            out[k, LIGHT + channel] = falling * among(share, out[k, RED + channel])


@inlined
def _mean_texel(
    atlas: Atlas, texture: np.uintp, texels: Texels, noise: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Mean linear colour, and mean factor on the sun's light."""
    level = mip_level(texels.width, noise)
    red, green, blue, sun = sample_lit(atlas, texture, texels.u, texels.v, level)
    if texels.samples > 1:
        u, v = texels.u, texels.v
        for _ in range(texels.samples - 1):
            u, v = u + texels.du, v + texels.dv
            r, g, b, s = sample_lit(atlas, texture, u, v, level)
            red, green, blue, sun = red + r, green + g, blue + b, sun + s
        share = np.float32(1.0) / np.float32(texels.samples)
        red, green, blue, sun = red * share, green * share, blue * share, sun * share
    return red, green, blue, sun


@inlined
def _far_factors(
    seen: Float32Array, row: np.uintp, view: Vector, far: np.float32, sun_x: np.float32, sun_y: np.float32
) -> tuple[np.float32, np.float32]:
    """Factors on colour and sunlight of relief that is too far away for its heights, see `render.materials`."""
    one = np.float32(1.0)
    a, b, c, d, e = view_terms(view[0], view[1], view[2], sun_x, sun_y)
    bright = seen[row, 0, 0] * a + seen[row, 0, 1] * b + seen[row, 0, 2] * c + seen[row, 0, 3] * d + seen[row, 0, 4] * e
    light = seen[row, 1, 0] * a + seen[row, 1, 1] * b + seen[row, 1, 2] * c + seen[row, 1, 3] * d + seen[row, 1, 4] * e
    return one + far * bright, one + far * light


@kernel(inner=True)
def _terrain_colours(
    shading: Shading, batch: RayBatch, scratch: Scratch, found: int, pixel: np.float32, out: Float32Array
) -> None:
    """Albedo from the texture of the material, and on the ground from the mixed colour of its surroundings."""
    rows, descent, hollow = scratch.rows, scratch.descent, scratch.hollow
    points, image, directions, distance = batch.point, batch.image, batch.direction, batch.distance
    materials, atlas, ground = shading.materials, shading.materials.atlas, shading.materials.ground
    grain, textures, tints, glosses = materials.ground_material, materials.texture, materials.tint, materials.gloss
    reliefs, patches, seen, mean_heights = materials.relief, materials.patch, materials.seen, atlas.mean_height
    sun_x, sun_y = np.float32(shading.light.sun[0]), np.float32(shading.light.sun[1])
    per_sun = np.float32(1.0) / np.sqrt(max(sun_x * sun_x + sun_y * sun_y, np.float32(1e-9)))
    sun_x, sun_y = sun_x * per_sun, sun_y * per_sun
    edge, border_row, trail_row = shading.hits.trail_distance, materials.border, materials.trail
    per_rgb, per_material = np.float32(materials.per_metre_rgb), np.float32(materials.per_metre_material)
    repeats, means = materials.repeat, materials.atlas.mean
    x0, y0 = np.float32(materials.corner[0]), np.float32(materials.corner[1])
    zero, one, puddles = np.float32(0.0), np.float32(1.0), np.float32(materials.wetness)
    for m in range(found):
        k = np.uintp(rows[m])
        x, y = points[0, k], points[1, k]
        trail = value_at(edge, x, y) if trail_row >= 0 else one
        if trail < zero:
            row = np.uintp(border_row if trail > np.float32(-materials.border_width) else trail_row)
        else:
            row = nearest(grain, (x - x0) * per_material, (y - y0) * per_material)
        texture = np.uintp(textures[row])
        relief = Relief(one / repeats[row], reliefs[row], mean_heights[texture], patches[row])
        view = directions[0, k], directions[1, k], descent[m]
        texels = ground_texels(atlas, texture, relief, x, y, view, distance[k] * pixel)
        red, green, blue, sun = _mean_texel(atlas, texture, texels, dither(image[0, k], image[1, k]))
        bright, light = _far_factors(seen, row, view, texels.far, sun_x, sun_y)
        red, green, blue, sun = red * bright, green * bright, blue * bright, sun * light
        out[k, GLOSS], out[k, MIRROR] = glosses[row], zero
        out[k, SUN] *= sun
        i, j, weights = corners_at(ground, (x - x0) * per_rgb, (y - y0) * per_rgb)
        if trail < zero:
            wear = mixed_at(ground, i, j, 4, weights)
            if puddles > zero:
                wear *= _puddle(hollow[m], puddles, k, out)
            red, green, blue = red * wear, green * wear, blue * wear
            out[k, RED], out[k, GREEN], out[k, BLUE] = red * tints[row, 0], green * tints[row, 1], blue * tints[row, 2]
            continue
        out[k, RED] = mixed_at(ground, i, j, 0, weights) * red / means[texture, 0]
        out[k, GREEN] = mixed_at(ground, i, j, 1, weights) * green / means[texture, 1]
        out[k, BLUE] = mixed_at(ground, i, j, 2, weights) * blue / means[texture, 2]


@inlined
def _puddle(hollow: np.float32, wetness: np.float32, k: np.uintp, out: Float32Array) -> np.float32:
    """Factor on the albedo below standing water, whose surface is level and glossy."""
    zero, one = np.float32(0.0), np.float32(1.0)
    share = min(max((hollow - PUDDLE * (np.float32(2.0) - wetness)) * np.float32(400.0), zero), one) * wetness
    if share > zero:
        out[k, GLOSS] += (np.float32(0.6) - out[k, GLOSS]) * share
        out[k, NX], out[k, NY] = out[k, NX] * (one - share), out[k, NY] * (one - share)
        out[k, NZ] = np.sqrt(max(one - out[k, NX] * out[k, NX] - out[k, NY] * out[k, NY], zero))
    return one - np.float32(0.4) * share


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


_Leaf = tuple[np.float32, np.float32]
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
def _leaf_variation(leaf: int, top: int) -> _Leaf:
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
        if age[row, FURROWS] > np.float32(0.0):
            colour = corked(colour, point, above, own)
        colour = overgrown(colour, colour[1] / mean, point, normal, above, own, age[row, WEATHERING])
    elif age[row, PATCHES] > np.float32(0.0):
        colour = patchy(colour, point[0], point[1], age[row, PATCHES])
    return colour


@inlined
def _tinted(
    colour: Colour, tints: Float32Array, row: np.uintp, own: Float32Array, top: np.uintp, leaf: _Leaf
) -> Colour:
    """Colour with the tints of its material and of the object, and the variation of a leaf."""
    (bright, warmth), one = leaf, np.float32(1.0)
    red = colour[0] * tints[row, 0] * own[top, 0] * bright * (one + np.float32(0.35) * warmth)
    green = colour[1] * tints[row, 1] * own[top, 1] * bright
    blue = colour[2] * tints[row, 2] * own[top, 2] * bright * (one - np.float32(0.25) * warmth)
    return red, green, blue


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
    movers = batch.mover
    for m in range(found):
        k, row = np.uintp(rows[m]), np.uintp(face[m, MATERIAL])
        top, through = np.uintp(tops[k]), throughs[row, 1]
        ray, own = (directions[0, k], directions[1, k], directions[2, k]), (out[k, NX], out[k, NY], out[k, NZ])
        if movers[k] >= 0:  # in the middle of the interval, for all rays
            own = mover_normal(shading.scene, movers[k], 0.5, own)
        normal, facing = _turned(rotations, top, own, ray, through > zero)
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
        colour, leaf = sample(atlas, texture, u, v, level), (one, zero)
        if through > zero:
            leaf = _leaf_variation(face[m, FIRST] // 4, tops[k])
        else:
            if age[row, FURROWS] > zero:
                along_u, along_v = texture_slope(atlas, texture, u, v, level)
                per_metre = age[row, FURROWS] * texels[m] / (distance[k] * pixel)
                out[k, NX], out[k, NY], out[k, NZ] = tilted(normal, along_u * per_metre, along_v * per_metre)
            point, mean = (points[0, k], points[1, k], points[2, k]), atlas.mean[texture, 1]
            colour = _aged(age, row, colour, mean, point, normal, (points[2, k] - bases[top], tops[k]))
            out[k, SUN] = one if distant and distance[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        colour = _tinted(colour, tints, row, own_tints, top, leaf)
        if distant and lands[row]:
            side = distance[k] * pixel / max(foreshortening[k], _FLATTEST)
            colour = near_edge(materials, colour, points[0, k], points[1, k], side, noise)
        out[k, RED], out[k, GREEN], out[k, BLUE] = colour


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
    robot, place, visible = shading.robot, scratch.robot, len(shading.robot.parts) > 0
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
        if (
            visible
            and through
            and behind > zero
            and in_reach(place, points[0, k], points[1, k], points[2, k], light.sun)
        ):
            behind *= sun_past_robot(robot, place, points[0, k], points[1, k], points[2, k])
        for channel in range(3):
            albedo, falling = out[k, RED + channel], falling_on(probe, channel, nx, ny, nz)
            if through:
                passed = throughs[row, channel]
                near = among(share, albedo * (one + passed))
                back = falling_on(probe, channel, -nx, -ny, -nz) * near + sun_rgb[channel] * behind
                out[k, LIGHT + channel] = falling * near + passed * back
            else:
                out[k, LIGHT + channel] = falling * among(share, albedo)
