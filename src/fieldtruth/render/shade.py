# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a hit looks like: colour, direction and openness of the surface there, before any light falls on it."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import zoom

from fieldtruth.render.atlas import Atlas, make_atlas, sample
from fieldtruth.render.light import AIR_BASE, AIR_LAYER, AIR_TEXEL, NO_SHADOW, LightTable
from fieldtruth.render.surfaces import (
    FIRST,
    MATERIAL,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    OPEN_SKY,
    SECOND,
    TEX_U,
    TEX_V,
    THIRD,
    SurfaceTable,
)  # fmt: skip
from fieldtruth.sense.hits import TERRAIN, HitTable, read_grid
from fieldtruth.sense.kernel import inlined, kernel
from fieldtruth.sense.strip import Strip
from fieldtruth.world.model import Material, Raster, Terrain, World

RED, GREEN, BLUE, NX, NY, NZ, SKY, SUN, THROUGH, GLOSS, MIRROR = range(11)
FIELDS: Final = 11
TRACE_SUN: Final = -1.0
"""Value of SUN that asks for a shadow ray; other values are the share of the sun that is known to arrive."""


_PER_AIR, _PER_LAYER = np.float32(1.0 / AIR_TEXEL), np.float32(1.0 / AIR_LAYER)
_SHADOWS_END = np.float32(90.0)
"""Distance [m] beyond which nobody sees whether a tree casts a shadow on the far land."""
_AIR_GAIN, _AIR_LEAST = np.float32(1.35), np.float32(0.06)
"""A thing stands in its own air; what it takes from it there is given back, roughly. And light that leaves and soil
throw from one to the other reaches everywhere."""


class PaintTable(NamedTuple):
    """Colours as kernels take them: rows by material, and the ground's colour and material on grids."""

    atlas: Atlas
    texture: NDArray[np.int32]  # (materials,) row of the atlas
    tint: NDArray[np.float32]  # (materials, 3)
    translucency: NDArray[np.float32]
    gloss: NDArray[np.float32]
    mirror: NDArray[np.float32]
    repeat: NDArray[np.float32]  # (materials,) [m] per repeat, used for the ground
    ground: NDArray[np.float32]  # (nx, ny, 5) linear colour off the trails, and the terrain's slope along x and y
    ground_material: NDArray[np.uint8]  # (mx, my) row of the material whose grain shows
    corner: tuple[float, float]  # [m] x and y of both grids' first node
    per_metre_rgb: float
    per_metre_material: float
    trail: int  # rows of materials
    border: int
    border_width: float


def paint_table(world: World) -> PaintTable:
    """Tables of a world's materials and ground."""
    names, materials = list(world.materials), list(world.materials.values())
    textures = list(world.textures)
    atlas = make_atlas(list(world.textures.values()))
    terrain = world.terrain
    texture = np.array([textures.index(m.texture) for m in materials], np.int32)
    tint = np.array([m.tint for m in materials], np.float32)
    rows = [names.index(n) for n in terrain.ground_materials]
    rgb, material = _ground(terrain, rows, atlas.mean[texture] * tint, materials)
    return PaintTable(
        atlas=atlas,
        texture=texture,
        tint=tint,
        translucency=np.array([m.translucency for m in materials], np.float32),
        gloss=np.array([m.gloss for m in materials], np.float32),
        mirror=np.array([m.mirror for m in materials], np.float32),
        repeat=np.array([m.repeat for m in materials], np.float32),
        ground=np.ascontiguousarray(np.concatenate([rgb, _slopes(terrain)], axis=-1), np.float32),
        ground_material=material,
        corner=(terrain.cover.x0, terrain.cover.y0),
        per_metre_rgb=1.0 / terrain.cover.spacing,
        per_metre_material=_FINER / terrain.cover.spacing,
        trail=names.index(terrain.trail_material),
        border=names.index(terrain.border_material),
        border_width=terrain.border_width,
    )


