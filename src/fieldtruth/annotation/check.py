# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a bag that was recorded elsewhere says: its true poses, and whether it fits the rig and the world.

Labels of a bag that does not fit would be wrong without an error. Two clocks may differ: that of the message headers,
which stamps readings, and that of the bag. ``rosbag record`` uses the computer's time for the latter unless
/use_sim_time is set.
"""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from math import ceil, floor
from typing import Final

import numpy as np

from fieldtruth.bag import geometry
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError, read_errors
from fieldtruth.bag.geometry import (
    ModelStatesReader,
    StaticFrames,
    Trajectory,
    pose_topic,
    read_objects,
    read_static_frames,
)
from fieldtruth.bag.messages import ModelStatesWriter, rig_transforms
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import inverse, pose_from_quaternion_wxyz, quaternion_wxyz_from_rotation
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
    """Read the poses of base_link; the whole bag is read, so that damage is found before hours of rendering.

    Raises:
        BagError: no poses or only one, a gap between them, poses of a frame that is not connected to base_link, or as
            ``bag.geometry.read_poses``.
        UnknownNameError: no such robot.
    """
    topic = pose_topic(run)
    check_type(run, topic)
    found = geometry.read_poses(run, topic, robot=robot, coarse=True, advance=advance)
    trajectory = found.trajectory
    if len(trajectory) < 2:
        raise BagError(f"{topic} of {run.bag} has only one pose; at least two are required")
    steps = np.diff(trajectory.stamps_ns)
    if steps.max() > LARGEST_STEP_NS:
        before, after = (f"{stamp / 1e9:.3f} s" for stamp in trajectory.stamps_ns[np.argmax(steps) :][:2])
        raise BagError(
            f"{topic} has a gap: no pose from {before} to {after}; at most {LARGEST_STEP_NS / 1e9:g} s are allowed; "
            "annotate a bag that ends before it or begins after it"
        )
    base_from_frame = _base_from(found.frame, run, rig)
    if base_from_frame is not None:
        world_from_frame = pose_from_quaternion_wxyz(trajectory.position, trajectory.quaternion_wxyz)
        pose = world_from_frame @ inverse(base_from_frame)
        quaternion = quaternion_wxyz_from_rotation(pose[:, :3, :3])
        trajectory = Trajectory(trajectory.stamps_ns, pose[:, :3, 3], quaternion)
    return Poses(topic, trajectory, found.recorded_ns)


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
