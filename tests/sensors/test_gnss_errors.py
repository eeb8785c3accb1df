# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of ranges and positions against laws: correlation, dilution of precision, covariance, states of RTK."""

import numpy as np
import pytest

from fieldtruth.core.random import GaussMarkov
from fieldtruth.sensors.gnss import sensing
from fieldtruth.sensors.gnss.config import GnssConfig, GnssSignal
from fieldtruth.sensors.gnss.sensing import ENU, PositionFilter, RangeErrors, sky_at, solve

RNG = np.random.default_rng


def _towards(azimuth_deg: np.ndarray, elevation_deg: np.ndarray) -> np.ndarray:
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    flat = np.cos(elevation)
    return np.stack([np.cos(azimuth) * flat, -np.sin(azimuth) * flat, np.sin(elevation) + 0.0 * azimuth], axis=-1)


THREE_AND_ZENITH = _towards(np.array([0.0, 120.0, 240.0, 0.0]), np.array([0.0, 0.0, 0.0, 90.0]))


def test_correlation_of_a_gauss_markov_series_falls_to_1_by_e_at_tau() -> None:
    series = GaussMarkov(RNG(1), 20, float(np.exp(-0.5 / 10.0))).draw(40_000)
    assert series.var() == pytest.approx(1.0, abs=0.02)
    assert series[0].std() == pytest.approx(1.0, abs=0.6)  # from the first row on
    assert (series[20:] * series[:-20]).mean() == pytest.approx(np.exp(-1.0), abs=0.02)  # 20 steps of 0.5 s are 10 s
    assert (series[40:] * series[:-40]).mean() == pytest.approx(np.exp(-2.0), abs=0.02)
    start = GaussMarkov(RNG(1), 20, float(np.exp(-0.5 / 10.0))).draw(100)
    assert np.array_equal(start, series[:100])


def test_the_first_row_of_a_gauss_markov_series_is_stationary() -> None:
    first = GaussMarkov(RNG(2), 50_000, 0.99).draw(2)
    assert first.std(axis=1) == pytest.approx([1.0, 1.0], abs=0.02)


def test_dilution_of_a_symmetric_constellation() -> None:
    """Three at the horizon and one at the zenith: horizontal 2 / (3/2), vertical 4 / 3, by inverting 2 x 2 matrices."""
    found = solve(THREE_AND_ZENITH[None], np.ones((1, 4), bool), np.ones((1, 4)))
    assert found.dop[0] == pytest.approx(np.sqrt([8 / 3, 4 / 3, 4 / 3]))
    assert found.satellites.tolist() == [4]


def test_three_satellites_or_a_plane_have_no_solution() -> None:
    used = np.array([[True, True, True, False], [True, True, True, True]])
    cone = _towards(np.array([0.0, 90.0, 180.0, 270.0]), np.full(4, 30.0))  # height and clock have the same effect
    found = solve(np.stack([THREE_AND_ZENITH, cone]), used, np.ones((2, 4)))
    assert np.isnan(found.dop).all()
    assert np.isnan(found.gain).all()


def test_half_of_the_sky_raises_the_dilution() -> None:
    azimuth = np.arange(0.0, 360.0, 30.0)
    sky = _towards(np.tile(azimuth, 2), np.repeat([20.0, 55.0], 12))[None].repeat(2, axis=0)
    east = np.tile((azimuth > 0.0) & (azimuth < 180.0), 2)
    found = solve(sky, np.stack([np.ones(24, bool), east]), np.ones((2, 24)))
    assert (found.dop[1] > 1.4 * found.dop[0]).all()


def test_a_range_error_moves_the_position_away_from_its_satellite() -> None:
    """A range that is 1 m too long, with three exact ones: by symmetry the position moves along the fourth."""
    gain = solve(THREE_AND_ZENITH[None], np.ones((1, 4), bool), np.ones((1, 4))).gain[0]
    assert gain[:, 0] == pytest.approx([-2 / 3, 0.0, gain[2, 0]])  # north satellite: to the south
    assert gain[1, 1] == pytest.approx(2 / 3 * np.sqrt(0.75))  # at 120 deg, in the east: to the west
    assert gain[2, 3] == pytest.approx(-1.0)  # zenith: down


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_claimed_covariance_is_that_of_the_errors(memory: float) -> None:
    """Over repetitions with changing satellites, slow, fast and white errors, with and without a filter."""
    count, steps = 600, 12
    rng = RNG(7)
    sky = np.stack([_towards(RNG(3).uniform(0, 360, 9), RNG(4).uniform(10, 90, 9))] * steps)
    used = RNG(5).random((steps, 9)) < 0.75
    sigma = RNG(6).uniform(0.3, 3.0, (3, steps, 9))
    gain = solve(sky, used, np.sqrt((sigma**2).sum(axis=0))).gain
    kept = (0.99, 0.7, 0.0)
    ends, covariance = [], np.zeros((3, 3))
    for _ in range(count):
        processes, position = [GaussMarkov(rng, 9, k) for k in kept], PositionFilter()
        for k in range(steps):
            parts = [RangeErrors(p.draw(1)[0], s[k], p.kept) for p, s in zip(processes, sigma, strict=True)]
            error, covariance = position.follow(gain[k], parts, memory)
        ends.append(ENU @ error)
    sample = np.array(ends)
    squares = np.einsum("ni,ij,nj->n", sample, np.linalg.inv(covariance), sample)
    assert squares.mean() == pytest.approx(3.0, abs=5.0 * np.sqrt(6.0 / count))
    assert np.mean(squares < 2.366) == pytest.approx(0.5, abs=5.0 * np.sqrt(0.25 / count))  # median of chi-square
    scale = np.sqrt(np.diag(covariance))
    assert np.cov(sample.T) / np.outer(scale, scale) == pytest.approx(
        covariance / np.outer(scale, scale), abs=5.0 * np.sqrt(2.0 / count)
    )