_FINER: Final = 2


def _slopes(terrain: Terrain) -> NDArray[np.float64]:
    """Slope of the terrain along x and y at the cover's nodes, (nx, ny, 2), smooth across the triangles."""
    field, cover = terrain.field, terrain.cover
    along_x, along_y = np.gradient(field.heights.astype(np.float64), field.spacing)
    slopes = np.stack([np.asarray(along_x), np.asarray(along_y)], axis=-1)
    smooth = Raster(values=slopes.astype(np.float32), spacing=field.spacing, x0=field.x0, y0=field.y0)
    nx, ny = cover.values.shape[:2]
    x, y = cover.x0 + cover.spacing * np.arange(nx), cover.y0 + cover.spacing * np.arange(ny)
    return smooth.at(*np.meshgrid(x, y, indexing="ij"))


def _ground(
    terrain: Terrain, rows: list[int], mean: NDArray[np.float32], materials: list[Material]
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Mixed colour per node of the cover; on a finer grid the one material whose grain shows, with ragged borders."""
    weights = terrain.cover.values / np.maximum(terrain.cover.values.sum(axis=-1, keepdims=True), 1e-6)
    rgb = weights @ mean[rows]
    nx, ny = weights.shape[:2]
    size = ((nx - 1) * _FINER + 1, (ny - 1) * _FINER + 1)
    noise = np.random.default_rng(1).random(size, np.float32)
    best, choice = np.full(size, -1.0, np.float32), np.zeros(size, np.uint8)
    for k, row in enumerate(rows):
        fine = zoom(weights[..., k], (size[0] / nx, size[1] / ny), order=1, grid_mode=False)
        score = fine.astype(np.float32) + 0.5 * np.roll(noise, 37 * k, axis=0) * (fine > 0.02)
        better = score > best
        best, choice = np.where(better, score, best), np.where(better, np.uint8(row), choice)
    return np.ascontiguousarray(rgb, np.float32), choice


@inlined
def _level(size: int, footprint: float, repeat: float, dither: float) -> int:
    """Mip level whose texels are as large as a pixel's footprint [m], dithered so that no seam shows between levels.

    It is the integer part of log2(texels) + dither; log2(1 + dither) is close enough to dither.
    """
    texels = footprint * size * (1.0 + dither) / repeat
    level = 0
    while texels >= 2.0 and level < 16:
        texels *= 0.5
        level += 1
    return level


@inlined
def _dither(u: float, v: float) -> float:
    """A fixed pattern in [0, 1) over the image (interleaved gradient noise, Jimenez 2014)."""
    inner = np.float32(0.06711056) * u + np.float32(0.00583715) * v
    value = np.float32(52.9829189) * (inner - np.floor(inner))
    return float(value - np.floor(value))


@inlined
def read_air(air: NDArray[np.float32], x: float, y: float, above: float) -> float:
    """Share of open sky in the air, x and y [m] from the world's corner and ``above`` [m] a thing's foot."""
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


@kernel
def paint_ground(
    strip: Strip, count: int, pixel: float, hits: HitTable, paint: PaintTable, light: LightTable,
    out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill rows of ``out`` (n, FIELDS) for the points that lie on the terrain; ``pixel`` is the angle [rad] of one.

    Tables are unpacked before the loop: Numba counts what is unpacked within up and down for each point, which was
    measured to cost more than everything else.
    """
    tops, points, directions, reach, image = strip.top, strip.point, strip.direction, strip.reach, strip.image
    atlas, ground, grain = paint.atlas, paint.ground, paint.ground_material
    textures, tints, repeats, glosses, means = paint.texture, paint.tint, paint.repeat, paint.gloss, paint.atlas.mean
    open_sky, sunlit, edge, sizes = light.ground_sky, light.ground_sun, hits.trail_distance, atlas.size
    x0, y0 = paint.corner
    one = np.float32(1.0)
    for k in range(count):
        if tops[k] != TERRAIN:
            continue
        x, y = points[0, k], points[1, k]
        u = min(max((x - x0) * paint.per_metre_rgb, 0.0), ground.shape[0] - 1.001)
        v = min(max((y - y0) * paint.per_metre_rgb, 0.0), ground.shape[1] - 1.001)
        i, j = int(u), int(v)
        fu, fv = np.float32(u - i), np.float32(v - j)
        a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
        sx = ground[i, j, 3] * a + ground[i, j + 1, 3] * b + ground[i + 1, j, 3] * c + ground[i + 1, j + 1, 3] * d
        sy = ground[i, j, 4] * a + ground[i, j + 1, 4] * b + ground[i + 1, j, 4] * c + ground[i + 1, j + 1, 4] * d
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        out[k, NX], out[k, NY], out[k, NZ] = -sx * scale, -sy * scale, scale
        out[k, SKY], out[k, SUN] = _AIR_LEAST + (1.0 - _AIR_LEAST) * read_grid(open_sky, x, y), read_grid(sunlit, x, y)
        out[k, THROUGH] = 0.0
        grazing = (directions[0, k] * sx + directions[1, k] * sy - directions[2, k]) * scale
        footprint = reach[k] * pixel / np.sqrt(max(grazing, np.float32(0.05)))
        trail = read_grid(edge, x, y)
        if trail < 0.0:
            row = paint.border if trail > -paint.border_width else paint.trail
        else:
            gi = min(max(int((x - x0) * paint.per_metre_material + 0.5), 0), grain.shape[0] - 1)
            gj = min(max(int((y - y0) * paint.per_metre_material + 0.5), 0), grain.shape[1] - 1)
            row = int(grain[gi, gj])
        texture, per_metre = textures[row], 1.0 / repeats[row]
        level = _level(sizes[texture, 0], footprint, repeats[row], _dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, x * per_metre, y * per_metre, level)
        out[k, GLOSS], out[k, MIRROR] = glosses[row], 0.0
        if trail < 0.0:
            out[k, RED], out[k, GREEN], out[k, BLUE] = red * tints[row, 0], green * tints[row, 1], blue * tints[row, 2]
        else:
            mixed = (
                ground[i, j, 0] * a + ground[i, j + 1, 0] * b + ground[i + 1, j, 0] * c + ground[i + 1, j + 1, 0] * d
            )
            out[k, RED] = mixed * red / means[texture, 0]
            mixed = (
                ground[i, j, 1] * a + ground[i, j + 1, 1] * b + ground[i + 1, j, 1] * c + ground[i + 1, j + 1, 1] * d
            )
            out[k, GREEN] = mixed * green / means[texture, 1]
            mixed = (
                ground[i, j, 2] * a + ground[i, j + 1, 2] * b + ground[i + 1, j, 2] * c + ground[i + 1, j + 1, 2] * d
            )
            out[k, BLUE] = mixed * blue / means[texture, 2]


@kernel
def paint_objects(
    strip: Strip, count: int, pixel: float, hits: HitTable, surfaces: SurfaceTable, paint: PaintTable,
    light: LightTable, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill rows of ``out`` (n, FIELDS) for the points that lie on meshes; SUN asks for shadow rays except on leaves."""
    tops, directions, reach, image, atlas = strip.top, strip.direction, strip.reach, strip.image, paint.atlas
    primitives, barycentric = strip.primitive, strip.barycentric
    sizes, textures, tints, glosses, translucency = (
        atlas.size, paint.texture, paint.tint, paint.gloss, paint.translucency,
    )  # fmt: skip
    top_mesh, mesh_face = hits.top_mesh, hits.mesh_face
    vertices, faces, repeats = surfaces.vertex, surfaces.face, surfaces.face_repeat
    leaf_sun, top_leaf, mirrors = light.leaf_sun, light.top_leaf, paint.mirror
    air, bases, points, ax0, ay0 = light.air_sky, light.top_base, strip.point, light.ground_sky.x0, light.ground_sky.y0
    rotations, own_tints = surfaces.top_rotation, surfaces.top_tint
    one, half = np.float32(1.0), np.float32(0.5)
    for k in range(count):
        top = tops[k]
        if top <= TERRAIN:
            continue
        face = mesh_face[top_mesh[top]] + primitives[k]
        a, b, c, row = faces[face, FIRST], faces[face, SECOND], faces[face, THIRD], faces[face, MATERIAL]
        fu, fv = barycentric[0, k], barycentric[1, k]
        fw = one - fu - fv
        nx = vertices[a, NORMAL_X] * fw + vertices[b, NORMAL_X] * fu + vertices[c, NORMAL_X] * fv
        ny = vertices[a, NORMAL_Y] * fw + vertices[b, NORMAL_Y] * fu + vertices[c, NORMAL_Y] * fv
        nz = vertices[a, NORMAL_Z] * fw + vertices[b, NORMAL_Z] * fu + vertices[c, NORMAL_Z] * fv
        wx = rotations[top, 0, 0] * nx + rotations[top, 0, 1] * ny + rotations[top, 0, 2] * nz
        wy = rotations[top, 1, 0] * nx + rotations[top, 1, 1] * ny + rotations[top, 1, 2] * nz
        wz = rotations[top, 2, 0] * nx + rotations[top, 2, 1] * ny + rotations[top, 2, 2] * nz
        scale = one / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
        through = translucency[row]
        facing = directions[0, k] * wx + directions[1, k] * wy + directions[2, k] * wz
        if through > 0.0 and facing > 0.0:  # a leaf is seen from whichever side it shows
            scale = -scale
        out[k, NX], out[k, NY], out[k, NZ] = wx * scale, wy * scale, wz * scale
        own_sky = vertices[a, OPEN_SKY] * fw + vertices[b, OPEN_SKY] * fu + vertices[c, OPEN_SKY] * fv
        around = read_air(air, points[0, k] - ax0, points[1, k] - ay0, points[2, k] - bases[top])
        out[k, SKY] = min(own_sky, _AIR_GAIN * around + _AIR_LEAST)
        out[k, THROUGH], out[k, GLOSS], out[k, MIRROR] = through, glosses[row], mirrors[row]
        if through > 0.0:
            out[k, SUN] = np.float32(leaf_sun[top_leaf[top] + primitives[k]])
        else:
            out[k, SUN] = one if top_leaf[top] == NO_SHADOW and reach[k] > _SHADOWS_END else np.float32(TRACE_SUN)
        texture = textures[row]
        u = vertices[a, TEX_U] * fw + vertices[b, TEX_U] * fu + vertices[c, TEX_U] * fv
        v = vertices[a, TEX_V] * fw + vertices[b, TEX_V] * fu + vertices[c, TEX_V] * fv
        level = _level(sizes[texture, 0], reach[k] * pixel, repeats[face], _dither(image[0, k], image[1, k]))
        red, green, blue = sample(atlas, texture, u, v, level)
        shade, warmth = one, np.float32(0.0)
        if through > 0.0:  # no two leaves have the same green
            key = np.uint32(a // 4 + 7919 * top) * np.uint32(2654435761)
            shade = np.float32(0.78) + np.float32(0.44 / 255.0) * np.float32((key >> np.uint32(8)) & np.uint32(255))
            warmth = np.float32((key >> np.uint32(16)) & np.uint32(255)) / np.float32(255.0) - half
        out[k, RED] = red * tints[row, 0] * own_tints[top, 0] * shade * (one + np.float32(0.35) * warmth)
        out[k, GREEN] = green * tints[row, 1] * own_tints[top, 1] * shade
        out[k, BLUE] = blue * tints[row, 2] * own_tints[top, 2] * shade * (one - np.float32(0.25) * warmth)
