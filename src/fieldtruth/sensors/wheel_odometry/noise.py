# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of real wheel encoders from the true angles of the wheels: arrays to arrays, for a whole drive at once.

Radii: a wheel whose radius is R (1 + e), where the robot assumes R, turns by 1 / (1 + e) of what the robot expects over
the same distance. The e are drawn once (Borenstein and Feng, Measurement and Correction of Systematic Odometry Errors
in Mobile Robots, IEEE Transactions on Robotics and Automation 12, 1996).

Counts: an encoder with c counts per revolution has passed floor(c angle / (2 pi) + phase) edges, with a phase in [0, 1)
that is drawn once. An angle is that number times 2 pi / c, a speed the change of the angle over the time between two
readings. Each count has an error that is even over one step q, with the variance q^2 / 12. An angle is the difference
of two counts, the first at the start, and so is a change: q^2 / 6 for both.

Odometry is dead reckoning from these angles. They add to its covariance, to first order: of the radii J J^T s^2,
where J is the change of the pose by each e and s the deviation of e, and of the counts that of the last angles.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.drive.track import Stamps, TachometerReadings, WheelMotion, WheelOdometry
from fieldtruth.experiment.robot_config import WheelConfig
from fieldtruth.sensors.wheel_odometry.sensing import TrueWheels, dead_reckoning, effective_track
from fieldtruth.sensors.wheel_odometry.signal import WheelSignal

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


def measured_wheels(
    base: TrueWheels, every_step: Stamps, wheels: WheelConfig, signal: WheelSignal, rng: np.random.Generator
) -> MeasuredWheels:
    """Return what real encoders read where ideal ones have the readings of ``base``.

    Args:
        base: the true angles at the stamps ``every_step`` [ns], and the ideal readings.
        every_step: see ``base``.
        wheels: the robot's wheels, with the radius that it assumes.
        signal: figures of the encoders.
        rng: used in the order of the docstring of this module.
    """
    of_radii, of_phases = rng.spawn(2)
    count = base.wheels.angle.shape[1]
    errors = signal.radius_error * of_radii.standard_normal(count)
    phases = of_phases.random((count,))

    def read(stamps_ns: Stamps) -> WheelMotion:
        rows: Counts = np.searchsorted(every_step, stamps_ns)
        angle = counted(base.wheels.angle[rows] / (1.0 + errors), signal.counts_per_revolution, phases)
        steps = np.diff(angle, axis=0, prepend=np.zeros((1, count)))
        return WheelMotion(angle=angle, speed=steps / (np.diff(stamps_ns, prepend=0)[:, None] / 1e9))

    speed = read(base.tachometers.stamps_ns).speed
    tachometers = TachometerReadings(stamps_ns=base.tachometers.stamps_ns, wheel_speed=speed)
    stamps = base.odometry.stamps_ns
    odometry = dead_reckoning(stamps, read(stamps), wheels)
    return MeasuredWheels(tachometers, odometry, *_covariances(odometry, wheels, signal))


def counted(angle: Array, counts_per_revolution: int | None, phases: Array) -> Array:
    """Return angles (n, wheels) [rad] as encoders count them; None: as they are."""
    if counts_per_revolution is None:
        return angle
    step = 2.0 * math.pi / counts_per_revolution
    return np.asarray(np.floor(angle / step + phases) * step)


def _covariances(odometry: WheelOdometry, wheels: WheelConfig, signal: WheelSignal) -> tuple[Array, Array]:
    """Return covariances (n, 36) of the pose and of the twist."""
    pose, twist = (np.zeros((len(odometry.stamps_ns), 6, 6)) for _ in range(2))
    of_pose, of_twist = _by_radii(odometry, wheels, signal.radius_error)
    if signal.counts_per_revolution is not None:
        variance = (2.0 * math.pi / signal.counts_per_revolution) ** 2 / 6.0 * wheels.radius**2
        # The mean of all wheels, and the difference of the means of two sides.
        count = odometry.wheels.angle.shape[1]
        forward, turn = variance / count, 4.0 * variance / count / effective_track(wheels) ** 2
        of_pose += np.diag([forward, forward, turn])
        seconds = np.diff(odometry.stamps_ns, prepend=0)[:, None, None] / 1e9
        of_twist += np.diag([forward, turn]) / seconds**2
    pose[:, _PLANAR[:, None], _PLANAR] += of_pose
    twist[:, _FORWARD_TURN[:, None], _FORWARD_TURN] += of_twist
    return pose.reshape(-1, 36), twist.reshape(-1, 36)


def _by_radii(odometry: WheelOdometry, wheels: WheelConfig, deviation: float) -> tuple[Array, Array]:
    """Return covariances (n, 3, 3) of the pose and (n, 2, 2) of the twist by unknown radii of the wheels."""
    count, own = len(odometry.stamps_ns), odometry.wheels
    of_pose, of_twist = np.zeros((count, 3, 3)), np.zeros((count, 2, 2))
    for wheel in range(own.angle.shape[1]) if deviation else ():
        scale = np.ones(own.angle.shape[1])
        scale[wheel] += _SMALL
        more, less = (
            dead_reckoning(odometry.stamps_ns, WheelMotion(angle=own.angle * s, speed=own.speed), wheels)
            for s in (scale, 2.0 - scale)
        )
        by_pose, by_twist = ((a - b) / (2.0 * _SMALL) for a, b in ((more.pose, less.pose), (more.twist, less.twist)))
        of_pose += deviation**2 * by_pose[:, :, None] * by_pose[:, None, :]
        of_twist += deviation**2 * by_twist[:, :, None] * by_twist[:, None, :]
    return of_pose, of_twist
