# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Erosion, limited slopes and noise on surfaces with known results."""

import numpy as np
import pytest

from fieldtruth.core.arrays import Array
from fieldtruth.world.grids import fractal_noise, solid_noise
from fieldtruth.world.relief import collapsed, eroded, limit_slope, slope_limit

X, Y = np.linspace(0, 20, 101), np.linspace(0, 10, 51)


def rough_flank(seed: int = 0) -> Array:
    noise = fractal_noise(X, Y, wavelength=8.0, octaves=4, rng=np.random.default_rng(seed))
    return np.asarray(0.5 * Y + 0.3 * noise)


def node_slope(heights: Array, spacing: float) -> Array:
    """Slope [rise over run] at each node: the steepest cell sides along x and along y that meet there."""
    steps = np.pad(np.abs(np.diff(heights, axis=0)) / spacing, ((1, 1), (0, 0)))
    rows = np.pad(np.abs(np.diff(heights, axis=1)) / spacing, ((0, 0), (1, 1)))
    return np.asarray(np.hypot(np.maximum(steps[1:], steps[:-1]), np.maximum(rows[:, 1:], rows[:, :-1])))


def test_plane_drains_line_by_line() -> None:
    """On an inclined plane the drained area grows by one cell with each step down."""
    plane = np.broadcast_to(0.5 * Y, (101, 51)).copy()
    drained = eroded(plane, 0.2, strength=0.0, creep=0.0, steps=1).drained
    column = drained[50, 1:-1]
    assert column == pytest.approx(0.2**2 * np.arange(49, 0, -1))


def test_streams_cut_by_the_implicit_equation() -> None:
    """One step on a plane of slope S: the lowest inner node falls as (h + f h_down) / (1 + f), f = K sqrt(A) / dx."""
    plane = np.broadcast_to(0.5 * Y, (101, 51)).copy()
    after = eroded(plane, 0.2, strength=0.05, creep=0.0, repose_deg=80, steps=1).heights
    cut = 0.05 * np.sqrt(49 * 0.2**2) / 0.2
    assert after[50, 1] == pytest.approx((plane[50, 1] + cut * plane[50, 0]) / (1 + cut))
    assert np.array_equal(after[:, 0], plane[:, 0])


def test_gullies_are_cut_where_water_gathers_and_nothing_rises() -> None:
    before = rough_flank()
    after, drained = eroded(before, 0.2, strength=0.02, creep=0.0, repose_deg=89, steps=20)
    fallen = before - after
    assert fallen.min() > -1e-12
    inside = (slice(5, -5), slice(5, -5))
    wet = drained[inside] > np.quantile(drained[inside], 0.95)
    assert fallen[inside][wet].mean() > 3 * fallen[inside][~wet].mean()
    assert drained.max() < 20.3 * 10.3  # no more than the whole area


def test_collapse_stops_at_the_angle_of_repose_and_keeps_volume() -> None:
    tower = np.zeros((61, 61))
    tower[28:33, 28:33] = 3.0
    after = collapsed(tower, 0.2, repose_deg=35, steps=600)
    slope = np.degrees(np.arctan(np.abs(np.diff(after, axis=0)).max() / 0.2))
    assert slope < 36.0
    assert after.sum() == pytest.approx(tower.sum())
    assert after[0].max() == 0.0


def test_creep_smooths_a_wave_at_its_own_rate() -> None:
    """Diffusion damps a sine of wave number k by exp(-D t k^2); D t = 0.02 m^2 in each of 10 steps."""
    wave = np.sin(np.pi * X / 2.0)[:, None] * np.ones(51)
    after = eroded(wave, 0.2, strength=0.0, creep=0.02, repose_deg=89, steps=10).heights
    expected = np.exp(-0.02 * 10 * (np.pi / 2.0) ** 2)
    assert after[50:60, 25].std() / wave[50:60, 25].std() == pytest.approx(expected, rel=0.03)


def test_limited_slopes_keep_their_bounds_and_gentle_ground_is_unchanged() -> None:
    before = rough_flank() * 1.5
    distance = np.abs(Y - 5.0) * np.ones((101, 1))
    limit = slope_limit(distance, within=12.0, beyond=36.0, near=1.0, far=3.0)
    after = limit_slope(before, 0.2, limit, rounds=80)
    slope = node_slope(after, 0.2)
    assert np.degrees(np.arctan(slope[distance < 0.9])).max() < 12.3
    assert np.all(slope < 1.03 * limit)
    assert after.mean() == pytest.approx(before.mean())
    plane = np.broadcast_to(0.1 * Y, (101, 51))
    assert limit_slope(plane, 0.2, np.tan(np.radians(12))) == pytest.approx(plane, abs=1e-12)


def test_slope_limits_in_numbers() -> None:
    limit = slope_limit(np.array([0.0, 1.0, 2.0, 3.0, np.inf]), within=10, beyond=30, near=1, far=3)
    assert np.degrees(np.arctan(limit)) == pytest.approx([10, 10, 20, 30, 30])


def test_noise_in_space_has_unit_deviation_and_its_wavelength() -> None:
    points = np.random.default_rng(0).uniform(0, 30, (20_000, 3))
    values = solid_noise(points, wavelength=3.0, octaves=2, rng=np.random.default_rng(1))
    assert values.std() == pytest.approx(1.0, abs=0.08)
    near, far = (
        solid_noise(np.concatenate([points, points + d]), wavelength=3.0, octaves=2, rng=np.random.default_rng(1))
        for d in (0.05, 9.0)
    )
    n = len(points)
    assert np.corrcoef(near[:n], near[n:])[0, 1] > 0.97
    assert abs(np.corrcoef(far[:n], far[n:])[0, 1]) < 0.1
