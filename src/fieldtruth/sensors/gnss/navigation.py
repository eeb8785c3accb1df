# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The filter with which a receiver follows its solutions, and the exact covariance of what it puts out.

A receiver knows its velocity from Doppler shifts to centimetres a second, so that the true motion passes the filter and
the errors of the solutions are averaged: f_k = b f_(k-1) + (1 - b) G_k e_k. The errors e of the ranges are sums of
Gauss-Markov processes, and the covariance of f with each of them obeys a recursion of its own, so that correlation in
time is accounted for.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array

ENU: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""East, north, up from north, west, up."""


class RangeErrors(NamedTuple):
    """Errors of ranges at a time: independent Gauss-Markov series (n,) of unit variance, and their sigma (n,) [m]."""

    series: Array
    sigma: Array
    kept: float
    """Correlation from one time to the next; 0 for white noise."""


class PositionFilter:
    """The filter of a receiver, which goes on from time to time."""

    def __init__(self) -> None:
        self._error, self._covariance = np.zeros(3), np.zeros((3, 3))
        self._shared: list[Array] | None = None  # covariance with each process; None without a position before

    def follow(self, gain: Array, errors: Sequence[RangeErrors], memory: float) -> tuple[Array, Array]:
        """Return the error (3,) of the position in the world frame [m], and its covariance (3, 3) in ENU [m^2].

        Args:
            gain: (3, n) of the solution, NaN without one: then so is the result.
            errors: whose sum is the error of each range.
            memory: share of the output before that the filter keeps; 0 where it begins.
        """
        if not np.isfinite(gain).all():
            self._shared = None
            return np.full(3, np.nan), np.full((3, 3), np.nan)
        old = 0.0 if self._shared is None else memory
        new, before = 1.0 - old, self._shared or [np.zeros_like(gain) for _ in errors]
        moved = [gain * each.sigma for each in errors]
        cross = old * sum(p.kept * (c @ m.T) for p, c, m in zip(errors, before, moved, strict=True))
        ours = new**2 * sum(m @ m.T for m in moved)
        self._covariance = old**2 * self._covariance + new * (cross + np.transpose(cross)) + ours
        self._shared = [old * p.kept * c + new * m for p, c, m in zip(errors, before, moved, strict=True)]
        self._error = old * self._error + new * sum(m @ p.series for p, m in zip(errors, moved, strict=True))
        return self._error, ENU @ self._covariance @ ENU.T
