# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of an inertial measurement unit: Imu.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fieldtruth.bag import messages as ros
from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Inertial
from fieldtruth.core.transforms import xyzw_from_wxyz

Covariances = tuple[Array, Array, Array]
UNKNOWN: Final = (np.zeros(9), np.zeros(9), np.zeros(9))
"""Covariances of an ideal IMU, which ROS reads as unknown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ImuReading(Inertial):
    """A reading with the covariances (9,) of orientation, angular velocity and linear acceleration."""

    covariances: Covariances = UNKNOWN


def imu(k: Any, reading: ImuReading) -> list[bytes]:
    """Serialise sensor_msgs/Imu, all of it in the IMU's frame (REP-145); the orientation is world_from_imu."""
    attitude, rate, force = (each.tobytes() for each in reading.covariances)
    return ros.serialized(
        np.size(k),
        *ros.header_fields(k, reading.header_ns, reading.frame),
        xyzw_from_wxyz(reading.orientation_wxyz),
        attitude,
        reading.angular_velocity,
        rate,
        reading.linear_acceleration,
        force,
    )
