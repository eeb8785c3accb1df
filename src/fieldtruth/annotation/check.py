# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag that was recorded elsewhere says: its true poses, and whether it fits the rig and the world.

Labels of a bag that does not fit would be wrong without an error. Two clocks may differ: that of the message headers,
which stamps readings, and that of the bag. ``rosbag record`` uses the computer's time for the latter unless
/use_sim_time is set.
"""

import warnings
from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor, isfinite
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.file import BagError, read_errors
from fieldtruth.bag.geometry import ModelStatesReader, StaticFrames, Trajectory, read_objects, read_static_frames
from fieldtruth.bag.messages import ModelStatesWriter, rig_transforms
from fieldtruth.bag.reader import BagReader, RawMessage, decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import FieldtruthWarning, UnknownNameError, nearest_first
from fieldtruth.core.progress import Advance, timed
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.record.streams import Stream
from fieldtruth.world.model import World

_SAME: Final = 1e-3
"""Tolerance [m] of equal frames, also for entries of rotations; values in a robot's description are rounded."""
_MOVED: Final = 0.05
"""Tolerance [m] of an object's position."""
_TURNED: Final = 1e-3
"""Tolerance of the product of two quaternions, 5 degrees."""


def check_type(run: Run, topic: str) -> None:
    """Check that a topic has the message type that it has in our runs.

    Raises:
        BagError: it has another type.
    """
    expected = next(row.msgtype for row in table.PAPER_TOPICS if row.name == topic)
    if (found := run.msgtypes[topic]) != expected:
        found, expected = (name.replace("/msg/", "/") for name in (found, expected))
        raise BagError(f"{topic} of {run.bag} must be of type {expected}, got {found}")


@contextmanager
def _defined_as_usual(run: Run, topic: str) -> Iterator[None]:
    """Turn damage, a wrong type or an unusual definition of a topic into one clear line."""
    check_type(run, topic)
    try:
        with read_errors(run.bag):
            yield
    except AttributeError as error:
        raise BagError(f"{topic} of {run.bag} has an unusual definition: {error}") from error


def static_frames(run: Run) -> StaticFrames:
    """Read the fixed frames of a bag; there may be none.

    Raises:
        BagError: /tf_static is damaged.
    """
    if table.TF_STATIC not in run.counts:
        return StaticFrames({}, str(run.bag))
    with _defined_as_usual(run, table.TF_STATIC):
        return read_static_frames(run)


def check_frames(run: Run, rig: Rig) -> dict[tuple[str, str], Array]:
    """Return ``parent_from_child`` by (parent, child) of the frames of cameras and LiDAR that the bag lacks.

    Raises:
        BagError: the bag has one of them at another pose.
    """
    seeing = [sensor for sensor in rig.in_order() if sensor.sees]
    needed = [frame for sensor in seeing for frame in (*sensor.frames(), *sensor.optical_frames())]
    own = {(parent, child): matrix for (parent, child), matrix in rig_transforms(rig).items() if child in needed}
    ours = StaticFrames({child: (parent, matrix) for (parent, child), matrix in own.items()}, "the rig")
    theirs = static_frames(run)
    for frame in needed:
        if frame not in theirs.parents:
            continue
        here, there = ours.base_from(frame), theirs.base_from(frame)
        if not np.allclose(here, there, 0.0, _SAME):
            raise BagError(
                f"/tf_static of {run.bag} has {frame!r} at {_xyz(there[:3, 3])} in base_link, the rig at "
                f"{_xyz(here[:3, 3])}, or rotated; set its mount in an experiment file (--experiment)"
            )
    return {key: matrix for key, matrix in own.items() if key[1] not in theirs.parents}


