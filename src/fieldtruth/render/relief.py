# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light on the heights of a texture: which texels face the sun, and which lie in the shadow of others.

The sun stands still and ground textures are not turned, so that this is computed once per texture. Mip maps then
average it with the colours, and the mean light is the same at every distance.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel

STEEPEST: Final = 1.0
"""Limit of the slope of shaded facets: heights that jump, as at a blade of grass, are no walls."""
MOST: Final = 3.0
"""Largest factor on the sun's light."""
THROUGH: Final = np.float32(0.35)
"""Share of the sun's light that reaches a texel in the shadow of others: through blades and by reflection."""
_SMOOTH: Final = 1.2
"""Standard deviation [texel] of the Gaussian that heights are smoothed with before their slope is taken."""
_STEPS: Final = 48


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
        _in_light(height, float(height.max()), towards, reach / _STEPS, seen)
    else:
        seen[:] = 1.0
    factor = np.maximum(facing, 0.0) * (THROUGH + (1 - THROUGH) * seen)
    weight = texture[..., :3].mean(axis=-1)
    for _ in range(3):  # a factor that is cut lowers the mean
        factor = np.minimum(factor * (weight.mean() / max(float((weight * factor).mean()), 1e-9)), MOST)
    return np.asarray(factor, np.float32)


@kernel
def _in_light(height: Float32Array, highest: float, step: Float32Array, least: float, seen: Float32Array) -> None:
    """Share of the sun that each texel sees, by steps of ``least`` texels or one; ``step`` is (column, row, rise)."""
    n = len(height)
    mask, one = n - 1, np.float32(1.0)
    size = max(one, np.float32(least))
    for i in range(n):
        for j in range(n):
            base, share = height[i, j], one
            for k in range(1, _STEPS + 1):
                run = size * np.float32(k)
                if base + run * step[2] >= highest:
                    break
                row, column = (
                    int(np.floor(i + run * step[1] + 0.5)) & mask,
                    int(np.floor(j + run * step[0] + 0.5)) & mask,
                )
                # The sun's disc and blurred edges: the shadow sets in over a quarter of a texel, more when far away.
                above = height[row, column] - base - run * step[2]
                if above > np.float32(0.0):
                    share = min(share, max(one - above / (np.float32(0.25) + np.float32(0.05) * run), np.float32(0.0)))
                    if share <= np.float32(0.0):
                        break
            seen[i, j] = share
