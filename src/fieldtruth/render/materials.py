# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours of a world's materials and ground, as tables that kernels read."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.render.atlas import make_atlas
from fieldtruth.render.tables import MaterialTable
from fieldtruth.sense.scene import grid_of
from fieldtruth.world.model import Heightfield, Terrain, World

_FINER: Final = 2
"""Nodes of the grid of ground materials per node of the terrain's cover."""
CRUMBS: Final = 0.015
"""Height [m] below which a layer is grains and crumbs, which light shows. What is higher is blades and leaves: no solid
surface, so that photographs shade the ground as if it ended there."""
MEAN_OVER: Final = 0.1
"""Standard deviation [m] of the Gaussian that separates relief, whose pits are darker, from the ground's shape."""


def material_table(world: World) -> MaterialTable:
    """Tables of a world's materials and ground."""
    names, materials = list(world.materials), list(world.materials.values())
    textures = list(world.textures)
    atlas = make_atlas(list(world.textures.values()))
    terrain = world.terrain
    texture = np.array([textures.index(m.texture) for m in materials], np.int32)
    tint = np.array([m.tint for m in materials], np.float32)
    rows = [names.index(n) for n in terrain.ground_materials]
    rgb, material = _ground(terrain, rows, atlas.mean[texture] * tint)
    solid = solid_surface(terrain)
    return MaterialTable(
        atlas=atlas,
        texture=texture,
        tint=tint,
        translucency=np.array([m.translucency for m in materials], np.float32),
        gloss=np.array([m.gloss for m in materials], np.float32),
        mirror=np.array([m.mirror for m in materials], np.float32),
        repeat=np.array([m.repeat for m in materials], np.float32),
        ground=np.ascontiguousarray(np.concatenate([rgb, _mean_heights(terrain, solid)], axis=-1), np.float32),
        ground_material=material,
        surface=grid_of(solid),
        corner=(terrain.cover.x0, terrain.cover.y0),
        per_metre_rgb=1.0 / terrain.cover.spacing,
        per_metre_material=_FINER / terrain.cover.spacing,
        trail=names.index(terrain.trail_material),
        border=names.index(terrain.border_material),
        border_width=terrain.border_width,
    )


def solid_surface(terrain: Terrain) -> Heightfield:
    """The ground that photographs shade: the field with the crumbs of its layer, without grass and litter."""
    field = terrain.field
    return field if terrain.layer is None else replace(field, heights=field.heights + np.minimum(terrain.layer, CRUMBS))


def _mean_heights(terrain: Terrain, field: Heightfield) -> Array:
    """Height [m] of a field without its relief, (nx, ny, 1) at the cover's nodes."""
    cover = terrain.cover
    smooth = replace(field, heights=gaussian_filter(field.heights, MEAN_OVER / field.spacing, mode="nearest"))
    nx, ny = cover.values.shape[:2]
    x, y = cover.x0 + cover.spacing * np.arange(nx), cover.y0 + cover.spacing * np.arange(ny)
    return smooth.height_at(*np.meshgrid(x, y, indexing="ij"))[..., None]


def _ground(terrain: Terrain, rows: list[int], mean: Float32Array) -> tuple[Float32Array, NDArray[np.uint8]]:
    """Mixed colour per node of the cover, and on a finer grid the row of one material, with ragged borders."""
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
