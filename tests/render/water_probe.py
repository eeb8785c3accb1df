# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays of tests that continue from water."""

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.camera_rays import RayBatch
from fieldtruth.kernels.water import SecondaryBatch, find_slopes, water_rays


def rays_on_water(
    hit: tuple[RayBatch, Float32Array],
    ripples: Float32Array,
    count: int,
    pixel: float,
    reflected: bool,
    second: SecondaryBatch,
) -> int:
    """Collect the rays of hits on water; returns their number."""
    find_slopes(hit, ripples, count, pixel, second)
    return water_rays(hit, count, reflected, second)
