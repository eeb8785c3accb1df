# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders as a kind of sensor: speeds of the wheels, joint states, and odometry from their angles."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from fieldtruth.bag.messages import JOINTS
from fieldtruth.core.random import rng_of
from fieldtruth.core.readings import Joints, Reading, WheelSpeeds
from fieldtruth.drive.track import Track
from fieldtruth.experiment.sensor_config import BASE, ODOM, Output
from fieldtruth.sensors.kind import At, MotionSensor
from fieldtruth.sensors.wheel_odometry import message
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.message import WheelReading
from fieldtruth.sensors.wheel_odometry.sensing import MeasuredWheels, TrueWheels, WheelErrors, WheelTruth


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
            return message.wheel_speeds(reading.speed)
        if isinstance(reading, Joints):
            return message.joint_states(number, reading)
        assert isinstance(reading, WheelReading)
        return message.wheel_odometry(number, reading)
