# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of the package's kinds of sensors."""

from typing import Final

from fieldtruth.sensors.camera.check import CHECKS as CAMERA
from fieldtruth.sensors.gnss.check import CHECKS as GNSS
from fieldtruth.sensors.imu.check import CHECKS as IMU
from fieldtruth.sensors.lidar.check import CHECKS as LIDAR
from fieldtruth.sensors.wheel_odometry.check import CHECKS as WHEELS
from fieldtruth.validation.kind_checks import KindChecks

CHECKS: Final[tuple[KindChecks, ...]] = (IMU, GNSS, WHEELS, LIDAR, CAMERA)
"""In the order of the output."""
