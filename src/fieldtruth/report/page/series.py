# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Time series from the small messages of a bag, as plots of a page: one collector per topic."""

import math
from array import array
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.report.drawing.style import fixed

BUCKETS: Final = 1000
VERTICES: Final = 2 * BUCKETS
"""Maximum number of vertices per channel."""
CHANNELS: Final = 40
"""A page with more channels has fewer vertices of each."""
Stamps = NDArray[np.int64]
_POSE_INTERVAL: Final = 19_000_000  # [ns]; keeps every pose of a topic at 50 Hz
SPEED, TILT, HEADING, HEIGHT = "speed", "tilt", "heading", "height"
TURNING, ACCELERATION, WHEELS, POSITION = "turning", "acceleration", "wheels", "position"
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


def decimated(stamps_ns: Stamps, values: Array, time: Time) -> Line:
    """Keep the smallest and the largest reading (n,) in each of so many equal intervals of time, in time order.

    Readings that are not finite are skipped; those before the first or after the last stamp of ``time`` belong to the
    first or last interval.
    """
    start_ns, end_ns, buckets = time
    good = np.flatnonzero(np.isfinite(values))
    bucket = np.clip((stamps_ns[good] - start_ns) * buckets // max(end_ns - start_ns, 1), 0, buckets - 1)
    order = np.lexsort((values[good], bucket))
    first = np.flatnonzero(np.diff(bucket[order], prepend=-1))
    last = np.append(first, len(order))[1:] - 1
    rows = good[np.unique(order[np.concatenate([first, last])])]
    rows = rows[np.argsort(stamps_ns[rows], kind="stable")]
    return Line(stamps_ns[rows], values[rows])


Curves = dict[str, dict[str, Array]]
"""Values (n,) by curve and channel."""
Lines = dict[str, dict[str, Line]]
"""Lines by curve and channel. The key of a curve is its kind; of one of several sensors, ``kind of name``."""


class Collector:
    """Collects the numbers of one topic's messages, packed, and makes curves of them.

    ``sensor`` is the name of one of several sensors of its kind, else empty.
    """

    def __init__(self, sensor: str = "") -> None:
        self.sensor = sensor
        self._stamps, self._values = array("q"), array("d")

    def row(self, message: Any) -> Row:
        """Return the numbers of a message that are used."""
        raise NotImplementedError

    def curves(self, rows: Array) -> Curves:
        """Return the curves of rows of such numbers."""
        raise NotImplementedError

    def is_valid(self, rows: Array) -> Mask:
        """Say for each row whether it counts."""
        return np.ones(len(rows), np.bool_)

    def add(self, stamp_ns: int, row: Row) -> None:
        """Add the numbers of a message."""
        self._stamps.append(stamp_ns)
        self._values.extend(row)

    def rows(self) -> tuple[Stamps, Array]:
        """Return the stamps (n,) and the numbers (n, c) of all rows that count."""
        stamps = np.array(self._stamps, np.int64)
        rows = np.array(self._values, np.float64).reshape(len(stamps), -1)
        good = self.is_valid(rows) if len(rows) else np.zeros(0, np.bool_)
        return stamps[good], rows[good]

    def lines(self, time: Time) -> Lines:
        """Return the curves with few vertices; none without a row that counts."""
        stamps, rows = self.rows()
        of = f" of {self.sensor}" if self.sensor else ""
        return {
            curve + of: {name: decimated(stamps, values, time) for name, values in channels.items()}
            for curve, channels in (self.curves(rows) if len(rows) else {}).items()
        }


class Motion(Collector):
    """True motion of base_link, from nav_msgs/Odometry or the serialized bytes of gazebo_msgs/ModelStates.

    Speed [m/s]; roll and pitch [deg]; heading [deg], 0 along x, which is north; height [m].
    """

    def __init__(self, *, from_model_states: bool) -> None:
        super().__init__()
        self.from_model_states = from_model_states
        self._states = ModelStatesReader()

    def row(self, message: Any) -> Row:
        """Position, quaternion (x, y, z, w), linear velocity."""
        if self.from_model_states:
            robot = self._states.row(message, ROBOT)
            pose, twist = self._states.poses(message)[robot], self._states.twists(message)[robot]
            return (*map(float, pose), *map(float, twist[:3]))
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v = message.twist.twist.linear
        return p.x, p.y, p.z, q.x, q.y, q.z, q.w, v.x, v.y, v.z

    def is_valid(self, rows: Array) -> Mask:
        """Say which rows are finite and have a quaternion."""
        return np.isfinite(rows).all(axis=1) & np.asarray(np.linalg.norm(rows[:, 3:7], axis=1) > 1e-6)

    def curves(self, rows: Array) -> Curves:
        """Speed, tilt, heading and height."""
        roll, pitch, yaw = Rotation.from_quat(rows[:, 3:7]).as_euler("xyz").T  # about fixed axes, like transforms.pose
        return {
            SPEED: {"speed": np.linalg.norm(rows[:, 7:10], axis=1)},
            TILT: {"roll": np.degrees(roll), "pitch": np.degrees(pitch)},
            HEADING: {"heading": np.degrees(np.unwrap(yaw))},  # no jump at south
            HEIGHT: {"height": rows[:, 2]},
        }

    def trajectory(self) -> Trajectory | None:
        """Return poses at least 19 ms apart, or None without a valid pose."""
        stamps, rows = self.rows()
        kept: list[int] = []
        for k, stamp in enumerate(stamps.tolist()):
            if not kept or stamp - stamps[kept[-1]] >= _POSE_INTERVAL:
                kept.append(k)
        quaternion = rows[kept][:, [6, 3, 4, 5]] if kept else np.zeros((0, 4))
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        return Trajectory(stamps[kept], rows[kept, :3], quaternion) if kept else None


class Inertial(Collector):
    """sensor_msgs/Imu in its own frame: angular velocity [rad/s] and acceleration [m/s^2]."""

    def row(self, message: Any) -> Row:
        """Angular velocity, linear acceleration."""
        w, a = message.angular_velocity, message.linear_acceleration
        return w.x, w.y, w.z, a.x, a.y, a.z

    def curves(self, rows: Array) -> Curves:
        """Both, by axis."""
        return {
            TURNING: dict(zip("xyz", rows[:, :3].T, strict=True)),
            ACCELERATION: dict(zip("xyz", rows[:, 3:].T, strict=True)),
        }


class Fixes(Collector):
    """sensor_msgs/NavSatFix as north, east, up [m] from the first fix."""

    def row(self, message: Any) -> Row:
        """Latitude, longitude [deg], height [m]."""
        return message.latitude, message.longitude, message.altitude

    def is_valid(self, rows: Array) -> Mask:
        """Say which rows are finite and on the globe."""
        return np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 0]) <= 90.0)

    @property
    def first(self) -> Row | None:
        """The first fix."""
        rows = self.rows()[1]
        return tuple(rows[0].tolist()) if len(rows) else None

    def curves(self, rows: Array) -> Curves:
        """Distances from the first fix."""
        east, north, up = pymap3d.geodetic2enu(*rows.T, *rows[0])
        return {POSITION: {"north": north, "east": east, "up": up}}


class Wheel(Collector):
    """std_msgs/Float32 with the angular speed [rad/s] of one wheel; ``channel`` is its name."""

    def __init__(self, channel: str) -> None:
        super().__init__()
        self.channel = channel

    def row(self, message: Any) -> Row:
        """Angular speed."""
        return (message.data,)

    def curves(self, rows: Array) -> Curves:
        """One channel."""
        return {WHEELS: {self.channel: rows[:, 0]}}


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
    WHEELS: _Kind("Wheel speed", "rad/s", "the tachometers", "", 0.5),
    POSITION: _Kind("Position", "m", "", "from the first fix", 0.5),
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
