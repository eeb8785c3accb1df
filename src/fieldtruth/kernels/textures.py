# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Textures in kernels: texels in linear light, relief of the ground, and what age and weather do to surfaces.

- **Ground.** Near the camera the ray is followed through the heights of the texture (relief mapping: Policarpo,
  Oliveira and Comba, 2005), so that what stands up hides what is behind it. Where a pixel is as large as the relief,
  it is flat, and the long side of a pixel's footprint is averaged over a few samples (Feline: McCormack et al.,
  SIGGRAPH 1999).
- **Age.** Textures repeat; tilt of furrows, moss, crusts, soil and patches follow the position in the world, so that no
  two trunks and no two slopes are equal. Light and dark parts of a texture stand for its relief, as in Glencross et
  al., "A perceptually validated model for surface depth hallucination" (SIGGRAPH 2008): moss and soil fill what is
  deep, and bright crests catch the sun.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel

_Corners = tuple[np.uint32, np.uint32, np.uint32, np.uint32]
LEVELS: Final = 11
SUN_ONE: Final = 85
"""Code of the share of the sun's light of level ground in a texel's highest byte; 255 is three times as much."""


class Atlas(NamedTuple):
    """Texels of every texture at every level, packed as 0xSSBBGGRR, and where each level starts.

    BBGGRR is sRGB. SS is the factor on the sun's light, see ``SUN_ONE``: it averages with the colour as its weight, so
    that a distant surface is as bright as the mean of a near one.
    """

    texels: NDArray[np.uint32]
    height: NDArray[np.uint8]  # of each texel, 0 to 255 over the relief of its material; 0 for flat textures
    start: NDArray[np.int64]  # (textures, LEVELS)
    size: NDArray[np.int64]  # (textures, LEVELS) [texel]
    mean: Float32Array  # (textures, 3) linear
    mean_height: Float32Array  # (textures,) 0 to 1
    linear: Float32Array  # (256,) linear value of an sRGB byte


