# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pits and mounds that uprooted trees left: where the roots were, and beside it the soil that fell from them.

Sizes of old pairs whose trunk has rotted: mounds about 0.2 to 0.5 m high and 2 to 3 m long, pits about as deep, the
longer axis across the fall; the trees of one storm fell in one direction (Schaetzl, Burns, Small and Johnson 1990,
Physical Geography 11, quoted from memory).
"""

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array


def pits_and_mounds(x: Array, y: Array, positions: ArrayLike, rng: np.random.Generator) -> Array:
    """Heights [m] at the nodes of axes x, y [m] of pairs about ``positions`` (n, 2); as much soil is up as down.

    Draws the storm's direction, then for each pair its deviation from it, length and depth.
    """
    total, storm = np.zeros((len(x), len(y))), rng.uniform(0.0, 2.0 * np.pi)
    for px, py in np.asarray(positions, np.float64).reshape(-1, 2):
        fall, half, depth = storm + rng.normal(0.0, 0.5), rng.uniform(0.7, 1.3), rng.uniform(0.15, 0.45)
        i, j = (np.flatnonzero(np.abs(axis - at) < 5.0 * half) for axis, at in ((x, px), (y, py)))
        dx, dy = np.meshgrid(x[i] - px, y[j] - py, indexing="ij")
        along, across = np.cos(fall) * dx + np.sin(fall) * dy, np.cos(fall) * dy - np.sin(fall) * dx
        # The pair is a Gaussian's slope along the fall: its two halves have the same volume.
        width = 0.6 * half
        total[np.ix_(i, j)] += (
            depth * np.exp(0.5) * along / width * np.exp(-0.5 * ((along / width) ** 2 + (across / half) ** 2))
        )
    return total
