# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a run beside its own robot: boxes, poses and velocities at any stamp, and which points are moving.

The experiment beside the bag says what there is and how large it is. /gazebo/model_states says where it is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.actors.cast import figures_of
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader, Trajectory
from fieldtruth.bag.reader import Storage
from fieldtruth.bag.stamps import Stream
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Box, Rig, body_parts
from fieldtruth.world.boxes import OrientedBox

STILL: Final = 0.05
"""Greatest speed [m/s] of the corners of a box at which its object still counts as standing."""
_BEYOND_NS: Final = 100_000_000
"""Time [ns] before the first and after the last message up to which the pose is that of this message."""
_CORNERS: Final = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


class MoverState(NamedTuple):
    """Pose and twist at a stamp."""

    pose: Array
    """world_from_mover (4, 4)."""
    linear: Array
    """(3,) [m/s] of its origin in the world frame."""
    angular: Array
    """(3,) [rad/s] in the world frame."""

    def velocity(self, points: Array) -> Array:
        """Velocities (n, 3) [m/s] in the world frame of points (n, 3) [m] of its frame."""
        return np.asarray(self.linear + np.cross(self.angular, points @ self.pose[:3, :3].T))


@dataclass(frozen=True, eq=False)
class Mover:
    """An object that can move. Its box is along the axes of its frame: x forward, z up where it stands upright."""

    name: str
    object_id: int
    label: int
    """Class id."""
    kind: str
    """What it is in formats that know more than classes: robot, person, car."""
    size: Array
    """(3,) [m] of the box, which is constant."""
    centre: Array
    """(3,) [m] of the box, in its frame."""
    reach: float = 0.0
    """[m] by which limbs that move are outside of the box at most."""

    @cached_property
    def corners(self) -> Array:
        """(8, 3) [m] of the box, in its frame."""
        return np.asarray(self.centre + _CORNERS * self.size)

    def box(self, state: MoverState) -> OrientedBox:
        """Return its box in the world frame."""
        rotation = state.pose[:3, :3]
        return OrientedBox(rotation @ self.centre + state.pose[:3, 3], self.size, rotation)

    def velocity(self, state: MoverState) -> Array:
        """Velocity (3,) [m/s] of the middle of its box in the world frame."""
        return np.asarray(state.velocity(self.centre[None])[0])

    def is_moving(self, state: MoverState) -> bool:
        """Return whether a corner of its box is faster than STILL."""
        return bool(np.linalg.norm(state.velocity(self.corners), axis=1).max() > STILL)


def movers_of(experiment: Experiment, names: Sequence[str]) -> list[Mover]:
    """Return what moves in a run beside its own robot; ``names`` are those of the objects by instance id.

    Raises:
        BagError: there is no object of the name of one.
    """
    found = []
    for name in (name for name in experiment.robots if name != experiment.namespace):
        if name not in names:
            raise BagError(f"the objects of the bag do not have the robot {name!r} of its experiment")
        size, centre = _body_box(experiment.of_robot(name).rig)
        found.append(Mover(name, names.index(name), int(Label.ROBOT), "robot", size, centre))
    for name, figure in figures_of(experiment).items():
        if name not in names:
            raise BagError(f"the objects of the bag do not have the actor {name!r} of its experiment")
        centre = np.array([0.0, 0.0, 0.0 if figure.flies else figure.size[2] / 2])
        box = np.array(figure.size), centre, figure.reach
        found.append(Mover(name, names.index(name), int(figure.label), figure.kind, *box))
    return found


def _body_box(rig: Rig) -> tuple[Array, Array]:
    """Size and centre (3,) [m] in base_link of the box around what other robots see of a robot."""
    boxes = [part if isinstance(part, Box) else part.box for part in body_parts(rig)]
    low = np.min([box.centre - box.size / 2 for box in boxes], axis=0)
    high = np.max([box.centre + box.size / 2 for box in boxes], axis=0)
    return high - low, (low + high) / 2


class Movers:
    """What moves in a run, by instance id, with its states by stamp. Threads may share it, and it can be pickled."""

    def __init__(self, movers: Sequence[Mover] = (), storage: Storage | None = None, states: Stream | None = None):
        self.by_id = {mover.object_id: mover for mover in movers}
        self._storage, self._states = storage, states

    def __len__(self) -> int:
        return len(self.by_id)

    def __iter__(self) -> Iterator[Mover]:
        return iter(self.by_id.values())

    def at(self, stamp_ns: int) -> dict[int, MoverState]:
        """Return the state of each by instance id at a stamp [ns], interpolated between two messages.

        Raises:
            BagError: the bag has changed, or has no message near the stamp.
        """
        if not self.by_id or self._storage is None or self._states is None:
            return {}
        known = self._states.stamps_ns
        after = int(np.searchsorted(known, stamp_ns))
        rows = [after] if after < len(known) and known[after] == stamp_ns else [after - 1, after]
        rows = sorted({min(max(row, 0), len(known) - 1) for row in rows})
        if not len(known) or abs(int(known[rows[0]]) - stamp_ns) > _BEYOND_NS:
            raise BagError(f"{self._storage.path} has no message of {self._states.topic} near {stamp_ns} ns")
        poses, twists = zip(*(self._read(row) for row in rows), strict=True)
        stamps = known[rows]
        within = int(np.clip(stamp_ns, stamps[0], stamps[-1]))
        share = (within - stamps[0]) / max(1, stamps[-1] - stamps[0])
        found = {}
        for number, object_id in enumerate(self.by_id):
            pose, twist = (np.array([each[number] for each in both]) for both in (poses, twists))
            path = Trajectory(stamps, pose[:, :3], wxyz_from_xyzw(pose[:, 3:]))
            linear, angular = np.split(twist[0] + share * (twist[-1] - twist[0]), 2)
            found[object_id] = MoverState(path.world_from_base(within), linear, angular)
        return found

    def moving(self, instance: NDArray[Any], stamp_ns: int) -> Mask:
        """Return whether points or pixels of these instance ids, of any shape, are of what moves at a stamp [ns]."""
        ids = [number for number, state in self.at(stamp_ns).items() if self.by_id[number].is_moving(state)]
        return np.isin(instance, ids)

    def _read(self, row: int) -> tuple[Array, Array]:
        """Poses (m, 7) and twists (m, 6) of all in a message."""
        assert self._storage is not None
        assert self._states is not None
        stream, reader = self._states, ModelStatesReader()
        data = self._storage.raw(stream.topic, int(stream.chunk[row]), int(stream.offset[row])).data
        rows = [reader.row(data, mover.name) for mover in self]
        return reader.poses(data)[rows], reader.twists(data)[rows]
