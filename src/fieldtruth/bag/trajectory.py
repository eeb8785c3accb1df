# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot's true trajectory in a bag, and its pose at any stamp."""

from array import array
from dataclasses import dataclass

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.bag_file import BagFile
from fieldtruth.bag.decode import UNIT, stamp_ns
from fieldtruth.bag.model_states import ROBOT, ModelStatesReader
from fieldtruth.bag.reader import BagError, decoder, open_bag
from fieldtruth.bag.streams import given_stamps, refuse_second_pass, rising_rows
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Counts

Rows = tuple["array[int] | Counts", "array[float]"]
"""Stamps [ns], and seven numbers for each; packed, because there may be 1000 per second."""


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


def read_trajectory(run: BagFile, topic: str = table.ODOMETRY, *, coarse: bool = False) -> Trajectory:
    """Read the true poses from odometry or, if that is missing, from the robot in /gazebo/model_states.

    Stamps are those of the headers; ModelStates has no header, and where all headers have the stamp 0, that is said
    with a warning, so the bag's stamps are used. Of several states with
    one stamp of the bag, whose clock may be coarse, the first is taken; with ``coarse`` so are poses of odometry.

    Raises:
        BagError: the bag has neither, or is damaged, or the stamps do not rise.
    """
    if topic in run.counts and topic != table.MODEL_STATES:
        stamps, rows = _from_odometry(run, topic)
    elif table.MODEL_STATES in run.counts:
        topic, coarse = table.MODEL_STATES, True
        stamps, rows = _from_model_states(run)
    else:
        run.require(topic)
    stamps_ns, poses = np.array(stamps, np.int64), np.array(rows, np.float64).reshape(-1, 7)
    _check_poses(stamps_ns, poses, f"{topic} of {run.bag}")
    order = rising_rows(stamps_ns, topic, run.bag, coarse=coarse)
    return Trajectory(stamps_ns[order], poses[order, :3], poses[order][:, [6, 3, 4, 5]])


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


def _from_odometry(run: BagFile, topic: str) -> Rows:
    stamps, recorded, rows = array("q"), array("q"), array("d")
    with open_bag(run.bag) as bag:
        decode = decoder(bag)
        for raw in bag.messages([topic]):
            message = decode(raw)
            p, q = message.pose.pose.position, message.pose.pose.orientation
            stamps.append(stamp_ns(message.header))
            recorded.append(raw.stamp_ns)
            rows.extend((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
        given = given_stamps(np.array(stamps, np.int64), np.array(recorded, np.int64), topic, run.bag)
        refuse_second_pass(given, bag.index([topic])[topic], topic, run.bag)
    return given, rows


def _from_model_states(run: BagFile) -> Rows:
    reader = ModelStatesReader()
    stamps, rows = array("q"), array("d")
    with open_bag(run.bag) as bag:
        for raw in bag.messages([table.MODEL_STATES]):
            stamps.append(raw.stamp_ns)
            rows.frombytes(reader.poses(raw.data)[reader.row(raw.data, ROBOT)].tobytes())
    return stamps, rows


def seconds(ns: int) -> str:
    """Format a time [ns] as seconds with nine decimals."""
    return f"{'-' * (ns < 0)}{abs(ns) // 10**9}.{abs(ns) % 10**9:09d}"
