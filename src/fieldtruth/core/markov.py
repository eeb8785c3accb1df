# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Gauss-Markov processes that go on from call to call: the same values in one piece or in many."""

import math
from typing import Final

import numpy as np
from scipy.signal import lfilter

from fieldtruth.core.arrays import Array


class GaussMarkov:
    """Independent stationary processes of unit variance, whose correlation over k steps is ``kept`` to the power of k.

    Args:
        rng: used by these processes only.
        width: number of processes.
        kept: correlation from one value to the next; 0 for white noise.
    """

    def __init__(self, rng: np.random.Generator, width: int, kept: float) -> None:
        self.kept: Final = kept
        self._rng, self._begun = rng, False
        self._memory: Array = np.zeros((1, width))

    def draw(self, count: int) -> Array:
        """Return the next values (count, width)."""
        white = self._rng.standard_normal((count, self._memory.shape[1]))
        if not count:
            return white
        white[0 if self._begun else 1 :] *= math.sqrt(1.0 - self.kept * self.kept)
        self._begun = True
        values, self._memory = lfilter([1.0], [1.0, -self.kept], white, axis=0, zi=self._memory)
        return np.asarray(values)
