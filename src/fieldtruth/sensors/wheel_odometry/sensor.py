# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wheel encoders as a kind of sensor: speeds of the wheels, joint states, and odometry from their angles."""

from collections.abc import Iterable

import numpy as np

from fieldtruth.bag.base_messages import BASE, JOINTS, ODOM
from fieldtruth.core.random import rng_of
from fieldtruth.core.readings import Joints, Reading, WheelSpeeds
from fieldtruth.drive.track import Track
from fieldtruth.experiment.topic import Output
from fieldtruth.sensors.kind import At, MotionSensor
from fieldtruth.sensors.wheel_odometry import message
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.message import WheelReading
from fieldtruth.sensors.wheel_odometry.noise import MeasuredWheels, measured_wheels
from fieldtruth.sensors.wheel_odometry.sensing import TrueWheels, read_odometry, read_tachometers


class Wheels(MotionSensor):
    """Encoders of a robot's wheels."""

    config_type = WheelOdometryConfig
    config: WheelOdometryConfig

    def true_series(self, track: Track) -> TrueWheels:
        """Return what ideal encoders read."""
        assert track.base is not None
        motion, wheels, config = track.motion, track.base.wheels, self.config
        tachometers = read_tachometers(motion, wheels.speed, config.tachometer_rate_hz)
        odometry = read_odometry(motion.stamps_ns, wheels, self.place.rig.wheels, config.rate_hz)
        return TrueWheels(wheels, tachometers, odometry)

    def signal_series(self, true: TrueWheels, track: Track) -> MeasuredWheels:
        """Return what real encoders read."""
        assert self.config.signal is not None
        rng = rng_of(self.place.seed, self.config.name)
        return measured_wheels(true, track.motion.stamps_ns, self.place.rig.wheels, self.config.signal, rng)

    def reading(self, output: Output, at: At, series: TrueWheels | MeasuredWheels) -> Reading:
        """Return one reading of the output's part."""
        k, names = at.number, self.place.rig.wheels.names
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
            return map(message.wheel_speed, reading.speed)
        if isinstance(reading, Joints):
            return [message.joint_states(number, reading)]
        assert isinstance(reading, WheelReading)
        return [message.wheel_odometry(number, reading)]
