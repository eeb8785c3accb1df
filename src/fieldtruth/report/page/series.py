# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time series from the small messages of a bag: one collector per topic, which works on blocks of readings."""

import math
from array import array
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.report.drawing.style import fixed

BUCKETS: Final = 1000
VERTICES: Final = 2 * BUCKETS
"""Maximum number of vertices per channel."""
CHANNELS: Final = 40
"""A page with more channels has fewer vertices of each."""
Stamps = NDArray[np.int64]
_BLOCK: Final = 4096
_POSE_INTERVAL: Final = 19_000_000  # [ns]; keeps every pose of a topic at 50 Hz
SPEED, TILT, HEADING, HEIGHT = "speed", "tilt", "heading", "height"
TURNING, ACCELERATION, WHEELS, GNSS = "turning", "acceleration", "wheels", "gnss"
Row = tuple[float, ...]
Time = tuple[int, int, int]
"""First and last stamp [ns], and the number of intervals that readings are reduced to."""
PLOT_WIDTH: Final = 1000.0
PLOT_HEIGHT: Final = 100.0
"""Size of a plot in its own units; the page stretches it."""
_DIGITS: Final = 5
"""Significant digits of the values."""
_MARGIN: Final = 0.06


class Line(NamedTuple):
    """Vertices of one channel: ascending ``stamps_ns`` (n,) and ``values`` (n,)."""

    stamps_ns: Stamps
    values: Array


