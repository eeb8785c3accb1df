# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Geometry in a bag: true poses of the robot and of objects, mounts of the sensors, and projection of the cameras.

Poses are in /ground_truth/odom or, if that is missing, in /gazebo/model_states, mounts in /tf_static, and projections
in CameraInfo.
"""

import struct
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import ceil, floor
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import UNIT, matrix, stamp_ns
from fieldtruth.bag.file import BagError, BagFile
from fieldtruth.bag.messages import rig_transforms
from fieldtruth.bag.reader import Decoder, RawMessage, Storage, decoder, open_bag
from fieldtruth.bag.stamps import Stream, given_stamps, refuse_second_pass, rising_rows
from fieldtruth.bag.topics import ROBOT, Source, objects_topic
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts, Mask
from fieldtruth.core.errors import UnknownNameError, nearest_first
from fieldtruth.core.progress import Advance, timed
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import BASE

_MODEL_STATES: Final = "gazebo_msgs/msg/ModelStates"
_LISTED: Final = 20
"""Models listed in an error message."""


def read_objects(run: BagFile) -> tuple[tuple[str, ...], Array]:
    """Return names and poses (n, 7) of all objects by instance id, as the run's first message has them; none without.

    Raises:
        BagError: the bag is damaged.
    """
    topic = objects_topic(run.counts)
    if run.msgtypes.get(topic) != _MODEL_STATES or topic not in run.counts:
        return (), np.zeros((0, 7))
    reader = ModelStatesReader()
    with open_bag(run.bag) as bag:
        poses = reader.poses(next(bag.messages([topic])).data)
    return reader.names, poses


class ModelStatesReader:
    """Names and true states of all objects, by row of the message. Names are unpacked only when they change."""

    def __init__(self) -> None:
        self.names: tuple[str, ...] = ()
        self._head = b""

    def poses(self, data: bytes) -> Array:
        """Return poses (n, 7) in the world: x, y, z [m] and the quaternion (x, y, z, w).

        Raises:
            BagError: the bytes are not a ModelStates message.
        """
        return self._rows(data, 0, 7)

    def twists(self, data: bytes) -> Array:
        """Return twists (n, 6) in the world frame: linear [m/s], angular [rad/s].

        Raises:
            BagError: the bytes are not a ModelStates message.
        """
        return self._rows(data, 4 + 56 * self._count(data), 6)

    def row(self, data: bytes, name: str = ROBOT) -> int:
        """Return the row of an object.

        Raises:
            BagError: no object has that name.
        """
        self._count(data)
        if name not in self.names:
            raise BagError(f"/gazebo/model_states has no model {name!r}; available: {', '.join(self.names[:_LISTED])}")
        return self.names.index(name)

    def _rows(self, data: bytes, skip: int, columns: int) -> Array:
        count = self._count(data)
        at = len(self._head) + skip
        if len(data) != len(self._head) + 8 + 104 * count or data[at : at + 4] != struct.pack("<L", count):
            raise BagError("a message of /gazebo/model_states is damaged")
        values: Array = np.frombuffer(data, "<f8", count * columns, at + 4).reshape(count, columns)
        return values

    def _count(self, data: bytes) -> int:
        if not self._head or not data.startswith(self._head):
            try:
                names, at = [], 4
                for _ in range(struct.unpack_from("<L", data)[0]):
                    (size,) = struct.unpack_from("<L", data, at)
                    names.append(data[at + 4 : at + 4 + size].decode())
                    at += 4 + size
                if at > len(data):
                    raise ValueError("truncated")
            except (struct.error, ValueError) as error:
                raise BagError("a message of /gazebo/model_states is damaged") from error
            self.names, self._head = tuple(names), data[:at]
        return len(self.names)


@dataclass(frozen=True)
class Trajectory:
    """Poses of base_link in the world, n rows: rising ``stamps_ns``, ``position`` [m], ``quaternion_wxyz``."""

    stamps_ns: Counts
    position: Array
    quaternion_wxyz: Array

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @property
    def length_m(self) -> float:
        """Length [m] of the path."""
        return float(np.linalg.norm(np.diff(self.position, axis=0), axis=1).sum())

    def world_from_base(self, stamp_ns: int) -> Array:
        """Return the pose (4, 4) at a stamp [ns], interpolated linearly and spherically between two rows.

        Raises:
            BagError: the stamp is outside the trajectory by more than its largest step.
        """
        after = int(np.searchsorted(self.stamps_ns, stamp_ns))
        if after < len(self) and self.stamps_ns[after] == stamp_ns:
            return transforms.pose_from_quaternion_wxyz(self.position[after], self.quaternion_wxyz[after])
        if after in (0, len(self)):
            nearest = min(after, len(self) - 1)
            step = int(np.diff(self.stamps_ns).max(initial=0))
            if abs(int(self.stamps_ns[nearest]) - stamp_ns) > step:
                raise BagError(
                    f"no true pose at {stamp_ns} ns; poses range from {self.stamps_ns[0]} to {self.stamps_ns[-1]} ns"
                )
            return transforms.pose_from_quaternion_wxyz(self.position[nearest], self.quaternion_wxyz[nearest])
        before = after - 1
        share = float(stamp_ns - self.stamps_ns[before]) / float(self.stamps_ns[after] - self.stamps_ns[before])
        a, b = self.quaternion_wxyz[before], self.quaternion_wxyz[after]
        b = b * np.copysign(1.0, a @ b)
        angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
        if angle > 1e-6:
            mixed = (np.sin((1.0 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
        else:
            mixed = (1.0 - share) * a + share * b
        position = (1.0 - share) * self.position[before] + share * self.position[after]
        return transforms.pose_from_quaternion_wxyz(position, mixed / np.linalg.norm(mixed))


class RecordedPoses(NamedTuple):
    """True poses as a bag has them, and the stamps [ns] in the bag with which they were recorded."""

    topic: str
    trajectory: Trajectory
    recorded_ns: Counts
    frame: str
    """Frame whose poses they are, as odometry states it; empty where nothing does."""

    def recorded_at(self, stamp_ns: int) -> int:
        """Stamp in the bag [ns] of the first pose at or after a stamp [ns]."""
        return int(self.recorded_ns[np.searchsorted(self.trajectory.stamps_ns, stamp_ns)])

    def stamps(self, sensor: str, rate_hz: float, sweep_ns: int = 0) -> Counts:
        """Return the stamps [ns] k / rate, k > 0, for which there are poses up to ``sweep_ns`` later.

        Raises:
            BagError: there are no such stamps.
        """
        first, last = (int(self.trajectory.stamps_ns[i]) for i in (0, -1))
        period = Fraction(10**9) / Fraction(rate_hz)
        numbers = range(max(1, ceil(first / period) - 1), floor(last / period) + 2)  # stamps are rounded up or down
        rounded = [round(k * period) for k in numbers]
        stamps: Counts = np.array([stamp for stamp in rounded if first <= stamp <= last - sweep_ns], np.int64)
        if not len(stamps):
            raise BagError(
                f"{self.topic} has poses from {first / 1e9:.3f} s to {last / 1e9:.3f} s; "
                f"no {sensor} stamp (a multiple of {float(period) / 1e9:g} s) lies between them"
            )
        return stamps


def read_poses(
    run: BagFile,
    topic: str | None = None,
    *,
    robot: str = ROBOT,
    coarse: bool = False,
    advance: Advance | None = None,
) -> RecordedPoses:
    """Read the poses in a topic of odometry, or of the robot in /gazebo/model_states, which may be spawned late.

    Stamps are those of the headers; ModelStates has no header, and where all headers have the stamp 0, that is said
    with a warning, so the bag's stamps are used.

    Args:
        run: the bag.
        topic: by default that of ``pose_topic``.
        robot: name of the model.
        coarse: take the first of several poses of odometry with one stamp, as clocks with coarse ticks give it; of
            model states it always is.
        advance: called with the time [s] just read; then all messages of the bag are read, to find damage.

    Raises:
        BagError: the bag has no such topic, or is damaged, a pose is invalid, poses are of several frames, or stamps
            do not rise.
        UnknownNameError: no such robot.
    """
    topic = topic or pose_topic(run)
    run.require(topic)
    of_models = topic == table.MODEL_STATES
    stamps, recorded, rows, frame = array("q"), array("q"), array("d"), ""
    with open_bag(run.bag) as bag:
        found = bag.messages([topic]) if advance is None else timed(bag.messages(), advance, run.start_ns)
        messages = (raw for raw in found if raw.topic == topic)
        for raw, stamp, pose, own in _robots(messages, robot) if of_models else _odometry(messages, decoder(bag)):
            stamps.append(stamp)
            recorded.append(raw.stamp_ns)
            rows.extend(pose)
            if frame not in ("", own):
                raise BagError(f"{topic} must have poses of one frame, got {frame!r} and {own!r}")
            frame = own
        recorded_ns, values = np.frombuffer(recorded, np.int64), np.frombuffer(rows).reshape(-1, 7)
        index = bag.index([topic])[topic]
        stamps_ns = given_stamps(np.frombuffer(stamps, np.int64), recorded_ns, topic, run.bag)
        refuse_second_pass(index.stamps_ns if of_models else stamps_ns, index, topic, run.bag)
    _check_poses(stamps_ns, values, f"{topic} of {run.bag}")
    order = rising_rows(stamps_ns, topic, run.bag, coarse=coarse or of_models)
    trajectory = Trajectory(stamps_ns[order], values[order, :3], wxyz_from_xyzw(values[order, 3:]))
    return RecordedPoses(topic, trajectory, recorded_ns[order], frame)


_Pose = tuple[RawMessage, int, Sequence[float], str]
"""Message, stamp [ns], x, y, z [m] and quaternion (x, y, z, w) in the world, and the frame that is there."""


def _odometry(messages: Iterable[RawMessage], decode: Decoder) -> Iterator[_Pose]:
    for raw in messages:
        message = decode(raw)
        try:
            p, q = message.pose.pose.position, message.pose.pose.orientation
            stamp, frame = stamp_ns(message.header), message.child_frame_id.strip("/")
        except AttributeError as error:
            raise BagError(f"{raw.topic} has a different definition of nav_msgs/Odometry: {error}") from error
        yield raw, stamp, (p.x, p.y, p.z, q.x, q.y, q.z, q.w), frame


def _robots(messages: Iterable[RawMessage], robot: str) -> Iterator[_Pose]:
    """Yield the poses of a model from its first message on."""
    states, spawned = ModelStatesReader(), False
    for raw in messages:
        poses = states.poses(raw.data)
        if spawned := spawned or robot in states.names:
            yield raw, raw.stamp_ns, poses[states.row(raw.data, robot)].tolist(), ""
    if not spawned:
        known = nearest_first(robot, states.names)[:_LISTED]
        raise UnknownNameError(f"model in {table.MODEL_STATES}", robot, known)


def _check_poses(stamps_ns: Counts, poses: Array, where: str) -> None:
    with np.errstate(invalid="ignore", over="ignore"):
        valid = np.isfinite(poses).all(axis=1) & (np.abs(np.linalg.norm(poses[:, 3:], axis=1) - 1.0) <= UNIT)
    if not valid.all():
        row = int(np.argmin(valid))
        values = ", ".join(f"{value:g}" for value in poses[row])
        raise BagError(
            f"{where} at {stamps_ns[row]} ns: a pose must be finite, with a quaternion of length 1, "
            f"got x, y, z, qx, qy, qz, qw {values}"
        )


def seconds(ns: int) -> str:
    """Format a time [ns] as seconds with nine decimals."""
    return f"{'-' * (ns < 0)}{abs(ns) // 10**9}.{abs(ns) % 10**9:09d}"


def pose_topic(run: BagFile) -> str:
    """Return the topic of the true pose: /ground_truth/odom if the bag has it, else /gazebo/model_states.

    Raises:
        BagError: the bag has neither.
    """
    found = next((topic for topic in (table.ODOMETRY, table.MODEL_STATES) if topic in run.counts), None)
    if found is None:
        instead = f"{table.ODOMETRY}, nor {table.MODEL_STATES} in its place"
        raise BagError(f"{run.bag} has no {instead}; available: {', '.join(sorted(run.counts))}")
    return found


class Poses:
    """True poses by stamp; only their positions in the bag are in memory."""

    def __init__(self, storage: Storage, stream: Stream) -> None:
        self._storage = storage
        self._stream = stream

    def cover(self, stamps_ns: Counts) -> Mask:
        """Return True (n,) for stamps [ns] between the first and the last pose."""
        known = self._stream.stamps_ns
        inside: Mask = (stamps_ns >= known[0]) & (stamps_ns <= known[-1])
        return inside

    def world_from_base(self, stamp_ns: int) -> Array:
        """Return the pose (4, 4) at a covered stamp [ns], interpolated between two messages."""
        known = self._stream.stamps_ns
        after = int(np.searchsorted(known, stamp_ns))
        rows = [after] if known[after] == stamp_ns else [after - 1, after]
        poses = np.array([self._row(row) for row in rows])
        return Trajectory(known[rows], poses[:, :3], poses[:, 3:]).world_from_base(stamp_ns)

    def _row(self, row: int) -> tuple[float, ...]:
        """Return position [m] and quaternion (w, x, y, z)."""
        stream = self._stream
        message = self._storage.message(stream.topic, int(stream.chunk[row]), int(stream.offset[row]))
        pose = self._pose(message)
        p, q = pose.position, pose.orientation
        return p.x, p.y, p.z, q.w, q.x, q.y, q.z

    def _pose(self, message: Any) -> Any:
        if self._stream.topic == table.ODOMETRY:
            return message.pose.pose
        if ROBOT not in message.name:
            raise BagError(f"{table.MODEL_STATES} of {self._storage.path} has no model {ROBOT!r}")
        return message.pose[message.name.index(ROBOT)]


@dataclass(frozen=True)
class StaticFrames:
    """The fixed frames of a robot: ``parents[child]`` is the parent and ``parent_from_child`` (4, 4)."""

    parents: Mapping[str, tuple[str, Array]]
    source: str
    """The bag, or other source, for error messages."""

    @classmethod
    def of_rig(cls, rig: Rig) -> "StaticFrames":
        """Return the frames of a rig, optical ones included."""
        return cls({child: (parent, pose) for (parent, child), pose in rig_transforms(rig).items()}, "the rig")

    def base_from(self, frame: str) -> Array:
        """Return base_link from ``frame``, (4, 4), composed along their chains of parents.

        Raises:
            BagError: unknown frame, or one that is not connected to base_link.
        """
        frame = frame.strip("/")
        known = {BASE, *self.parents, *(parent for parent, _ in self.parents.values())}
        if frame not in known:
            raise BagError(f"/tf_static of {self.source} has no frame {frame!r}; available: {', '.join(sorted(known))}")
        (root, root_from_frame), (base_root, root_from_base) = self._to_root(frame), self._to_root(BASE)
        if root != base_root:
            raise BagError(f"/tf_static of {self.source} does not connect {frame!r} with {BASE!r}")
        return transforms.inverse(root_from_base) @ root_from_frame

    def _to_root(self, frame: str) -> tuple[str, Array]:
        """Return the root of a frame's tree, and ``root_from_frame``."""
        root_from_frame: Array = np.eye(4)
        for _ in self.parents:
            if frame not in self.parents:
                break
            frame, parent_from_child = self.parents[frame]
            root_from_frame = parent_from_child @ root_from_frame
        if frame in self.parents:
            raise BagError(f"/tf_static of {self.source} has a cycle at {frame!r}")
        return frame, root_from_frame


