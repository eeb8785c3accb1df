# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours of a world's materials and ground, as tables that kernels read.

- Textures and their mip maps lie in one array, averaged in linear light.
- Relief: which texels of a ground texture face the sun, and which lie in the shadow of others. The sun stands still and
  ground textures are not turned, so that this is computed once per texture; mip maps average it with the colours, and
  the mean light is the same at every distance. Who looks along the sun's light sees lit sides, who looks against it
  shadows; and what is high hides dark gaps. Near the camera this comes from rays that are followed through the relief.
  Far away their mean is used instead: factors on colour and on sunlight, fitted per material as polynomials of the
  view's cotangent and the cosine of its azimuth to the sun.
- Wet ground is darker, because a film of water reflects part of the light back onto the ground, which absorbs it
  (Angstrom, "The albedo of various surfaces of ground", 1925; Lekner and Dorf, Applied Optics 27, 1278, 1988).
- The colour of the ground varies over decimetres to metres: drier and greener patches, dust, trodden lanes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.classes import Label
from fieldtruth.kernels.baking import RELIEF_STEPS, fill_in_light, fill_terms, seen_means
from fieldtruth.kernels.light import MaterialTable
from fieldtruth.kernels.textures import LEVELS, SUN_ONE, TERMS, Atlas, Relief, linear_from_srgb, srgb_from_linear
from fieldtruth.sense.scene import grid_of
from fieldtruth.world.model import Heightfield, Terrain, World, node_axes
from fieldtruth.world.textures.canvas import halve

WATER: Final = 1.33
"""Refractive index of water."""
WET_GLOSS: Final = 0.35
"""Gloss of soaked ground, that of mud."""
LEAF_GLOW: Final = np.array([2.6, 2.8, 1.0])
"""Light through a leaf over light from it by channel, for a translucency of 1: it is yellower."""
CRUMBS: Final = 0.015
"""Height [m] below which a layer is grains and crumbs, which light shows. What is higher is blades and leaves: no solid
surface, so that photographs shade the ground as if it ended there."""
MEAN_OVER: Final = 0.1
"""Standard deviation [m] of the Gaussian that separates relief, whose pits are darker, from the ground's shape."""
_MOST: Final = 0.9
"""Of what falls on a leaf, the share that it reflects and transmits at most."""
_PATCH: Final = 0.8
"""Side of a patch of ground that shows one part of a tile, in repeats."""
_WHOLE: Final = ("", "paving")
"""Ground types, and what has none, whose tiles are not cut into patches."""
_FINER: Final = 2
"""Nodes of the grid of ground materials per node of the terrain's cover."""


def material_table(world: World, sun: Array | None = None, wetness: float = 0.0) -> MaterialTable:
    """Tables of a world's materials and ground.

    Args:
        world: the world.
        sun: unit vector (3,) towards the sun, which lights the relief of ground textures; None lights none.
        wetness: of the ground, 0 (dry) to 1 (soaked).
    """
    names, materials = list(world.materials), list(world.materials.values())
    atlas, terrain, textures = _atlas(world, sun, wetness), world.terrain, list(world.textures)
    texture = np.array([textures.index(m.texture) for m in materials], np.int32)
    tint = np.array([m.tint for m in materials], np.float32)
    rows = [names.index(n) for n in terrain.ground_materials]
    rgb, material = _ground(terrain, rows, atlas.mean[texture] * tint)
    rgb = rgb if terrain.colour is None else terrain.colour
    trail, border = (names.index(name) for name in terrain.trail_materials) if terrain.trail_material else (-1, -1)
    solid, wear = solid_surface(terrain), ground_wear(terrain, rgb, world.seed)
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
        trail=trail,
        border=border,
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
    smooth = replace(field, heights=gaussian_filter(field.heights, MEAN_OVER / field.spacing, mode="nearest"))
    return smooth.height_at(*np.meshgrid(*node_axes(terrain.cover), indexing="ij"))[..., None]


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


def make_atlas(textures: Sequence[NDArray[np.uint8]], sun: Mapping[int, Float32Array] | None = None) -> Atlas:
    """Pack square textures with mip maps averaged in linear light.

    Args:
        textures: each (n, n, 3) sRGB or (n, n, 4) with heights, n a power of two.
        sun: factors (n, n) on the sun's light by row of ``textures``; the others have 1.
    """
    levels, starts, sizes, end = list[tuple[NDArray[np.uint32], NDArray[np.uint8]]](), [], [], 0
    for row, texture in enumerate(textures):
        start, size = [], []
        for codes, height in _mip_maps(texture, (sun or {}).get(row)):
            levels.append((codes.ravel(), height.ravel()))
            start.append(end)
            size.append(len(codes))
            end += codes.size
        starts.append(start + start[-1:] * (LEVELS - len(start)))
        sizes.append(size + size[-1:] * (LEVELS - len(size)))
    return Atlas(
        texels=np.concatenate([codes for codes, _ in levels]),
        height=np.concatenate([height for _, height in levels]),
        start=np.array(starts, np.int64),
        size=np.array(sizes, np.int64),
        mean=np.array([_LINEAR[t[..., :3]].mean(axis=(0, 1), dtype=np.float64) for t in textures], np.float32),
        mean_height=np.array([t[..., 3].mean() / 255.0 if t.shape[2] > 3 else 0.0 for t in textures], np.float32),
        linear=_LINEAR,
    )


