# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What age and weather do to wood, rock and land: tilt of furrows and pits, moss, crusts, soil at the foot, patches.

Textures repeat; these follow the position in the world, so that no two trunks and no two slopes are equal. Light and
dark parts of a texture stand for its relief, as in Glencross et al., "A perceptually validated model for surface depth
hallucination" (SIGGRAPH 2008): moss and soil fill what is deep, and bright crests catch the sun.
"""

from typing import Final

import numpy as np

from fieldtruth.kernels.compile import inlined
from fieldtruth.render.atlas import LEVELS, Atlas

Colour = tuple[np.float32, np.float32, np.float32]
Vector = tuple[np.float32, np.float32, np.float32]

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
    a, b = np.float32(texels[j0 + i0] >> 8 & 255), np.float32(texels[j0 + i1] >> 8 & 255)
    c, d = np.float32(texels[j1 + i0] >> 8 & 255), np.float32(texels[j1 + i1] >> 8 & 255)
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
    number in [0, 1) of the object. Moss grows on the north side and on top, where it is damp near the ground (y is
    north, z up).
    """
    zero, half, one = np.float32(0.0), np.float32(0.5), np.float32(1.0)
    x, y, z = point
    broad = solid_value(x * _PER_MOSS, y * _PER_MOSS, z * _PER_MOSS * half)
    fine = solid_value(x * _PER_CRUST, y * _PER_CRUST, z * _PER_CRUST)
    deep = min(max(one - bright, -one), one)
    foot = np.exp(-max(above, zero) / _DAMP)
    north = half * normal[1] + np.float32(0.35) * max(normal[2], zero)
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
