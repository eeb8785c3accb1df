# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seeds of the parts of an experiment, and noise with a memory.

Each seed is independent of the others and of the order in which they are used.
"""

import math
import zlib
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array


def seed_of(seed: int, *names: str | int) -> np.random.SeedSequence:
    """Child of an experiment's seed for what ``names`` say: a sensor's name, a purpose, the number of a reading."""
    words = [zlib.crc32(name.encode()) if isinstance(name, str) else name for name in names]
    return np.random.SeedSequence(seed, spawn_key=words)


def rng_of(seed: int, *names: str | int) -> np.random.Generator:
    """Return the generator of a child seed; see ``seed_of``."""
    return np.random.default_rng(seed_of(seed, *names))


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
        from scipy.signal import lfilter  # brings all of SciPy's statistics: half a second at the start of each command

        white = self._rng.standard_normal((count, self._memory.shape[1]))
        if not count:
            return white
        white[0 if self._begun else 1 :] *= math.sqrt(1.0 - self.kept * self.kept)
        self._begun = True
        values, self._memory = lfilter([1.0], [1.0, -self.kept], white, axis=0, zi=self._memory)
        return np.asarray(values)
