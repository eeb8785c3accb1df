# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""From the small messages of a bag to curves: each collector takes one topic and works on blocks of its readings."""

from array import array
from collections.abc import Iterable
from typing import Any, Final, Protocol

import numpy as np
import pymap3d
from scipy.spatial.transform import Rotation

from fieldtruth.bag.model_states import ROBOT, ModelStatesReader
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.report.page.decimate import F8, I8, Line, Thinner

_BLOCK: Final = 4096
_POSES_APART: Final = 19_000_000  # [ns]; poses at 50 Hz are kept one and all

SPEED, TILT, HEADING, HEIGHT = "speed", "tilt", "heading", "height"
TURNING, ACCELERATION, WHEELS, GNSS = "turning", "acceleration", "wheels", "gnss"

Lines = dict[str, dict[str, Line]]
"""Lines by curve and channel."""


class Collector(Protocol):
    """Takes the messages of one topic, one after the other."""

    def row(self, message: Any) -> tuple[float, ...]:
        """Return the numbers that are wanted of a message."""
        ...

    def add(self, stamp_ns: int, row: tuple[float, ...]) -> None:
        """Take them."""
        ...

    def lines(self) -> Lines:
        """Return the lines that it has made."""
        ...


class _Blocks:
    """Collects rows and works on 4096 of them at once, so that it is fast and memory does not grow."""

    def __init__(self) -> None:
        self._stamps, self._values = array("q"), array("d")

    def add(self, stamp_ns: int, row: tuple[float, ...]) -> None:
        self._stamps.append(stamp_ns)
        self._values.extend(row)
        if len(self._stamps) >= _BLOCK:
            self._flush()

    def _flush(self) -> None:
        if self._stamps:
            stamps = np.array(self._stamps, np.int64)
            self._block(stamps, np.array(self._values, np.float64).reshape(len(stamps), -1))
            self._stamps, self._values = array("q"), array("d")

    def _block(self, stamps_ns: I8, rows: F8) -> None:
        raise NotImplementedError


class Motion(_Blocks):
    """True motion of base_link in the world, of nav_msgs/Odometry or, as bytes, of gazebo_msgs/ModelStates."""

    def __init__(self, start_ns: int, end_ns: int, *, from_model_states: bool) -> None:
        super().__init__()
        self.from_model_states = from_model_states
        self._states = ModelStatesReader()
        self._speed, self._tilt, self._heading, self._height = (Thinner(n, start_ns, end_ns) for n in (1, 2, 1, 1))
        self._yaw = 0.0
        self._kept_ns, self._kept = array("q"), array("d")

    def row(self, message: Any) -> tuple[float, ...]:
        """Position, quaternion (x, y, z, w), linear velocity."""
        if self.from_model_states:
            robot = self._states.row(message, ROBOT)
            pose, twist = self._states.poses(message)[robot], self._states.twists(message)[robot]
            return (*map(float, pose), *map(float, twist[:3]))
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v = message.twist.twist.linear
        return p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z

    def _block(self, stamps_ns: I8, rows: F8) -> None:
        norm = np.linalg.norm(rows[:, 3:7], axis=1)
        good = np.isfinite(rows).all(axis=1) & (norm > 1e-6)
        stamps_ns, rows = stamps_ns[good], rows[good]
        if not len(rows):
            return
        roll, pitch, yaw = Rotation.from_quat(rows[:, 3:7]).as_euler("xyz").T  # about fixed axes, as frames.pose
        yaw = np.unwrap(np.append(self._yaw, yaw))[1:]  # not to jump where south is crossed
        self._yaw = float(yaw[-1])
        self._speed.add(stamps_ns, np.linalg.norm(rows[:, 7:10], axis=1, keepdims=True))
        self._tilt.add(stamps_ns, np.degrees(np.column_stack([roll, pitch])))
        self._heading.add(stamps_ns, np.degrees(yaw)[:, None])
        self._height.add(stamps_ns, rows[:, 2:3])
        for stamp, row in zip(stamps_ns.tolist(), rows[:, :7], strict=True):
            if not self._kept_ns or stamp - self._kept_ns[-1] >= _POSES_APART:
                self._kept_ns.append(stamp)
                self._kept.extend(row.tolist())

    def lines(self) -> Lines:
        """Speed [m/s]; roll and pitch [deg]; heading [deg], 0 along x, which is north; height [m]."""
        self._flush()
        return {
            SPEED: _named(["speed"], self._speed),
            TILT: _named(["roll", "pitch"], self._tilt),
            HEADING: _named(["heading"], self._heading),
            HEIGHT: _named(["height"], self._height),
        }

    def trajectory(self) -> Trajectory | None:
        """Poses, at least 19 ms apart; None if there was none."""
        self._flush()
        if not self._kept_ns:
            return None
        poses = np.array(self._kept, np.float64).reshape(-1, 7)
        quaternion = poses[:, [6, 3, 4, 5]]
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        return Trajectory(np.array(self._kept_ns, np.int64), poses[:, :3], quaternion)


