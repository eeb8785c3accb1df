# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Random numbers by position: a draw depends on the scan's key, the ray and the draw alone, not on the order."""

import numpy as np

from fieldtruth.kernels.compile import inlined

DRAWS_PER_RAY = 16
_GAMMA, _FIRST, _SECOND = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _32, _LOW = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(32), np.uint64(0xFFFFFFFF)
_PER_RAY = np.uint64(DRAWS_PER_RAY)
_SCALE = 1.0 / 4294967296.0


@inlined
def _bits(key: np.uint64, ray: int, draw: int) -> np.uint64:
    """Bits of SplitMix64 seeded with ``key`` at a position of its sequence (Steele, Lea and Flood 2014, Fast
    splittable pseudorandom number generators).
    """
    bits = key + (np.uint64(ray) * _PER_RAY + np.uint64(draw + 1)) * _GAMMA
    bits = (bits ^ (bits >> _30)) * _FIRST
    bits = (bits ^ (bits >> _27)) * _SECOND
    return bits ^ (bits >> _31)


@inlined
def uniforms(key: np.uint64, ray: int, draw: int) -> tuple[float, float]:
    """Two independent numbers between 0 and 1, without the ends."""
    bits = _bits(key, ray, draw)
    return (np.float64(bits >> _32) + 0.5) * _SCALE, (np.float64(bits & _LOW) + 0.5) * _SCALE


@inlined
def normals(key: np.uint64, ray: int, draw: int) -> tuple[float, float]:
    """Two independent numbers of the standard normal distribution.

    Box and Muller's transform of two halves of 32 bits ends at 6.8.
    """
    bits = _bits(key, ray, draw)
    radius = np.sqrt(-2.0 * np.log((np.float64(bits >> _32) + 0.5) * _SCALE))
    angle = 2.0 * np.pi * (np.float64(bits & _LOW) * _SCALE)
    return radius * np.cos(angle), radius * np.sin(angle)
