# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light of a moving camera: rows that are read one after the other, and means over the time of exposure.

The camera has a pose of its own for each strip of STRIP rows, and for each of the sub-frames that are averaged.
"""

from functools import cache
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.photograph import STRIP

_ORDERS: Final = 200


def strips_of(height: int) -> int:
    """Number of strips of an image."""
    return -(-height // STRIP)


@cache
def offsets_of(count: int) -> Array:
    """Points (n, 2) [pixel] of a pixel around its centre: one in each row and column of n x n (Latin hypercube).

    They are in the order that least correlates with time: if they drifted over the exposure, the blur would change.
    """
    rng, time, best = np.random.default_rng(count), np.arange(count), np.zeros((3, count))
    least = np.inf
    for _ in range(_ORDERS if count > 1 else 0):
        found = np.stack([time, rng.permutation(count), rng.permutation(count)])
        drift = float(np.abs(np.corrcoef(found)[np.triu_indices(3, 1)]).sum())
        if drift < least:
            best, least = found, drift
    return np.ascontiguousarray(((best[1:] + 0.5) / count - 0.5).T)
