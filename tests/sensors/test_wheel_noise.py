# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of real encoders against closed forms: counts, radii, arcs, and the covariance of odometry."""

import copy
import math
from collections.abc import Iterable

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.drive.track import WheelMotion, stamps_at_rate
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig, WheelSignal
from fieldtruth.sensors.wheel_odometry.sensing import (
    DeadReckoning,
    MeasuredWheels,
    TachometerReadings,
    TrueWheels,
    WheelErrors,
    WheelTruth,
    counted,
    effective_track,
)

Floats = NDArray[np.float64]
WHEELS = RobotConfig().wheels
STEPS = stamps_at_rate(1000.0, 20 * 10**9)


def driven(left: float, right: float) -> TrueWheels:
    """Wheels that turn evenly [rad/s] for 20 s."""
    speed = np.tile((left, right, left, right), (len(STEPS), 1))
    wheels = WheelMotion(angle=speed * (STEPS[:, None] / 1e9), speed=speed)
    return WheelTruth(WheelOdometryConfig(), WHEELS).extend(STEPS, wheels)


def measure(base: TrueWheels, seed: int = 0, *, counts: int | None = None, radii: float = 0.0) -> MeasuredWheels:
    signal = WheelSignal(counts_per_revolution=counts, radius_error=radii)
    return WheelErrors(WHEELS, signal, np.random.default_rng(seed)).extend(base)


def test_without_figures_nothing_differs_but_speeds_are_differences() -> None:
    base = driven(2.0, 3.0)
    read = measure(base)
    np.testing.assert_array_equal(read.odometry.pose, base.odometry.pose)
    np.testing.assert_array_equal(read.odometry.wheels.angle, base.odometry.wheels.angle)
    np.testing.assert_allclose(read.odometry.wheels.speed, base.odometry.wheels.speed, rtol=1e-9)
    np.testing.assert_allclose(read.tachometers.wheel_speed, base.tachometers.wheel_speed, rtol=1e-9)
    assert not read.pose_covariance.any()
    assert not read.twist_covariance.any()


@pytest.mark.parametrize("cuts", [(1, 2, 3), (20,), range(1, 1000)])
def test_readings_do_not_depend_on_how_a_drive_is_cut(cuts: Iterable[int]) -> None:
    base, signal = driven(2.0, 3.1), WheelSignal(counts_per_revolution=512, radius_error=0.01)
    whole = measure(base, 3, counts=512, radii=0.01)
    noise, parts = WheelErrors(WHEELS, signal, np.random.default_rng(3)), list[MeasuredWheels]()
    none = TachometerReadings(stamps_ns=STEPS[:0], wheel_speed=np.zeros((0, 4)))
    true, ideal = base.odometry, DeadReckoning(WHEELS)
    for rows in np.split(np.arange(len(true.stamps_ns)), list(cuts)):
        noise = copy.deepcopy(noise)  # a copy goes on as well
        wheels = WheelMotion(angle=true.wheels.angle[rows], speed=true.wheels.speed[rows])
        part = ideal.extend(true.stamps_ns[rows], wheels)
        np.testing.assert_array_equal(part.pose, true.pose[rows])
        np.testing.assert_array_equal(part.twist, true.twist[rows])
        parts.append(noise.extend(TrueWheels(none, part, np.zeros((0, 4)))))
    for name in ("pose_covariance", "twist_covariance"):
        np.testing.assert_array_equal(np.concatenate([getattr(part, name) for part in parts]), getattr(whole, name))
    for name in ("pose", "twist"):
        cut = np.concatenate([getattr(part.odometry, name) for part in parts])
        np.testing.assert_array_equal(cut, getattr(whole.odometry, name))


def test_counts() -> None:
    angle = np.array([[-0.1], [0.0], [0.1], [1.0], [1.6]])
    quarter = math.pi / 2.0
    np.testing.assert_allclose(counted(angle, 4, np.array([0.0])), [[-quarter], [0.0], [0.0], [0.0], [quarter]])
    np.testing.assert_allclose(counted(angle, 4, np.array([0.5])), [[0.0], [0.0], [0.0], [quarter], [quarter]])
    assert counted(angle, None, np.array([0.5])) is angle


