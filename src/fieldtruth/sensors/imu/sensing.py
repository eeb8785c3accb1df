# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of an inertial measurement unit: a pure function of the true motion; and those of a real one.

True readings are means over the interval that ends at the stamp, as ``ImuReadings`` states: their sums are attitude and
velocity, and a short drive equals the start of a long one. Means of the rotating body's angular velocity and specific
force would miss coning and sculling (Savage, Strapdown Inertial Navigation Integration Algorithm Design, Journal of
Guidance, Control, and Dynamics 21, 1998); the rotation vector and the change of velocity of the interval contain both.

Readings of a real IMU are made from the true ones, arrays to arrays, in one piece or as they come. docs/imu_signal.md
has the formulas and their sources; with u the true reading of a triad

    measured = quantised(limited((1 + S + M) u + bias + white)).
"""

import math
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.random import GaussMarkov
from fieldtruth.core.transforms import (
    quaternion_wxyz_from_rotation,
    rotation_from_quaternion_wxyz,
    wxyz_from_xyzw,
    xyzw_from_wxyz,
)
from fieldtruth.drive.track import STEP_NS, STEP_S, Motion, Stamps, steps_at_rate
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.sensors.imu.config import Axes, ImuConfig, ImuSignal


@dataclass(frozen=True, kw_only=True)
class ImuReadings:
    """Readings in the IMU's frame (REP-145): orientation is world_from_imu; at rest the acceleration is +g upwards.

    Reading k is the mean over the interval (begin, stamp k]: ``angular_velocity`` is the rotation vector from begin to
    the stamp divided by the interval, and ``linear_acceleration`` the change of velocity, less that of gravity, divided
    by the interval and expressed in its frame at the stamp. With ``sampling: mean`` the interval begins at the stamp
    before, so that with R the attitude (3, 3) these two lines integrate without error::

        R = R @ exp(angular_velocity * dt)
        v = v + (R @ linear_acceleration - (0, 0, 9.81)) * dt

    With ``sampling: instant`` the interval is one step of the physics. That of the first reading begins with the first
    state.
    """

    stamps_ns: Stamps
    quaternion_wxyz: Array  # (n, 4)
    angular_velocity: Array  # (n, 3) [rad/s], in the IMU's frame
    linear_acceleration: Array  # (n, 3) [m/s^2], specific force in the IMU's frame


class ImuTruth:
    """Readings of an ideal IMU, which go on as a motion grows."""

    def __init__(self, config: ImuConfig) -> None:
        self._config = config
        self._until_ns, self._last = 0, 1  # time that was reached, and step of the last reading

    def extend(self, motion: Motion) -> ImuReadings:
        """Return attitude, mean angular velocity and mean specific force in imu_link (REP-145), lever arm included.

        They are the readings that are due since the call before; the motion has the rows since the last of these.
        """
        config, end_ns = self._config, int(motion.stamps_ns[-1])
        steps = steps_at_rate(config.rate_hz, end_ns, self._until_ns)
        first = int(motion.stamps_ns[0]) // STEP_NS
        rows = steps - first
        starts, ends = imu_intervals(rows, max(self._last - first, 0), len(motion.stamps_ns), config)
        self._until_ns, self._last = end_ns, int(steps[-1]) if len(steps) else self._last
        base_from_imu = config.mount.base_from_sensor
        attitude, ended = motion.quaternion_wxyz[rows], motion.quaternion_wxyz[ends]
        world_from_imu = rotation_from_quaternion_wxyz(attitude) @ base_from_imu[:3, :3]
        seconds = np.maximum(ends - starts, 1)[:, None] * STEP_S
        velocity, velocity_before = (point_velocity(motion, k, base_from_imu[:3, 3]) for k in (ends, starts))
        specific_force = (velocity - velocity_before) / seconds + (0.0, 0.0, GRAVITY)
        turned = rotation_vector(motion.quaternion_wxyz[starts], ended) / seconds
        # One row alone is rounded by BLAS otherwise than among many.
        turn_rate = np.concatenate([turned, turned[:1]]) @ base_from_imu[:3, :3]
        return ImuReadings(
            stamps_ns=motion.stamps_ns[rows],
            quaternion_wxyz=quaternion_wxyz_from_rotation(world_from_imu).reshape(-1, 4),
            angular_velocity=turn_rate[: len(rows)],
            linear_acceleration=np.einsum("nji,nj->ni", world_from_imu, specific_force),
        )


def read_imu(motion: Motion, config: ImuConfig) -> ImuReadings:
    """Return all readings of an ideal IMU along a motion; see ``ImuTruth.extend``."""
    return ImuTruth(config).extend(motion)


def imu_intervals(rows: Counts, before: int, count: int, config: ImuConfig) -> tuple[Counts, Counts]:
    """First and last row of the motion of the intervals (n,) over which the readings at ``rows`` (n,) are means.

    The motion has ``count`` rows, and ``before`` is that of the reading before. No reading is at time 0, so that the
    first reading begins at the first row. A reading at the first row itself has the interval of the next one; the robot
    starts at rest.
    """
    ends = np.clip(rows, 1, count - 1)
    starts = np.concatenate([[before], rows])[:-1] if config.sampling == "mean" else rows - 1
    return np.clip(starts, 0, np.maximum(ends - 1, 0)), ends


def rotation_vector(before_wxyz: Array, after_wxyz: Array) -> Array:
    """Rotation vectors (n, 3) [rad], in the turning frame, between attitudes (n, 4)."""
    before, after = (Rotation.from_quat(xyzw_from_wxyz(q)) for q in (before_wxyz, after_wxyz))
    vectors: Array = (before.inv() * after).as_rotvec()
    return vectors


def point_velocity(motion: Motion, rows: NDArray[np.int64], lever_base: Array) -> Array:
    """World velocity (n, 3) [m/s] at ``rows`` of the point ``lever_base`` (3,) [m] that is fixed in base_link."""
    lever = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]) @ lever_base
    velocity: Array = motion.linear_velocity[rows] + np.cross(motion.angular_velocity[rows], lever)
    return velocity


FLICKER_TIMES_S: Final = tuple(4.0**n for n in range(7))
"""Correlation times [s] of the processes whose sum is flicker noise."""
BOTTOM: Final = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise with B = 1: IEEE Std 952, C.1.2."""


