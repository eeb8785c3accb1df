# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Visibility: the share of directions that are unobstructed at a point."""

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.baking import fill_visibility
from fieldtruth.kernels.light import SHADOW_RANGE
from fieldtruth.kernels.packets import new_packet


def sun_disc(sun: Array, radius_deg: float, count: int) -> Array:
    """Directions (count, 3) spread evenly over a disc about the unit vector ``sun``."""
    k = np.arange(count) + 0.5
    radius, angle = np.radians(radius_deg) * np.sqrt(k / count), k * np.pi * (3.0 - np.sqrt(5.0))
    side = np.cross(sun, [0.0, 0.0, 1.0] if abs(sun[2]) < 0.99 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    rays = sun + np.outer(radius * np.cos(angle), side) + np.outer(radius * np.sin(angle), np.cross(sun, side))
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def hemisphere(count: int) -> Array:
    """Directions (count, 3) spread evenly over the upper half (spherical Fibonacci)."""
    k = np.arange(count) + 0.5
    z, angle = k / count, k * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def visibility(
    scene: np.uint64,
    points: Float32Array,
    normals: Float32Array | None,
    directions: Array,
    near: float,
    reach: float = SHADOW_RANGE,
) -> Float32Array:
    """Share (n,) of ``directions`` (k, 3) that are unobstructed at each point (n, 3).

    Directions are weighted by the cosine to the point's normal, or equally without ``normals`` or for a normal of
    length 0. Where no direction has a positive weight, the share is 0.5. Occluders within ``near`` and beyond ``reach``
    [m] are ignored.
    """
    result = np.empty(len(points), np.float32)
    normals = np.zeros_like(points) if normals is None else normals
    fill_visibility(scene, new_packet(coherent=True), points, normals, directions, near, reach, result)
    return result
