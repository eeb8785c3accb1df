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


class Process(NamedTuple):
    """Errors of ranges: independent Gauss-Markov series (t, n) of unit variance, and their sigma (t, n) [m]."""

    series: Array
    sigma: Array
    kept: float
    """Correlation from one time to the next; 0 for white noise."""


def follow(gain: Array, processes: Sequence[Process], memory: Array) -> tuple[Array, Array]:
    """Return the errors (t, 3) of the positions in the world frame [m], and their covariances (t, 3, 3) in ENU [m^2].

    Args:
        gain: (t, 3, n) of the solutions, NaN without one.
        processes: whose sum is the error of each range.
        memory: (t,) share of the output before that the filter keeps; 0 where it begins.
    """
    count, _, satellites = gain.shape
    errors, covariances = np.full((count, 3), np.nan), np.full((count, 3, 3), np.nan)
    error, covariance, lost = np.zeros(3), np.zeros((3, 3)), True
    shared = [np.zeros((3, satellites)) for _ in processes]  # covariance with each process
    for k in range(count):
        if not np.isfinite(gain[k]).all():
            lost = True
            continue
        old = 0.0 if lost else memory[k]
        new, lost = 1.0 - old, False
        moved = [gain[k] * process.sigma[k] for process in processes]
        cross = old * sum(p.kept * (c @ m.T) for p, c, m in zip(processes, shared, moved, strict=True))
        covariance = old**2 * covariance + new * (cross + cross.T) + new**2 * sum(m @ m.T for m in moved)
        shared = [old * p.kept * c + new * m for p, c, m in zip(processes, shared, moved, strict=True)]
        error = old * error + new * sum(m @ p.series[k] for p, m in zip(processes, moved, strict=True))
        errors[k], covariances[k] = error, ENU @ covariance @ ENU.T
    return errors, covariances
