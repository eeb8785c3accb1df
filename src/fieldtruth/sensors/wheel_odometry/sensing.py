# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of tachometers, and wheel odometry: dead reckoning from the angles of the wheels, true or measured.

The model is that of a skid-steered or differential robot, as in ``diff_drive_controller``, the driver of a real Husky:
a side's advance is the mean of its wheels, the robot turns by the difference of the sides over the effective track, and
moves on an arc from one reading to the next. Slip is what it does not see, so its error is that of a real robot.

Readings of real wheel encoders are made from the true angles of the wheels, arrays to arrays, in one piece or as they
come. docs/imu_signal.md has the formulas of radii, counts and covariances. Each count has an error that is even over
one step q, with the variance q^2 / 12. An angle is the difference of two counts, the first at the start, and so is a
change: q^2 / 6 for both.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import skid_compensation
from fieldtruth.drive.track import STEP_NS, Stamps, WheelMotion, steps_at_rate
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig, WheelSignal


def effective_track(wheels: WheelConfig) -> float:
    """Distance [m] between the wheels of a robot that turns without skidding as fast as this one."""
    return 2 * wheels.half_track * skid_compensation(wheels)


def advance(turned: Array, wheels: WheelConfig) -> tuple[Array, Array]:
    """Advance (n,) [m] and turn (n,) [rad] of the robot for the angles (n, m) [rad] by which its wheels turn."""
    left, right = (wheels.radius * turned[:, side::2].mean(axis=1) for side in (0, 1))
    return (left + right) / 2, (right - left) / effective_track(wheels)


@dataclass(frozen=True, kw_only=True)
class WheelOdometry:
    """Dead reckoning from the angles of the wheels; units and columns as in ``WheelMotion``."""

    stamps_ns: Stamps
    wheels: WheelMotion
    pose: Array
    """(n, 3): x, y [m] and yaw [rad] of base_link in the frame odom, which is base_link's at time 0."""
    twist: Array
    """(n, 2): mean forward speed [m/s] and turn rate [rad/s] since the reading before."""


class DeadReckoning:
    """Wheel odometry that goes on from call to call, from the start of a drive: readings do not depend on the cuts."""

    def __init__(self, config: WheelConfig) -> None:
        self._config = config
        self._angle: Array = np.zeros((1, len(config.names)))
        self._stamp_ns = 0
        self._pose: Array = np.full((1, 3), -0.0)  # so that the first sum has the sign of a zero

    def extend(self, stamps_ns: Stamps, wheels: WheelMotion) -> WheelOdometry:
        """Return odometry for the angles of the wheels at the next stamps (n,) [ns]; they are 0 at time 0."""
        forward, turn = advance(np.diff(wheels.angle, axis=0, prepend=self._angle), self._config)
        yaw = np.cumsum(np.append(self._pose[:, 2], turn))[1:]
        middle, chord = yaw - turn / 2, forward * np.sinc(turn / (2 * np.pi))
        moves = np.column_stack([chord * np.cos(middle), chord * np.sin(middle)])
        pose = np.column_stack([np.cumsum(np.vstack([self._pose[:, :2], moves]), axis=0)[1:], yaw])
        seconds = np.diff(stamps_ns, prepend=self._stamp_ns) / 1e9
        if len(stamps_ns):
            self._angle, self._stamp_ns, self._pose = wheels.angle[-1:].copy(), int(stamps_ns[-1]), pose[-1:].copy()
        twist = np.column_stack([forward, turn]) / seconds[:, None]
        return WheelOdometry(stamps_ns=stamps_ns, wheels=wheels, pose=pose, twist=twist)


@dataclass(frozen=True, kw_only=True)
class TachometerReadings:
    """Angular speed of each wheel (n, wheels) [rad/s], positive forwards."""

    stamps_ns: Stamps
    wheel_speed: Array


class TrueWheels(NamedTuple):
    """Readings of ideal encoders, and the angles (n, wheels) [rad] at the stamps of the tachometers."""

    tachometers: TachometerReadings
    odometry: WheelOdometry
    slow_angle: Array


class WheelTruth:
    """Readings of ideal encoders, which go on as a motion grows.

    Args:
        config: rates of the readings.
        wheels: of the robot.
    """

    def __init__(self, config: WheelOdometryConfig, wheels: WheelConfig) -> None:
        self._config, self._reckoning, self._until_ns = config, DeadReckoning(wheels), 0

    def extend(self, stamps_ns: Stamps, turned: WheelMotion) -> TrueWheels:
        """Return the readings that are due since the call before, of wheels that turned so at these stamps [ns]."""
        config, end_ns = self._config, int(stamps_ns[-1])
        first = int(stamps_ns[0]) // STEP_NS
        rates = config.tachometer_rate_hz, config.rate_hz
        slow, fast = (steps_at_rate(rate, end_ns, self._until_ns) - first for rate in rates)
        self._until_ns = end_ns
        read = WheelMotion(angle=turned.angle[fast], speed=turned.speed[fast])
        return TrueWheels(
            TachometerReadings(stamps_ns=stamps_ns[slow], wheel_speed=turned.speed[slow]),
            self._reckoning.extend(stamps_ns[fast], read),
            turned.angle[slow],
        )


