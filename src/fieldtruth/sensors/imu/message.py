# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of an inertial measurement unit: Imu.

Covariances are all zero: the readings are exact. ROS reads zeros as "unknown", so a filter must be given its own.
"""

from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Imu as Imu

from fieldtruth.bag import types as ros
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import ImuReadings

Covariances = tuple[Array, Array, Array]


UNKNOWN: Final = (np.zeros(9), np.zeros(9), np.zeros(9))
"""Covariances of an ideal IMU, which ROS reads as unknown."""


def imu(k: int, readings: ImuReadings, frame: str, covariances: Covariances = UNKNOWN) -> bytes:
    """Serialise sensor_msgs/Imu, all of it in the IMU's frame (REP-145); the orientation is world_from_imu.

    ``covariances`` (9,) are those of orientation, angular velocity and linear acceleration.
    """
    attitude, rate, force = covariances
    message = Imu(
        ros.header(k, int(readings.stamps_ns[k]), frame),
        ros.quaternion(readings.quaternion_wxyz[k]),
        attitude,
        ros.vector(readings.angular_velocity[k]),
        rate,
        ros.vector(readings.linear_acceleration[k]),
        force,
    )
    return ros.serialize(message, "sensor_msgs/msg/Imu")
