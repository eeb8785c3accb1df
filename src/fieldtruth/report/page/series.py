# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time series from the small messages of a bag: one collector per topic, which works on blocks of readings."""

from array import array
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pymap3d
from scipy.spatial.transform import Rotation

from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.report.page.decimate import Decimator, Line, Stamps

_BLOCK: Final = 4096
_POSE_INTERVAL: Final = 19_000_000  # [ns]; keeps every pose of a topic at 50 Hz

SPEED, TILT, HEADING, HEIGHT = "speed", "tilt", "heading", "height"
TURNING, ACCELERATION, WHEELS, GNSS = "turning", "acceleration", "wheels", "gnss"

Lines = dict[str, dict[str, Line]]
"""Lines by curve and channel. The key of a curve is its kind; of one of several sensors, ``kind of name``."""
Row = tuple[float, ...]
Time = tuple[int, int, int]
"""First and last stamp [ns], and the number of intervals that readings are reduced to."""


class Collector:
    """Collects the messages of one topic; 4096 rows are processed at once, which is fast and bounds memory.

    ``sensor`` is the name of one of several sensors of its kind, else empty.
    """

    def __init__(self, time: Time, channels: Mapping[str, Sequence[str]], sensor: str = "") -> None:
        self._channels, self.sensor = channels, sensor
        self._decimators = {curve: Decimator(len(names), *time) for curve, names in channels.items()}
        self._stamps, self._values = array("q"), array("d")

    def row(self, message: Any) -> Row:
        """Return the numbers of a message that are used."""
        raise NotImplementedError

    def add(self, stamp_ns: int, row: Row) -> None:
        """Add the numbers of a message."""
        self._stamps.append(stamp_ns)
        self._values.extend(row)
        if len(self._stamps) >= _BLOCK:
            self._flush()

    def lines(self) -> Lines:
        """Return the decimated lines."""
        self._flush()
        return {
            self._key(curve): dict(zip(names, self._decimators[curve].lines(), strict=True))
            for curve, names in self._channels.items()
        }

    def _key(self, curve: str) -> str:
        return f"{curve} of {self.sensor}" if self.sensor else curve

    def _flush(self) -> None:
        if self._stamps:
            stamps = np.array(self._stamps, np.int64)
            rows = np.array(self._values, np.float64).reshape(len(stamps), -1)
            self._stamps, self._values = array("q"), array("d")
            good = self._valid(rows)
            if good.any():
                for curve, values in self._convert(stamps[good], rows[good]).items():
                    self._decimators[curve].add(stamps[good], values)

    def _valid(self, rows: Array) -> Mask:
        return np.ones(len(rows), np.bool_)

    def _convert(self, stamps_ns: Stamps, rows: Array) -> dict[str, Array]:
        """Return the channels (n, c) of each curve."""
        raise NotImplementedError


class Motion(Collector):
    """True motion of base_link, from nav_msgs/Odometry or the serialized bytes of gazebo_msgs/ModelStates.

    Speed [m/s]; roll and pitch [deg]; heading [deg], 0 along x, which is north; height [m].
    """

    def __init__(self, time: Time, *, from_model_states: bool) -> None:
        channels = {SPEED: ["speed"], TILT: ["roll", "pitch"], HEADING: ["heading"], HEIGHT: ["height"]}
        super().__init__(time, channels)
        self.from_model_states = from_model_states
        self._states = ModelStatesReader()
        self._yaw = 0.0
        self._pose_stamps, self._poses = array("q"), array("d")

    def row(self, message: Any) -> Row:
        """Position, quaternion (x, y, z, w), linear velocity."""
        if self.from_model_states:
            robot = self._states.row(message, ROBOT)
            pose, twist = self._states.poses(message)[robot], self._states.twists(message)[robot]
            return (*map(float, pose), *map(float, twist[:3]))
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v = message.twist.twist.linear
        return p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z

    def _valid(self, rows: Array) -> Mask:
        return np.isfinite(rows).all(axis=1) & np.asarray(np.linalg.norm(rows[:, 3:7], axis=1) > 1e-6)

    def _convert(self, stamps_ns: Stamps, rows: Array) -> dict[str, Array]:
        roll, pitch, yaw = Rotation.from_quat(rows[:, 3:7]).as_euler("xyz").T  # about fixed axes, like frames.pose
        yaw = np.unwrap(np.append(self._yaw, yaw))[1:]  # no jump at south
        self._yaw = float(yaw[-1])
        for stamp, row in zip(stamps_ns.tolist(), rows[:, :7], strict=True):
            if not self._pose_stamps or stamp - self._pose_stamps[-1] >= _POSE_INTERVAL:
                self._pose_stamps.append(stamp)
                self._poses.extend(row.tolist())
        return {
            SPEED: np.linalg.norm(rows[:, 7:10], axis=1, keepdims=True),
            TILT: np.degrees(np.column_stack([roll, pitch])),
            HEADING: np.degrees(yaw)[:, None],
            HEIGHT: rows[:, 2:3],
        }

    def trajectory(self) -> Trajectory | None:
        """Return poses at least 19 ms apart, or None without a valid pose."""
        self._flush()
        if not self._pose_stamps:
            return None
        poses = np.array(self._poses, np.float64).reshape(-1, 7)
        quaternion = poses[:, [6, 3, 4, 5]]
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        return Trajectory(np.array(self._pose_stamps, np.int64), poses[:, :3], quaternion)


class Inertial(Collector):
    """sensor_msgs/Imu in its own frame: angular velocity [rad/s] and acceleration [m/s^2]."""

    def __init__(self, time: Time, sensor: str = "") -> None:
        super().__init__(time, {TURNING: "xyz", ACCELERATION: "xyz"}, sensor)

    def row(self, message: Any) -> Row:
        """Angular velocity, linear acceleration."""
        w, a = message.angular_velocity, message.linear_acceleration
        return w.x, w.y, w.z, a.x, a.y, a.z

    def _convert(self, stamps_ns: Stamps, rows: Array) -> dict[str, Array]:
        return {TURNING: rows[:, :3], ACCELERATION: rows[:, 3:]}


class Fixes(Collector):
    """sensor_msgs/NavSatFix as north, east, up [m] from the first fix."""

    def __init__(self, time: Time, sensor: str = "") -> None:
        super().__init__(time, {GNSS: ["north", "east", "up"]}, sensor)
        self.first: tuple[float, float, float] | None = None

    def row(self, message: Any) -> Row:
        """Latitude, longitude [deg], height [m]."""
        return message.latitude, message.longitude, message.altitude

    def _valid(self, rows: Array) -> Mask:
        return np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 0]) <= 90.0)

    def _convert(self, stamps_ns: Stamps, rows: Array) -> dict[str, Array]:
        latitude, longitude, height = rows.T
        if self.first is None:
            self.first = float(latitude[0]), float(longitude[0]), float(height[0])
        east, north, up = pymap3d.geodetic2enu(latitude, longitude, height, *self.first)
        return {GNSS: np.column_stack([north, east, up])}


class Wheel(Collector):
    """std_msgs/Float32 with the angular speed [rad/s] of one wheel; ``name`` is its channel."""

    def __init__(self, time: Time, name: str) -> None:
        super().__init__(time, {WHEELS: [name]})

    def row(self, message: Any) -> Row:
        """Angular speed."""
        return (message.data,)

    def _convert(self, stamps_ns: Stamps, rows: Array) -> dict[str, Array]:
        return {WHEELS: rows}
