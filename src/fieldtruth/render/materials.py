# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours of a world's materials and ground, as tables that kernels read."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.light import MaterialTable
from fieldtruth.kernels.textures import TERMS, Atlas, Relief
from fieldtruth.render.atlas import make_atlas
from fieldtruth.render.ground_wear import ground_wear
from fieldtruth.render.relief import sun_factors, view_factors
from fieldtruth.render.wetness import WET_GLOSS, wet_texture
from fieldtruth.sense.scene import grid_of
from fieldtruth.world.model import Heightfield, Terrain, World

LEAF_GLOW: Final = np.array([2.6, 2.8, 1.0])
"""Light through a leaf over light from it by channel, for a translucency of 1: it is yellower."""
_MOST: Final = 0.9
"""Of what falls on a leaf, the share that it reflects and transmits at most."""
_PATCH: Final = 0.8
"""Side of a patch of ground that shows one part of a tile, in repeats."""
_WHOLE: Final = ("", "paving")
"""Ground types, and what has none, whose tiles are not cut into patches."""
_FINER: Final = 2
"""Nodes of the grid of ground materials per node of the terrain's cover."""
CRUMBS: Final = 0.015
"""Height [m] below which a layer is grains and crumbs, which light shows. What is higher is blades and leaves: no solid
surface, so that photographs shade the ground as if it ended there."""
MEAN_OVER: Final = 0.1
"""Standard deviation [m] of the Gaussian that separates relief, whose pits are darker, from the ground's shape."""


def material_table(world: World, sun: Array | None = None, wetness: float = 0.0) -> MaterialTable:
    """Tables of a world's materials and ground.

    Args:
        world: the world.
        sun: unit vector (3,) towards the sun, which lights the relief of ground textures; None lights none.
        wetness: of the ground, 0 (dry) to 1 (soaked).
    """
    names, materials = list(world.materials), list(world.materials.values())
    textures = list(world.textures)
    atlas = _atlas(world, sun, wetness)
    terrain = world.terrain
    texture = np.array([textures.index(m.texture) for m in materials], np.int32)
    tint = np.array([m.tint for m in materials], np.float32)
    rows = [names.index(n) for n in terrain.ground_materials]
    rgb, material = _ground(terrain, rows, atlas.mean[texture] * tint)
    solid = solid_surface(terrain)
    wear = ground_wear(terrain, rgb, world.seed)
    relief = [m.relief if world.textures[m.texture].shape[2] > 3 else 0.0 for m in materials]
    seen = np.zeros((len(materials), 2, TERMS), np.float32)
    for k, m in enumerate(materials):
        if sun is not None and relief[k] > 0:
            mean = float(atlas.mean_height[texture[k]])
            lies = Relief(np.float32(1.0 / m.repeat), np.float32(relief[k]), np.float32(mean), np.float32(0.0))
            seen[k] = view_factors(atlas, int(texture[k]), lies, sun)
    ground = [rgb * wear[..., :3], _mean_heights(terrain, solid), wear[..., 3:]]
    return MaterialTable(
        atlas=atlas,
        texture=texture,
        tint=tint,
        through=_through(np.array([m.translucency for m in materials]), atlas.mean[texture] * tint),
        gloss=np.array([max(m.gloss, WET_GLOSS * wetness if m.ground_type else 0.0) for m in materials], np.float32),
        mirror=np.array([m.mirror for m in materials], np.float32),
        repeat=np.array([m.repeat for m in materials], np.float32),
        relief=np.array(relief, np.float32),
        seen=seen,
        age=np.array([(m.furrows, m.weathering, m.patches) for m in materials], np.float32),
        patch=np.array([_PATCH * m.repeat if m.ground_type not in _WHOLE else 0.0 for m in materials], np.float32),
        land=np.array([m.label == Label.GROUND for m in materials], np.bool_),
        steep=np.array([textures.index(m.steep) if m.steep else -1 for m in materials], np.int32),
        wetness=wetness,
        ground=np.ascontiguousarray(np.concatenate(ground, axis=-1), np.float32),
        ground_material=material,
        surface=grid_of(solid),
        corner=(terrain.cover.x0, terrain.cover.y0),
        per_metre_rgb=1.0 / terrain.cover.spacing,
        per_metre_material=_FINER / terrain.cover.spacing,
        trail=names.index(terrain.trail_material),
        border=names.index(terrain.border_material),
        border_width=terrain.border_width,
    )


def _through(translucency: Array, albedo: Float32Array) -> Float32Array:
    """Light through a leaf over light from it, (materials, 3); of bright petals, what they do not reflect."""
    most = np.maximum(_MOST - albedo, 0.0) / np.maximum(albedo, 1e-6)
    return np.asarray(np.minimum(translucency[:, None] * LEAF_GLOW, most), np.float32)


def _atlas(world: World, sun: Array | None, wetness: float) -> Atlas:
    """Textures of a world; those of ground are lit by the sun and wet."""
    images = dict(world.textures)
    ground = {m.texture: m for m in world.materials.values() if m.ground_type}
    factors = dict[int, Float32Array]()
    for name, material in ground.items():
        if sun is not None and material.relief > 0 and images[name].shape[2] > 3:
            row = list(images).index(name)
            factors[row] = sun_factors(images[name], material.relief, material.repeat, sun)
        if wetness > 0:
            images[name] = wet_texture(images[name], wetness)
    return make_atlas(list(images.values()), factors)


def solid_surface(terrain: Terrain) -> Heightfield:
    """The ground that photographs shade: the field with the crumbs of its layer and snow, without grass and litter."""
    field, layer = terrain.field, terrain.layer
    if layer is None:
        return field
    solid = np.minimum(layer, CRUMBS)
    return replace(field, heights=field.heights + (solid if terrain.snow is None else np.maximum(solid, terrain.snow)))


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
