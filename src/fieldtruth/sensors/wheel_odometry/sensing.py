# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of tachometers, and wheel odometry: dead reckoning from the angles of the wheels.

The model is that of a skid-steered or differential robot, as in ``diff_drive_controller``, the driver of a real Husky:
a side's advance is the mean of its wheels, the robot turns by the difference of the sides over the effective track, and
moves on an arc from one reading to the next. Slip is what it does not see, so its error is that of a real robot.
"""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.robot import skid_compensation
from fieldtruth.drive.steps import steps_at_rate
from fieldtruth.drive.track import Motion, Stamps, TachometerReadings, WheelMotion, WheelOdometry
from fieldtruth.experiment.robot_config import WheelConfig


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


def read_odometry(stamps_ns: Stamps, wheels: WheelMotion, config: WheelConfig, rate_hz: float) -> WheelOdometry:
    """Return wheel odometry for the rotation of the wheels at every physics step, which has these stamps [ns]."""
    rows = steps_at_rate(rate_hz, int(stamps_ns[-1])) - 1
    read = WheelMotion(angle=wheels.angle[rows], speed=wheels.speed[rows])
    return DeadReckoning(config).extend(stamps_ns[rows], read)


def read_tachometers(motion: Motion, wheel_speed: Array, rate_hz: float) -> TachometerReadings:
    """Return the readings of ``wheel_speed`` (n, 4) [rad/s], given at every physics step."""
    rows = steps_at_rate(rate_hz, int(motion.stamps_ns[-1])) - 1
    return TachometerReadings(stamps_ns=motion.stamps_ns[rows], wheel_speed=wheel_speed[rows])
