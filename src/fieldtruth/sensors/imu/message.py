# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of an inertial measurement unit: Imu.

Covariances are all zero: the readings are exact. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__Imu as Imu

from fieldtruth.bag import types as ros
from fieldtruth.drive.track import ImuReadings


def imu(k: int, readings: ImuReadings, frame: str) -> bytes:
    """Serialise sensor_msgs/Imu, all of it in the IMU's frame (REP-145); the orientation is world_from_imu."""
    zeros = np.zeros(9)
    message = Imu(
        ros.header(k, int(readings.stamps_ns[k]), frame),
        ros.quaternion(readings.quaternion_wxyz[k]),
        zeros,
        ros.vector(readings.angular_velocity[k]),
        zeros,
        ros.vector(readings.linear_acceleration[k]),
        zeros,
    )
    return ros.serialize(message, "sensor_msgs/msg/Imu")
