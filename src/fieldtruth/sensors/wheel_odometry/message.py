# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of wheel encoders and of the driver that integrates them: Float32, JointState and Odometry."""

from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__JointState as JointState
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Float32 as Float32

from fieldtruth.bag import types as ros
from fieldtruth.bag.base_messages import BASE, JOINTS, ODOM
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import WheelOdometry

Covariances = tuple[Array, Array]
VARIANCES: Final = (0.001, 0.001, 0.001, 0.001, 0.001, 0.03)
"""Of x, y, z [m^2], roll, pitch, yaw [rad^2], and of their rates: those that a Husky's driver states (husky_control,
control.yaml). They are constants, although the error of dead reckoning grows."""


def wheel_speed(speed: float) -> bytes:
    """Serialise std_msgs/Float32 [rad/s]; it has no header, so its stamp is that in the bag."""
    return ros.serialize(Float32(float(speed)), "std_msgs/msg/Float32")


def joint_states(k: int, odometry: WheelOdometry) -> bytes:
    """Serialise sensor_msgs/JointState: angle [rad] and speed [rad/s] of each wheel, positive forwards; no torques."""
    head, wheels = ros.header(k, int(odometry.stamps_ns[k]), BASE), odometry.wheels
    message = JointState(head, list(JOINTS[: wheels.angle.shape[1]]), wheels.angle[k], wheels.speed[k], np.zeros(0))
    return ros.serialize(message, "sensor_msgs/msg/JointState")


def wheel_odometry(k: int, odometry: WheelOdometry, covariances: Covariances | None = None) -> bytes:
    """Serialise nav_msgs/Odometry: the pose of base_link in odom, the twist in base_link; both are planar.

    ``covariances`` (n, 36) of pose and twist are added to those of the driver, which stand for slip.
    """
    (x, y, yaw), (speed, turn_rate) = odometry.pose[k], odometry.twist[k]
    attitude = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    pose = ros.Pose(ros.Point(float(x), float(y), 0.0), ros.quaternion(attitude))
    twist = ros.Twist(ros.Vector3(float(speed), 0.0, 0.0), ros.Vector3(0.0, 0.0, float(turn_rate)))
    driver = np.diag(VARIANCES).ravel()
    of_pose, of_twist = (driver, driver) if covariances is None else (driver + each[k] for each in covariances)
    head = ros.header(k, int(odometry.stamps_ns[k]), ODOM)
    message = Odometry(head, BASE, PoseWithCovariance(pose, of_pose), TwistWithCovariance(twist, of_twist))
    return ros.serialize(message, "nav_msgs/msg/Odometry")