def check_objects(run: Run, world: World, robot: str = ROBOT) -> None:
    """Check that the static objects of a bag are those of the world: the same names at the same poses.

    Models beside them, such as a second robot, are allowed with a warning, unless their names are those of objects that
    another layout has. A bag without models is taken as it is, with a warning.

    Raises:
        BagError: an object of the world is missing or has another pose, or the bag has more of its kind.
    """
    topic, where = table.objects_topic(run.counts), f"{world.name} with seed {world.seed}"
    if topic not in run.counts:
        text = f"{run.bag} has no {topic}, so that nothing shows whether it was recorded in {where}; this is assumed"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)
        return
    check_type(run, topic)
    expected = ModelStatesReader()
    poses = expected.poses(ModelStatesWriter(world).template)[1:]
    ours = dict(zip(expected.names[1:], poses, strict=True))
    theirs = dict(zip(*read_objects(run), strict=True))
    missing = [name for name in ours if name not in theirs]
    moved = [name for name in ours if name in theirs and not _is_near(theirs[name], ours[name])]
    # Gazebo has the land beyond the edge as models of their own, and may have any number of robots.
    usual = {robot, ROBOT, f"{world.name}_backdrop", *ours, *(f"{name}_beyond" for name in ours)}
    others, kinds = [name for name in theirs if name not in usual], {*map(_kind, ours)}
    extra = [name for name in others if _kind(name) in kinds]
    if missing or moved or extra:
        differ = [f"{name!r} is at {_xyz(theirs[name])}, in this world at {_xyz(ours[name])}" for name in moved[:1]]
        differ += [f"{len(missing)} are missing, first {missing[0]!r}"] if missing else []
        differ += [f"{len(extra)} are not in this world, first {extra[0]!r}"] if extra else []
        raise BagError(
            f"{run.bag} was recorded in another world: {len(ours) - len(missing) - len(moved)} of the {len(ours)} "
            f"objects of {where} match; {'; '.join(differ)}; give its --environment, --seed, or layout (--experiment)"
        )
    if others:
        text = f"{run.bag} has models that {where} lacks, so that no added sensor sees them: {', '.join(others)}"
        warnings.warn(text, FieldtruthWarning, stacklevel=4)


def _is_near(found: Array, expected: Array) -> bool:
    """Whether two poses (7,) are those of one object; heights differ a little between grids of the ground."""
    turned = 1.0 - abs(float(found[3:] @ expected[3:]))
    return bool(np.linalg.norm(found[:3] - expected[:3]) <= _MOVED) and abs(turned) <= _TURNED


def _kind(name: str) -> str:
    """Return the name of an object without its number."""
    return name.rstrip("0123456789")


def check_poses(trajectory: Trajectory, streams: Sequence[Stream], rig: Rig, world: World) -> None:
    """Check that the robot is within the world, and its sensors above the ground, at all their stamps.

    Raises:
        BagError: with time and position.
    """
    mounts = [mount for sensor in rig.in_order() if sensor.sees for mount in sensor.frames().values()]
    half = np.array(world.size) / 2.0
    stamps = np.unique(np.concatenate([stream.stamps_ns for stream in streams]))
    for stamp in stamps.tolist():
        world_from_base = trajectory.world_from_base(stamp)
        when = f"at {stamp / 1e9:.3f} s base_link is at {_xyz(world_from_base[:3, 3])}"
        if (np.abs(world_from_base[:2, 3]) > half).any():
            x, y = half
            raise BagError(f"{when}, outside of {world.name}, which spans x -{x:g} to {x:g} m, y -{y:g} to {y:g} m")
        origins = transforms.transform(world_from_base, [mount.xyz for mount in mounts])
        depth = world.terrain.field.height_at(origins[:, 0], origins[:, 1]) - origins[:, 2]
        if (depth > 0.0).any():
            raise BagError(
                f"{when}, so that its sensors are up to {depth.max():.1f} m below the ground of {world.name} "
                f"with seed {world.seed}; was it recorded in another world?"
            )


def _xyz(xyz: Array) -> str:
    return "x {:.3f}, y {:.3f}, z {:.3f} m".format(*xyz[:3])


LARGEST_STEP_NS: Final = 200_000_000
"""Largest time [ns] between two poses; over a longer gap interpolation is not accurate to a pixel."""
_UNIT: Final = 1e-3
"""Largest deviation of a quaternion's squared norm from 1."""
_LISTED: Final = 20
"""Models listed in an error message."""


