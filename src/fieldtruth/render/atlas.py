# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All textures and their mip maps in one array, sampled in linear light."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.textures import LEVELS, SUN_ONE, Atlas, linear_from_srgb, srgb_from_linear

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
