# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One pass through a bag: time series and their plots, the robot's trajectory, and counts of classes.

Memory does not grow with the bag, except for the numbers of the small messages (below 1 MB per minute).
"""

import math
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
import pymap3d
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import points, tag_image
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.readings import Readings
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core import readings
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.core.classes import CLASSES, ClassTable
from fieldtruth.core.parallel import in_order
from fieldtruth.core.progress import Progress, counted
from fieldtruth.core.readings import Cloud, Image
from fieldtruth.experiment.sensor_config import Topic
from fieldtruth.kernels.counting import count_runs
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


class Line(NamedTuple):
    """Vertices of one channel: ascending ``stamps_ns`` (n,) and ``values`` (n,)."""

    stamps_ns: Stamps
    values: Array


class _Kind(NamedTuple):
    title: str
    unit: str
    whose: str
    """Body or sensor; of one of several sensors, its name replaces this."""
    note: str
    least_span: float
    """Smallest span of the axis, so that nearly constant values do not look like noise."""


Curves = dict[str, dict[str, Array]]
"""Values (n,) by curve and channel."""
Lines = dict[str, dict[str, Line]]
"""Lines by curve and channel. The key of a curve is its kind; of one of several sensors, ``kind of name``."""
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


PLOT_WIDTH: Final = 1000.0
PLOT_HEIGHT: Final = 100.0
"""Size of a plot in its own units; the page stretches it."""
_DIGITS: Final = 5
"""Significant digits of the values."""
_MARGIN: Final = 0.06


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


UNEXPECTED: Final = (BagError, AttributeError, KeyError, TypeError, ValueError, IndexError)
"""Exceptions from a message that differs from what its topic promises."""
_CHANNELS: Final = {Inertial: 6, Fixes: 3}
_OTHER_CHANNELS: Final = 9
"""Numbers of channels: of a topic by its collector, and of motion and wheels together."""


def count_pixels(tag: Any, classes: ClassTable = CLASSES) -> Counts:
    """Count the pixels of a tag image message by class id (classes,); row 0 counts colours that no class has.

    Raises:
        BagError: the image is not one in colour.
    """
    counts, codes = np.zeros((2, len(classes)), np.int64)
    codes[:] = [-1 if row.rgb is None else int.from_bytes(row.rgb, "little") for row in classes]
    count_runs(np.ascontiguousarray(tag_image(tag)).reshape(-1, 3), codes, counts)
    return counts


def count_points(cloud: Any, classes: ClassTable = CLASSES) -> Counts:
    """Count the points of a cloud message by class id (classes,); row 0 counts points without a class."""
    return np.bincount(class_ids(points(cloud), classes), minlength=len(classes)).astype(np.int64)


def class_ids(cloud: NDArray[np.void], classes: ClassTable = CLASSES) -> NDArray[np.uint8]:
    """Class id of each point (n,) from ``label`` or, as in the paper, intensity; 0 if it is not a class id."""
    names = cloud.dtype.names or ()
    name = next((name for name in ("label", "intensity") if name in names), None)
    if name is None or cloud[name].ndim != 1:
        return np.zeros(len(cloud), np.uint8)
    value = cloud[name]
    known = np.isin(value, [row.label for row in classes.coloured])
    ids: NDArray[np.uint8] = np.where(known, value, 0).astype(np.uint8)
    return ids


@dataclass
class BagSummary:
    """Result of a pass through a bag."""

    lines: Lines = field(default_factory=dict)
    trajectory: Trajectory | None = None
    first_fixes: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """Latitude, longitude [deg], height [m] by sensor; the name is empty if there is one receiver."""
    pixels: dict[str, Counts] = field(default_factory=dict)
    """Pixels by class id (classes,) of each tag topic; row 0 counts colours that no class has."""
    points: dict[str, Counts] = field(default_factory=dict)
    """Points by class id (classes,) of each topic of clouds."""
    unreadable: dict[str, str] = field(default_factory=dict)
    """By topic that exists and cannot be shown: the reason."""


def published(run: Run) -> tuple[Topic, ...]:
    """Topics that a run with its rig can have; of a bag from elsewhere the paper's."""
    return table.PAPER_TOPICS if run.experiment is None else table.topics_of(run.rig, latched=True)


def usable_topics(run: Run) -> tuple[set[str], dict[str, str]]:
    """Topics whose messages have the type that we publish under this name, and why the others are not usable."""
    promised = {topic.name: topic.msgtype for topic in published(run)}
    known = {topic: msgtype for topic, msgtype in run.msgtypes.items() if topic in promised and topic in run.counts}
    other = {t: f"contains {found}, not {promised[t]}" for t, found in known.items() if found != promised[t]}
    return set(known) - set(other), other


