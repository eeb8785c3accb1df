# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Noise of an IMU against its laws: Allan deviations, variances, ranges, and an independent implementation of them."""

import copy
import math
from collections.abc import Iterable
from functools import cache
from typing import Any

import allantools
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.random import GaussMarkov
from fieldtruth.drive.track import stamps_at_rate
from fieldtruth.sensors.imu.config import ImuSignal
from fieldtruth.sensors.imu.sensing import ImuErrors, ImuReadings, MeasuredImu, Triad, TriadErrors, quantised

Floats = NDArray[np.float64]
RATE = 100.0
NOISY = ImuSignal(
    gyroscope_noise_density=1e-3,
    gyroscope_random_walk=3e-4,
    accelerometer_noise_density=(2e-3, 2e-3, 4e-3),
    accelerometer_random_walk=6e-4,
)


def at_rest(seconds: float, rate: float = RATE) -> ImuReadings:
    """Readings of an ideal IMU that stands level."""
    stamps = stamps_at_rate(rate, round(seconds * 1e9))
    still = np.zeros((len(stamps), 3))
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (len(stamps), 1))
    return ImuReadings(
        stamps_ns=stamps,
        quaternion_wxyz=attitude,
        angular_velocity=still,
        linear_acceleration=still + np.array([0, 0, 9.81]),
    )


def measure(signal: ImuSignal, true: ImuReadings, seed: int = 0, rate: float = RATE) -> MeasuredImu:
    return ImuErrors(signal, rate, np.random.default_rng(seed)).extend(true)


def adev(values: Floats, taus: list[float], rate: float = RATE) -> Floats:
    """Overlapping Allan deviation at averaging times [s], of the mean variance of three axes."""
    found = [allantools.oadev(axis, rate=rate, data_type="freq", taus=taus) for axis in values.T]
    assert all(np.allclose(used, taus) for used, *_ in found)
    return np.asarray(np.sqrt(np.mean([deviation**2 for _, deviation, *_ in found], axis=0)))


@cache
def two_hours() -> ImuReadings:
    return measure(NOISY, at_rest(7200.0), seed=3).readings


def test_the_densities_are_recovered_from_two_hours_at_rest() -> None:
    short = [0.05, 0.1, 0.2]  # white noise: N / sqrt(tau)
    gyroscope = adev(two_hours().angular_velocity, short) * np.sqrt(short)
    np.testing.assert_allclose(gyroscope, 1e-3, rtol=0.02)
    force = two_hours().linear_acceleration
    np.testing.assert_allclose(adev(force[:, :2], short) * np.sqrt(short), 2e-3, rtol=0.03)
    np.testing.assert_allclose(adev(force[:, 2:], short) * np.sqrt(short), 4e-3, rtol=0.03)


def test_the_random_walks_are_recovered_from_two_hours_at_rest() -> None:
    long = [40.0, 60.0, 90.0]  # random walk: K sqrt(tau / 3); 10 % is two deviations of the estimate at 90 s
    for values, walk in ((two_hours().angular_velocity, 3e-4), (two_hours().linear_acceleration, 6e-4)):
        found = adev(values, long) * np.sqrt(3.0 / np.array(long))
        assert found.mean() == pytest.approx(walk, rel=0.1)


def test_bias_instability_is_the_flat_bottom_of_the_allan_deviation() -> None:
    signal = ImuSignal(gyroscope_bias_instability=1e-4)
    taus = [4.0, 8.0, 16.0, 32.0, 64.0, 128.0]
    still = at_rest(7200.0, 10.0)
    runs = [adev(measure(signal, still, seed, 10.0).readings.angular_velocity, taus, 10.0) for seed in range(4)]
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(runs), axis=0)), 1e-4, rtol=0.2)


def test_a_markov_process_has_its_deviation_and_forgets_in_its_time() -> None:
    kept = math.exp(-1.0 / (2.0 * 10.0))
    values = GaussMarkov(np.random.default_rng(1), 3, kept).draw(200_000)
    np.testing.assert_allclose(values.std(axis=0), 1.0, rtol=0.05)
    after = [float(np.mean(values[:-20, k] * values[20:, k]) / np.var(values[:, k])) for k in range(3)]
    np.testing.assert_allclose(after, math.exp(-1.0), atol=0.05)
    starts = [GaussMarkov(np.random.default_rng(seed), 3, kept).draw(1)[0] for seed in range(400)]
    assert np.std(starts) == pytest.approx(1.0, rel=0.1)  # not zero: it has gone on for ever


def test_without_figures_nothing_differs() -> None:
    true = at_rest(2.0)
    read = measure(ImuSignal(), true)
    for name, values in vars(true).items():
        np.testing.assert_array_equal(getattr(read.readings, name), values)
    assert not np.concatenate(read[1:]).any()


def test_a_short_series_is_the_start_of_a_long_one() -> None:
    signal = NOISY.model_copy(update={"gyroscope_bias_instability": 1e-4, "yaw_error": 0.01, "gyroscope_bias": 0.01})
    long, short = (measure(signal, at_rest(seconds)).readings for seconds in (20.0, 5.0))
    for name in ("angular_velocity", "linear_acceleration", "quaternion_wxyz"):
        np.testing.assert_array_equal(getattr(short, name), getattr(long, name)[:500])


@pytest.mark.parametrize("cuts", [(1, 2, 3), (20,), range(1, 100)])
def test_readings_do_not_depend_on_how_a_series_is_cut(cuts: Iterable[int]) -> None:
    signal = NOISY.model_copy(
        update={"gyroscope_bias_instability": 1e-4, "yaw_error": 0.01, "gyroscope_misalignment": 0.01}
    )
    true = at_rest(1.0)
    whole = measure(signal, true).readings
    imu, parts = ImuErrors(signal, RATE, np.random.default_rng(0)), list[ImuReadings]()
    for rows in np.split(np.arange(100), list(cuts)):
        imu = copy.deepcopy(imu)  # a copy goes on as well
        parts.append(imu.extend(ImuReadings(**{name: values[rows] for name, values in vars(true).items()})).readings)
    for name, values in vars(whole).items():
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), values)


