# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of an inertial measurement unit as a pure function of the true motion, without noise.

They are means over the interval that ends at the stamp, as ``ImuReadings`` states: their sums are attitude and
velocity, and a short drive equals the start of a long one. Means of the rotating body's angular velocity and specific
force would miss coning and sculling (Savage, Strapdown Inertial Navigation Integration Algorithm Design, Journal of
Guidance, Control, and Dynamics 21, 1998); the rotation vector and the change of velocity of the interval contain both.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.core.transforms import quaternion_wxyz_from_rotation, rotation_from_quaternion_wxyz, xyzw_from_wxyz
from fieldtruth.drive.track import STEP_NS, STEP_S, ImuReadings, Motion, steps_at_rate
from fieldtruth.experiment.robot_config import GRAVITY
from fieldtruth.sensors.imu.config import ImuConfig


class ImuTruth:
    """Readings of an ideal IMU, which go on as a motion grows."""

    def __init__(self, config: ImuConfig) -> None:
        self._config = config
        self._until_ns, self._last = 0, 1  # time that was reached, and step of the last reading

    def extend(self, motion: Motion) -> ImuReadings:
        """Return attitude, mean angular velocity and mean specific force in imu_link (REP-145), lever arm included.

        They are the readings that are due since the call before; the motion has the rows since the last of these.
        """
        config, end_ns = self._config, int(motion.stamps_ns[-1])
        steps = steps_at_rate(config.rate_hz, end_ns, self._until_ns)
        first = int(motion.stamps_ns[0]) // STEP_NS
        rows = steps - first
        starts, ends = imu_intervals(rows, max(self._last - first, 0), len(motion.stamps_ns), config)
        self._until_ns, self._last = end_ns, int(steps[-1]) if len(steps) else self._last
        base_from_imu = config.mount.base_from_sensor
        attitude, ended = motion.quaternion_wxyz[rows], motion.quaternion_wxyz[ends]
        world_from_imu = rotation_from_quaternion_wxyz(attitude) @ base_from_imu[:3, :3]
        seconds = np.maximum(ends - starts, 1)[:, None] * STEP_S
        velocity, velocity_before = (point_velocity(motion, k, base_from_imu[:3, 3]) for k in (ends, starts))
        specific_force = (velocity - velocity_before) / seconds + (0.0, 0.0, GRAVITY)
        turned = rotation_vector(motion.quaternion_wxyz[starts], ended) / seconds
        # One row alone is rounded by BLAS otherwise than among many.
        turn_rate = np.concatenate([turned, turned[:1]]) @ base_from_imu[:3, :3]
        return ImuReadings(
            stamps_ns=motion.stamps_ns[rows],
            quaternion_wxyz=quaternion_wxyz_from_rotation(world_from_imu).reshape(-1, 4),
            angular_velocity=turn_rate[: len(rows)],
            linear_acceleration=_into_frame(world_from_imu, specific_force),
        )


def read_imu(motion: Motion, config: ImuConfig) -> ImuReadings:
    """Return all readings of an ideal IMU along a motion; see ``ImuTruth.extend``."""
    return ImuTruth(config).extend(motion)


def imu_intervals(rows: Counts, before: int, count: int, config: ImuConfig) -> tuple[Counts, Counts]:
    """First and last row of the motion of the intervals (n,) over which the readings at ``rows`` (n,) are means.

    The motion has ``count`` rows, and ``before`` is that of the reading before. No reading is at time 0, so that the
    first reading begins at the first row. A reading at the first row itself has the interval of the next one; the robot
    starts at rest.
    """
    ends = np.clip(rows, 1, count - 1)
    starts = np.concatenate([[before], rows])[:-1] if config.sampling == "mean" else rows - 1
    return np.clip(starts, 0, np.maximum(ends - 1, 0)), ends


def rotation_vector(before_wxyz: Array, after_wxyz: Array) -> Array:
    """Rotation vectors (n, 3) [rad], in the turning frame, between attitudes (n, 4)."""
    before, after = (Rotation.from_quat(xyzw_from_wxyz(q)) for q in (before_wxyz, after_wxyz))
    vectors: Array = (before.inv() * after).as_rotvec()
    return vectors


def point_velocity(motion: Motion, rows: NDArray[np.int64], lever_base: Array) -> Array:
    """World velocity (n, 3) [m/s] at ``rows`` of the point ``lever_base`` (3,) [m] that is fixed in base_link."""
    lever = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[rows]) @ lever_base
    velocity: Array = motion.linear_velocity[rows] + np.cross(motion.angular_velocity[rows], lever)
    return velocity


def _into_frame(world_from_frame: Array, vectors_world: Array) -> Array:
    vectors: Array = np.einsum("nji,nj->ni", world_from_frame, vectors_world)
    return vectors