def reason(error: Exception) -> str:
    """Explain why a message cannot be read."""
    return str(error) if isinstance(error, BagError) else f"its messages have an unexpected form ({error})"


def summarize_bag(run: Run, workers: int, progress: Progress) -> BagSummary:
    """Read a bag once.

    Raises:
        BagError: the bag is damaged.
    """
    topics, unusable = usable_topics(run)
    summary = BagSummary(unreadable=unusable)
    collectors = _collectors(run, topics)
    clouds = [each.topic for each in run.of(Cloud)]
    tags = [view.topics["label"] for view in run.of(Image, "label")]
    counters: dict[str, Callable[[Any], Counts]] = {
        **dict.fromkeys(tags, partial(count_pixels, classes=run.classes)),
        **dict.fromkeys(clouds, partial(count_points, classes=run.classes)),
    }
    wanted = [topic for topic in (*collectors, *counters) if topic in topics]
    opened: dict[str, Readings] = {}
    for topic in set(wanted) - {table.MODEL_STATES}:
        try:
            opened[topic] = run.messages(topic)
        except BagError as error:
            summary.unreadable[topic] = reason(error)
    counts: dict[str, Counts] = {}
    jobs = sorted((stamp, t, row) for t, each in opened.items() for row, stamp in enumerate(each.stamps_ns.tolist()))

    def work(job: tuple[int, str, int]) -> tuple[str, int, Row | Counts | str]:
        stamp, topic, row = job
        use = counters[topic] if topic in counters else collectors[topic].row
        try:
            return topic, stamp, use(opened[topic].message(row))
        except UNEXPECTED as error:
            return topic, stamp, reason(error)

    with progress.stage("read the bag", run.duration_s) as advance:
        for topic, stamp, found in counted(in_order(jobs, work, workers), advance, run.duration_s, len(jobs)):
            if isinstance(found, str):
                summary.unreadable.setdefault(topic, found)
            elif isinstance(found, tuple):
                collectors[topic].add(stamp, found)
            else:
                counts[topic] = counts.get(topic, np.zeros(len(run.classes), np.int64)) + found
        if table.MODEL_STATES in wanted:
            _collect_states(run, collectors[table.MODEL_STATES], summary.unreadable)
    _finish(summary, collectors, run)
    good = {topic: found for topic, found in counts.items() if topic not in summary.unreadable}
    summary.points = {topic: found for topic, found in good.items() if topic in clouds}
    summary.pixels = {topic: found for topic, found in good.items() if topic in tags}
    return summary


def _collectors(run: Run, topics: set[str]) -> dict[str, Collector]:
    """Collectors of the small messages by topic; Odometry replaces ModelStates, whose rate is 20 times as high."""
    poses = table.ODOMETRY if table.ODOMETRY in topics else table.MODEL_STATES
    inertial, fixes, wheels = (
        run.of(kind, recorded=False) for kind in (readings.Inertial, readings.Fix, readings.WheelSpeeds)
    )
    made: Mapping[str, Collector] = {
        poses: Motion(from_model_states=poses == table.MODEL_STATES),
        **{each.topic: Inertial(each.name * (len(inertial) > 1)) for each in inertial},
        **{each.topic: Fixes(each.name * (len(fixes) > 1)) for each in fixes},
        **{t: Wheel(name.replace("_", " ")) for each in wheels for name, t in each.topics.items()},
    }
    return {topic: collector for topic, collector in made.items() if topic in topics}


def _collect_states(run: Run, collector: Collector, unreadable: dict[str, str]) -> None:
    """Collect the robot's states, which come at 1000 Hz with all objects, and so are not decoded."""
    with open_bag(run.bag) as bag:
        try:
            for raw in bag.messages([table.MODEL_STATES]):
                collector.add(raw.stamp_ns, collector.row(raw.data))
        except UNEXPECTED as error:
            unreadable[table.MODEL_STATES] = reason(error)


def _finish(summary: BagSummary, collectors: Mapping[str, Collector], run: Run) -> None:
    found = [each for topic, each in collectors.items() if topic not in summary.unreadable]
    channels = _OTHER_CHANNELS + sum(_CHANNELS.get(type(each), 0) for each in collectors.values())
    time = run.start_ns, run.end_ns, min(BUCKETS, BUCKETS * CHANNELS // channels)
    for collector in found:
        for curve, lines in collector.lines(time).items():
            summary.lines.setdefault(curve, {}).update(lines)
        if isinstance(collector, Motion):
            summary.trajectory = collector.trajectory()
        if isinstance(collector, Fixes) and collector.first is not None:
            summary.first_fixes[collector.sensor] = collector.first
