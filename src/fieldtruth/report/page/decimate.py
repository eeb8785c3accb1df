# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Min-max decimation of time series: few vertices, each an original reading, and no extreme is lost."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts

BUCKETS: Final = 1000
VERTICES: Final = 2 * BUCKETS
"""Maximum number of vertices per channel."""
CHANNELS: Final = 40
"""A page with more channels has fewer vertices of each."""

Stamps = NDArray[np.int64]


class Line(NamedTuple):
    """Vertices of one channel: ascending ``stamps_ns`` (n,) and ``values`` (n,)."""

    stamps_ns: Stamps
    values: Array


class Decimator:
    """Keeps the smallest and the largest reading of each channel in each of so many equal intervals of time.

    Memory does not grow with the number of readings. Readings that are not finite are skipped; those before
    ``start_ns`` or after ``end_ns`` belong to the first or last interval.
    """

    def __init__(self, channels: int, start_ns: int, end_ns: int, buckets: int = BUCKETS) -> None:
        self._start, self._span, self._buckets = start_ns, max(end_ns - start_ns, 1), buckets
        shape = channels, buckets
        self._low, self._low_ns = np.full(shape, np.inf), np.zeros(shape, np.int64)
        self._high, self._high_ns = np.full(shape, -np.inf), np.zeros(shape, np.int64)

    def add(self, stamps_ns: Stamps, values: Array) -> None:
        """Add readings (n, channels) with their stamps (n,)."""
        bucket = np.clip((stamps_ns - self._start) * self._buckets // self._span, 0, self._buckets - 1)
        for channel, column in enumerate(values.T):
            good = np.isfinite(column)
            order = np.lexsort((column[good], bucket[good]))
            buckets, readings, stamps = bucket[good][order], column[good][order], stamps_ns[good][order]
            edge = np.flatnonzero(np.diff(buckets))
            firsts, lasts = np.append(-1, edge) + 1, np.append(edge, len(buckets) - 1)
            if len(buckets):
                low, high = (self._low[channel], self._low_ns[channel]), (self._high[channel], self._high_ns[channel])
                _keep(*low, buckets[firsts], readings[firsts], stamps[firsts], np.less)
                _keep(*high, buckets[lasts], readings[lasts], stamps[lasts], np.greater)

    def lines(self) -> list[Line]:
        """Return the vertices of each channel in time order."""
        return [_line(*rows) for rows in zip(self._low, self._low_ns, self._high, self._high_ns, strict=True)]


def _keep(kept: Array, kept_ns: Stamps, buckets: Counts, readings: Array, stamps_ns: Stamps, better: np.ufunc) -> None:
    replaced = better(readings, kept[buckets])
    kept[buckets[replaced]], kept_ns[buckets[replaced]] = readings[replaced], stamps_ns[replaced]


def _line(low: Array, low_ns: Stamps, high: Array, high_ns: Stamps) -> Line:
    filled = np.isfinite(low)
    second = filled & ((low_ns != high_ns) | (low != high))  # a bucket with one reading has one vertex
    stamps = np.concatenate([low_ns[filled], high_ns[second]])
    order = np.argsort(stamps, kind="stable")
    return Line(stamps[order], np.concatenate([low[filled], high[second]])[order])