class Inertial(_Blocks):
    """sensor_msgs/Imu in its own frame."""

    def __init__(self, start_ns: int, end_ns: int) -> None:
        super().__init__()
        self._turning, self._acceleration = Thinner(3, start_ns, end_ns), Thinner(3, start_ns, end_ns)

    def row(self, message: Any) -> tuple[float, ...]:
        """Angular velocity, linear acceleration."""
        w, a = message.angular_velocity, message.linear_acceleration
        return w.x, w.y, w.z, a.x, a.y, a.z

    def _block(self, stamps_ns: I8, rows: F8) -> None:
        self._turning.add(stamps_ns, rows[:, :3])
        self._acceleration.add(stamps_ns, rows[:, 3:])

    def lines(self) -> Lines:
        """Angular velocity [rad/s] and acceleration [m/s^2] about and along x, y, z."""
        self._flush()
        return {TURNING: _named("xyz", self._turning), ACCELERATION: _named("xyz", self._acceleration)}


class Fixes(_Blocks):
    """sensor_msgs/NavSatFix, shown in metres from the first fix."""

    def __init__(self, start_ns: int, end_ns: int) -> None:
        super().__init__()
        self._thinner = Thinner(3, start_ns, end_ns)
        self.first: tuple[float, float, float] | None = None

    def row(self, message: Any) -> tuple[float, ...]:
        """Latitude, longitude [deg], height [m]."""
        return message.latitude, message.longitude, message.altitude

    def _block(self, stamps_ns: I8, rows: F8) -> None:
        good = np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 0]) <= 90.0)
        if not good.any():
            return
        latitude, longitude, height = rows[good].T
        if self.first is None:
            self.first = float(latitude[0]), float(longitude[0]), float(height[0])
        east, north, up = pymap3d.geodetic2enu(latitude, longitude, height, *self.first)
        self._thinner.add(stamps_ns[good], np.column_stack([north, east, up]))

    def lines(self) -> Lines:
        """North, east, up [m] of the first fix."""
        self._flush()
        return {GNSS: _named(["north", "east", "up"], self._thinner)}


class Wheel(_Blocks):
    """std_msgs/Float32 of one wheel, whose ``name`` is the channel's."""

    def __init__(self, start_ns: int, end_ns: int, name: str) -> None:
        super().__init__()
        self._name = name
        self._thinner = Thinner(1, start_ns, end_ns)

    def row(self, message: Any) -> tuple[float, ...]:
        """Angular speed."""
        return (message.data,)

    def _block(self, stamps_ns: I8, rows: F8) -> None:
        self._thinner.add(stamps_ns, rows)

    def lines(self) -> Lines:
        """Angular speed [rad/s]."""
        self._flush()
        return {WHEELS: _named([self._name], self._thinner)}


def _named(names: Iterable[str], thinner: Thinner) -> dict[str, Line]:
    return dict(zip(names, thinner.lines(), strict=True))
