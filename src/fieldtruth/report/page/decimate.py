# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Long series of readings as few vertices: what is kept are readings, and no extreme is lost."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]
I8 = NDArray[np.int64]

BUCKETS: Final = 1000
VERTICES: Final = 2 * BUCKETS
"""At most so many vertices remain of a channel."""


class Line(NamedTuple):
    """Vertices of one channel: rising ``stamps_ns`` (n,) and ``values`` (n,)."""

    stamps_ns: I8
    values: F8


class Thinner:
    """Keeps the smallest and the largest reading of each channel in each of 1000 equal spans of time.

    Memory does not grow with what is added. Readings that are no numbers are left out; those outside the time from
    ``start_ns`` to ``end_ns`` count to the first or last span.
    """

    def __init__(self, channels: int, start_ns: int, end_ns: int) -> None:
        self._start, self._span = start_ns, max(end_ns - start_ns, 1)
        empty = np.zeros((channels, BUCKETS), np.int64)
        self._low, self._low_ns = np.full((channels, BUCKETS), np.inf), empty
        self._high, self._high_ns = np.full((channels, BUCKETS), -np.inf), empty.copy()

    def add(self, stamps_ns: I8, values: F8) -> None:
        """Add readings (n, channels) with their stamps (n,)."""
        bucket = np.clip((stamps_ns - self._start) * BUCKETS // self._span, 0, BUCKETS - 1)
        for channel, column in enumerate(values.T):
            good = np.isfinite(column)
            order = np.lexsort((column[good], bucket[good]))
            spans, readings, stamps = bucket[good][order], column[good][order], stamps_ns[good][order]
            edge = np.flatnonzero(np.diff(spans))
            firsts, lasts = np.append(-1, edge) + 1, np.append(edge, len(spans) - 1)
            if len(spans):
                _keep(self._low[channel], self._low_ns[channel], spans[firsts], readings[firsts], stamps[firsts], 1.0)
                _keep(self._high[channel], self._high_ns[channel], spans[lasts], readings[lasts], stamps[lasts], -1.0)

    def lines(self) -> list[Line]:
        """Return each channel's vertices in time order."""
        return [_line(*rows) for rows in zip(self._low, self._low_ns, self._high, self._high_ns, strict=True)]


def _keep(kept: F8, kept_ns: I8, spans: I8, readings: F8, stamps_ns: I8, sign: float) -> None:
    """Put readings into their spans where they are beyond what is there: below with ``sign`` 1, above with -1."""
    beyond = sign * readings < sign * kept[spans]
    kept[spans[beyond]], kept_ns[spans[beyond]] = readings[beyond], stamps_ns[beyond]


def _line(low: F8, low_ns: I8, high: F8, high_ns: I8) -> Line:
    filled = np.isfinite(low)
    another = filled & ((low_ns != high_ns) | (low != high))  # a span with one reading has one vertex
    stamps = np.concatenate([low_ns[filled], high_ns[another]])
    order = np.argsort(stamps, kind="stable")
    return Line(stamps[order], np.concatenate([low[filled], high[another]])[order])
