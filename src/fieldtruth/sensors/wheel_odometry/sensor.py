# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders as a kind of sensor, and their messages.

Speeds of the wheels (Float32), joint states (JointState), and the odometry that a driver integrates from their angles
(Odometry).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__JointState as JointState
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Float32 as Float32

from fieldtruth.bag import messages as ros
from fieldtruth.bag.messages import JOINTS
from fieldtruth.core.arrays import Array
from fieldtruth.core.random import rng_of
from fieldtruth.core.readings import Joints, Odometry, Reading, WheelSpeeds
from fieldtruth.drive.track import Track
from fieldtruth.experiment.sensor_config import BASE, ODOM, Output
from fieldtruth.sensors.kind import At, MotionSensor
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import MeasuredWheels, TrueWheels, WheelErrors, WheelTruth

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


class Wheels(MotionSensor):
    """Encoders of a robot's wheels."""

    config_type = WheelOdometryConfig
    config: WheelOdometryConfig

    def begin(self) -> tuple[WheelTruth, WheelErrors | None]:
        """Return the readings of ideal encoders and the errors of real ones, which go on as the motion grows."""
        config, wheels = self.config, self.sensor_world.rig.wheels
        rng = rng_of(self.sensor_world.seed, config.name)
        errors = None if config.signal is None else WheelErrors(wheels, config.signal, rng)
        return WheelTruth(config, wheels), errors

    def extend(
        self, memory: tuple[WheelTruth, WheelErrors | None], track: Track
    ) -> tuple[TrueWheels, TrueWheels | MeasuredWheels]:
        """Return what ideal and what real encoders read."""
        assert track.base is not None
        truth, errors = memory
        true = truth.extend(track.motion.stamps_ns, track.base.wheels)
        return true, true if errors is None else errors.extend(true)

    def reading(self, output: Output, at: At, series: TrueWheels | MeasuredWheels) -> Reading:
        """Return one reading of the output's part."""
        k, names = at.number, self.sensor_world.rig.wheels.names
        if output.part == "speeds":
            return WheelSpeeds(**at.stamps, speed=series.tachometers.wheel_speed[k], names=names)
        odometry = series.odometry
        if output.part == "joints":
            joints = JOINTS[: len(names)]
            angle, speed = odometry.wheels.angle[k], odometry.wheels.speed[k]
            return Joints(**at.stamps, frame=BASE, names=joints, angle=angle, speed=speed)
        covariances = None
        if isinstance(series, MeasuredWheels):
            covariances = series.pose_covariance[k], series.twist_covariance[k]
        (x, y, yaw), (forward, turn) = odometry.pose[k], odometry.twist[k]
        return WheelReading(
            **at.stamps,
            frame=ODOM,
            position=np.array([x, y, 0.0]),
            quaternion_wxyz=np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)]),
            linear_velocity=np.array([forward, 0.0, 0.0]),
            angular_velocity=np.array([0.0, 0.0, turn]),
            child=BASE,
            covariances=covariances,
        )

    def messages(self, output: Output, number: int, reading: Reading) -> Iterable[bytes]:
        """Serialise std_msgs/Float32 for each wheel, sensor_msgs/JointState or nav_msgs/Odometry."""
        if isinstance(reading, WheelSpeeds):
            return map(wheel_speed, reading.speed)
        if isinstance(reading, Joints):
            return [joint_states(number, reading)]
        assert isinstance(reading, WheelReading)
        return [wheel_odometry(number, reading)]