@dataclass(frozen=True)
class Poses:
    """Poses of base_link by rising stamp, and the stamp in the bag [ns] with which each was recorded."""

    source: str
    """Their topic."""
    trajectory: Trajectory
    recorded_ns: Counts

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
                f"{self.source} has poses from {first / 1e9:.3f} s to {last / 1e9:.3f} s; "
                f"no {sensor} stamp (a multiple of {float(period) / 1e9:g} s) lies between them"
            )
        return stamps


def read_poses(run: Run, rig: Rig, robot: str, advance: Advance) -> Poses:
    """Read the poses of base_link: from /ground_truth/odom or, where that is missing, /gazebo/model_states.

    The whole bag is read, so that damage is found before hours of rendering. Only the poses next to a stamp of the
    rig's sensors are kept.

    Raises:
        BagError: no poses or only one, a gap between them, time that goes back, poses of a frame that is not connected
            to base_link, or a damaged bag.
        UnknownNameError: no such robot.
    """
    source = next((topic for topic in (table.ODOMETRY, table.MODEL_STATES) if topic in run.counts), None)
    if source is None:
        raise BagError(
            f"{run.bag} has no poses: neither {table.ODOMETRY} nor {table.MODEL_STATES}; "
            f"it has: {', '.join(sorted(run.counts))}"
        )
    check_type(run, source)
    log = _Log(source, rig)
    with open_bag(run.bag) as bag:
        reader = _Odometry(bag) if source == table.ODOMETRY else _ModelStates(robot)
        for raw in timed(bag.messages(), advance, run.start_ns):
            if raw.topic == source and (pose := reader.pose(raw)) is not None:
                log.add(pose, raw.stamp_ns)
    log.finish()
    if not log.stamps:
        reader.explain_absence()
    if len(log.stamps) < 2:
        raise BagError(f"{source} of {run.bag} has only one pose; at least two are required")
    return log.poses(_base_from(reader.frame, run, rig))


class _Pose(NamedTuple):
    """A recorded pose: stamp [ns], and x, y, z [m] and quaternion (x, y, z, w) of a frame in the world."""

    stamp_ns: int
    values: Sequence[float]


class _Odometry:
    """Reads nav_msgs/Odometry. A stamp of zero in a header means that the clock had not started; it is skipped."""

    def __init__(self, bag: BagReader) -> None:
        self.frame = ""
        self._decode = decoder(bag)

    def pose(self, raw: RawMessage) -> _Pose | None:
        message = self._decode(raw)
        try:
            p, q = message.pose.pose.position, message.pose.pose.orientation
            values = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
            stamp, frame = stamp_ns(message.header), message.child_frame_id.strip("/")
        except AttributeError as error:
            raise BagError(f"{raw.topic} has a different definition of nav_msgs/Odometry: {error}") from error
        if stamp == 0:
            return None
        if self.frame not in ("", frame):
            raise BagError(f"{raw.topic} must have poses of one frame, got {self.frame!r} and {frame!r}")
        self.frame = frame
        return _Pose(stamp, values)

    def explain_absence(self) -> None:
        raise BagError(f"{table.ODOMETRY} has no stamps: they are 0 in all its headers")


class _ModelStates:
    """Reads gazebo_msgs/ModelStates. It has no header, so the bag's stamps are used. The robot may be spawned late."""

    frame = ""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._reader = ModelStatesReader()

    def pose(self, raw: RawMessage) -> _Pose | None:
        rows = self._reader.poses(raw.data)
        if self._robot not in self._reader.names:
            return None
        return _Pose(raw.stamp_ns, rows[self._reader.names.index(self._robot)].tolist())

    def explain_absence(self) -> None:
        names = nearest_first(self._robot, self._reader.names)
        raise UnknownNameError(f"model in {table.MODEL_STATES}", self._robot, names[:_LISTED])


