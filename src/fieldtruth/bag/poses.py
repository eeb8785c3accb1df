# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot's true pose at any stamp, from the one or two nearest messages."""

from typing import Any

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.bag_file import BagFile
from fieldtruth.bag.model_states import ROBOT
from fieldtruth.bag.reader import BagError
from fieldtruth.bag.storage import Storage
from fieldtruth.bag.streams import Stream
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core.arrays import Array, Counts, Mask


def pose_topic(run: BagFile) -> str:
    """Return the topic of the true pose: /ground_truth/odom if the bag has it, else /gazebo/model_states.

    Raises:
        BagError: the bag has neither.
    """
    if table.ODOMETRY not in run.counts and table.MODEL_STATES in run.counts:
        return table.MODEL_STATES
    run.require(table.ODOMETRY)
    return table.ODOMETRY


class Poses:
    """True poses by stamp; only their positions in the bag are in memory."""

    def __init__(self, storage: Storage, stream: Stream) -> None:
        self._storage = storage
        self._stream = stream

    def cover(self, stamps_ns: Counts) -> Mask:
        """Return which stamps lie between the first and the last pose."""
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
