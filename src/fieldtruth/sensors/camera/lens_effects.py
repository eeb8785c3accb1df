# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a real lens does to light on its path to the sensor: vignetting, veiling glare, blur."""

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core import lenses
from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.render.tonemap import SPILL
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.signal import CameraSignal


def illumination(config: CameraConfig, signal: CameraSignal, u: ArrayLike, v: ArrayLike) -> Float32Array:
    """Share of the light at image points [pixel] of any shape that vignetting leaves; 1 where the lens has no ray."""
    lens = config.projection
    share = np.ones(np.broadcast_shapes(np.shape(u), np.shape(v)))
    if signal.vignetting_power:
        cosine = np.nan_to_num(lenses.directions(lens, u, v)[..., 2], nan=1.0)
        share = share * np.clip(cosine, 0.0, 1.0) ** signal.vignetting_power
    if any(signal.vignetting_polynomial):
        a, b, c = signal.vignetting_polynomial
        corner = np.hypot(config.width / 2.0, config.height / 2.0)
        s = ((np.asarray(u) - lens.cx) ** 2 + (np.asarray(v) - lens.cy) ** 2) / corner**2
        share = share * np.clip(1.0 + s * (a + s * (b + s * c)), 0.0, None)
    return np.asarray(share, np.float32)


def point_spread(sigma_px: float) -> Float32Array:
    """Half of a normal point spread, from its middle on; its sum over both sides is 1."""
    reach = max(1, int(np.ceil(3.0 * sigma_px)))
    half = np.exp(-0.5 * (np.arange(reach + 1) / sigma_px) ** 2)
    return np.asarray(half / (2.0 * half.sum() - half[0]), np.float32)


@kernel
def spill(light: Float32Array, share: Float32Array, factor: float, out: Float32Array) -> None:
    """Fill ``out`` (h, w, 3) with light that spills into neighbours as an ideal camera's does.

    It is multiplied with ``factor`` and with the ``share`` (h, w) that vignetting leaves, which is empty for none.
    """
    height, width, _ = light.shape
    keep, part, exposed = np.float32(1.0 - 4.0 * SPILL), np.float32(SPILL), np.float32(factor)
    for v in range(height):
        up, down = max(v - 1, 0), min(v + 1, height - 1)
        for u in range(width):
            left, right = max(u - 1, 0), min(u + 1, width - 1)
            scale = exposed * share[v, u] if share.size else exposed
            for channel in range(3):
                near = (
                    light[up, u, channel] + light[down, u, channel]
                    + light[v, left, channel] + light[v, right, channel]
                )  # fmt: skip
                out[v, u, channel] = (keep * light[v, u, channel] + part * near) * scale


@kernel
def blur(light: Float32Array, spread: Float32Array, scratch: Float32Array) -> None:
    """Convolve light (h, w, n) with a point spread; beyond the border is the border's light."""
    height, width, channels = light.shape
    for v in range(height):
        for u in range(width):
            for channel in range(channels):
                total = spread[0] * light[v, u, channel]
                for k in range(1, len(spread)):
                    total += spread[k] * (light[v, max(u - k, 0), channel] + light[v, min(u + k, width - 1), channel])
                scratch[v, u, channel] = total
    for v in range(height):
        for u in range(width):
            for channel in range(channels):
                light[v, u, channel] = spread[0] * scratch[v, u, channel]
        for k in range(1, len(spread)):
            up, down = max(v - k, 0), min(v + k, height - 1)
            for u in range(width):
                for channel in range(channels):
                    light[v, u, channel] += spread[k] * (scratch[up, u, channel] + scratch[down, u, channel])


def add_glare(light: Float32Array, share: float) -> None:
    """Spread a share of the mean of light (..., 3) evenly over the image."""
    mean = light.reshape(-1, 3).mean(axis=0, dtype=np.float64)
    light *= np.float32(1.0 - share)
    light += np.asarray(share * mean, np.float32)
