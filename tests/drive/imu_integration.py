# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A user's simplest strapdown integration of IMU readings."""

import numpy as np
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.track import Motion
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.sensing import ImuReadings, point_velocity, read_imu

GRAVITY = np.array([0.0, 0.0, 9.81])


def true_state(motion: Motion, stamp_ns: int, config: ImuConfig) -> tuple[Array, Array, Array]:
    """Attitude (3, 3), velocity (3,) [m/s] and position (3,) [m] of the IMU, as a user gets them from odometry."""
    row, base_from_imu = int(np.searchsorted(motion.stamps_ns, stamp_ns)), config.mount.base_from_sensor
    world_from_base = rotation_from_quaternion_wxyz(motion.quaternion_wxyz[row])
    velocity = point_velocity(motion, np.array([row]), base_from_imu[:3, 3])[0]
    return (
        world_from_base @ base_from_imu[:3, :3],
        velocity,
        motion.position[row] + world_from_base @ base_from_imu[:3, 3],
    )


def integrated(imu: ImuReadings, attitude: Array, velocity: Array, position: Array) -> tuple[Array, Array, Array]:
    """State at the last reading, from that at the first one."""
    seconds = np.diff(imu.stamps_ns) / 1e9
    turns = Rotation.from_rotvec(imu.angular_velocity[1:] * seconds[:, None]).as_matrix()
    for dt, turn, force in zip(seconds, turns, imu.linear_acceleration[1:], strict=True):
        attitude = attitude @ turn
        velocity = velocity + (attitude @ force - GRAVITY) * dt
        position = position + velocity * dt
    return attitude, velocity, position


def errors(motion: Motion, config: ImuConfig) -> tuple[float, float, float]:
    """Errors of attitude [deg], velocity [m/s] and position [m] at the last reading, integrated from the first one."""
    imu = read_imu(motion, config)
    first, last = int(imu.stamps_ns[0]), int(imu.stamps_ns[-1])
    attitude, velocity, position = integrated(imu, *true_state(motion, first, config))
    true_attitude, true_velocity, true_position = true_state(motion, last, config)
    angle = Rotation.from_matrix(attitude.T @ true_attitude).magnitude()
    moved, offset = np.linalg.norm(velocity - true_velocity), np.linalg.norm(position - true_position)
    return float(np.rad2deg(angle)), float(moved), float(offset)
