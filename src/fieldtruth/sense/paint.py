# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a hit looks like: colour, direction and openness of the surface there, before any light falls on it."""

from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import zoom

from fieldtruth.sense import embree
from fieldtruth.sense.atlas import Atlas, make_atlas, sample
from fieldtruth.sense.hits import TERRAIN, Grid, HitTable, read_grid
from fieldtruth.sense.light import LightTable
from fieldtruth.sense.packets import Packet
from fieldtruth.sense.scene import SurfaceTable
from fieldtruth.world.model import Material, Terrain, World

RED, GREEN, BLUE, NX, NY, NZ, SKY, SUN, THROUGH, GLOSS = range(10)
FIELDS: Final = 10
TRACE_SUN: Final = -1.0
"""Value of SUN that asks for a shadow ray; other values are the share of the sun that is known to arrive."""

_NGX, _NGY, _NGZ, _U, _V, _PRIM = (
    embree.NG_X, embree.NG_Y, embree.NG_Z, embree.HIT_U, embree.HIT_V, embree.PRIM_ID,
)  # fmt: skip
_DX, _DY, _DZ = embree.DIR_X, embree.DIR_Y, embree.DIR_Z


class PaintTable(NamedTuple):
    """Colours as kernels take them: rows by material, and the ground's colour and material on grids."""

    atlas: Atlas
    texture: NDArray[np.int32]  # (materials,) row of the atlas
    tint: NDArray[np.float32]  # (materials, 3)
    translucency: NDArray[np.float32]
    gloss: NDArray[np.float32]
    repeat: NDArray[np.float32]  # (materials,) [m] per repeat, used for the ground
    ground_rgb: NDArray[np.float32]  # (nx, ny, 3) linear colour of the ground off the trails
    ground_material: NDArray[np.uint8]  # (mx, my) row of the material whose grain shows
    slope_x: Grid
    slope_y: Grid
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
    slope_x, slope_y = np.gradient(terrain.field.heights.astype(np.float64), terrain.field.spacing)
    grid = (terrain.field.x0, terrain.field.y0, 1.0 / terrain.field.spacing)
    rows = [names.index(n) for n in terrain.ground_materials]
    rgb, material = _ground(terrain, rows, atlas.mean[texture] * tint, materials)
    return PaintTable(
        atlas=atlas,
        texture=texture,
        tint=tint,
        translucency=np.array([m.translucency for m in materials], np.float32),
        gloss=np.array([m.gloss for m in materials], np.float32),
        repeat=np.array([m.repeat for m in materials], np.float32),
        ground_rgb=rgb,
        ground_material=material,
        slope_x=Grid(slope_x.astype(np.float32), *grid),
        slope_y=Grid(slope_y.astype(np.float32), *grid),
        corner=(terrain.cover.x0, terrain.cover.y0),
        per_metre_rgb=1.0 / terrain.cover.spacing,
        per_metre_material=_FINER / terrain.cover.spacing,
        trail=names.index(terrain.trail_material),
        border=names.index(terrain.border_material),
        border_width=terrain.border_width,
    )


_FINER: Final = 4


