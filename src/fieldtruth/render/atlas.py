# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All textures and their mip maps in one array, sampled in linear light."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel

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


_LINEAR: Final[Float32Array] = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
_CODE_OF: Final = np.rint(srgb_from_linear(np.arange(65536) / 65535.0) * 255.0).astype(np.uint32)


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
        colour, height = _halved(colour), _halved(height)
        lit = None if lit is None else _halved(lit)


def _grey(colour: Float32Array) -> Float32Array:
    """Mean of the channels; NumPy's ``mean`` over so short an axis takes eight times as long."""
    return np.asarray((colour[..., 0] + colour[..., 1] + colour[..., 2]) / np.float32(3.0))


def _halved(image: Float32Array) -> Float32Array:
    rows = image[::2] + image[1::2]
    return np.asarray((rows[:, ::2] + rows[:, 1::2]) * np.float32(0.25))


@inlined
def _corners(
    atlas: Atlas, texture: int | np.uintp, u: np.float32, v: np.float32, level: int
) -> tuple[tuple[np.uint32, np.uint32, np.uint32, np.uint32], tuple[np.float32, np.float32, np.float32, np.float32]]:
    """The four texels of a level around (u, v), and their weights."""
    level = min(max(level, 0), LEVELS - 1)
    size, start = atlas.size[texture, level], np.uintp(atlas.start[texture, level])
    half, side, one = np.float32(0.5), np.float32(size), np.float32(1.0)
    x, y = u * side - half, -v * side - half
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    i, j, mask = int(left), int(top), size - 1
    i0, i1 = np.uintp(i & mask), np.uintp((i + 1) & mask)
    j0, j1 = start + np.uintp((j & mask) * size), start + np.uintp(((j + 1) & mask) * size)
    texels = atlas.texels
    weights = (one - fx) * (one - fy), fx * (one - fy), (one - fx) * fy, fx * fy
    return (texels[j0 + i0], texels[j0 + i1], texels[j1 + i0], texels[j1 + i1]), weights


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
