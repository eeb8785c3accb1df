# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What a robot with wheels reports of itself: wheel speeds, joint states, wheel odometry, commands, turning frames."""

from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__PoseWithCovariance as PoseWithCovariance
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__TwistWithCovariance as TwistWithCovariance
from rosbags.typesys.stores.ros1_noetic import nav_msgs__msg__Odometry as Odometry
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__JointState as JointState
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Float32 as Float32

from fieldtruth.bag import types as ros
from fieldtruth.core import frames
from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Commands, WheelOdometry
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.topic import WHEELS

BASE: Final = "base_link"
ODOM: Final = "odom"
"""Frame in which wheel odometry starts (REP-105). It is not in /tf, where the parent of base_link is the world."""
WHEEL_FRAMES: Final = tuple(f"{wheel}_wheel" for wheel in WHEELS)
JOINTS: Final = tuple(f"{wheel}_wheel_joint" for wheel in WHEELS)
"""Names of the wheels' joints, as in the URDF of ``fieldtruth gazebo``; a differential robot has the first two."""
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


def wheel_odometry(k: int, odometry: WheelOdometry, covariances: tuple[Array, Array] | None = None) -> bytes:
    """Serialise nav_msgs/Odometry: the pose of base_link in odom, the twist in base_link; both are planar.

    ``covariances`` of pose and twist are (n, 36); without them, they are those of a Husky's driver.
    """
    (x, y, yaw), (speed, turn_rate) = odometry.pose[k], odometry.twist[k]
    attitude = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
    pose = ros.Pose(ros.Point(float(x), float(y), 0.0), ros.quaternion(attitude))
    twist = ros.Twist(ros.Vector3(float(speed), 0.0, 0.0), ros.Vector3(0.0, 0.0, float(turn_rate)))
    driver = np.diag(VARIANCES).ravel()
    of_pose, of_twist = (driver, driver) if covariances is None else (each[k] for each in covariances)
    head = ros.header(k, int(odometry.stamps_ns[k]), ODOM)
    message = Odometry(head, BASE, PoseWithCovariance(pose, of_pose), TwistWithCovariance(twist, of_twist))
    return ros.serialize(message, "nav_msgs/msg/Odometry")


def command(k: int, commands: Commands) -> bytes:
    """Serialise geometry_msgs/Twist: forward speed [m/s] and turn rate [rad/s] in base_link; it has no header."""
    speed, turn_rate = map(float, commands.command[k])
    message = ros.Twist(ros.Vector3(speed, 0.0, 0.0), ros.Vector3(0.0, 0.0, turn_rate))
    return ros.serialize(message, "geometry_msgs/msg/Twist")


def wheel_transforms(rig: Rig, angles: Array) -> dict[str, Array]:
    """Return base_from_wheel (4, 4) by frame for the angles (n,) [rad] of the wheels about their axles."""
    mounts = rig.mounts()
    return {
        name: mounts[name].base_from_sensor @ frames.pose((0.0, 0.0, 0.0), (0.0, float(np.rad2deg(angle)), 0.0))
        for name, angle in zip(WHEEL_FRAMES[: len(angles)], angles, strict=True)
    }
