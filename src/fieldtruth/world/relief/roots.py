# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Roots at the surface: the swell of soil about a trunk, and lateral roots that run out from it and dip in and out.

Sizes follow the trunk's radius r: the swell is 0.25 r high and falls off over 2.5 r; four to seven roots leave the
trunk 0.4 r above the soil, thin out over 6 to 16 r and show above it in parts (drawn from photographs of spruce and
beech on shallow soils; no published statistics were found).
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array

STEP: Final = 0.04
"""Distance [m] between the points of a root."""


def root_swells(
    x: Array, y: Array, trunks: Iterable[tuple[float, float, float]], rng: np.random.Generator | None
) -> Array:
    """Heights [m] at the nodes of axes x, y [m] of the roots of ``trunks`` (x, y, radius) [m]; None: only swells."""
    total = np.zeros((len(x), len(y)))
    for tx, ty, radius in trunks:
        roots = [_root(radius, turn, rng) for turn in _directions(rng)] if rng is not None else []
        points = np.concatenate([np.zeros((0, 4)), *roots])
        reach = max(float(np.abs(points[:, :2]).max(initial=0.0)) + 0.2, 6.0 * radius)
        i, j = (np.flatnonzero(np.abs(axis - at) < reach) for axis, at in ((x, tx), (y, ty)))
        if len(i) and len(j):
            dx, dy = x[i] - tx, y[j] - ty
            swell = np.exp(-0.5 * (dx[:, None] ** 2 + dy**2) / (2.5 * radius) ** 2)
            total[np.ix_(i, j)] += 0.25 * radius * swell + _ridges(dx, dy, points)
    return total


def _directions(rng: np.random.Generator) -> Array:
    """Directions [rad] of four to seven roots, roughly even."""
    count = int(rng.integers(4, 8))
    return np.asarray(
        (np.arange(count) + rng.uniform(-0.35, 0.35, count)) * 2.0 * np.pi / count + rng.uniform(0.0, 6.3)
    )


def _root(radius: float, turn: float, rng: np.random.Generator) -> Array:
    """Points (n, 4) of a root: x, y from the trunk's centre, height and half width [m]."""
    length = radius * rng.uniform(6.0, 16.0)
    s = np.arange(0.0, length, STEP)
    heading = turn + np.cumsum(rng.normal(0.0, 0.12, len(s)))
    xy = radius * np.array([np.cos(turn), np.sin(turn)]) + np.cumsum(
        STEP * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0
    )
    left = 1.0 - s / length
    dips = np.sin(2.0 * np.pi * s / rng.uniform(0.5, 1.1) + rng.uniform(0.0, 6.3))
    height = 0.4 * radius * np.exp(-1.2 * s / radius) + 0.14 * radius * left * np.clip(0.4 + dips, 0.0, 1.0)
    return np.column_stack([xy, height, np.maximum(0.03, 0.3 * radius * left**2)])


def _ridges(dx: Array, dy: Array, points: Array) -> Array:
    """Highest of Gaussian bumps (len(dx), len(dy)) at points (n, 4) of x, y, height and half width [m]."""
    heights = np.zeros((len(dx), len(dy)))
    for x, y, height, width in points:
        i = slice(*np.searchsorted(dx, (x - 3.0 * width, x + 3.0 * width)))
        j = slice(*np.searchsorted(dy, (y - 3.0 * width, y + 3.0 * width)))
        away = (dx[i, None] - x) ** 2 + (dy[j] - y) ** 2
        heights[i, j] = np.maximum(heights[i, j], height * np.exp(-0.5 * away / width**2))
    return heights
