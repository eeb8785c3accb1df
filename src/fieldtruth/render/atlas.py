# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All textures and their mip maps in one array, sampled in linear light."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.sense.kernel import light_kernel

LEVELS: Final = 10


class Atlas(NamedTuple):
    """Texels of every texture at every level, packed as 0xBBGGRR of sRGB, and where each level starts."""

    texels: NDArray[np.uint32]
    start: NDArray[np.int64]  # (textures, LEVELS)
    size: NDArray[np.int64]  # (textures, LEVELS) [texel]
    mean: Float32Array  # (textures, 3) linear
    linear: Float32Array  # (256,) linear value of an sRGB byte


def linear_from_srgb(value: NDArray[np.floating]) -> Array:
    """Linear light of sRGB values in [0, 1] (IEC 61966-2-1)."""
    v = np.asarray(value, np.float64)
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(value: NDArray[np.floating]) -> Array:
    """Inverse of ``linear_from_srgb``, for values in [0, 1]."""
    v = np.clip(np.asarray(value, np.float64), 0.0, 1.0)
    return np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)


def make_atlas(textures: Sequence[NDArray[np.uint8]]) -> Atlas:
    """Pack square textures (n, n, 3) sRGB, n a power of two, with mip maps averaged in linear light."""
    linear = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
    code_of = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint32)
    texels, starts, sizes, means, end = [], [], [], [], 0
    for texture in textures:
        level = linear[texture]
        means.append(level.mean(axis=(0, 1), dtype=np.float64))
        start, size = [], []
        for _ in range(LEVELS):
            code = code_of[np.rint(level * np.float32(65535.0)).astype(np.uint16)]
            texels.append((code[..., 0] | code[..., 1] << 8 | code[..., 2] << 16).ravel())
            start.append(end)
            size.append(len(level))
            end += level.shape[0] * level.shape[1]
            if len(level) > 1:
                level = (level[::2, ::2] + level[1::2, ::2] + level[::2, 1::2] + level[1::2, 1::2]) * np.float32(0.25)
        starts.append(start)
        sizes.append(size)
    return Atlas(
        texels=np.concatenate(texels),
        start=np.array(starts, np.int64),
        size=np.array(sizes, np.int64),
        mean=np.array(means, np.float32),
        linear=linear,
    )


@light_kernel
def sample(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[float, float, float]:
    """Linear colour at (u, v) in repeats, bilinear within one mip level; u is to the right, v up."""
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
    t00, t01, t10, t11 = texels[j0 + i0], texels[j0 + i1], texels[j1 + i0], texels[j1 + i1]
    one = np.float32(1.0)
    w00, w01, w10, w11 = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    table = atlas.linear
    red = table[t00 & 255] * w00 + table[t01 & 255] * w01 + table[t10 & 255] * w10 + table[t11 & 255] * w11
    green = (
        table[t00 >> 8 & 255] * w00 + table[t01 >> 8 & 255] * w01 + table[t10 >> 8 & 255] * w10
        + table[t11 >> 8 & 255] * w11
    )  # fmt: skip
    blue = (
        table[t00 >> 16 & 255] * w00 + table[t01 >> 16 & 255] * w01 + table[t10 >> 16 & 255] * w10
        + table[t11 >> 16 & 255] * w11
    )  # fmt: skip
    return red, green, blue