def test_without_a_filter_the_covariance_is_that_of_least_squares() -> None:
    sigma = np.array([[1.0, 2.0, 3.0, 0.5]])
    gain = solve(THREE_AND_ZENITH[None], np.ones((1, 4), bool), sigma).gain
    _, covariance = PositionFilter().follow(gain[0], [RangeErrors(np.zeros(4), sigma[0], 0.0)], 0.0)
    rows = np.concatenate([-THREE_AND_ZENITH, np.ones((4, 1))], axis=1)
    own = np.linalg.inv(rows.T @ np.diag(1.0 / sigma[0] ** 2) @ rows)[:3, :3]
    assert ENU.T @ covariance @ ENU == pytest.approx(own)


def test_obliquity_and_strength() -> None:
    for elevation in np.radians([0.0, 5.0, 30.0, 90.0]):  # by the law of sines in the triangle to the layer
        zenith_there = np.arcsin(6378.137 / (6378.137 + 350.0) * np.cos(elevation))
        assert sensing.obliquity(np.sin(elevation)) == pytest.approx(1.0 / np.cos(zenith_there))
    signal = GnssSignal(cn0_zenith_dbhz=50.0, cn0_horizon_dbhz=40.0)
    ratio = sensing.carrier_to_noise(np.array([1.0, 0.5, 1.0]), np.array([1.0, 1.0, 0.5]), signal)
    assert ratio == pytest.approx([50.0, 45.0, 50.0 - 6.0206], abs=1e-3)
    noisy = GnssSignal(white_sigma_m=1.0)
    white = sensing.sigmas(np.ones((1, 2)), np.array([[45.0, 25.0]]), np.zeros(1, np.int64), noisy)[2]
    assert white[0] == pytest.approx([1.0, 10.0])  # a hundredth of the power


@pytest.mark.parametrize(
    ("model", "state", "middle"), [("neo_m8n", 0, 2.5), ("zed_f9p", 0, 1.5), ("zed_f9p", 2, 0.01), ("duro", 0, 0.75)]
)
def test_open_sky_has_the_error_of_the_data_sheet(model: str, state: int, middle: float) -> None:
    """Half of the positions of a day are within the circular error that the data sheet states."""
    signal = GnssConfig(model=model, signal="datasheet").signal  # type: ignore[arg-type]
    assert signal is not None
    stamps = np.arange(0, 86_400, 600) * 10**9
    sky = sky_at(None, np.zeros((len(stamps), 3)), stamps, signal)
    sigma = sensing.sigmas(sky.directions[..., 2], sky.ratio, np.full(len(stamps), state), signal)
    gain = solve(sky.directions, sky.used, np.sqrt(sum(each**2 for each in sigma))).gain
    drawn = RNG(0).standard_normal((200, *sky.used.shape)) * np.sqrt(sum(each**2 for each in sigma))
    error = np.einsum("tin,ktn->kti", np.nan_to_num(gain), np.where(sky.used, drawn, 0.0))
    assert np.median(np.hypot(error[..., 0], error[..., 1])) == pytest.approx(middle, rel=0.04)


def test_states_of_rtk() -> None:
    signal = GnssSignal(mode="rtk", rtk_cn0_min_dbhz=35.0, rtk_min_satellites=5, rtk_fix_s=2.0)
    ratio = np.full((10, 6), 40.0)
    ratio[3, :2] = 30.0
    states = sensing.RtkStates(RNG(0), 1.0, signal).extend(ratio)
    assert states.tolist() == [2, 2, 2, 1, 1, 2, 2, 2, 2, 2]
    assert (sensing.RtkStates(RNG(0), 1.0, signal).extend(np.full((5, 4), 40.0)) == sensing.FLOAT).all()


def test_rates_of_losses() -> None:
    ratio, hours = np.full((100_000, 6), 40.0), 100_000 / 3600.0
    lost = GnssSignal(mode="rtk", rtk_losses_per_hour=12.0, rtk_fix_s=3.0)
    states = sensing.RtkStates(RNG(1), 1.0, lost).extend(ratio)
    begun = np.count_nonzero(np.diff(states) == -1)
    assert begun == pytest.approx(12.0 * hours, abs=5.0 * np.sqrt(12.0 * hours))
    assert np.count_nonzero(states == sensing.FLOAT) == pytest.approx(3 * begun, rel=0.03)
    cut = GnssSignal(mode="rtk", link_losses_per_hour=24.0, link_loss_s=5.0)
    states = sensing.RtkStates(RNG(2), 1.0, cut).extend(ratio)
    share = 24.0 * 5.0 / 3600.0  # of the time, as pauses rarely meet
    assert np.mean(states == sensing.SINGLE) == pytest.approx(share, rel=0.2)
    assert not (states == sensing.FLOAT).any()
    assert np.array_equal(sensing.RtkStates(RNG(2), 1.0, cut).extend(ratio[:999]), states[:999])