class Triad(NamedTuple):
    """Figures of the three axes of gyroscope or accelerometer; arrays are (3,), in units of the readings."""

    density: Array
    walk: Array
    bottom: Array
    bias: Array
    scale: float
    misalignment: float
    range: float | None
    resolution: float | None

    @classmethod
    def of(cls, signal: ImuSignal, triad: str) -> "Triad":
        """Figures of ``gyroscope`` or ``accelerometer``."""

        def figure(name: str) -> Any:
            return getattr(signal, f"{triad}_{name}")

        density, walk, bottom, bias = (
            axes_of(figure(name)) for name in ("noise_density", "random_walk", "bias_instability", "bias")
        )
        others = (figure(name) for name in ("scale_error", "misalignment", "range", "resolution"))
        return cls(density, walk, bottom, bias, *others)

    def variances(self, rate_hz: float) -> Array:
        """Variances (3,) of the part of a reading's error that no other reading has: white noise and rounding."""
        rounding = 0.0 if self.resolution is None else self.resolution**2 / 12.0
        variances: Array = self.density**2 * rate_hz + rounding
        return variances


class MeasuredImu(NamedTuple):
    """Readings of a real IMU, and the covariances (9,) of its messages, row by row: 0 is unknown."""

    readings: ImuReadings
    attitude_covariance: Array  # [rad^2], about the axes of the world
    rate_covariance: Array  # [rad^2/s^2]
    force_covariance: Array  # [m^2/s^4]


