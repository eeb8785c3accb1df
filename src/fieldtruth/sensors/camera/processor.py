# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a camera's processor does to its values: colours by a matrix before the response curve, sharpening after it."""

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import kernel


@kernel
def mix_colours(light: Float32Array, gains: Float32Array, matrix: Float32Array, white: float) -> None:
    """Apply white balance (3,) and a colour matrix (3, 3) to light (h, w, 3).

    Light is clipped at white between them, so that what saturates the sensor is white and no other colour.
    """
    height, width, _ = light.shape
    top, zero = np.float32(white), np.float32(0.0)
    for v in range(height):
        for u in range(width):
            r = min(light[v, u, 0] * gains[0], top)
            g = min(light[v, u, 1] * gains[1], top)
            b = min(light[v, u, 2] * gains[2], top)
            for channel in range(3):
                value = matrix[channel, 0] * r + matrix[channel, 1] * g + matrix[channel, 2] * b
                light[v, u, channel] = max(value, zero)


@kernel
def sharpen(photo: NDArray[np.uint8], amount: float, spread: Float32Array, buffers: Float32Array) -> None:
    """Add to each channel of a photograph (h, w, 3) what its luminance differs from that blurred with ``spread``.

    This is an unsharp mask; edges get halos as wide as the blur. ``spread`` is half of a point spread, see
    ``lens_effects.point_spread``; ``buffers`` (2, h, w) is overwritten.
    """
    height, width, _ = photo.shape
    luminance, blurred = buffers[0], buffers[1]
    strength, half, zero, top = np.float32(amount), np.float32(0.5), np.float32(0.0), np.float32(255.0)
    for v in range(height):
        for u in range(width):
            r, g, b = np.float32(photo[v, u, 0]), np.float32(photo[v, u, 1]), np.float32(photo[v, u, 2])
            luminance[v, u] = np.float32(0.299) * r + np.float32(0.587) * g + np.float32(0.114) * b  # ITU-R BT.601
    for v in range(height):
        for u in range(width):
            total = spread[0] * luminance[v, u]
            for k in range(1, len(spread)):
                total += spread[k] * (luminance[v, max(u - k, 0)] + luminance[v, min(u + k, width - 1)])
            blurred[v, u] = total
    for v in range(height):
        for u in range(width):
            total = spread[0] * blurred[v, u]
            for k in range(1, len(spread)):
                total += spread[k] * (blurred[max(v - k, 0), u] + blurred[min(v + k, height - 1), u])
            more = strength * (luminance[v, u] - total) + half
            for channel in range(3):
                photo[v, u, channel] = np.uint8(min(max(np.float32(photo[v, u, channel]) + more, zero), top))
