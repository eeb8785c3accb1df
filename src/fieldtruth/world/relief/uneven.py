# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Unevenness of natural soil: pits and mounds that fallen trees left, and the swell at a tree's foot."""

import numpy as np

from fieldtruth.core.arrays import Array


def pits_and_mounds(
    x: Array, y: Array, *, rng: np.random.Generator, per_ha: float = 250.0, height: float = 0.35, length: float = 2.6
) -> Array:
    """Heights (len(x), len(y)) [m] to add: ``per_ha`` pits, each with the mound of the root plate that left it.

    Uprooting makes pairs of about 2 to 3 m ``length``, a few decimetres deep and high, which last for centuries
    (Schaetzl and Follmer, Geomorphology 3, 1990). Windthrow has a direction: pairs of a wood lie much alike.
    """
    result = np.zeros((len(x), len(y)))
    count = rng.poisson(per_ha * np.ptp(x) * np.ptp(y) / 1e4)
    wind = rng.uniform(0, 2 * np.pi)
    for _ in range(count):
        turn, size = wind + rng.normal(0, 0.5), length * np.exp(rng.normal(0, 0.25))
        rise = height * np.exp(rng.normal(0, 0.4)) * (size / length)
        cx, cy = rng.uniform(x[0], x[-1]), rng.uniform(y[0], y[-1])
        rows, columns = np.abs(x - cx) < 2 * size, np.abs(y - cy) < 2 * size
        dx, dy = np.meshgrid(x[rows] - cx, y[columns] - cy, indexing="ij")
        u = (dx * np.cos(turn) + dy * np.sin(turn)) / (0.42 * size)
        v = (dy * np.cos(turn) - dx * np.sin(turn)) / (0.6 * size)
        # The derivative of a bell: a hump on one side, a hollow on the other.
        result[np.ix_(rows, columns)] += 1.65 * rise * u * np.exp(-0.5 * u**2 - 0.5 * v**2 - 0.02 * (u * v) ** 2)
    return result


def root_swells(x: Array, y: Array, places: Array, radius: Array, height: Array) -> Array:
    """Heights (len(x), len(y)) [m] to add: soil heaped about trunks at ``places`` (n, 2), by ``height`` (n,) [m].

    The swell falls to nothing within about twice ``radius`` (n,) [m].
    """
    result = np.zeros((len(x), len(y)))
    for (cx, cy), r, h in zip(places, radius, height, strict=True):
        rows, columns = np.abs(x - cx) < 3 * r, np.abs(y - cy) < 3 * r
        away = np.hypot(*np.meshgrid(x[rows] - cx, y[columns] - cy, indexing="ij"))
        result[np.ix_(rows, columns)] += h * np.exp(-((away / r) ** 2))
    return result
