# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seeds of the parts of an experiment, each independent of the others and of the order in which they are used."""

import zlib

import numpy as np


def seed_of(seed: int, *names: str | int) -> np.random.SeedSequence:
    """Child of an experiment's seed for what ``names`` say: a sensor's name, a purpose, the number of a reading."""
    words = [zlib.crc32(name.encode()) if isinstance(name, str) else name for name in names]
    return np.random.SeedSequence(seed, spawn_key=words)


def rng_of(seed: int, *names: str | int) -> np.random.Generator:
    """Return the generator of a child seed; see ``seed_of``."""
    return np.random.default_rng(seed_of(seed, *names))