_LINEAR: Final[Float32Array] = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
_CODE_OF: Final = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint32)


def _mip_maps(
    texture: NDArray[np.uint8], sun: Float32Array | None
) -> Iterator[tuple[NDArray[np.uint32], NDArray[np.uint8]]]:
    """Packed texels and heights of each level."""
    colour = _LINEAR[texture[..., :3]]
    height = texture[..., 3].astype(np.float32) if texture.shape[2] > 3 else np.zeros(texture.shape[:2], np.float32)
    lit = None if sun is None else _grey(colour) * sun
    for _ in range(LEVELS):
        code = _CODE_OF[np.rint(colour * np.float32(65535.0)).astype(np.uint16)]
        factor = np.float32(1.0) if lit is None else lit / np.maximum(_grey(colour), np.float32(1e-6))
        share = np.rint(np.clip(factor * SUN_ONE, 0, 255)).astype(np.uint32)
        yield code[..., 0] | code[..., 1] << 8 | code[..., 2] << 16 | share << 24, np.rint(height).astype(np.uint8)
        if len(colour) == 1:
            return
        colour, height = halve(colour), halve(height)
        lit = None if lit is None else halve(lit)


def _grey(colour: Float32Array) -> Float32Array:
    """Mean of the channels; NumPy's ``mean`` over so short an axis takes eight times as long."""
    return np.asarray((colour[..., 0] + colour[..., 1] + colour[..., 2]) / np.float32(3.0))


STEEPEST: Final = 1.0
"""Limit of the slope of shaded facets: heights that jump, as at a blade of grass, are no walls."""
MOST: Final = 3.0
"""Largest factor on the sun's light."""
THROUGH: Final = np.float32(0.35)
"""Share of the sun's light that reaches a texel in the shadow of others: through blades and by reflection."""
_SMOOTH: Final = 1.2
"""Standard deviation [texel] of the Gaussian that heights are smoothed with before their slope is taken."""
_DESCENTS: Final = (0.08, 0.16, 0.3, 0.5, 0.8)
_AZIMUTHS: Final = 8
_POINTS: Final = 1500


def sun_factors(texture: NDArray[np.uint8], relief: float, repeat: float, sun: Array) -> Float32Array:
    """Sunlight on each texel over that on level ground, (n, n); its mean, weighted by the colour, is 1.

    The albedo of a texture is measured with the shadows that it has, so that relief must not darken it.

    Args:
        texture: (n, n, 4) sRGB and heights; u, world x, along axis 1; v, world y, up axis 0.
        relief: height [m] of code 255 above code 0.
        repeat: side [m] of the texture.
        sun: unit vector (3,) towards the sun.
    """
    n = len(texture)
    texel = repeat / n
    height = texture[..., 3].astype(np.float32) * np.float32(relief / 255.0 / texel)  # in texels
    smooth = gaussian_filter(height, _SMOOTH, mode="wrap")
    along_u = (np.roll(smooth, -1, 1) - np.roll(smooth, 1, 1)) * 0.5
    along_v = (np.roll(smooth, 1, 0) - np.roll(smooth, -1, 0)) * 0.5
    limit = 1.0 / (1.0 + np.hypot(along_u, along_v) / STEEPEST)
    along_u, along_v = along_u * limit, along_v * limit
    facing = (sun[2] - along_u * sun[0] - along_v * sun[1]) / np.sqrt(1.0 + along_u**2 + along_v**2)
    seen = np.empty_like(height)
    across = float(np.hypot(sun[0], sun[1]))
    if across > 1e-6:
        reach = relief / texel * across / max(float(sun[2]), 0.05)
        towards = np.array([sun[0], -sun[1], sun[2]], np.float32) / np.float32(across)
        fill_in_light(height, float(height.max()), towards, reach / RELIEF_STEPS, seen)
    else:
        seen[:] = 1.0
    factor = np.maximum(facing, 0.0) * (THROUGH + (1 - THROUGH) * seen)
    weight = texture[..., :3].mean(axis=-1)
    for _ in range(3):  # a factor that is cut lowers the mean
        factor = np.minimum(factor * (weight.mean() / max(float((weight * factor).mean()), 1e-9)), MOST)
    return np.asarray(factor, np.float32)


