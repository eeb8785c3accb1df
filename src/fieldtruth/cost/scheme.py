# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From coarse to fine: which nodes of a square lattice are driven, and which take the mean of those around them.

First every ``first``-th node is driven. Then the distance is halved until it is one: a node between is driven where the
nodes around it differ, or where they pass and a hazard is near; else it takes their cause, and the mean of their costs.
"""

import itertools
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Mask
from fieldtruth.cost.stretch import Cause, Passage

QUANTITIES: Final = Passage._fields
Drive = Callable[[int, int, int], tuple[Cause, Passage]]
"""Drives at a node i, j and the k-th heading."""


class Costs(NamedTuple):
    """Costs at the nodes of a lattice (n, m) and at h headings."""

    cause: NDArray[np.uint8]  # (n, m, h)
    values: Float32Array  # (n, m, h, quantities); NaN where it does not pass
    driven: Mask  # (n, m, h): False where it is taken from the nodes around


def found_costs(shape: tuple[int, int, int], drive: Drive, hazard: Mask, first: int, tolerance: Array) -> Costs:
    """Return the costs of a lattice.

    Args:
        shape: n, m and h; n and m are 1 more than a multiple of ``first``.
        drive: drives at a node.
        hazard: (n, m, h), where a hazard is near.
        first: distance of the nodes that are driven first, a power of two; 1 drives all of them.
        tolerance: (quantities,) by which nodes that are alike may differ.
    """
    costs = Costs(
        np.zeros(shape, np.uint8), np.full((*shape, len(QUANTITIES)), np.nan, np.float32), np.zeros(shape, bool)
    )
    for i, j, k in itertools.product(range(0, shape[0], first), range(0, shape[1], first), range(shape[2])):
        _take(costs, drive, i, j, k)
    step = first // 2
    while step:
        for i, j in _between(shape, step):
            _fill(costs, drive, hazard, (i, j), step, tolerance)
        step //= 2
    return costs


def _take(costs: Costs, drive: Drive, i: int, j: int, k: int) -> None:
    costs.cause[i, j, k], costs.values[i, j, k] = drive(i, j, k)
    costs.driven[i, j, k] = True


def _between(shape: tuple[int, ...], step: int) -> Iterator[tuple[int, int]]:
    """Nodes at multiples of ``step`` that are not all multiples of twice of it."""
    for i in range(0, shape[0], step):
        for j in range(0, shape[1], step):
            if i % (2 * step) or j % (2 * step):
                yield i, j


def _fill(costs: Costs, drive: Drive, hazard: Mask, node: tuple[int, int], step: int, tolerance: Array) -> None:
    """Fill a node at all headings, from the two or four nodes around it."""
    i, j = node
    rows, columns = ([v - step, v + step] if v % (2 * step) else [v] for v in node)
    around = np.ix_(rows, columns)
    causes = costs.cause[around].reshape(-1, costs.cause.shape[2])
    values = costs.values[around].reshape(-1, *costs.values.shape[2:]).astype(np.float64)
    alike = (causes == causes[0]).all(axis=0)
    passes = alike & (causes[0] == Cause.PASSES)
    spread = values.max(axis=0) - values.min(axis=0)  # NaN where one does not pass
    alike &= ~passes | ((spread <= tolerance).all(axis=1) & ~hazard[i, j])
    for k in range(len(alike)):
        if alike[k]:
            costs.cause[i, j, k], costs.values[i, j, k] = causes[0, k], values[:, k].mean(axis=0)
        else:
            _take(costs, drive, i, j, k)
