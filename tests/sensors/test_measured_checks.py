# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The checks of clocks and noise pass what the package makes, and find each figure that is wrong."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fieldtruth.bag.reader import RawMessage
from fieldtruth.drive.track import stamps_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import ClockConfig
from fieldtruth.record.streams import read_clock
from fieldtruth.sensors.imu.check import ImuNoise
from fieldtruth.sensors.imu.config import ImuSignal
from fieldtruth.sensors.imu.sensing import ImuErrors, ImuReadings, Triad
from fieldtruth.sensors.wheel_odometry.check import WheelNoise
from fieldtruth.validation.check import Check, Spec, Tally
from fieldtruth.validation.streams import Clocks

RATE = 200.0
STAMPS = stamps_at_rate(RATE, 60 * 10**9)
OF_IMU = stamps_at_rate(RATE, 20 * 10**9)
SIGNAL = {
    "gyroscope_noise_density": 1e-3,
    "gyroscope_random_walk": 1e-5,
    "gyroscope_bias": 0.02,
    "gyroscope_scale_error": 0.01,
    "gyroscope_resolution": 1e-3,
    "accelerometer_noise_density": 2e-3,
    "accelerometer_bias": 0.05,
    "accelerometer_range": 30.0,
    "roll_pitch_error": 0.01,
    "yaw_error": 0.02,
}


def context(rig: Rig, *topics: str) -> Any:
    run = SimpleNamespace(counts=dict.fromkeys(topics, 1), end_ns=int(STAMPS[-1]))
    own = tuple(topic for sensor in rig.sensors for topic in sensor.topics())

    def tally(spec: Spec) -> Tally:
        return Tally(spec, strict=True)

    return SimpleNamespace(rig=rig, run=run, topics=own, tally=tally)


def header(stamp: int) -> Any:
    return SimpleNamespace(stamp=SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9))


def vector(row: Any, names: str = "xyz") -> Any:
    return SimpleNamespace(**dict(zip(names, row.tolist(), strict=True)))


def feed(checker: Any, topic: str, stamps: Any, message: Callable[[int], Any]) -> None:
    for k, stamp in enumerate(stamps):
        checker.see(RawMessage(int(stamp), topic, "", b""), message(k))


def finished(checker: Any) -> Check:
    checker.finish()
    [tally] = checker.tallies
    result: Check = tally.result()
    return result


CLOCK = ClockConfig(offset_s=0.02, drift_ppm=50.0, jitter_s=1e-4, drop_share=0.05)


def check_clock(made: ClockConfig, break_stamp: int = 0) -> Check:
    """Check messages of a clock against another one in the experiment."""
    sensor = {"kind": "imu", "rate_hz": RATE, "clock": CLOCK.model_dump()}
    checker = Clocks(context(Rig.model_validate({"sensors": [sensor]}), "/imu/data", "/imu/data/truth"))
    clock = read_clock(STAMPS, made, np.random.default_rng(2))
    shown = clock.shown_ns.copy()
    shown[clock.kept[100]] += break_stamp
    feed(checker, "/imu/data", STAMPS[clock.kept], lambda k: SimpleNamespace(header=header(int(shown[clock.kept[k]]))))
    return finished(checker)


def test_the_clock_of_the_experiment_passes() -> None:
    assert check_clock(CLOCK).passed


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"offset_s": 0.02001}, "mean zero"),
        ({"offset_s": -0.02}, "shows the true time"),
        ({"drift_ppm": 51.0}, "mean zero"),
        ({"drift_ppm": -50.0}, "shows the true time"),
        ({"jitter_s": 1.1e-4}, "has its deviation"),
        ({"drop_share": 0.07}, "share of lost"),
        ({"drop_share": 0.0}, "share of lost"),
    ],
)
def test_another_clock_fails(change: dict[str, float], rule: str) -> None:
    result = check_clock(CLOCK.model_copy(update=change))
    assert result.passed is False
    assert rule in result.text


def test_a_stamp_that_falls_fails() -> None:
    assert "clock of a sensor rises" in check_clock(CLOCK, -6_000_000).text