def view_factors(atlas: Atlas, texture: int, relief: Relief, sun: Array) -> Float32Array:
    """Coefficients (2, TERMS) of the factors less 1 on colour and on sunlight of ground that is far away."""
    rng = np.random.default_rng(5)
    points = rng.uniform(0.0, 1.0 / float(relief.per_metre), (_POINTS, 2)).astype(np.float32)
    angle = 2.0 * np.pi * np.arange(_AZIMUTHS) / _AZIMUTHS
    views = np.array(
        [(np.sqrt(1 - d * d) * np.cos(a), np.sqrt(1 - d * d) * np.sin(a), d) for d in _DESCENTS for a in angle]
    )
    views = np.concatenate([[[0.0, 0.0, 1.0]], views]).astype(np.float32)
    means, terms = np.empty((len(views), 2), np.float32), np.empty((len(views), TERMS), np.float32)
    seen_means(atlas, texture, relief, points, views, means)
    across = sun[:2] / max(float(np.hypot(sun[0], sun[1])), 1e-9)
    fill_terms(views, np.float32(across[0]), np.float32(across[1]), terms)
    colour = means[:, 0] / means[0, 0]
    light = means[:, 1] / means[:, 0] / (means[0, 1] / means[0, 0])
    fitted = np.linalg.lstsq(terms[1:], np.stack([colour, light], axis=-1)[1:] - 1.0, rcond=None)[0]
    return np.asarray(fitted.T, np.float32)


def mean_reflectance(n: float) -> float:
    """Share of isotropic light from a thin medium that the surface of one ``n`` times as dense reflects.

    It is the mean of Fresnel's equations over directions and polarisations (Duntley 1942; 0.066 for water).
    """
    m, k = n * n, n**4 - 1
    return float(
        0.5
        + (n - 1) * (3 * n + 1) / (6 * (n + 1) ** 2)
        + m * (m - 1) ** 2 / (m + 1) ** 3 * np.log((n - 1) / (n + 1))
        - 2 * n**3 * (m + 2 * n - 1) / ((m + 1) * k)
        + 8 * m * m * (m * m + 1) / ((m + 1) * k**2) * np.log(n)
    )


def wet_albedo(albedo: NDArray[np.floating], wetness: float) -> Array:
    """Albedo of ground that is ``wetness``, 0 (dry) to 1 (below a film of water), wet.

    Of the light that the ground scatters up, the film returns the share p, again and again:
    A = (1 - R) (1 - p) a / (1 - p a), with p = 1 - (1 - R) / n^2 for isotropic light.
    """
    outside = mean_reflectance(WATER)
    returned = 1.0 - (1.0 - outside) / WATER**2
    dry = np.asarray(albedo, np.float64)
    wet = (1.0 - outside) * (1.0 - returned) * dry / (1.0 - returned * dry)
    return np.asarray(dry + wetness * (wet - dry))


def wet_texture(texture: NDArray[np.uint8], wetness: float) -> NDArray[np.uint8]:
    """A texture (n, n, 3 or 4) sRGB with the albedo of wet ground; heights stay."""
    table = np.rint(srgb_from_linear(wet_albedo(linear_from_srgb(np.arange(256) / 255.0), wetness)) * 255.0)
    return np.concatenate([table.astype(np.uint8)[texture[..., :3]], texture[..., 3:]], axis=-1)


SCALES: Final = ((0.25, 0.10), (0.6, 0.10), (2.0, 0.10), (8.0, 0.08))
"""Width [m] of patches and standard deviation of the logarithm of their brightness."""
DRYNESS: Final = (0.35, 0.0, 0.0)
"""Changes of red, green and blue with the dryness of green plants: a bleached patch is redder."""
LANES: Final = 0.10
"""By how much the middle of a trail is brighter than its edges, where litter lies."""


def ground_wear(terrain: Terrain, rgb: NDArray[np.floating], seed: int) -> Array:
    """Factors (nx, ny, 4) at the cover's nodes, about 1: on red, green and blue off trails, on brightness on trails.

    ``rgb`` (nx, ny, 3) is the colour of the ground there: what is green varies in dryness, the rest in brightness only.
    """
    rng = np.random.default_rng([seed, 11])
    shape, spacing = terrain.cover.values.shape[:2], terrain.cover.spacing
    fields = [[_field(rng, shape, width / spacing, sigma) for width, sigma in SCALES] for _ in range(2)]
    bright, dry = np.sum(fields, axis=1)
    green = np.clip(6.0 * (rgb[..., 1] / np.maximum(rgb.mean(axis=-1), 1e-6) - 1.05), 0.0, 1.0)
    colour = np.exp(bright[..., None] + (green * dry)[..., None] * np.array(DRYNESS))
    nodes = np.meshgrid(*node_axes(terrain.cover), indexing="ij")
    inside = np.clip(-terrain.trail_distance.at(*nodes) / 0.6, 0.0, 1.0)
    trail = np.exp(bright + dry * 0.5 + LANES * (inside - 0.5))
    return np.concatenate([colour, trail[..., None]], axis=-1)


def _field(rng: np.random.Generator, shape: tuple[int, ...], width: float, sigma: float) -> Array:
    """Normal numbers of deviation ``sigma`` that vary over ``width`` [node]; 0 if that is less than a node."""
    white = rng.standard_normal(shape, dtype=np.float32)
    if width < 0.5:
        return np.zeros(shape)
    gain = max(np.sqrt(np.pi) * width, 1.0)  # a Gaussian of deviation s divides that of white noise by 2 sqrt(pi) s
    return np.asarray(sigma * gain * gaussian_filter(white, width / 2, mode="wrap"))
