# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Splits by world: every world, with all its runs, is in exactly one of train, val and test."""

from collections.abc import Callable, Hashable, Mapping, Sequence

import numpy as np

from fieldtruth.core.errors import ConfigurationError


def splits_of(
    worlds: Sequence[Hashable], shares: Mapping[str, float], rng_of: Callable[[int], np.random.Generator]
) -> list[str]:
    """Return the split of each run.

    Worlds get their split in the order in which they first occur, so that later runs do not move earlier ones: the
    first ones give every split a world, each other is drawn among the splits in proportion to the worlds that they
    lack. A split never exceeds its share by a whole world.

    Args:
        worlds: the world of each run.
        shares: share of the worlds by split; empty for no split, then all are "".
        rng_of: random generator of the i-th world.

    Raises:
        ConfigurationError: fewer worlds than splits.
    """
    found: dict[Hashable, str] = {}
    names = list(shares)
    counts = np.zeros(len(names), int)
    for world in worlds if names else ():
        if world not in found:
            lacking = np.array([*shares.values()]) * (len(found) + 1) - counts
            empty = np.flatnonzero(counts == 0)
            weights = np.maximum(lacking, 0.0)
            drawn = rng_of(len(found)).choice(len(names), p=weights / weights.sum())
            chosen = int(empty[0] if len(empty) else drawn)
            counts[chosen] += 1
            found[world] = names[chosen]
    if len(found) < len(names):
        raise ConfigurationError(
            f"split: {', '.join(names[len(found) :])} would be empty, because the runs have {len(found)} "
            f"world{'s' * (len(found) != 1)} (environments and seeds) for {len(names)} splits; give more seeds"
        )
    return [found.get(world, "") for world in worlds]