class Lens(NamedTuple):
    """Size and projection of a camera's images, as CameraInfo has them."""

    frame: str
    width: int
    height: int
    K: Array
    """(3, 3) [pixel]; the centre of the first pixel is (0, 0). Of a panorama zeros."""
    R: Array
    """(3, 3) rotation to the rectified frame."""
    P: Array
    """(3, 4) [pixel] of points [m] in the optical frame of the left camera; the right one holds the baseline."""
    D: Array
    """(n,) coefficients."""
    model: str
    """plumb_bob, equidistant, ..."""

    @property
    def is_pinhole(self) -> bool:
        """True if K alone describes it."""
        return self.model in ("", "plumb_bob") and not self.D.any()


class Calibration:
    """Mounts of the sensors and lenses of the cameras, by name of the sensor; each is read when it is first asked."""

    def __init__(self, run: BagFile, sensors: Mapping[str, Source]) -> None:
        self._run, self._sensors = run, sensors
        self._lenses: dict[str, Lens] = {}

    def has_lens(self, sensor: str) -> bool:
        """Return whether the bag has the lens of a view."""
        return self._sensors[sensor].info in self._run.counts

    def lens(self, sensor: str) -> Lens:
        """Return the lens of a view.

        Raises:
            BagError: the bag has none, or is damaged.
        """
        if sensor not in self._lenses:
            topic = self._sensors[sensor].info
            self._run.require(topic)
            m = first_message(self._run, topic)
            k, r, p = (np.array(getattr(m, name), np.float64).reshape(3, -1) for name in "KRP")
            d = np.array(m.D, np.float64)
            size = int(m.width), int(m.height)
            self._lenses[sensor] = Lens(str(m.header.frame_id), *size, k, r, p, d, str(m.distortion_model))
        return self._lenses[sensor]

    def projection(self, sensor: str) -> Array:
        """Return P (3, 4) [pixel] of a rectified view.

        Raises:
            BagError: the bag has none, or one that is no projection.
        """
        p = self.lens(sensor).P
        if not (np.isfinite(p).all() and p[0, 0] > 0.0 < p[1, 1]):
            topic = self._sensors[sensor].info
            raise BagError(f"{topic} of {self._run.bag} has an invalid projection: P has fx {p[0, 0]}, fy {p[1, 1]}")
        return p

    def frame(self, sensor: str) -> str:
        """Return the frame of a sensor's readings: that of its first message, without any that of its configuration."""
        source = self._sensors[sensor]
        topic = next((t for t in (source.info, *source.topics.values()) if t in self._run.counts), None)
        return source.frame if topic is None else str(first_message(self._run, topic).header.frame_id)

    def base_from(self, sensor: str) -> Array:
        """Return base_link from the frame of a sensor's readings, (4, 4).

        Raises:
            BagError: /tf_static is missing, or does not connect the frame with base_link.
        """
        return self.static.base_from(self.frame(sensor))

    @cached_property
    def static(self) -> StaticFrames:
        """The fixed frames; raises as ``read_static_frames``."""
        return read_static_frames(self._run)


