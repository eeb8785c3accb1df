# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""State of the robot at any stamp, interpolated between the rows of the motion."""

from typing import NamedTuple

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Motion, Stamps


class State(NamedTuple):
    """True state of base_link in the world; units and frames as in ``Motion``, each of shape (3,) or (4,)."""

    position: Array
    quaternion_wxyz: Array
    linear_velocity: Array
    angular_velocity: Array

    @property
    def world_from_base(self) -> Array:
        """Pose (4, 4) of base_link in the world."""
        return transforms.pose_from_quaternion_wxyz(self.position, self.quaternion_wxyz)


def state_at(motion: Motion, stamp_ns: int) -> State:
    """State at a stamp [ns]: the motion's row at that stamp, or linear between its neighbours.

    Stamps of rates that do not divide 1000 Hz lie between rows. Quaternions are interpolated linearly and normalised: a
    robot turns by less than a milliradian in a step, where this and slerp agree to 1e-10 rad. Before the first and
    after the last row, the nearest row is returned.
    """
    row = int(np.searchsorted(motion.stamps_ns, stamp_ns))
    if row == 0 or row == len(motion.stamps_ns) or motion.stamps_ns[row] == stamp_ns:
        return _row(motion, min(row, len(motion.stamps_ns) - 1))
    before, after = _row(motion, row - 1), _row(motion, row)
    start, end = motion.stamps_ns[row - 1 : row + 1]
    share = float(stamp_ns - start) / float(end - start)
    same_sign = after.quaternion_wxyz * np.copysign(1.0, before.quaternion_wxyz @ after.quaternion_wxyz)
    after = after._replace(quaternion_wxyz=same_sign)
    mixed = State(*((1.0 - share) * a + share * b for a, b in zip(before, after, strict=True)))
    return mixed._replace(quaternion_wxyz=mixed.quaternion_wxyz / np.linalg.norm(mixed.quaternion_wxyz))


def poses_at(motion: Motion, stamps_ns: Stamps) -> Array:
    """Poses (n, 4, 4) of base_link in the world at stamps (n,) [ns], to rounding those of ``state_at``.

    A spinning LiDAR needs one for each column; one by one, they would take longer than its rays.
    """
    last = len(motion.stamps_ns) - 1
    after = np.clip(np.searchsorted(motion.stamps_ns, stamps_ns), min(1, last), last)
    before = np.maximum(after - 1, 0)
    start, end = motion.stamps_ns[before], motion.stamps_ns[after]
    share = np.clip((stamps_ns - start) / np.maximum(end - start, 1), 0.0, 1.0)[:, None]
    a, b = motion.quaternion_wxyz[before], motion.quaternion_wxyz[after]
    b = b * np.copysign(1.0, np.einsum("ni,ni->n", a, b))[:, None]
    mixed = (1.0 - share) * a + share * b
    position = (1.0 - share) * motion.position[before] + share * motion.position[after]
    return transforms.pose_from_quaternion_wxyz(position, mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def _row(motion: Motion, k: int) -> State:
    return State(motion.position[k], motion.quaternion_wxyz[k], motion.linear_velocity[k], motion.angular_velocity[k])
