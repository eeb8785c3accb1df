# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of an inertial measurement unit: Imu.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Imu as ImuMessage

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Inertial

Covariances = tuple[Array, Array, Array]
UNKNOWN: Final = (np.zeros(9), np.zeros(9), np.zeros(9))
"""Covariances of an ideal IMU, which ROS reads as unknown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuReading(Inertial):
    """A reading with the covariances (9,) of orientation, angular velocity and linear acceleration."""

    covariances: Covariances = UNKNOWN


def imu(k: int, reading: ImuReading) -> bytes:
    """Serialise sensor_msgs/Imu, all of it in the IMU's frame (REP-145); the orientation is world_from_imu."""
    attitude, rate, force = reading.covariances
    message = ImuMessage(
        ros.header(k, int(reading.header_ns), reading.frame),
        ros.quaternion(reading.orientation_wxyz),
        attitude,
        ros.vector(reading.angular_velocity),
        rate,
        ros.vector(reading.linear_acceleration),
        force,
    )
    return ros.serialize(message, "sensor_msgs/msg/Imu")
