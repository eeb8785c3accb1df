# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Limits on the slope of a heightfield that vary over it, as along a route that a robot must drive.

The gradient is cut to the limit and integrated by Poisson's equation (as Fattal, Lischinski and Werman did with light,
SIGGRAPH 2002). "Is a gradient" and "is nowhere too steep" are both convex, so alternating projections (von Neumann)
converge to a surface that is both. A route across a steep flank becomes a ledge without edges, and the hill keeps its
shape on either side.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft

from fieldtruth.core.arrays import Array


def slope_limit(distance: Array, *, within: float, beyond: float, near: float, far: float) -> Array:
    """Maximum slope [rise over run] at ``distance`` [m] from a route.

    ``within`` [deg] up to ``near`` [m], ``beyond`` [deg] from ``far`` [m] on, smooth in between.
    """
    t = np.clip((distance - near) / (far - near), 0.0, 1.0)
    return np.asarray(np.tan(np.radians(within + (beyond - within) * t * t * (3.0 - 2.0 * t))))


def limit_slope(heights: Array, spacing: float, limit: ArrayLike, *, rounds: int = 40, tighter: float = 0.96) -> Array:
    """Heights (nx, ny) [m] whose slope nowhere exceeds ``limit`` [rise over run], a number or one per node.

    The mean height is kept. Each round cuts to ``tighter`` times the limit, so that a few rounds get below it.
    """
    h = np.array(heights, np.float64)
    aim = np.broadcast_to(np.asarray(limit, np.float64) * tighter, h.shape)
    nx, ny = h.shape
    waves = 2 * np.cos(np.pi * np.arange(nx) / nx)[:, None] + 2 * np.cos(np.pi * np.arange(ny) / ny) - 4
    waves[0, 0] = 1.0
    mean = h.mean()
    for _ in range(rounds):
        along, across = np.diff(h, axis=0) / spacing, np.diff(h, axis=1) / spacing
        share = np.minimum(1.0, aim / np.maximum(_steepness(along, across), 1e-9))
        if share.min() > tighter - 0.005:
            break
        along = along * np.minimum(share[1:], share[:-1]) * spacing
        across = across * np.minimum(share[:, 1:], share[:, :-1]) * spacing
        divergence = np.zeros_like(h)
        divergence[:-1] += along
        divergence[1:] -= along
        divergence[:, :-1] += across
        divergence[:, 1:] -= across
        spectrum = fft.dctn(divergence, type=2) / waves
        spectrum[0, 0] = 0.0
        h = fft.idctn(spectrum, type=2) + mean
    return h


def _steepness(along: Array, across: Array) -> Array:
    """Slope [rise over run] at each node (nx, ny), from the steepest cell sides along x and along y at the node."""
    a, b = np.abs(along), np.abs(across)
    a = np.maximum(np.pad(a, ((1, 0), (0, 0))), np.pad(a, ((0, 1), (0, 0))))
    b = np.maximum(np.pad(b, ((0, 0), (1, 0))), np.pad(b, ((0, 0), (0, 1))))
    return np.asarray(np.hypot(a, b))
