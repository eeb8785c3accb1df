# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes that rays of the second ray tracer meet."""

from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask

SKIN: Final = 0.001  # [m] by which boxes are larger
_PAIRS: Final = 200_000  # of rays and boxes at once


def meets(low: Array, high: Array, start: Array, ahead: Array, limit: Array) -> Mask:
    """Return whether rays up to their limits meet boxes."""
    near, far = np.zeros(()), limit
    for axis in range(3):
        along = ahead[..., axis]
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        first, second = (low[..., axis] - start[..., axis]) / along, (high[..., axis] - start[..., axis]) / along
        near, far = np.maximum(near, np.minimum(first, second)), np.minimum(far, np.maximum(first, second))
    return np.asarray(near <= far)


def near_all(low: Array, high: Array, start: Array, ahead: Array, limit: Array) -> Index:
    """Rows of boxes (n, 3) that meet the one box around all rays (..., 3): in a large world few boxes are near."""
    ends = np.stack([start, start + ahead * limit[..., None]]).reshape(-1, 3)
    return np.flatnonzero(((low <= ends.max(axis=0)) & (high >= ends.min(axis=0))).all(axis=1))


def blocks(count: int, each: int) -> list[slice]:
    """Slices of ``count`` items that hold at most 200,000 pairs of ``each``."""
    step = max(1, _PAIRS // max(1, each))
    return [slice(first, min(first + step, count)) for first in range(0, count, step)]