def linear_from_srgb(value: NDArray[np.floating]) -> Array:
    """Linear light of sRGB values in [0, 1] (IEC 61966-2-1)."""
    v = np.asarray(value, np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(value: NDArray[np.floating]) -> Array:
    """Inverse of ``linear_from_srgb``, for values in [0, 1]."""
    v = np.clip(np.asarray(value, np.float64), 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


@inlined
def _around(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[_Corners, np.float32, np.float32, np.float32]:
    """The four texels of a level around (u, v), the position between them, and how many make a repeat."""
    level = min(max(level, 0), LEVELS - 1)
    size, start = atlas.size[texture, level], np.uintp(atlas.start[texture, level])
    half, side = np.float32(0.5), np.float32(size)
    x, y = u * side - half, -v * side - half
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    i, j, mask = int(left), int(top), size - 1
    i0, i1 = np.uintp(i & mask), np.uintp((i + 1) & mask)
    j0, j1 = start + np.uintp((j & mask) * size), start + np.uintp(((j + 1) & mask) * size)
    texels = atlas.texels
    return (texels[j0 + i0], texels[j0 + i1], texels[j1 + i0], texels[j1 + i1]), fx, fy, side


@inlined
def _corners(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[_Corners, tuple[np.float32, np.float32, np.float32, np.float32]]:
    """The four texels of a level around (u, v), and their weights."""
    (found, fx, fy, _), one = _around(atlas, texture, u, v, level), np.float32(1.0)
    return found, ((one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy)


@inlined
def _channel(
    table: Float32Array,
    texels: tuple[np.uint32, np.uint32, np.uint32, np.uint32],
    weights: tuple[np.float32, np.float32, np.float32, np.float32],
    shift: int,
) -> np.float32:
    t00, t01, t10, t11 = texels
    w00, w01, w10, w11 = weights
    return (  # type: ignore[no-any-return]
        table[t00 >> shift & 255] * w00 + table[t01 >> shift & 255] * w01 + table[t10 >> shift & 255] * w10
        + table[t11 >> shift & 255] * w11
    )  # fmt: skip


@kernel
def sample(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[np.float32, np.float32, np.float32]:
    """Linear colour at (u, v) in repeats, bilinear within one mip level; u is to the right, v up."""
    found, weights = _corners(atlas, texture, u, v, level)
    table = atlas.linear
    return (
        _channel(table, found, weights, 0),
        _channel(table, found, weights, 8),
        _channel(table, found, weights, 16),
    )


@kernel
def sample_lit(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Linear colour as `sample`, and the factor on the sun's light."""
    (t00, t01, t10, t11), weights = _corners(atlas, texture, u, v, level)
    w00, w01, w10, w11 = weights
    table = atlas.linear
    sun = (
        np.float32(t00 >> 24) * w00 + np.float32(t01 >> 24) * w01 + np.float32(t10 >> 24) * w10
        + np.float32(t11 >> 24) * w11
    ) * np.float32(1.0 / SUN_ONE)  # fmt: skip
    return (
        _channel(table, (t00, t01, t10, t11), weights, 0),
        _channel(table, (t00, t01, t10, t11), weights, 8),
        _channel(table, (t00, t01, t10, t11), weights, 16),
        sun,
    )


SAMPLES: Final = 2
"""Samples along the long side of a pixel's footprint, at most."""
NEAR: Final = np.float32(0.006)
"""Width [m] of a pixel from which relief fades; it has gone at twice as much."""
BLUR: Final = np.float32(1.2)
"""Width of the texels that are averaged over that of a pixel: with much less, fine blades flicker and sparkle."""
LONG_SIDE: Final = np.float32(0.75)
"""Part of the long side of a pixel's footprint that is averaged: what stands up is seen sharper than a plane."""
_FLATTEST: Final = np.float32(0.03)
STEEP: Final = np.float32(0.12)
"""Least descent of a ray through relief: tops hide what a lower one would reach."""
_STEPS_LEAST, _STEPS_MOST = 4, 7
_PER_CODE = np.float32(1.0 / 255.0)
Vector = tuple[np.float32, np.float32, np.float32]


class Relief(NamedTuple):
    """How a material's texture lies on the ground."""

    per_metre: np.float32  # repeats
    height: np.float32  # [m] of code 255 above code 0
    mean: np.float32  # height of the hit surface above code 0, 0 to 1
    patch: np.float32  # [m] side of the patches that show different parts of the tile; 0: none


class Texels(NamedTuple):
    """Samples along a line: the first of ``samples`` positions in repeats, steps, and the width [texel] of each."""

    u: np.float32
    v: np.float32
    du: np.float32
    dv: np.float32
    width: np.float32
    samples: int
    far: np.float32  # 0 where the ray was followed through the relief to 1 where it was not


@inlined
def _ramp(x: np.float32) -> np.float32:
    """Triangle wave of period 1 between -1 and 1."""
    return np.float32(4.0) * abs(x - np.floor(x) - np.float32(0.5)) - np.float32(1.0)  # type: ignore[no-any-return]


@inlined
def patch_offset(x: np.float32, y: np.float32, patch: np.float32) -> tuple[np.float32, np.float32]:
    """Shift (u, v) in repeats of the tile at world x, y [m]: constant in patches with wavy borders.

    Tiles are not turned: their relief is lit by a sun that stands still.
    """
    if patch <= np.float32(0.0):
        return np.float32(0.0), np.float32(0.0)
    per, wave, ripple = np.float32(1.0) / patch, np.float32(0.22), np.float32(0.04)
    a, b = x * per, y * per
    i = np.int64(np.floor(a + wave * _ramp(b * np.float32(0.9)) + ripple * _ramp(b * np.float32(7.3))))
    j = np.int64(np.floor(b + wave * _ramp(a * np.float32(1.1)) + ripple * _ramp(a * np.float32(6.1))))
    key = np.uint32(i * 374761393 + j * 668265263)
    key = np.uint32((key ^ (key >> np.uint32(13))) * np.uint32(1274126177))
    per_code = np.float32(1.0 / 65536.0)
    return np.float32(key & np.uint32(65535)) * per_code, np.float32(key >> np.uint32(16)) * per_code


@inlined
def _height(atlas: Atlas, start: np.uintp, size: int, u: np.float32, v: np.float32) -> np.float32:
    """Height 0 to 1 of the texel at u, v [repeat]."""
    side, mask = np.float32(size), size - 1
    column, row = int(np.floor(u * side)) & mask, int(np.floor(-v * side)) & mask
    return np.float32(atlas.height[start + np.uintp(row * size + column)]) * _PER_CODE


@inlined
def _met(
    atlas: Atlas, texture: np.uintp, u: np.float32, v: np.float32, across: tuple[np.float32, np.float32],
    mean: np.float32, width: np.float32,
) -> tuple[np.float32, np.float32]:  # fmt: skip
    """Where a ray that crosses the surface's mean at u, v meets the heights.

    It enters at their top and moves by ``across`` [repeat] down to the bottom; ``width`` [texel] of a pixel.
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    travel = max(abs(across[0]), abs(across[1])) * np.float32(atlas.size[texture, 0])  # [texel]
    steps = min(max(int(travel / (np.float32(1.5) * max(width, one))), _STEPS_LEAST), _STEPS_MOST)
    per_step = one / np.float32(steps)
    coarse = max(width, np.float32(0.7) * travel * per_step)
    level = min(max((int(np.float32(max(coarse, one)).view(np.int32)) >> 23) - 127, 0), LEVELS - 1)
    start, size = np.uintp(atlas.start[texture, level]), atlas.size[texture, level]
    du, dv = across[0] * per_step, across[1] * per_step
    u, v = u - across[0] * (one - mean), v - across[1] * (one - mean)
    before, ray = zero, one
    for _ in range(steps):
        u, v, ray = u + du, v + dv, ray - per_step
        below = _height(atlas, start, size, u, v) - ray
        if below >= zero:
            back = below / max(below + before, np.float32(1e-6))
            return u - du * back, v - dv * back
        before = -below
    return u, v


@inlined
def ground_texels(
    atlas: Atlas, texture: np.uintp, relief: Relief, x: np.float32, y: np.float32, view: Vector, side: np.float32
) -> Texels:
    """Texels of a pixel of width ``side`` [m] at world x, y [m].

    ``view`` is the ray's direction along x and y, and its descent towards the ground, all of unit length.
    """
    zero, one, half = np.float32(0.0), np.float32(1.0), np.float32(0.5)
    dx, dy, descent = view
    shift_u, shift_v = patch_offset(x, y, relief.patch)
    u, v = x * relief.per_metre + shift_u, y * relief.per_metre + shift_v
    per_texel = np.float32(atlas.size[texture, 0]) * relief.per_metre
    ratio = max(LONG_SIDE / max(descent, _FLATTEST), one)
    near = min(min(np.float32(2.0) - side / NEAR, relief.height / side * half - half), one)
    if near > zero:
        scale = near * relief.height * relief.per_metre / max(descent, STEEP)
        u, v = _met(atlas, texture, u, v, (dx * scale, dy * scale), relief.mean, side * per_texel)
        ratio = one + (ratio - one) * (one - near)
    count = min(max(int(ratio + half), 1), SAMPLES)
    length, share = side * ratio, one / np.float32(count)
    flat = relief.per_metre * length * share / np.sqrt(max(dx * dx + dy * dy, np.float32(1e-6)))
    du, dv = dx * flat, dy * flat
    middle = half * np.float32(count - 1)
    width = max(side, length * share) * per_texel * BLUR
    return Texels(u - du * middle, v - dv * middle, du, dv, width, count, one - max(near, zero))


@kernel
def patch_offsets(x: Float32Array, y: Float32Array, patch: np.float32, out: Float32Array) -> None:
    """`patch_offset` of positions (n,) into ``out`` (n, 2)."""
    for k in range(len(x)):
        out[k, 0], out[k, 1] = patch_offset(x[k], y[k], patch)


TERMS: Final = 5


@inlined
def view_terms(
    dx: np.float32, dy: np.float32, descent: np.float32, sun_x: np.float32, sun_y: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32, np.float32]:
    """Terms of the polynomials; all are 0 straight from above. The sun's azimuth is a unit vector, or 0."""
    across = np.sqrt(max(dx * dx + dy * dy, np.float32(1e-8)))
    cotangent = across / max(descent, STEEP)
    towards = (dx * sun_x + dy * sun_y) / across
    square = cotangent * cotangent
    return cotangent, cotangent * towards, cotangent * towards * towards, square, square * towards


Colour = tuple[np.float32, np.float32, np.float32]
FURROWS, WEATHERING, PATCHES = range(3)
"""Columns of ``MaterialTable.age``: those fields of a material."""
STEEPEST: Final = np.float32(1.2)
"""Greatest slope of a texture's relief; steeper flanks would be hidden by crests."""
_MOSS: Final = np.array([0.056, 0.066, 0.022], np.float32)
_CRUST: Final = np.array([0.21, 0.215, 0.17], np.float32)  # of green-grey lichens
_SOIL: Final = np.array([0.098, 0.078, 0.058], np.float32)
_PER_MOSS, _PER_CRUST = np.float32(1.0 / 0.3), np.float32(1.0 / 0.07)
"""Per wavelength [m] of moss and of crusts."""
_SPLASH, _DAMP = np.float32(0.16), np.float32(0.7)
"""Height [m] above the ground to which rain throws soil, and to which a trunk stays damp."""
_CORK: Final = np.array([0.06, 0.053, 0.046], np.float32)
_CORK_HEIGHT: Final = np.float32(2.0)
"""Height [m] over which the dark, cracked bark at the foot of birches falls to 1/e, in the mean of trunks."""
_STEEP: Final = np.float32(0.8)  # cosine of the slope above which land shows its other texture
_PER_LEDGE, _PER_STREAK = np.float32(1.0 / 47.0), np.float32(1.0 / 13.0)
_LAND: Final = np.array([23.0, 71.0, 260.0], np.float32)
"""Wavelengths [m] of patches of land."""


@inlined
def _hashed(i: int, j: int, k: int) -> np.float32:
    """A number in [0, 1) of a node."""
    key = np.uint32(np.uint32(i) * np.uint32(73856093) ^ np.uint32(j) * np.uint32(19349663))
    key = np.uint32((key ^ np.uint32(k) * np.uint32(83492791)) * np.uint32(2654435761))
    key = np.uint32((key ^ (key >> np.uint32(15))) * np.uint32(2246822519))
    return np.float32(key >> np.uint32(8)) * np.float32(1.0 / 16777216.0)


@inlined
def _ease(t: np.float32) -> np.float32:
    return t * t * (np.float32(3.0) - np.float32(2.0) * t)


@inlined
def solid_value(x: np.float32, y: np.float32, z: np.float32) -> np.float32:
    """Value noise in [0, 1) with nodes one unit apart (Perlin, SIGGRAPH 1985)."""
    fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
    i, j, k = int(fx), int(fy), int(fz)
    u, v, w = _ease(x - fx), _ease(y - fy), _ease(z - fz)
    a, b = _hashed(i, j, k), _hashed(i + 1, j, k)
    c, d = _hashed(i, j + 1, k), _hashed(i + 1, j + 1, k)
    e, f = _hashed(i, j, k + 1), _hashed(i + 1, j, k + 1)
    g, h = _hashed(i, j + 1, k + 1), _hashed(i + 1, j + 1, k + 1)
    low = a + (b - a) * u + ((c + (d - c) * u) - (a + (b - a) * u)) * v
    high = e + (f - e) * u + ((g + (h - g) * u) - (e + (f - e) * u)) * v
    return low + (high - low) * w


@inlined
def flat_value(x: np.float32, y: np.float32) -> np.float32:
    """As `solid_value`, over a plane."""
    fx, fy = np.floor(x), np.floor(y)
    i, j = int(fx), int(fy)
    u, v = _ease(x - fx), _ease(y - fy)
    a, b, c, d = _hashed(i, j, 0), _hashed(i + 1, j, 0), _hashed(i, j + 1, 0), _hashed(i + 1, j + 1, 0)
    low, high = a + (b - a) * u, c + (d - c) * u
    return low + (high - low) * v


@inlined
def texture_slope(
    atlas: Atlas, texture: np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[np.float32, np.float32]:
    """Rise of a texture's brightness (sRGB green, 0 to 1) per repeat along u and v, between texels about a point."""
    (t00, t01, t10, t11), fx, fy, side = _around(atlas, texture, u, v, level)
    a, b = np.float32(t00 >> 8 & 255), np.float32(t01 >> 8 & 255)
    c, d = np.float32(t10 >> 8 & 255), np.float32(t11 >> 8 & 255)
    scale = side * np.float32(1.0 / 255.0)
    return ((b - a) + ((d - c) - (b - a)) * fy) * scale, -((c - a) + ((d - b) - (c - a)) * fx) * scale


@inlined
def tilted(n: Vector, along_u: np.float32, along_v: np.float32) -> Vector:
    """Unit normal of a relief with slopes along u and v, on a surface with unit normal ``n``.

    v runs up the surface, as on trunks and the sides of rocks; on level surfaces it runs along y.
    """
    one, zero = np.float32(1.0), np.float32(0.0)
    nx, ny, nz = n
    level = abs(nz) > np.float32(0.98)
    gx, gy, gz = zero, one if level else zero, zero if level else one
    dot = gx * nx + gy * ny + gz * nz
    vx, vy, vz = gx - dot * nx, gy - dot * ny, gz - dot * nz
    scale = one / np.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx * scale, vy * scale, vz * scale
    ux, uy, uz = vy * nz - vz * ny, vz * nx - vx * nz, vx * ny - vy * nx
    su, sv = min(max(along_u, -STEEPEST), STEEPEST), min(max(along_v, -STEEPEST), STEEPEST)
    tx, ty, tz = nx - su * ux - sv * vx, ny - su * uy - sv * vy, nz - su * uz - sv * vz
    scale = one / np.sqrt(tx * tx + ty * ty + tz * tz)
    return tx * scale, ty * scale, tz * scale


@inlined
def overgrown(
    colour: Colour, bright: np.float32, point: Vector, normal: Vector, above: np.float32, own: np.float32,
    amount: np.float32,
) -> Colour:  # fmt: skip
    """Albedo of wood or rock with crusts, moss and soil, ``amount`` 0 to 1.

    ``bright`` is the texture's brightness over its mean, ``above`` the height [m] over the object's base, ``own`` a
    number in [0, 1) of the object. Moss grows on the north side and on top, where it is damp near the ground (x is
    north, z up).
    """
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    x, y, z = point
    broad = solid_value(x * _PER_MOSS, y * _PER_MOSS, z * _PER_MOSS * half)
    fine = solid_value(x * _PER_CRUST, y * _PER_CRUST, z * _PER_CRUST)
    deep = min(max(one - bright, -one), one)
    foot = np.exp(-max(above, zero) / _DAMP)
    north = half * normal[0] + np.float32(0.35) * max(normal[2], zero)
    moss = np.float32(1.5) * broad + np.float32(0.5) * fine + np.float32(0.55) * north + np.float32(0.8) * own
    moss += np.float32(0.75) * foot + np.float32(0.3) * deep - np.float32(1.85)
    moss = amount * min(max(np.float32(1.6) * moss, zero), np.float32(0.85))
    crust = np.float32(1.2) * fine + np.float32(0.7) * (one - broad) - np.float32(0.3) * deep - np.float32(1.0)
    crust = amount * min(max(np.float32(1.8) * crust, zero), np.float32(0.38)) * (one - foot)
    soil = np.exp(-max(above, zero) / (_SPLASH * (half + broad + fine)))
    soil = amount * min(max(soil * (np.float32(0.75) + np.float32(0.5) * deep), zero), np.float32(0.9))
    shade = one + amount * (
        np.float32(0.5) * (broad - half) + np.float32(0.2) * (fine - half) - np.float32(0.25) * foot
    )
    light = np.float32(0.55) + np.float32(0.45) * min(bright, np.float32(1.6))
    # The foot of a pale trunk has dark, rough bark.
    pale = min(max(np.float32(5.0) * colour[1] - one, zero), one)
    rough = min(max(np.float32(2.2) * foot + broad + half * fine - np.float32(1.9), zero), np.float32(0.75))
    shade = shade * (one - amount * pale * rough)
    keep = (one - moss) * (one - crust) * (one - soil) * shade
    crusted, mossed = crust * (one - moss) * (one - soil), moss * (one - soil)
    red = colour[0] * keep + light * (_CRUST[0] * crusted + _MOSS[0] * mossed + _SOIL[0] * soil)
    green = colour[1] * keep + light * (_CRUST[1] * crusted + _MOSS[1] * mossed + _SOIL[1] * soil)
    blue = colour[2] * keep + light * (_CRUST[2] * crusted + _MOSS[2] * mossed + _SOIL[2] * soil)
    return red, green, blue


@inlined
def corked(colour: Colour, point: Vector, above: np.float32, own: np.float32) -> Colour:
    """Albedo of bark that is pale: dark and cracked at the foot; ``above`` and ``own`` are as in ``overgrown``."""
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    pale = min(max(np.float32(5.0) * colour[1] - one, zero), one)
    x, y, z = point
    broad = solid_value(x * _PER_MOSS, y * _PER_MOSS, z * _PER_MOSS * half)
    fine = solid_value(x * _PER_CRUST, y * _PER_CRUST, z * _PER_CRUST * half)
    foot = np.exp(-max(above, zero) / (_CORK_HEIGHT * (half + own)))
    share = np.float32(2.5) * foot + np.float32(1.2) * broad + half * fine - np.float32(1.9)
    share = pale * min(max(share, zero), np.float32(0.85))
    return (
        colour[0] + share * (_CORK[0] - colour[0]),
        colour[1] + share * (_CORK[1] - colour[1]),
        colour[2] + share * (_CORK[2] - colour[2]),
    )


@inlined
def patchy(colour: Colour, x: np.float32, y: np.float32, amount: np.float32) -> Colour:
    """Albedo of land with broad patches, brighter and browner or darker and greener by about ``amount`` (relative)."""
    half, one = np.float32(0.5), np.float32(1.0)
    a = flat_value(x / _LAND[0], y / _LAND[0]) - half
    b = flat_value(x / _LAND[1] + np.float32(7.3), y / _LAND[1]) - half
    c = flat_value(x / _LAND[2], y / _LAND[2] + np.float32(3.1)) - half
    tone = amount * (np.float32(1.1) * a + np.float32(1.3) * b + np.float32(1.4) * c)
    hue = np.float32(0.35) * amount * (a - b + c)
    bright = max(one + tone, np.float32(0.3))
    return colour[0] * bright * (one + hue), colour[1] * bright, colour[2] * bright * (one - half * hue)


@inlined
def mip_level(texels: np.float32, dither: np.float32) -> int:
    """Mip level whose texels are as large as a pixel's footprint, which has a side of ``texels`` at the finest level.

    It is the integer part of log2(texels) + dither, to hide seams between levels: the exponent of a floating-point
    number; log2(1 + dither) is close enough to dither.
    """
    bits = np.float32(texels * (np.float32(1.0) + dither)).view(np.int32)
    return max((int(bits) >> 23) - 127, 0)


@inlined
def dither(u: np.float32, v: np.float32) -> np.float32:
    """Fixed pattern in [0, 1) over the image (interleaved gradient noise, Jimenez 2014)."""
    inner = np.float32(0.06711056) * u + np.float32(0.00583715) * v
    value = np.float32(52.9829189) * (inner - np.floor(inner))
    return value - np.floor(value)  # type: ignore[no-any-return]


@inlined
def is_steep(x: np.float32, y: np.float32, up: np.float32) -> np.bool_:
    """Return whether land at x, y [m] with the normal's z ``up`` has the texture of steep land, with ragged borders."""
    half = np.float32(0.5)
    ragged = flat_value(x * _PER_LEDGE, y * _PER_LEDGE) + flat_value(x * _PER_STREAK, y * _PER_STREAK) * half
    return up + np.float32(0.16) * (ragged - np.float32(0.75)) < _STEEP
