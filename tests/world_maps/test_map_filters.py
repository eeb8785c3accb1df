# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Slope, steps, roughness, gaps and distances against closed forms: plane, step, wave, ditch, hole."""

from typing import Final

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.world_maps.filters import (
    BANDS,
    FARTHEST,
    drops,
    roughness,
    slope,
    solid_distance,
    step_height,
)

F8 = NDArray[np.float64]
CELL: Final = 0.05
X, Y = np.meshgrid(CELL * np.arange(200.0), CELL * np.arange(160.0), indexing="ij")


def test_a_plane_has_one_slope_and_the_step_that_follows_and_no_gap_up_to_the_edge() -> None:
    plane = 0.3 * X - 0.4 * Y + 200.0
    np.testing.assert_allclose(slope(plane, CELL), np.arctan(0.5), atol=1e-9)
    np.testing.assert_allclose(step_height(plane, CELL), 0.7 * 0.1, atol=1e-9)
    assert drops(plane, CELL)[0].max() < 1e-9
    for band in BANDS.values():
        assert roughness(plane, CELL, band).max() < 1e-6


def test_a_step_has_its_height_within_reach_on_both_sides() -> None:
    step = np.where(X < 5.0, 0.0, 0.12)  # cell 100 is the first above
    found = step_height(step, CELL)
    np.testing.assert_allclose(found[98:102], 0.12)
    assert not found[:98].any()
    assert not found[102:].any()
    assert slope(step, CELL)[100, 80] > 0.1
    assert not drops(step, CELL)[0].any()


@pytest.mark.parametrize(("length", "name"), [(0.3, "20_50cm"), (0.9, "50_150cm"), (2.5, "150_500cm")])
def test_a_wave_has_its_rms_in_its_band_as_the_gaussian_filter_passes_it(length: float, name: str) -> None:
    x = np.arange(2000) * CELL  # far from the edges
    wave = np.tile(0.1 * np.sin(2 * np.pi * x / length)[:, None], (1, 3))
    found = roughness(wave, CELL, BANDS[name])[800:1200, 1].mean()
    short, long = BANDS[name]
    passed = 2.0 ** -((short / length) ** 2) - 2.0 ** -((long / length) ** 2)
    assert found == pytest.approx(0.1 / np.sqrt(2.0) * passed, rel=0.03)
    others = [roughness(wave, CELL, band)[800:1200, 1].mean() for key, band in BANDS.items() if key != name]
    assert found > max(others)


@pytest.mark.parametrize(("cells", "deep"), [(4, 0.4), (30, 0.4), (40, 0.4), (41, 0.0)])
def test_a_ditch_has_its_depth_and_width_if_it_is_narrower_than_two_metres(cells: int, deep: float) -> None:
    inside = np.abs(X - 3.0 - (cells - 1) * CELL / 2) < cells * CELL / 2
    drop, width = drops(np.where(inside, -0.4, 0.0) + 100.0, CELL)
    np.testing.assert_allclose(drop, np.where(inside, deep, 0.0), atol=1e-9)
    if deep:
        np.testing.assert_allclose(width[inside], cells * CELL)
    assert np.isnan(width[drop == 0]).all()


def test_a_ditch_between_unequal_banks_is_as_deep_as_the_lower_one() -> None:
    drop, width = drops(np.where(X < 3.0, 0.3, np.where(X < 3.5, -0.2, 0.1)), CELL)
    assert drop[65, 80] == pytest.approx(0.3)
    assert width[65, 80] == pytest.approx(0.5)
    assert drop[40, 80] == 0.0


def test_a_diagonal_ditch_has_its_width_across() -> None:
    inside = np.abs(X - Y) < 0.2 * np.sqrt(2.0)
    drop, width = drops(np.where(inside, -0.3, 0.0), CELL)
    middle = np.abs(X - Y) < 1e-9
    assert drop[middle][40:-40].min() == pytest.approx(0.3)
    np.testing.assert_allclose(width[middle][40:-40], 5 * CELL * np.sqrt(2.0))  # 0.35 of 0.4 m


def test_distance_is_that_of_the_middles_of_cells_up_to_its_limit() -> None:
    obstacle = np.zeros(X.shape, np.uint8)
    obstacle[20, 30] = 1
    found = solid_distance(obstacle, CELL)
    expected = np.hypot(X - X[20, 30], Y - Y[20, 30])
    np.testing.assert_allclose(found, np.minimum(expected, FARTHEST))
    assert (solid_distance(np.zeros((4, 4), np.uint8), CELL) == FARTHEST).all()
