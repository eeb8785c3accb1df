# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Result of a drive: the true motion at the physics rate and commands; and series of readings that it makes."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts

Stamps = NDArray[np.int64]
"""Simulated time (n,) [ns]."""
_Columns = TypeVar("_Columns", "Motion", "WheelMotion")


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

    def first(self, count: int) -> "Motion":
        """The first ``count`` rows."""
        return rows_of(self, 0, count)


@dataclass(frozen=True, kw_only=True)
class WheelMotion:
    """True rotation of the wheels at the physics rate, positive forwards; columns by the names of the wheels."""

    angle: Array  # (n, wheels) [rad], 0 before the robot settles
    speed: Array  # (n, wheels) [rad/s]


def rows_of(columns: _Columns, begin: int, end: int) -> _Columns:
    """Return the rows of a motion from ``begin`` to before ``end``."""
    return type(columns)(**{name: rows[begin:end] for name, rows in vars(columns).items()})


def joined(before: _Columns, after: _Columns) -> _Columns:
    """Return the rows of two motions, one behind the other."""
    return type(before)(**{name: np.concatenate([rows, getattr(after, name)]) for name, rows in vars(before).items()})


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


@dataclass(frozen=True, kw_only=True)
class GnssFixes:
    """What a receiver measures; rows without a position have NaN there, and zeros in the covariance."""

    geodetic: Array
    """(n, 3) latitude, longitude [deg], ellipsoidal height [m]."""
    covariance: Array
    """(n, 3, 3) of the position in east, north, up [m^2]; zeros without errors."""
    status: Counts
    """(n,) of sensor_msgs/NavSatStatus."""
    service: int
    """Satellite systems, of sensor_msgs/NavSatStatus."""
    state: Counts
    """(n,) of RTK: 0 alone, 1 float, 2 fixed."""
    satellites: Counts
    """(n,) satellites in use."""
    dop: Array
    """(n, 3): position, horizontal and vertical dilution of precision; NaN below four satellites."""


@dataclass(frozen=True, kw_only=True)
class GnssReadings:
    """Position of the antenna: ``geodetic`` (n, 3) latitude, longitude [deg], ellipsoidal height [m]."""

    stamps_ns: Stamps
    geodetic: Array
    fixes: GnssFixes | None = None
    """What the receiver measures; None if its signal is ideal."""


@dataclass(frozen=True, kw_only=True)
class TachometerReadings:
    """Angular speed of each wheel (n, wheels) [rad/s], positive forwards."""

    stamps_ns: Stamps
    wheel_speed: Array


@dataclass(frozen=True, kw_only=True)
class WheelOdometry:
    """Dead reckoning from the angles of the wheels; units and columns as in ``WheelMotion``."""

    stamps_ns: Stamps
    wheels: WheelMotion
    pose: Array
    """(n, 3): x, y [m] and yaw [rad] of base_link in the frame odom, which is base_link's at time 0."""
    twist: Array
    """(n, 2): mean forward speed [m/s] and turn rate [rad/s] since the reading before."""


@dataclass(frozen=True, kw_only=True)
class Commands:
    """Forward speed [m/s] and turn rate [rad/s] (n, 2) that the controller demands from each stamp on."""

    stamps_ns: Stamps
    command: Array


@dataclass(frozen=True, kw_only=True)
class Base:
    """What a robot with wheels does. Rows of ``wheels`` are those of the track's motion."""

    wheels: WheelMotion
    commands: Commands


@dataclass(frozen=True, kw_only=True)
class Track:
    """One drive. A sensor of rate r reads at k / r for k = 1, 2, ..., up to and including the end."""

    motion: Motion
    swept: Motion
    """The motion, continued beyond the end until the last scan of a spinning LiDAR is complete."""
    base: Base | None
    """None without wheels, as along a track file."""
    is_frames: bool = False
    """Whether each row of the motion is a pose of its own, at which all sensors read; no sensor measures motion."""

    @property
    def duration_s(self) -> float:
        """Simulated time [s] from 0 to the last state."""
        return float(self.motion.stamps_ns[-1]) / 1e9

    @property
    def length_m(self) -> float:
        """Driven length [m]: base_link's path sampled at 10 Hz, so that jitter does not add to it."""
        corners = self.motion.position[:: max(1, round(1e8 / float(self.motion.stamps_ns[0])))]
        return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())


def count_at_rate(rate_hz: float, duration_ns: int) -> int:
    """Return the number of readings of a sensor of ``rate_hz`` that are due up to and including a time [ns]."""
    return int(duration_ns * rate_hz / 1e9 + 1e-9)


def stamps_at_rate(rate_hz: float, duration_ns: int, since_ns: int = 0) -> Stamps:
    """Stamps [ns] of a sensor of ``rate_hz``: k / rate for k = 1, 2, ..., after ``since_ns`` up to ``duration_ns``."""
    first, last = (count_at_rate(rate_hz, time_ns) for time_ns in (since_ns, duration_ns))
    stamps: Stamps = np.rint(np.arange(first + 1, last + 1) * (1e9 / rate_hz)).astype(np.int64)
    return stamps