def moving() -> ImuReadings:
    t = OF_IMU[:, None] / 1e9
    turn = np.hstack([np.sin(t), np.cos(0.7 * t), 0.5 * np.sin(0.3 * t)])
    force = np.hstack([np.sin(2.0 * t), np.cos(1.3 * t), 9.81 + np.sin(0.9 * t)])
    attitude = np.tile([0.5, 0.5, 0.5, 0.5], (len(t), 1))
    return ImuReadings(stamps_ns=OF_IMU, quaternion_wxyz=attitude, angular_velocity=turn, linear_acceleration=force)


def check_imu(made: dict[str, Any], change: Callable[[ImuReadings], None] = lambda _: None) -> Check:
    """Check readings with figures against those of an experiment with ``SIGNAL``."""
    sensor = {"kind": "imu", "rate_hz": RATE, "signal": SIGNAL}
    checker = ImuNoise(context(Rig.model_validate({"sensors": [sensor]}), "/imu/data", "/imu/data/truth"))
    true = moving()
    read = ImuErrors(ImuSignal(**(SIGNAL | made)), RATE, np.random.default_rng(4)).extend(true)
    change(read.readings)
    due = [
        np.diag(Triad.of(ImuSignal(**(SIGNAL | made)), t).variances(RATE)).ravel()
        for t in ("gyroscope", "accelerometer")
    ]

    def message(readings: ImuReadings) -> Callable[[int], Any]:
        return lambda k: SimpleNamespace(
            orientation=vector(readings.quaternion_wxyz[k], "wxyz"),
            angular_velocity=vector(readings.angular_velocity[k]),
            linear_acceleration=vector(readings.linear_acceleration[k]),
            angular_velocity_covariance=due[0],
            linear_acceleration_covariance=due[1],
        )

    feed(checker, "/imu/data", OF_IMU, message(read.readings))
    feed(checker, "/imu/data/truth", OF_IMU, message(true))
    return finished(checker)


def test_the_signal_of_the_experiment_passes() -> None:
    result = check_imu({})
    assert result.passed, result.text


@pytest.mark.parametrize(
    ("made", "rule"),
    [
        ({"accelerometer_noise_density": 2.2e-3}, "noise has its deviation"),
        ({"accelerometer_noise_density": 1.8e-3}, "noise has its deviation"),
        ({"gyroscope_bias": 2.0}, "bias has the order"),
        ({"gyroscope_resolution": 1.1e-3}, "steps of its resolution"),
        ({"yaw_error": 0.5}, "error of the attitude"),
        ({"gyroscope_noise_density": 1.001e-3}, "covariances"),
    ],
)
def test_another_signal_fails(made: dict[str, Any], rule: str) -> None:
    result = check_imu(made)
    assert result.passed is False
    assert rule in result.text


def test_readings_out_of_range_and_with_a_wrong_sign_fail() -> None:
    def beyond(readings: ImuReadings) -> None:
        readings.linear_acceleration[7] = 31.0

    def mirrored(readings: ImuReadings) -> None:
        readings.linear_acceleration[:] *= -1.0

    assert "within its range" in check_imu({}, beyond).text
    assert "bias has the order" in check_imu({}, mirrored).text


def check_wheels(angle: Any) -> Check:
    """Check angles against wheels that turn evenly, for encoders of 100 counts and radii known to 1 %."""
    signal = {"counts_per_revolution": 100, "radius_error": 0.01}
    rig = Rig.model_validate({"sensors": [{"kind": "wheel_odometry", "signal": signal}]})
    checker = WheelNoise(context(rig, "/joint_states", "/joint_states/truth"))
    true = np.outer(STAMPS / 1e9, (1.0, 2.0, 1.0, 2.0))
    for topic, rows in (("/joint_states", angle(true)), ("/joint_states/truth", true)):
        feed(checker, topic, STAMPS, lambda k, rows=rows: SimpleNamespace(position=rows[k]))  # type: ignore[misc]
    return finished(checker)


STEP = 2.0 * np.pi / 100.0


def test_counts_of_real_wheels_pass_and_others_fail() -> None:
    assert check_wheels(lambda true: np.floor(true * 1.012 / STEP + 0.3) * STEP).passed
    assert "whole counts" in check_wheels(lambda true: true).text
    assert "what their radii" in check_wheels(lambda true: np.floor(true * 1.1 / STEP) * STEP).text
    assert "what their radii" in check_wheels(lambda true: np.floor(-true / STEP) * STEP).text
    assert "at most a count" in check_wheels(lambda true: np.floor((true + 0.2 * np.sin(true)) / STEP) * STEP).text
