# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light on the heights of a texture: which texels face the sun, and which lie in the shadow of others.

The sun stands still and ground textures are not turned, so that this is computed once per texture. Mip maps then
average it with the colours, and the mean light is the same at every distance.

Who looks along the sun's light sees lit sides, who looks against it shadows; and tops hide dark gaps. Near the camera
this comes from rays that are followed through the relief. Far away their mean is used instead: factors on colour and on
sunlight, fitted per material as polynomials of the view's cotangent and the cosine of its azimuth to the sun.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.baking import RELIEF_STEPS, fill_in_light, fill_terms, seen_means
from fieldtruth.kernels.textures import TERMS, Atlas, Relief

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