def test_angles_are_whole_counts_that_follow_the_wheel_and_speeds_are_their_differences() -> None:
    base, step = driven(2.0, -3.0), 2.0 * math.pi / 512
    read = measure(base, counts=512)
    counts = read.odometry.wheels.angle / step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    error = read.odometry.wheels.angle - base.odometry.wheels.angle
    assert np.abs(error).max() <= step * (1.0 + 1e-9)
    assert error.std(axis=0) == pytest.approx(step / math.sqrt(12.0), rel=0.1)  # even over a step
    before = np.vstack([np.zeros(4), read.odometry.wheels.angle[:-1]])
    np.testing.assert_allclose(read.odometry.wheels.speed, (read.odometry.wheels.angle - before) * 50.0, atol=1e-9)
    slow = read.tachometers.wheel_speed / (step * 10.0)  # counts in a tenth of a second
    np.testing.assert_allclose(slow, np.rint(slow), atol=1e-9)
    assert abs(slow[:, 0].mean() * step * 10.0 - 2.0) < step


def test_a_larger_wheel_turns_less() -> None:
    base = driven(2.0, 2.0)
    read = measure(base, 4, radii=0.02)
    shares = base.odometry.wheels.angle[-1] / read.odometry.wheels.angle[-1] - 1.0
    same = base.odometry.wheels.angle / read.odometry.wheels.angle - 1.0
    np.testing.assert_allclose(same, np.tile(shares, (len(same), 1)), atol=1e-9)
    drawn = [
        base.odometry.wheels.angle[-1] / measure(base, k, radii=0.02).odometry.wheels.angle[-1] for k in range(300)
    ]
    assert (np.array(drawn) - 1.0).std() == pytest.approx(0.02, rel=0.1)
    # Borenstein and Feng: unequal wheels bend a straight drive to a circle, R = track * mean / difference.
    left, right = (float(np.mean(1.0 / (1.0 + shares[side::2]))) for side in (0, 1))
    turn = (right - left) * 2.0 * 20.0 * WHEELS.radius / effective_track(WHEELS)
    assert read.odometry.pose[-1, 2] == pytest.approx(turn, rel=1e-9)
    radius = effective_track(WHEELS) * (left + right) / 2.0 / (right - left)
    x, y = read.odometry.pose[-1, :2]
    assert (x, y) == pytest.approx((radius * math.sin(turn), radius * (1.0 - math.cos(turn))), rel=1e-6)


def test_the_covariance_is_that_of_many_robots() -> None:
    base = driven(2.0, 2.6)
    runs = [measure(base, seed, radii=0.002).odometry for seed in range(600)]
    one = measure(base, 1, radii=0.002)
    for k in (200, 999):
        stated = one.pose_covariance[k].reshape(6, 6)
        sampled = np.cov(np.array([run.pose[k] for run in runs]).T)
        found = stated[np.ix_([0, 1, 5], [0, 1, 5])]
        scale = np.sqrt(np.outer(np.diag(sampled), np.diag(sampled)))
        np.testing.assert_allclose(found / scale, sampled / scale, atol=0.12)
        stated = one.twist_covariance[k].reshape(6, 6)
        sampled = np.cov(np.array([run.twist[k] for run in runs]).T)
        np.testing.assert_allclose(np.diag(stated)[[0, 5]], np.diag(sampled), rtol=0.15)


def test_the_covariance_of_counts_is_that_of_many_phases() -> None:
    """Mean over a second, because a single angle is nearer to one count than to the next."""
    base, some = driven(2.0, 2.6), slice(20, 70)
    runs = [measure(base, seed, counts=256).odometry for seed in range(200)]
    one = measure(base, counts=256)
    stated = (one.pose_covariance[some].reshape(-1, 6, 6)).mean(axis=0).diagonal()
    poses = np.array([run.pose[some] for run in runs])
    assert poses.var(axis=0).mean(axis=0)[[0, 2]] == pytest.approx(stated[[0, 5]], rel=0.1)
    stated = (one.twist_covariance[some].reshape(-1, 6, 6)).mean(axis=0).diagonal()
    errors = np.array([run.twist[some] for run in runs]) - base.odometry.twist[some]
    assert (errors**2).mean(axis=(0, 1)) == pytest.approx(stated[[0, 5]], rel=0.2)
