# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of an inertial measurement unit."""

from fieldtruth.drive.track import ImuReadings
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.imu import message
from fieldtruth.sensors.imu.config import ImuConfig


def imu_stream(config: ImuConfig, readings: ImuReadings) -> Stream:
    """Readings of an IMU."""
    return Stream((config.topic,), readings.stamps_ns, lambda k, _: [message.imu(k, readings, config.frame)])
