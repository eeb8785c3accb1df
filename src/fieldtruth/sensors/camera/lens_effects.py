# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a real lens does to light on its path to the sensor: vignetting, veiling glare, blur."""

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core import lenses
from fieldtruth.core.arrays import Float32Array
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


def add_glare(light: Float32Array, share: float) -> None:
    """Spread a share of the mean of light (..., 3) evenly over the image."""
    mean = light.reshape(-1, 3).mean(axis=0, dtype=np.float64)
    light *= np.float32(1.0 - share)
    light += np.asarray(share * mean, np.float32)
