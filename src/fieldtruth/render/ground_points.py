# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which texels a hit on the ground shows: tiles without visible repetition, relief near the camera, footprints.

Near the camera the ray is followed through the heights of the texture (relief mapping: Policarpo, Oliveira and Comba,
2005), so that what stands up hides what is behind it. Where a pixel is as large as the relief, it is flat, and the
long side of a pixel's footprint is averaged over a few samples (Feline: McCormack et al., SIGGRAPH 1999).
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.atlas import LEVELS, Atlas

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
    """What to sample: the first of ``samples`` positions in repeats, steps, and the width [texel] of each."""

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