class ImuErrors:
    """Errors of a real IMU, which go on from call to call: readings do not depend on how their series is cut.

    Args:
        signal: figures of the IMU.
        rate_hz: of the readings.
        rng: of the experiment's seed and the IMU's name.
    """

    def __init__(self, signal: ImuSignal, rate_hz: float, rng: np.random.Generator) -> None:
        of_gyroscope, of_accelerometer, of_attitude = rng.spawn(3)
        triads = Triad.of(signal, "gyroscope"), Triad.of(signal, "accelerometer")
        self._gyroscope = TriadErrors(triads[0], rate_hz, of_gyroscope)
        self._accelerometer = TriadErrors(triads[1], rate_hz, of_accelerometer)
        self._no_attitude = signal.no_attitude
        self._turn = np.array([signal.roll_pitch_error, signal.roll_pitch_error, signal.yaw_error])
        self._turns = GaussMarkov(of_attitude, 3, math.exp(-1.0 / (signal.attitude_correlation_s * rate_hz)))
        attitude = np.array([-1.0, *[0.0] * 8]) if signal.no_attitude else np.diag(self._turn**2).ravel()
        rate, force = (np.diag(triad.variances(rate_hz)).ravel() for triad in triads)
        self._covariances = attitude, rate, force

    def extend(self, true: ImuReadings) -> MeasuredImu:
        """Return what the IMU reads where an ideal one has the ``true`` readings, the next of its series."""
        readings = replace(
            true,
            quaternion_wxyz=self._attitude(true.quaternion_wxyz),
            angular_velocity=self._gyroscope.extend(true.angular_velocity),
            linear_acceleration=self._accelerometer.extend(true.linear_acceleration),
        )
        return MeasuredImu(readings, *self._covariances)

    def _attitude(self, quaternion_wxyz: Array) -> Array:
        """Return the attitudes (n, 4) that the sensor states."""
        if self._no_attitude:
            return np.tile([1.0, 0.0, 0.0, 0.0], (len(quaternion_wxyz), 1))
        if not self._turn.any() or not len(quaternion_wxyz):
            return quaternion_wxyz
        turned = Rotation.from_rotvec(self._turns.draw(len(quaternion_wxyz)) * self._turn)
        return np.asarray(wxyz_from_xyzw((turned * Rotation.from_quat(xyzw_from_wxyz(quaternion_wxyz))).as_quat()))


class TriadErrors:
    """Errors of a real gyroscope or accelerometer; see ``ImuErrors``."""

    def __init__(self, triad: Triad, rate_hz: float, rng: np.random.Generator) -> None:
        fixed, self._white, slow = rng.spawn(3)
        self._triad, self._rate_hz = triad, rate_hz
        matrix = np.eye(3) + triad.misalignment * fixed.standard_normal((3, 3)) * (1.0 - np.eye(3))
        self._matrix: Array = matrix + np.diag(triad.scale * fixed.standard_normal(3))
        self._bias: Array = triad.bias * fixed.standard_normal(3)
        self._of_walk, *of_flicker = slow.spawn(1 + len(FLICKER_TIMES_S))
        self._walked = np.zeros(3)
        self._flicker = [
            GaussMarkov(own, 3, math.exp(-1.0 / (time_s * rate_hz)))
            for time_s, own in zip(FLICKER_TIMES_S, of_flicker, strict=True)
        ]

    def extend(self, true: Array) -> Array:
        """Return the readings (n, 3) whose true ones are (n, 3), the next of their series."""
        white = self._triad.density * math.sqrt(self._rate_hz) * self._white.standard_normal(true.shape)
        # Column by column: the sums of a product of matrices depend on the number of rows.
        turned = true[:, :1] * self._matrix[:, 0] + true[:, 1:2] * self._matrix[:, 1] + true[:, 2:] * self._matrix[:, 2]
        read = turned + (self._bias + self._bias_changes(len(true))) + white
        return quantised(read, self._triad.range, self._triad.resolution)

    def _bias_changes(self, count: int) -> Array:
        """Return how the bias differs (count, 3) from what it was when the sensor was turned on."""
        triad, bias = self._triad, np.zeros((count, 3))
        if triad.walk.any() and count:
            steps = self._of_walk.standard_normal((count, 3))
            steps[0] += self._walked
            walked = np.cumsum(steps, axis=0)
            self._walked = walked[-1]
            bias += walked * triad.walk / math.sqrt(self._rate_hz)
        if triad.bottom.any():
            deviation = triad.bottom / BOTTOM * math.sqrt(math.log(4.0) / math.pi)
            for process in self._flicker:
                bias += process.draw(count) * deviation
        return bias


def quantised(values: Array, limit: float | None, resolution: float | None) -> Array:
    """Return values limited to ``limit`` of either sign, as the nearest multiples of ``resolution`` within it."""
    if resolution is None:
        return values if limit is None else np.clip(values, -limit, limit)
    steps = np.rint(values / resolution)
    if limit is not None:
        most = math.floor(limit / resolution * (1.0 + 1e-12))
        steps = np.clip(steps, -most, most)
    return np.asarray(steps * resolution)


def axes_of(value: Axes) -> Array:
    """Return a figure of three axes (3,)."""
    return np.array(np.broadcast_to(np.asarray(value, np.float64), 3))