class _Log:
    """Takes poses in the order of the bag and keeps those on either side of a stamp of the rig's sensors.

    At 1000 Hz that is one in twenty. A spinning LiDAR needs all of them.
    """

    def __init__(self, source: str, rig: Rig) -> None:
        self.source = source
        self.stamps, self.recorded, self.values = array("q"), array("q"), array("d")
        seeing = [sensor for sensor in rig.in_order() if sensor.sees]
        rates = dict.fromkeys(output.rate_hz for each in seeing for output in each.outputs())
        self._rates = [(Fraction(rate_hz) / 10**9).as_integer_ratio() for rate_hz in rates]
        self._every = any(sensor.sweep_s for sensor in seeing)
        self._last: tuple[_Pose, int] | None = None
        self._kept = False

    def add(self, pose: _Pose, recorded_ns: int) -> None:
        if not (isfinite(sum(pose.values)) and abs(sum(v * v for v in pose.values[3:]) - 1.0) < _UNIT):
            raise BagError(f"{self.source} at {_seconds(pose.stamp_ns)} is not a valid pose: {list(pose.values)}")
        if self._last is None:
            self._keep(pose, recorded_ns)
        else:
            before = self._last[0].stamp_ns
            # A clock with coarse ticks gives several poses the same stamp; the first is the closest to it.
            if pose.stamp_ns == before:
                return
            self._check_step(before, pose.stamp_ns)
            if self._every or self._stamp_between(before, pose.stamp_ns):
                if not self._kept:
                    self._keep(*self._last)
                self._keep(pose, recorded_ns)
            else:
                self._kept = False
        self._last = pose, recorded_ns

    def finish(self) -> None:
        if self._last is not None and not self._kept:
            self._keep(*self._last)

    def poses(self, base_from_frame: Array | None) -> Poses:
        """Return the kept poses, converted to base_link if ``base_from_frame`` is given."""
        table_ = np.frombuffer(self.values).reshape(-1, 7)
        position, quaternion = table_[:, :3], transforms.wxyz_from_xyzw(table_[:, 3:])
        if base_from_frame is not None:
            world_from_base = transforms.pose_from_quaternion_wxyz(position, quaternion) @ transforms.inverse(
                base_from_frame
            )
            position = world_from_base[:, :3, 3]
            quaternion = transforms.quaternion_wxyz_from_rotation(world_from_base[:, :3, :3])
        stamps = np.frombuffer(self.stamps, np.int64)
        return Poses(self.source, Trajectory(stamps, position, quaternion), np.frombuffer(self.recorded, np.int64))

    def _keep(self, pose: _Pose, recorded_ns: int) -> None:
        self.stamps.append(pose.stamp_ns)
        self.recorded.append(recorded_ns)
        self.values.extend(pose.values)
        self._kept = True

    def _check_step(self, before: int, after: int) -> None:
        if after < before:
            raise BagError(
                f"{self.source}: time jumps back from {_seconds(before)} to {_seconds(after)}, as after a reset of the "
                "simulation; annotate a bag that ends before it or begins after it"
            )
        if after - before > LARGEST_STEP_NS:
            raise BagError(
                f"{self.source} has a gap: no pose from {_seconds(before)} to {_seconds(after)}; at most "
                f"{LARGEST_STEP_NS / 1e9:g} s are allowed; annotate a bag that ends before it or begins after it"
            )

    def _stamp_between(self, before: int, after: int) -> bool:
        """Whether a stamp of a sensor lies between; with a margin of 1 ns, as stamps are rounded."""
        return any((after + 1) * n // d > (before - 1) * n // d for n, d in self._rates)


def _base_from(frame: str, run: Run, rig: Rig) -> Array | None:
    """Pose in base_link of the recorded frame, from the bag's /tf_static or the rig; None for base_link itself."""
    if frame in ("", BASE):
        return None
    static = static_frames(run)
    if frame in static.parents or frame in {parent for parent, _ in static.parents.values()}:
        return static.base_from(frame)
    if frame in rig.mounts():
        return rig.mounts()[frame].base_from_sensor
    raise BagError(
        f"{table.ODOMETRY} of {run.bag} has poses of {frame!r}, which /tf_static does not connect to {BASE!r}"
    )


def _seconds(stamp: int) -> str:
    return f"{stamp / 1e9:.3f} s"
