# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The streams of wheel encoders: wheel speeds, and joint states with wheel odometry."""

from fieldtruth.drive.track import Base
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.wheel_odometry import message
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES, WheelOdometryConfig


def wheel_streams(config: WheelOdometryConfig, speed_topics: tuple[str, ...], base: Base) -> list[Stream]:
    """Speeds of the wheels, one topic each, and what the robot's driver computes from their angles."""
    tachometers, odometry = base.tachometers, base.odometry
    speeds = tachometers.wheel_speed
    return [
        Stream(speed_topics, tachometers.stamps_ns, lambda k, _: map(message.wheel_speed, speeds[k])),
        Stream(
            (JOINT_STATES, config.topic),
            odometry.stamps_ns,
            lambda k, _: [message.joint_states(k, odometry), message.wheel_odometry(k, odometry)],
        ),
    ]
