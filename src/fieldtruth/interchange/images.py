# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Looks of materials in other tools: images for tools that have no colour factor, their encoding, roughness."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.core.png import encode_png
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear
from fieldtruth.world.model import Material, World

JPEG_QUALITY: Final = 90
"""Textures of 512 x 512 texels: 60 to 130 kB, a quarter of their PNG."""


def material_image(world: World, material: str) -> NDArray[np.uint8]:
    """Image (n, n, 3) sRGB of a material: its texture times its tint in linear light, at most white."""
    found = world.materials[material]
    return tinted(world.textures[found.texture], found.tint)


def tinted(texture: NDArray[np.uint8], tint: Sequence[float]) -> NDArray[np.uint8]:
    """Multiply the colours (n, n, 3) sRGB of an image by a linear tint (3,); the result is at most white."""
    linear = linear_from_srgb(np.arange(256) / 255.0)[:, None] * np.array(tint)
    table = np.rint(srgb_from_linear(linear) * 255.0).astype(np.uint8)
    return np.stack([table[texture[..., k], k] for k in range(3)], axis=-1)


def encode_image(image: NDArray[np.uint8], *, jpeg: bool = True) -> bytes:
    """Encode an image (h, w, 3) sRGB as JPEG, or as PNG."""
    if not jpeg:
        return encode_png(image)
    data: bytes = simplejpeg.encode_jpeg(np.ascontiguousarray(image), quality=JPEG_QUALITY, colorsubsampling="420")
    return data


def roughness(material: Material) -> float:
    """Roughness of a material, 0 (mirror) to 1 (matt), as glTF and USD define it."""
    return 0.05 if material.mirror > 0 else 1.0 - 0.7 * material.gloss
