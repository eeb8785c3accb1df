# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Result of a drive: the true motion at the physics rate, and the readings of IMU, GNSS and tachometers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array

Stamps = NDArray[np.int64]
"""Simulated time (n,) [ns]."""


@dataclass(frozen=True, kw_only=True)
class Motion:
    """True motion of base_link at the physics rate; row k is the state at ``stamps_ns[k]``, the first after one step.

    ``position`` (n, 3) [m] and ``quaternion_wxyz`` (n, 4) are world_from_base; ``linear_velocity`` (n, 3) [m/s] and
    ``angular_velocity`` (n, 3) [rad/s] are those of base_link's origin in the world frame, as in gazebo_msgs.
    """

    stamps_ns: Stamps
    position: Array
    quaternion_wxyz: Array
    linear_velocity: Array
    angular_velocity: Array


@dataclass(frozen=True, kw_only=True)
class ImuReadings:
    """Readings in imu_link (REP-145): orientation is world_from_imu; at rest the acceleration is +g upwards."""

    stamps_ns: Stamps
    quaternion_wxyz: Array  # (n, 4)
    angular_velocity: Array  # (n, 3) [rad/s], in imu_link
    linear_acceleration: Array  # (n, 3) [m/s^2], specific force in imu_link


@dataclass(frozen=True, kw_only=True)
class GnssReadings:
    """Position of the antenna (GNSS_link): ``geodetic`` (n, 3) latitude, longitude [deg], ellipsoidal height [m]."""

    stamps_ns: Stamps
    geodetic: Array


@dataclass(frozen=True, kw_only=True)
class TachometerReadings:
    """Angular speed of each wheel (n, 4) [rad/s], positive forwards, columns as in ``WHEELS``."""

    stamps_ns: Stamps
    wheel_speed: Array


@dataclass(frozen=True, kw_only=True)
class Track:
    """One drive. A sensor of rate r reads at k / r for k = 1, 2, ..., up to and including the end."""

    motion: Motion
    imu: ImuReadings
    gnss: GnssReadings
    tachometers: TachometerReadings | None
    """None without wheels, as along a track file."""

    @property
    def duration_s(self) -> float:
        """Simulated time [s] from 0 to the last state."""
        return float(self.motion.stamps_ns[-1]) / 1e9

    @property
    def length_m(self) -> float:
        """Driven length [m]: base_link's path sampled at 10 Hz, so that jitter does not add to it."""
        corners = self.motion.position[:: max(1, round(1e8 / float(self.motion.stamps_ns[0])))]
        return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def stamps_at_rate(rate_hz: float, duration_ns: int) -> Stamps:
    """Stamps [ns] of a sensor of ``rate_hz``: k / rate for k = 1, 2, ... up to and including ``duration_ns``."""
    count = int(duration_ns * rate_hz / 1e9 + 1e-9)
    stamps: Stamps = np.rint(np.arange(1, count + 1) * (1e9 / rate_hz)).astype(np.int64)
    return stamps
