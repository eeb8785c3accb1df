# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Result of a drive: the true motion at the physics rate, its state at any stamp, and the stamps of readings.

A sensor of the motion reads at the physics step nearest to its due time, and the reading carries that step's own stamp;
for rates that divide 1000 Hz the two are equal.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.experiment.rig import Rig

STEP_NS: Final = 1_000_000
"""A step of the physics [ns]."""
STEP_S: Final = STEP_NS / 1e9
Stamps = NDArray[np.int64]
"""Simulated time (n,) [ns]."""
PoseAt = Callable[[int | NDArray[np.int64]], Array]
"""``world_from_base`` (4, 4) at a stamp [ns], or (n, 4, 4) at n."""
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

    def at(self, rows: Counts) -> "Motion":
        """Some of the rows."""
        return Motion(**{name: values[rows] for name, values in vars(self).items()})


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
class Commands:
    """Forward speed [m/s] and turn rate [rad/s] (n, 2) that the controller demands from each stamp on."""

    stamps_ns: Stamps
    command: Array


@dataclass(frozen=True, kw_only=True)
class Base:
    """Wheels and commands of a robot. Rows of ``wheels`` are those of the track's motion."""

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
    """True if each row of the motion is a pose of its own, at which all sensors read; no sensor measures motion."""

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


class State(NamedTuple):
    """True state of base_link in the world; units and frames as in ``Motion``, each of shape (3,) or (4,)."""

    position: Array
    quaternion_wxyz: Array
    linear_velocity: Array
    angular_velocity: Array

    @property
    def world_from_base(self) -> Array:
        """Pose (4, 4) of base_link in the world."""
        return transforms.pose_from_quaternion_wxyz(self.position, self.quaternion_wxyz)


def state_at(motion: Motion, stamp_ns: int) -> State:
    """State at a stamp [ns]: the motion's row at that stamp, or linear between its neighbours.

    Stamps of rates that do not divide 1000 Hz lie between rows. Quaternions are interpolated linearly and normalised: a
    robot turns by less than a milliradian in a step, where this and slerp agree to 1e-10 rad. Before the first and
    after the last row, the nearest row is returned.
    """
    row = int(np.searchsorted(motion.stamps_ns, stamp_ns))
    if row == 0 or row == len(motion.stamps_ns) or motion.stamps_ns[row] == stamp_ns:
        return _row(motion, min(row, len(motion.stamps_ns) - 1))
    before, after = _row(motion, row - 1), _row(motion, row)
    start, end = motion.stamps_ns[row - 1 : row + 1]
    share = float(stamp_ns - start) / float(end - start)
    same_sign = after.quaternion_wxyz * np.copysign(1.0, before.quaternion_wxyz @ after.quaternion_wxyz)
    after = after._replace(quaternion_wxyz=same_sign)
    mixed = State(*((1.0 - share) * a + share * b for a, b in zip(before, after, strict=True)))
    return mixed._replace(quaternion_wxyz=mixed.quaternion_wxyz / np.linalg.norm(mixed.quaternion_wxyz))


def poses_at(motion: Motion, stamps_ns: Stamps) -> Array:
    """Poses (n, 4, 4) of base_link in the world at stamps (n,) [ns], to rounding those of ``state_at``.

    A spinning LiDAR needs one for each column; one by one, they would take longer than its rays.
    """
    last = len(motion.stamps_ns) - 1
    after = np.clip(np.searchsorted(motion.stamps_ns, stamps_ns), min(1, last), last)
    before = np.maximum(after - 1, 0)
    start, end = motion.stamps_ns[before], motion.stamps_ns[after]
    share = np.clip((stamps_ns - start) / np.maximum(end - start, 1), 0.0, 1.0)[:, None]
    a, b = motion.quaternion_wxyz[before], motion.quaternion_wxyz[after]
    b = b * np.copysign(1.0, np.einsum("ni,ni->n", a, b))[:, None]
    mixed = (1.0 - share) * a + share * b
    position = (1.0 - share) * motion.position[before] + share * motion.position[after]
    return transforms.pose_from_quaternion_wxyz(position, mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def poses_of(motion: Motion) -> PoseAt:
    """Return the poses along a motion."""

    def pose(stamp_ns: int | Stamps) -> Array:
        if isinstance(stamp_ns, np.ndarray):
            return poses_at(motion, stamp_ns)
        return state_at(motion, stamp_ns).world_from_base

    return pose


def standing_at(world_from_base: Array) -> PoseAt:
    """Return the poses of a robot that stands at one (4, 4)."""
    return lambda stamp_ns: np.tile(world_from_base, (*np.shape(stamp_ns), 1, 1))


def _row(motion: Motion, k: int) -> State:
    return State(motion.position[k], motion.quaternion_wxyz[k], motion.linear_velocity[k], motion.angular_velocity[k])


def steps_at_rate(rate_hz: float, duration_ns: int, since_ns: int = 0) -> Counts:
    """Physics steps (n,), counted from 1, of the readings of a sensor that are due after one time and up to another."""
    return np.rint(stamps_at_rate(rate_hz, duration_ns, since_ns) / STEP_NS).astype(np.int64)


def due_step(rate_hz: float, number: int) -> int:
    """Return the physics step of the reading with this number, from 1, as ``steps_at_rate`` has it."""
    return round(round(number * (1e9 / rate_hz)) / STEP_NS)


def sweep_steps(rig: Rig) -> int:
    """Physics steps from a stamp until the last rays of its scan or photograph leave; see ``SensorConfig.late_s``."""
    late_s = max((sensor.late_s for sensor in rig.sensors if sensor.enabled), default=0.0)
    return math.ceil(round(1e9 * late_s, 3) / STEP_NS)
