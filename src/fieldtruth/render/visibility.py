# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Visibility: the share of directions that are unobstructed at a point."""

from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense import embree
from fieldtruth.sense.packets import Packet, new_packet, set_shadow_ray

SHADOW_RANGE: Final = 80.0  # [m]; occluders farther away cast no shadow

_LANES = embree.LANES
_FAR = embree.TFAR
_occluded: Any = embree.occluded


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
    _visibility(scene, new_packet(coherent=True), points, normals, directions, near, reach, result)
    return result


@inlined
def _weight(n: Float32Array, dx: float, dy: float, dz: float) -> float:
    if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
        return 1.0
    return n[0] * dx + n[1] * dy + n[2] * dz  # type: ignore[no-any-return]


@kernel(allocates=True)
def _visibility(
    scene: np.uint64,
    packet: Packet,
    points: Float32Array,
    normals: Float32Array,
    directions: Array,
    near: float,
    reach: float,
    result: Float32Array,
) -> None:
    """Trace packets of neighbouring points in one direction at a time, which keeps the rays parallel."""
    free, total = np.zeros(_LANES, np.float32), np.zeros(_LANES, np.float32)
    for first in range(0, len(points), _LANES):
        free[:], total[:] = 0.0, 0.0
        for k in range(len(directions)):
            dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
            for lane in range(_LANES):
                packet.valid[lane] = 0
                row = first + lane
                if row >= len(points):
                    continue
                weight = _weight(normals[row], dx, dy, dz)
                if weight <= 0.0:
                    continue
                p = points[row]
                set_shadow_ray(packet, lane, (p[0], p[1], p[2]), (dx, dy, dz), near, reach)
                total[lane] += weight
                free[lane] += weight
            _occluded(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                if packet.valid[lane] != 0 and packet.ray[_FAR + lane] < 0.0:
                    free[lane] -= _weight(normals[first + lane], dx, dy, dz)
        for lane in range(min(_LANES, len(points) - first)):
            result[first + lane] = max(free[lane] / total[lane], 0.0) if total[lane] > 0.0 else 0.5
