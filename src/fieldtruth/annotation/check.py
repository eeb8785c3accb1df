# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Check that a bag fits the rig and the world; otherwise the labels would be wrong without an error."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, first_message, read_static_frames
from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.robot_messages import rig_transforms
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.stream import Stream
from fieldtruth.world.model import World

_SAME: Final = 1e-3
"""Tolerance [m] of equal frames, also for entries of rotations; values in a robot's description are rounded."""
_MOVED: Final = 0.05
"""Tolerance [m] of an object's position."""


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


def check_objects(run: Run, world: World) -> None:
    """Check that objects with the same name in bag and world have the same position.

    Raises:
        BagError: one differs, so the bag was recorded in another world.
    """
    topic = table.objects_topic(run.counts)
    if topic not in run.counts:
        return
    with _defined_as_usual(run, topic):
        states = first_message(run, topic)
        positions = [np.array([pose.position.x, pose.position.y, pose.position.z]) for pose in states.pose]
        theirs = dict(zip(states.name, positions, strict=True))
    for instance in (each for each in world.instances if each.name in theirs):
        xyz, here = theirs[instance.name], instance.world_from_object[:3, 3]
        if not np.linalg.norm(xyz - here) <= _MOVED:
            raise BagError(
                f"{run.bag} was recorded in another world: {instance.name!r} is at {_xyz(xyz)}, "
                f"in {world.name} with seed {world.seed} at {_xyz(here)}"
            )


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
        origins = frames.transform(world_from_base, [mount.xyz for mount in mounts])
        depth = world.terrain.field.height_at(origins[:, 0], origins[:, 1]) - origins[:, 2]
        if (depth > 0.0).any():
            raise BagError(
                f"{when}, so that its sensors are up to {depth.max():.1f} m below the ground of {world.name} "
                f"with seed {world.seed}; was it recorded in another world?"
            )


def _xyz(xyz: Array) -> str:
    return "x {:.3f}, y {:.3f}, z {:.3f} m".format(*xyz)