def read_static_frames(run: BagFile) -> StaticFrames:
    """Read the fixed frames of a run.

    Raises:
        BagError: the bag has no /tf_static, or is damaged.
    """
    run.require(table.TF_STATIC)
    with open_bag(run.bag) as bag:
        decode = decoder(bag)
        stamped = [each for raw in bag.messages([table.TF_STATIC]) for each in decode(raw).transforms]
    parents: dict[str, tuple[str, Array]] = {}
    for each in stamped:  # of one that is published again, the last counts
        parent, child = each.header.frame_id.strip("/"), each.child_frame_id.strip("/")
        try:
            parent_from_child = matrix(each.transform)
        except BagError as error:
            raise BagError(f"/tf_static of {run.bag}: {parent!r} to {child!r}: {error}") from error
        if (before := parents.setdefault(child, (parent, parent_from_child))[0]) != parent:
            raise BagError(
                f"/tf_static of {run.bag} has {child!r} below both {before!r} and {parent!r}; one is allowed"
            )
        parents[child] = parent, parent_from_child
    return StaticFrames(parents, str(run.bag))


def first_message(run: BagFile, topic: str) -> Any:
    """Read the first message of a topic of the run, with ROS's field names.

    Raises:
        BagError: the bag is damaged.
    """
    with open_bag(run.bag) as bag:
        return decoder(bag)(next(bag.messages([topic])))
