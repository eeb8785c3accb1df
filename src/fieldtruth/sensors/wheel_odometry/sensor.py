# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders as a kind of sensor, and their messages.

Speeds of the wheels (Float32), joint states (JointState), and the odometry that a driver integrates from their angles
(Odometry).
"""

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fieldtruth.bag import messages as ros
from fieldtruth.bag.messages import JOINTS
from fieldtruth.core.arrays import Array
from fieldtruth.core.random import rng_of
from fieldtruth.core.readings import Joints, Odometry, Reading, WheelSpeeds
from fieldtruth.core.transforms import xyzw_from_wxyz
from fieldtruth.drive.track import Track
from fieldtruth.experiment.sensor_config import BASE, ODOM, Output
from fieldtruth.sensors.kind import At, MotionSensor
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.sensing import MeasuredWheels, TrueWheels, WheelErrors, WheelTruth

Covariances = tuple[Array, Array]
VARIANCES: Final = (0.001, 0.001, 0.001, 0.001, 0.001, 0.03)
"""Of x, y, z [m^2], roll, pitch, yaw [rad^2], and of their rates: those that a Husky's driver states (husky_control,
control.yaml). They are constants, although the error of dead reckoning grows."""


def wheel_speeds(speeds: Array) -> list[bytes]:
    """Serialise std_msgs/Float32 (..., wheels) [rad/s]; it has no header, so its stamp is that in the bag."""
    return ros.serialized(speeds.size, speeds.astype("<f4"))


@dataclass(frozen=True, kw_only=True, eq=False)
class WheelReading(Odometry):
    """Wheel odometry with the covariances (36,) of pose and twist that are added to those of the driver."""

    covariances: Covariances | None = None


def joint_states(k: Any, joints: Joints) -> list[bytes]:
    """Serialise sensor_msgs/JointState: angle [rad] and speed [rad/s] of each wheel, positive forwards; no torques."""
    count = struct.pack("<L", len(joints.names))
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, joints.header_ns, joints.frame),
        count + b"".join(map(ros.text_field, joints.names)),
        count,
        joints.angle,
        count,
        joints.speed,
        bytes(4),
    )


def wheel_odometry(k: Any, reading: WheelReading) -> list[bytes]:
    """Serialise nav_msgs/Odometry: the pose of base_link in odom, the twist in base_link; both are planar.

    Covariances of the reading are added to those of the driver, which stand for slip.
    """
    driver, added = np.diag(VARIANCES).ravel(), reading.covariances
    of_pose, of_twist = [driver.tobytes()] * 2 if added is None else (driver + each for each in added)
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, reading.header_ns, reading.frame),
        ros.text_field(reading.child),
        reading.position,
        xyzw_from_wxyz(reading.quaternion_wxyz),
        of_pose,
        reading.linear_velocity,
        reading.angular_velocity,
        of_twist,
    )


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
        """Return readings of the output's part."""
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
        (x, y, yaw), (forward, turn) = odometry.pose[k].T, odometry.twist[k].T
        zero = np.zeros_like(x)
        return WheelReading(
            **at.stamps,
            frame=ODOM,
            position=np.stack([x, y, zero], axis=-1),
            quaternion_wxyz=np.stack([np.cos(yaw / 2), zero, zero, np.sin(yaw / 2)], axis=-1),
            linear_velocity=np.stack([forward, zero, zero], axis=-1),
            angular_velocity=np.stack([zero, zero, turn], axis=-1),
            child=BASE,
            covariances=covariances,
        )

    def messages(self, output: Output, number: Any, reading: Reading) -> Iterable[bytes]:
        """Serialise std_msgs/Float32 for each wheel, sensor_msgs/JointState or nav_msgs/Odometry."""
        if isinstance(reading, WheelSpeeds):
            return wheel_speeds(reading.speed)
        if isinstance(reading, Joints):
            return joint_states(number, reading)
        assert isinstance(reading, WheelReading)
        return wheel_odometry(number, reading)
