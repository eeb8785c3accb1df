# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sun's disc in photographs, and its glitter on water."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.render.tables import EXPOSURE, LightTable
from fieldtruth.sense.ray_batch import RayBatch

RADIUS: Final = float(np.radians(0.266))
LIMB: Final = 0.6
"""Radiance falls by this share from the middle of the disc to its limb (linear law; Cox 2000, section 14.7)."""
DISC: Final = 1.0 / (np.pi * RADIUS**2 * (1.0 - LIMB / 3.0))
"""[1/sr] Radiance in the middle of the disc over the irradiance of a surface that faces it."""
GLITTER_WIDTH: Final = float(np.radians(1.6))
"""Standard deviation to which ripples that are smaller than a pixel spread the sun's reflection."""


@kernel
def add_disc(light: LightTable, exposure: np.float32, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Add the disc, whose centre has the radiance ``light.disc``, to rays that leave the world."""
    top, direction, disc = batch.top, batch.direction, light.disc
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    widest, one, scale = np.float32(RADIUS * RADIUS), np.float32(1.0), np.float32(EXPOSURE) * exposure
    if disc[0] <= np.float32(0.0):
        return
    for k in range(count):
        if top[k] >= 0:
            continue
        x, y, z = direction[0, k] - sx, direction[1, k] - sy, direction[2, k] - sz
        squared = x * x + y * y + z * z
        if squared < widest and direction[2, k] > np.float32(0.0):
            radiance = scale * (one - np.float32(LIMB) * (one - np.sqrt(one - squared / widest)))
            for channel in range(3):
                colour[k, channel] += radiance * disc[channel]


@kernel
def add_glitter(light: LightTable, exposure: np.float32, batch: RayBatch, count: int, colour: Float32Array) -> None:
    """Add the sun, as wide as ripples spread it, to reflected rays that leave the world."""
    top, direction, disc = batch.top, batch.direction, light.disc
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    variance, farthest = np.float32(GLITTER_WIDTH**2), np.float32((4.0 * GLITTER_WIDTH) ** 2)
    scale = np.float32(EXPOSURE / (2.0 * np.pi * GLITTER_WIDTH**2 * DISC)) * exposure
    for k in range(count):
        if top[k] >= 0:
            continue
        x, y, z = direction[0, k] - sx, direction[1, k] - sy, direction[2, k] - sz
        squared = x * x + y * y + z * z
        if squared < farthest:
            share = scale * np.exp(np.float32(-0.5) * squared / variance)
            for channel in range(3):
                colour[k, channel] += share * disc[channel]
