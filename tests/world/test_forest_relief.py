# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Relief of the ground about trees: roots about trunks, pits and mounds."""

import numpy as np
import pytest

from fieldtruth.world.relief import pits_and_mounds, root_swells

X, Y = np.arange(-4.0, 4.01, 0.05), np.arange(-3.0, 3.01, 0.05)


def test_roots_are_highest_at_the_trunk_and_end_within_sixteen_radii() -> None:
    radius = 0.2
    heights = root_swells(X, Y, [(0.5, -0.25, radius)], np.random.default_rng(1))
    away = np.hypot(*np.meshgrid(X - 0.5, Y + 0.25, indexing="ij"))
    assert heights.min() >= 0.0
    assert 0.4 * radius < heights[away < 1.5 * radius].max() < (0.4 + 0.14 + 0.25) * radius
    assert np.all(heights[away > 17.5 * radius] < 1e-3)
    # A circle through the roots crosses four to seven ridges.
    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    i = np.rint((0.5 + 2.2 * radius * np.cos(turn) - X[0]) / 0.05).astype(int)
    j = np.rint((-0.25 + 2.2 * radius * np.sin(turn) - Y[0]) / 0.05).astype(int)
    circle = heights[i, j] > heights[i, j].min() + 0.02
    assert 3 <= np.count_nonzero(circle & ~np.roll(circle, 1)) <= 7


def test_a_pair_has_as_much_soil_above_as_below() -> None:
    heights = pits_and_mounds(X * 2, Y * 2, [(0.0, 0.0)], np.random.default_rng(2))
    assert heights.sum() == pytest.approx(0.0, abs=1e-3 * np.abs(heights).sum())
    assert 0.15 <= heights.max() <= 0.45
    assert -heights.min() == pytest.approx(heights.max(), rel=0.02)
    assert not pits_and_mounds(X, Y, [], np.random.default_rng(2)).any()


def test_the_same_seed_gives_the_same_roots() -> None:
    trunks = [(-1.0, 1.0, 0.1), (3.9, 2.9, 0.3), (40.0, 0.0, 0.3)]  # one at the corner, one outside
    first, again = (root_swells(X, Y, trunks, np.random.default_rng(5)) for _ in range(2))
    assert first.tobytes() == again.tobytes()
    assert first[-5:, -5:].max() > 0.05