_SMALL: Final = 1e-4
"""Error of a radius for which differences of poses are taken."""
_PLANAR: Final = np.array([0, 1, 5])
"""x, y and yaw among the axes of a covariance of ROS."""
_FORWARD_TURN: Final = np.array([0, 5])


class MeasuredWheels(NamedTuple):
    """Readings of real encoders, and covariances (n, 36) of the pose and the twist of odometry, row by row."""

    tachometers: TachometerReadings
    odometry: WheelOdometry
    pose_covariance: Array
    twist_covariance: Array


@dataclass
class _Last:
    """Angles (1, wheels) [rad] and stamp [ns] of the reading before."""

    angle: Array
    stamp_ns: int = 0


class WheelErrors:
    """Errors of real encoders, which go on from call to call: readings do not depend on how their series are cut.

    Args:
        wheels: the robot's wheels, with the radius that it assumes.
        signal: figures of the encoders.
        rng: used in the order of the docstring of this module.
    """

    def __init__(self, wheels: WheelConfig, signal: WheelSignal, rng: np.random.Generator) -> None:
        of_radii, of_phases = rng.spawn(2)
        count = len(wheels.names)
        self._wheels, self._signal = wheels, signal
        self._errors: Array = signal.radius_error * of_radii.standard_normal(count)
        self._phases: Array = of_phases.random((count,))
        self._tachometers, self._odometry = _Last(np.zeros((1, count))), _Last(np.zeros((1, count)))
        self._reckoning = DeadReckoning(wheels)
        scales = np.ones((count, count)) + _SMALL * np.eye(count)
        self._varied = [
            [(scale, DeadReckoning(wheels)) for scale in pair] for pair in zip(scales, 2.0 - scales, strict=True)
        ]

    def extend(self, true: TrueWheels) -> MeasuredWheels:
        """Return what real encoders read where ideal ones have these readings, the next of their series."""
        tachometers, odometry, slow_angle = true
        speed = self._read(self._tachometers, tachometers.stamps_ns, slow_angle).speed
        stamps = odometry.stamps_ns
        seconds = np.diff(stamps, prepend=self._odometry.stamp_ns) / 1e9
        read = self._reckoning.extend(stamps, self._read(self._odometry, stamps, odometry.wheels.angle))
        return MeasuredWheels(replace(tachometers, wheel_speed=speed), read, *self._covariances(read, seconds))

    def _read(self, last: _Last, stamps_ns: Stamps, true_angle: Array) -> WheelMotion:
        angle = counted(true_angle / (1.0 + self._errors), self._signal.counts_per_revolution, self._phases)
        steps = np.diff(angle, axis=0, prepend=last.angle)
        seconds = np.diff(stamps_ns, prepend=last.stamp_ns) / 1e9
        if len(stamps_ns):
            last.angle, last.stamp_ns = angle[-1:].copy(), int(stamps_ns[-1])
        return WheelMotion(angle=angle, speed=steps / seconds[:, None])

    def _covariances(self, odometry: WheelOdometry, seconds: Array) -> tuple[Array, Array]:
        """Return covariances (n, 36) of the pose and of the twist."""
        wheels, signal = self._wheels, self._signal
        pose, twist = (np.zeros((len(odometry.stamps_ns), 6, 6)) for _ in range(2))
        of_pose, of_twist = self._by_radii(odometry)
        if signal.counts_per_revolution is not None:
            variance = (2.0 * math.pi / signal.counts_per_revolution) ** 2 / 6.0 * wheels.radius**2
            # The mean of all wheels, and the difference of the means of two sides.
            count = odometry.wheels.angle.shape[1]
            forward, turn = variance / count, 4.0 * variance / count / effective_track(wheels) ** 2
            of_pose += np.diag([forward, forward, turn])
            of_twist += np.diag([forward, turn]) / seconds[:, None, None] ** 2
        pose[:, _PLANAR[:, None], _PLANAR] += of_pose
        twist[:, _FORWARD_TURN[:, None], _FORWARD_TURN] += of_twist
        return pose.reshape(-1, 36), twist.reshape(-1, 36)

    def _by_radii(self, odometry: WheelOdometry) -> tuple[Array, Array]:
        """Return covariances (n, 3, 3) of the pose and (n, 2, 2) of the twist by unknown radii of the wheels."""
        count, own, deviation = len(odometry.stamps_ns), odometry.wheels, self._signal.radius_error
        of_pose, of_twist = np.zeros((count, 3, 3)), np.zeros((count, 2, 2))
        for pair in self._varied if deviation else ():
            more, less = (
                reckoning.extend(odometry.stamps_ns, WheelMotion(angle=own.angle * scale, speed=own.speed))
                for scale, reckoning in pair
            )
            by_pose, by_twist = (
                (a - b) / (2.0 * _SMALL) for a, b in ((more.pose, less.pose), (more.twist, less.twist))
            )
            of_pose += deviation**2 * by_pose[:, :, None] * by_pose[:, None, :]
            of_twist += deviation**2 * by_twist[:, :, None] * by_twist[:, None, :]
        return of_pose, of_twist


def counted(angle: Array, counts_per_revolution: int | None, phases: Array) -> Array:
    """Return angles (n, wheels) [rad] as encoders count them; None: as they are."""
    if counts_per_revolution is None:
        return angle
    step = 2.0 * math.pi / counts_per_revolution
    return np.asarray(np.floor(angle / step + phases) * step)