def test_effects_do_not_change_the_noise_of_each_other() -> None:
    """So that a figure can be varied while everything else of a run stays."""
    alone = measure(ImuSignal(gyroscope_noise_density=1e-3), at_rest(5.0)).readings.angular_velocity
    both = measure(ImuSignal(gyroscope_noise_density=1e-3, gyroscope_bias=0.5), at_rest(5.0)).readings.angular_velocity
    np.testing.assert_allclose(both - alone, np.tile((both - alone)[0], (500, 1)), atol=1e-12)
    assert 0.01 < np.abs((both - alone)[0]).max() < 2.5


def triad(**values: Any) -> Triad:
    return Triad.of(ImuSignal(**{f"gyroscope_{key}": value for key, value in values.items()}), "gyroscope")


def test_turn_on_biases_scales_and_misalignments_have_their_deviations() -> None:
    unit = np.vstack([np.zeros(3), np.eye(3)])
    figures = triad(bias=(0.1, 0.2, 0.3), scale_error=0.01, misalignment=0.003)
    read = np.array([TriadErrors(figures, RATE, np.random.default_rng(seed)).extend(unit) for seed in range(3000)])
    np.testing.assert_allclose(read[:, 0].std(axis=0), [0.1, 0.2, 0.3], rtol=0.06)
    matrices = (read[:, 1:] - read[:, :1]).transpose(0, 2, 1) - np.eye(3)  # columns are the answers to unit vectors
    np.testing.assert_allclose(matrices.std(axis=0), np.full((3, 3), 0.003) + 0.007 * np.eye(3), rtol=0.06)
    np.testing.assert_allclose(matrices.mean(axis=0), 0.0, atol=0.001)


def test_order_of_the_effects() -> None:
    """Bias is not scaled; the range limits what has bias and noise; steps come last and stay in the range."""
    figures = triad(bias=1.0, scale_error=0.1, range=2.05, resolution=0.1)
    rng = np.random.default_rng(5)
    zero, one = TriadErrors(triad(bias=1.0, scale_error=0.1), RATE, rng).extend(np.array([[0.0] * 3, [0.5] * 3]))
    expected = np.clip(np.rint(np.array([zero, one, 2 * one - zero, zero + 20 * (one - zero)]) / 0.1), -20, 20) * 0.1
    true = np.array([[0.0] * 3, [0.5] * 3, [1.0] * 3, [10.0] * 3])
    read = TriadErrors(figures, RATE, np.random.default_rng(5)).extend(true)
    np.testing.assert_allclose(read, expected, atol=1e-12)
    assert read.max() == pytest.approx(2.0)


def test_ranges_and_resolutions() -> None:
    values = np.array([-5.0, -0.26, -0.24, 0.0, 0.24, 0.26, 5.0])
    np.testing.assert_allclose(quantised(values, None, 0.5), [-5, -0.5, 0, 0, 0, 0.5, 5])
    np.testing.assert_allclose(quantised(values, 1.2, 0.5), [-1, -0.5, 0, 0, 0, 0.5, 1])
    np.testing.assert_allclose(quantised(values, 1.2, None), [-1.2, -0.26, -0.24, 0, 0.24, 0.26, 1.2])
    assert quantised(values, None, None) is values


def test_the_error_of_the_attitude_is_about_the_axes_of_the_world() -> None:
    """Of a sensor on its side, too: the heading is worse than roll and pitch."""
    signal = ImuSignal(roll_pitch_error=0.01, yaw_error=0.05, attitude_correlation_s=0.5)
    side = Rotation.from_euler("xyz", [20.0, -90.0, 130.0], degrees=True)
    x, y, z, w = side.as_quat()
    true = at_rest(2000.0, 10.0)
    true = ImuReadings(**{**vars(true), "quaternion_wxyz": np.tile([w, x, y, z], (len(true.stamps_ns), 1))})
    read = measure(signal, true, rate=10.0)
    turned = Rotation.from_quat(read.readings.quaternion_wxyz[:, [1, 2, 3, 0]]) * side.inv()
    np.testing.assert_allclose(turned.as_rotvec().std(axis=0), [0.01, 0.01, 0.05], rtol=0.06)
    np.testing.assert_allclose(np.diag(read.attitude_covariance.reshape(3, 3)), [1e-4, 1e-4, 25e-4])


def test_covariances_are_the_variances_of_a_reading() -> None:
    signal = NOISY.model_copy(update={"gyroscope_resolution": 0.02, "gyroscope_random_walk": 0.0})
    read = measure(signal, at_rest(600.0))
    rate = read.rate_covariance.reshape(3, 3)
    np.testing.assert_allclose(rate, np.eye(3) * (1e-3**2 * 100.0 + 0.02**2 / 12.0))
    np.testing.assert_allclose(read.readings.angular_velocity.var(axis=0), np.diag(rate), rtol=0.03)
    force = read.force_covariance.reshape(3, 3)
    np.testing.assert_allclose(np.diag(force), np.array([4e-6, 4e-6, 16e-6]) * 100.0)


def test_a_sensor_without_attitude_says_so_as_ros_does() -> None:
    read = measure(ImuSignal(no_attitude=True), at_rest(1.0))
    assert read.attitude_covariance.tolist() == [-1.0, *[0.0] * 8]
    assert (read.readings.quaternion_wxyz == [1.0, 0.0, 0.0, 0.0]).all()