def _ground(
    terrain: Terrain, rows: list[int], mean: NDArray[np.float32], materials: list[Material]
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Mixed colour per node of the cover, and on a finer grid the one material whose grain shows, with ragged borders."""
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


@njit(nogil=True, cache=True, inline="always")
def _level(atlas: Atlas, texture: int, footprint: float, repeat: float, dither: float) -> int:
    """Mip level whose texels are as large as a pixel's footprint [m]; dithered so that no seam shows between levels."""
    texels = footprint * atlas.size[texture, 0] / repeat
    return int(np.log2(max(texels, 1e-3)) + dither) if texels > 1.0 else 0


@njit(nogil=True, cache=True)
def paint_ground(
    packet: Packet, lane: int, x: float, y: float, footprint: float, dither: float,
    hits: HitTable, paint: PaintTable, light: LightTable, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill ``out`` (FIELDS,) for a hit on the terrain at world x, y [m]."""
    sx, sy = read_grid(paint.slope_x, x, y), read_grid(paint.slope_y, x, y)
    scale = 1.0 / np.sqrt(1.0 + sx * sx + sy * sy)
    out[NX], out[NY], out[NZ] = -sx * scale, -sy * scale, scale
    out[SKY], out[SUN] = read_grid(light.ground_sky, x, y), read_grid(light.ground_sun, x, y)
    out[THROUGH] = 0.0
    trail = read_grid(hits.trail_distance, x, y)
    grazing = -(packet.ray[_DX + lane] * out[NX] + packet.ray[_DY + lane] * out[NY] + packet.ray[_DZ + lane] * out[NZ])
    footprint = footprint / np.sqrt(max(grazing, 0.05))
    if trail < 0.0:
        row = paint.border if trail > -paint.border_width else paint.trail
        texture = paint.texture[row]
        repeat = paint.repeat[row]
        r, g, b = sample(
            paint.atlas, texture, x / repeat, y / repeat, _level(paint.atlas, texture, footprint, repeat, dither)
        )
        tint = paint.tint[row]
        out[RED], out[GREEN], out[BLUE] = r * tint[0], g * tint[1], b * tint[2]
        out[GLOSS] = paint.gloss[row]
        return
    mx, my = paint.ground_material.shape
    i = min(max(int((x - paint.corner[0]) * paint.per_metre_material + 0.5), 0), mx - 1)
    j = min(max(int((y - paint.corner[1]) * paint.per_metre_material + 0.5), 0), my - 1)
    row = paint.ground_material[i, j]
    texture = paint.texture[row]
    repeat = paint.repeat[row]
    r, g, b = sample(
        paint.atlas, texture, x / repeat, y / repeat, _level(paint.atlas, texture, footprint, repeat, dither)
    )
    mean = paint.atlas.mean[texture]
    nx, ny, _ = paint.ground_rgb.shape
    u = min(max((x - paint.corner[0]) * paint.per_metre_rgb, 0.0), nx - 1.001)
    v = min(max((y - paint.corner[1]) * paint.per_metre_rgb, 0.0), ny - 1.001)
    i, j = int(u), int(v)
    fu, fv = u - i, v - j
    for channel in range(3):
        c = paint.ground_rgb
        low = c[i, j, channel] * (1.0 - fv) + c[i, j + 1, channel] * fv
        high = c[i + 1, j, channel] * (1.0 - fv) + c[i + 1, j + 1, channel] * fv
        grain = (r, g, b)[channel] / mean[channel]
        out[RED + channel] = (low * (1.0 - fu) + high * fu) * grain
    out[GLOSS] = paint.gloss[row]


@njit(nogil=True, cache=True)
def paint_object(
    packet: Packet, lane: int, top: int, footprint: float, dither: float,
    hits: HitTable, surfaces: SurfaceTable, paint: PaintTable, light: LightTable, out: NDArray[np.float32],
) -> None:  # fmt: skip
    """Fill ``out`` (FIELDS,) for a hit on a mesh."""
    mesh = hits.top_mesh[top]
    face = hits.mesh_face[mesh] + packet.words[_PRIM + lane]
    a, b, c = surfaces.face_vertices[face]
    fu, fv = packet.ray[_U + lane], packet.ray[_V + lane]
    fw = np.float32(1.0) - fu - fv
    n, uv, sky = surfaces.vertex_normal, surfaces.vertex_uv, light.vertex_sky
    nx = n[a, 0] * fw + n[b, 0] * fu + n[c, 0] * fv
    ny = n[a, 1] * fw + n[b, 1] * fu + n[c, 1] * fv
    nz = n[a, 2] * fw + n[b, 2] * fu + n[c, 2] * fv
    m = surfaces.top_rotation[top]
    wx = m[0, 0] * nx + m[0, 1] * ny + m[0, 2] * nz
    wy = m[1, 0] * nx + m[1, 1] * ny + m[1, 2] * nz
    wz = m[2, 0] * nx + m[2, 1] * ny + m[2, 2] * nz
    scale = np.float32(1.0) / np.sqrt(max(wx * wx + wy * wy + wz * wz, np.float32(1e-12)))
    row = surfaces.face_material[face]
    through = paint.translucency[row]
    facing = packet.ray[_DX + lane] * wx + packet.ray[_DY + lane] * wy + packet.ray[_DZ + lane] * wz
    if through > 0.0 and facing > 0.0:  # a leaf is seen from whichever side it shows
        scale = -scale
    out[NX], out[NY], out[NZ] = wx * scale, wy * scale, wz * scale
    out[SKY] = sky[a] * fw + sky[b] * fu + sky[c] * fv
    out[SUN], out[THROUGH], out[GLOSS] = TRACE_SUN, through, paint.gloss[row]
    texture, repeat = paint.texture[row], surfaces.face_repeat[face]
    u = uv[a, 0] * fw + uv[b, 0] * fu + uv[c, 0] * fv
    v = uv[a, 1] * fw + uv[b, 1] * fu + uv[c, 1] * fv
    level = _level(paint.atlas, texture, footprint, repeat, dither)
    red, green, blue = sample(paint.atlas, texture, u, v, level)
    tint, own = paint.tint[row], surfaces.top_tint[top]
    shade, warmth = np.float32(1.0), np.float32(0.0)
    if through > 0.0:  # no two leaves have the same green
        key = np.uint32(a // 4 + 7919 * top) * np.uint32(2654435761)
        shade = np.float32(0.78) + np.float32(0.44) * np.float32((key >> np.uint32(8)) & np.uint32(255)) / np.float32(255.0)
        warmth = np.float32((key >> np.uint32(16)) & np.uint32(255)) / np.float32(255.0) - np.float32(0.5)
    out[RED] = red * tint[0] * own[0] * shade * (np.float32(1.0) + np.float32(0.35) * warmth)
    out[GREEN] = green * tint[1] * own[1] * shade
    out[BLUE] = blue * tint[2] * own[2] * shade * (np.float32(1.0) - np.float32(0.25) * warmth)


__all__ = ["FIELDS", "TERRAIN", "PaintTable", "paint_ground", "paint_object", "paint_table"]
