# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a bag fits the rig and the world: a label would be wrong without a word if it did not."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, first_message, read_static_frames
from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.robot_messages import rig_transforms
from fieldtruth.bag.run import Run
from fieldtruth.bag.sensor_messages import optical_frame
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.bag.types import F8
from fieldtruth.core import frames
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.streams import Stream
from fieldtruth.world.model import World

_SAME: Final = 1e-3
"""[m], and entries of rotations: frames that agree to this are the same; a robot's description is rounded."""
_MOVED: Final = 0.05
"""[m]; an object farther from its place stands elsewhere."""


def check_type(run: Run, topic: str) -> None:
    """Make sure that a topic has the type that it has in a run of ours.

    Raises:
        BagError: it has another.
    """
    expected = next(row.msgtype for row in table.TOPICS if row.name == topic)
    if (there := run.msgtypes[topic]) != expected:
        told, needed = (name.replace("/msg/", "/") for name in (there, expected))
        raise BagError(f"{topic} of {run.bag} is of type {told}; needed is {needed}")


@contextmanager
def _defined_as_usual(run: Run, topic: str) -> Iterator[None]:
    """Turn what goes wrong with a topic into one clear line: damage, another type, another definition of it."""
    check_type(run, topic)
    try:
        with read_errors(run.bag):
            yield
    except AttributeError as error:
        raise BagError(f"{topic} of {run.bag} has another definition than usual: {error}") from error


def static_frames(run: Run) -> StaticFrames:
    """Fixed frames of a bag, which may have none.

    Raises:
        BagError: /tf_static is damaged.
    """
    if table.TF_STATIC not in run.counts:
        return StaticFrames({}, str(run.bag))
    with _defined_as_usual(run, table.TF_STATIC):
        return read_static_frames(run)


def check_frames(run: Run, rig: Rig) -> dict[tuple[str, str], F8]:
    """Fixed frames of the rig's cameras and LiDAR that the bag lacks: ``parent_from_child`` by (parent, child).

    Raises:
        BagError: the bag has one of them elsewhere.
    """
    cameras = [frame for side in table.SIDES for frame in (f"{side}_camera", optical_frame(side))]
    needed = cameras * rig.cameras.enabled + ["os1_lidar"] * rig.lidar.enabled
    own = {(parent, child): matrix for (parent, child), matrix in rig_transforms(rig).items() if child in needed}
    ours = StaticFrames({child: (parent, matrix) for (parent, child), matrix in own.items()}, "the rig")
    theirs = static_frames(run)
    for frame in needed:
        if frame not in theirs.parents:
            continue
        here, there = ours.base_from(frame), theirs.base_from(frame)
        if not np.allclose(here, there, 0.0, _SAME):
            raise BagError(
                f"/tf_static of {run.bag} has {frame!r} at {_place(there[:3, 3])} of base_link, the rig at "
                f"{_place(here[:3, 3])}, or turned; an experiment's file (--experiment) can say where it is"
            )
    return {key: matrix for key, matrix in own.items() if key[1] not in theirs.parents}


def check_objects(run: Run, world: World) -> None:
    """Make sure that objects which bag and world have in common stand at the same places.

    Raises:
        BagError: one does not: the bag was recorded in another world.
    """
    if table.MODEL_STATES not in run.counts:
        return
    with _defined_as_usual(run, table.MODEL_STATES):
        states = first_message(run, table.MODEL_STATES)
        places = [np.array([pose.position.x, pose.position.y, pose.position.z]) for pose in states.pose]
        theirs = dict(zip(states.name, places, strict=True))
    for instance in (each for each in world.instances if each.name in theirs):
        xyz, here = theirs[instance.name], instance.world_from_object[:3, 3]
        if not np.linalg.norm(xyz - here) <= _MOVED:
            raise BagError(
                f"{run.bag} was recorded in another world: {instance.name!r} stands at {_place(xyz)}, "
                f"in {world.name} with seed {world.seed} at {_place(here)}"
            )


def check_place(trajectory: Trajectory, streams: Sequence[Stream], rig: Rig, world: World) -> None:
    """Make sure that the robot is in the world, and its sensors above the ground, whenever they sense.

    Raises:
        BagError: says when it is where.
    """
    mounts = [rig.cameras.left, rig.cameras.right] * rig.cameras.enabled + [rig.lidar.mount] * rig.lidar.enabled
    half = np.array(world.size) / 2.0
    stamps = np.unique(np.concatenate([stream.stamps_ns for stream in streams]))
    for stamp in stamps.tolist():
        world_from_base = trajectory.world_from_base(stamp)
        when = f"at {stamp / 1e9:.3f} s base_link is at {_place(world_from_base[:3, 3])}"
        if (np.abs(world_from_base[:2, 3]) > half).any():
            x, y = half
            raise BagError(f"{when}, outside of {world.name}, which spans x -{x:g} to {x:g} m, y -{y:g} to {y:g} m")
        eyes = frames.transform(world_from_base, [mount.xyz for mount in mounts])
        depth = world.terrain.field.height_at(eyes[:, 0], eyes[:, 1]) - eyes[:, 2]
        if (depth > 0.0).any():
            raise BagError(
                f"{when}, so that its sensors are up to {depth.max():.1f} m below the ground of {world.name} "
                f"with seed {world.seed}; was it recorded in another world?"
            )


def _place(xyz: F8) -> str:
    return "x {:.3f}, y {:.3f}, z {:.3f} m".format(*xyz)
