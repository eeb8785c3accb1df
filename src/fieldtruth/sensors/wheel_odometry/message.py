# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of wheel encoders and of the driver that integrates them: Float32, JointState and Odometry."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__JointState as JointState
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Float32 as Float32

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Joints, Odometry

Covariances = tuple[Array, Array]
VARIANCES: Final = (0.001, 0.001, 0.001, 0.001, 0.001, 0.03)
"""Of x, y, z [m^2], roll, pitch, yaw [rad^2], and of their rates: those that a Husky's driver states (husky_control,
control.yaml). They are constants, although the error of dead reckoning grows."""


def wheel_speed(speed: float) -> bytes:
    """Serialise std_msgs/Float32 [rad/s]; it has no header, so its stamp is that in the bag."""
    return ros.serialize(Float32(float(speed)), "std_msgs/msg/Float32")


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelReading(Odometry):
    """Wheel odometry with the covariances (36,) of pose and twist that are added to those of the driver."""

    covariances: Covariances | None = None


def joint_states(k: int, joints: Joints) -> bytes:
    """Serialise sensor_msgs/JointState: angle [rad] and speed [rad/s] of each wheel, positive forwards; no torques."""
    head = ros.header(k, int(joints.header_ns), joints.frame)
    message = JointState(head, list(joints.names), joints.angle, joints.speed, np.zeros(0))
    return ros.serialize(message, "sensor_msgs/msg/JointState")


def wheel_odometry(k: int, reading: WheelReading) -> bytes:
    """Serialise nav_msgs/Odometry: the pose of base_link in odom, the twist in base_link; both are planar.

    Covariances of the reading are added to those of the driver, which stand for slip.
    """
    pose = ros.Pose(ros.point(reading.position), ros.quaternion(reading.quaternion_wxyz))
    twist = ros.Twist(ros.vector(reading.linear_velocity), ros.vector(reading.angular_velocity))
    driver = np.diag(VARIANCES).ravel()
    added = reading.covariances
    of_pose, of_twist = (driver, driver) if added is None else (driver + each for each in added)
    head = ros.header(k, int(reading.header_ns), reading.frame)
    parts = ros.PoseWithCovariance(pose, of_pose), ros.TwistWithCovariance(twist, of_twist)
    return ros.serialize(ros.Odometry(head, reading.child, *parts), "nav_msgs/msg/Odometry")
