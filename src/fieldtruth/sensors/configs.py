# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Configurations of the package's kinds of sensors, which become known by their import."""

from typing import Final

from fieldtruth.experiment.sensor_config import SensorConfig
from fieldtruth.sensors.camera.config import CameraConfig, StereoConfig
from fieldtruth.sensors.gnss.config import GnssConfig
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.wheel_odometry.config import WheelOdometryConfig

CONFIGS: Final[tuple[type[SensorConfig], ...]] = (
    ImuConfig, GnssConfig, WheelOdometryConfig, LidarConfig, CameraConfig, StereoConfig
)  # fmt: skip
"""In the order of their topics in a bag."""