class Decimator:
    """Keeps the smallest and the largest reading of each channel in each of so many equal intervals of time.

    Memory does not grow with the number of readings. Readings that are not finite are skipped; those before
    ``start_ns`` or after ``end_ns`` belong to the first or last interval.
    """

    def __init__(self, channels: int, start_ns: int, end_ns: int, buckets: int = BUCKETS) -> None:
        self._start, self._span, self._buckets = start_ns, max(end_ns - start_ns, 1), buckets
        shape = channels, buckets
        self._low, self._low_ns = np.full(shape, np.inf), np.zeros(shape, np.int64)
        self._high, self._high_ns = np.full(shape, -np.inf), np.zeros(shape, np.int64)

    def add(self, stamps_ns: Stamps, values: Array) -> None:
        """Add readings (n, channels) with their stamps (n,)."""
        bucket = np.clip((stamps_ns - self._start) * self._buckets // self._span, 0, self._buckets - 1)
        for channel, column in enumerate(values.T):
            good = np.isfinite(column)
            order = np.lexsort((column[good], bucket[good]))
            buckets, readings, stamps = bucket[good][order], column[good][order], stamps_ns[good][order]
            edge = np.flatnonzero(np.diff(buckets))
            firsts, lasts = np.append(-1, edge) + 1, np.append(edge, len(buckets) - 1)
            if len(buckets):
                low, high = (self._low[channel], self._low_ns[channel]), (self._high[channel], self._high_ns[channel])
                _keep(*low, buckets[firsts], readings[firsts], stamps[firsts], np.less)
                _keep(*high, buckets[lasts], readings[lasts], stamps[lasts], np.greater)

    def lines(self) -> list[Line]:
        """Return the vertices of each channel in time order."""
        return [_line(*rows) for rows in zip(self._low, self._low_ns, self._high, self._high_ns, strict=True)]


def _keep(kept: Array, kept_ns: Stamps, buckets: Counts, readings: Array, stamps_ns: Stamps, better: np.ufunc) -> None:
    replaced = better(readings, kept[buckets])
    kept[buckets[replaced]], kept_ns[buckets[replaced]] = readings[replaced], stamps_ns[replaced]


def _line(low: Array, low_ns: Stamps, high: Array, high_ns: Stamps) -> Line:
    filled = np.isfinite(low)
    second = filled & ((low_ns != high_ns) | (low != high))  # a bucket with one reading has one vertex
    stamps = np.concatenate([low_ns[filled], high_ns[second]])
    order = np.argsort(stamps, kind="stable")
    return Line(stamps[order], np.concatenate([low[filled], high[second]])[order])


Lines = dict[str, dict[str, Line]]
"""Lines by curve and channel. The key of a curve is its kind; of one of several sensors, ``kind of name``."""


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


class _Kind(NamedTuple):
    title: str
    unit: str
    whose: str
    """What is measured; of one of several sensors, its name replaces this."""
    note: str
    least_span: float
    """Smallest span of the axis, so that nearly constant values do not look like noise."""


_KINDS: Final = {
    SPEED: _Kind("Speed", "m/s", "base_link", "ground truth", 0.1),
    TILT: _Kind("Roll and pitch", "°", "base_link", "ground truth; pitch is positive downhill", 2.0),
    HEADING: _Kind("Heading", "°", "", "yaw, ground truth; 0 is north, west is positive", 5.0),
    HEIGHT: _Kind("Height", "m", "base_link", "ground truth", 0.5),
    TURNING: _Kind("Angular velocity", "rad/s", "the IMU", "in its own frame", 0.1),
    ACCELERATION: _Kind("Acceleration", "m/s²", "the IMU", "in its own frame, including gravity", 1.0),
    WHEELS: _Kind("Wheel speed", "rad/s", "the four tachometers", "", 0.5),
    GNSS: _Kind("GNSS", "m", "", "from the first fix", 0.5),
}


class Tick(NamedTuple):
    """A grid line at ``at`` percent from the left or the top, and its label."""

    at: float
    text: str


class Channel(NamedTuple):
    """A line of a curve: its SVG path, and its lowest and highest value."""

    name: str
    path: str
    lowest: str
    highest: str


class Curve(NamedTuple):
    """A plot."""

    key: str
    title: str
    unit: str
    note: str
    channels: tuple[Channel, ...]
    ticks: tuple[Tick, ...]


def draw_curves(lines: Lines, start_ns: int, end_ns: int) -> tuple[Curve, ...]:
    """Draw all curves with readings, in a fixed order, over the same time."""
    return tuple(
        _curve(key, lines[key], start_ns, max(end_ns - start_ns, 1))
        for key in _in_order(lines)
        if any(len(line.values) for line in lines.get(key, {}).values())
    )


def time_ticks(duration_s: float) -> tuple[Tick, ...]:
    """Ticks of the time axis [s from the start]."""
    if duration_s <= 0.0:
        return (Tick(0.0, "0"),)
    step, values = _steps(0.0, duration_s, 8)
    return tuple(Tick(round(100 * t / duration_s, 3), _plain(t, step)) for t in values)


def curve_values(lines: Lines, start_ns: int) -> dict[str, Any]:
    """Times [ms from the start] and values of each channel by curve, for the reader who points at a curve.

    They are readings from the bag; nothing is averaged.
    """
    return {
        key: [
            [
                [round((stamp - start_ns) / 1e6) for stamp in line.stamps_ns.tolist()],
                [float(f"{value:.{_DIGITS}g}") for value in line.values],
            ]
            for line in lines[key].values()
            if len(line.values)
        ]
        for key in _in_order(lines)
    }


def _in_order(lines: Lines) -> list[str]:
    """Keys of the curves, kind by kind."""
    return sorted(lines, key=lambda key: list(_KINDS).index(key.partition(" of ")[0]))


def _curve(key: str, channels: Mapping[str, Line], start_ns: int, span_ns: int) -> Curve:
    name, _, sensor = key.partition(" of ")
    kind = _KINDS[name]
    filled = {name: line for name, line in channels.items() if len(line.values)}
    low = min(float(line.values.min()) for line in filled.values())
    high = max(float(line.values.max()) for line in filled.values())
    middle, span = (low + high) / 2, max(high - low, kind.least_span) * (1 + 2 * _MARGIN)
    low, high = middle - span / 2, middle + span / 2
    step, values = _steps(low, high, 5)
    drawn = tuple(
        Channel(name, _path(line, start_ns, span_ns, low, high), *(_plain(float(v), step / 100) for v in ends))
        for name, line in filled.items()
        for ends in [(line.values.min(), line.values.max())]
    )
    ticks = tuple(Tick(round(100 * (high - v) / span, 2), _plain(v, step)) for v in values)
    whose = sensor or kind.whose
    note = ", ".join(filter(None, (f"of {whose}" if whose else "", kind.note)))
    return Curve(key, kind.title, kind.unit, note, drawn, ticks)


def _path(line: Line, start_ns: int, span_ns: int, low: float, high: float) -> str:
    x = np.clip(PLOT_WIDTH * (line.stamps_ns - start_ns) / span_ns, 0.0, PLOT_WIDTH)
    y = PLOT_HEIGHT * (high - line.values) / (high - low)
    if len(x) == 1:
        x, y = np.array([0.0, PLOT_WIDTH]), y.repeat(2)
    return "M" + "L".join(f"{a:.1f},{b:.2f}" for a, b in zip(x, y, strict=True))


def _steps(low: float, high: float, about: int) -> tuple[float, list[float]]:
    """A round distance, and its multiples between two values, approximately so many."""
    raw = (high - low) / about
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= raw * 0.999)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return step, [k * step for k in range(first, last + 1)]


def _plain(value: float, step: float) -> str:
    return fixed(value, max(0, -math.floor(math.log10(step) + 1e-9)))
