# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of tachometers, and wheel odometry: dead reckoning from the angles of the wheels.

The model is that of a skid-steered or differential robot, as in ``diff_drive_controller``, the driver of a real Husky:
a side's advance is the mean of its wheels, the robot turns by the difference of the sides over the effective track, and
moves on an arc from one reading to the next. Slip is what it does not see, so its error is that of a real robot.
"""

from typing import NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.physics import skid_compensation
from fieldtruth.drive.track import STEP_NS, Stamps, TachometerReadings, WheelMotion, WheelOdometry, steps_at_rate
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig


def effective_track(wheels: WheelConfig) -> float:
    """Distance [m] between the wheels of a robot that turns without skidding as fast as this one."""
    return 2 * wheels.half_track * skid_compensation(wheels)


def advance(turned: Array, wheels: WheelConfig) -> tuple[Array, Array]:
    """Advance (n,) [m] and turn (n,) [rad] of the robot for the angles (n, m) [rad] by which its wheels turn."""
    left, right = (wheels.radius * turned[:, side::2].mean(axis=1) for side in (0, 1))
    return (left + right) / 2, (right - left) / effective_track(wheels)


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
