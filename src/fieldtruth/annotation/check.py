# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Check that a bag fits the rig and the world; otherwise the labels would be wrong without an error."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, read_static_frames
from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.model_states import ROBOT, ModelStatesReader, read_objects
from fieldtruth.bag.robot_messages import ModelStatesWriter, rig_transforms
from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.stream import Stream
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
