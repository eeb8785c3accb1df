# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of a GNSS receiver: NavSatFix.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

from typing import Final

from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatFix as NavSatFix
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatStatus as NavSatStatus

from fieldtruth.bag import messages as ros
from fieldtruth.core.readings import Fix
from fieldtruth.sensors.gnss.config import SERVICE

FIX: Final = int(NavSatStatus.STATUS_FIX)


def navsat(k: int, reading: Fix, service: int = SERVICE["gps"]) -> bytes:
    """Serialise sensor_msgs/NavSatFix of the antenna: latitude and longitude [deg], ellipsoidal height [m]."""
    latitude, longitude, height = map(float, reading.geodetic)
    known = reading.covariance.any()
    message = NavSatFix(
        ros.header(k, int(reading.header_ns), reading.frame),
        NavSatStatus(reading.status, service),
        latitude,
        longitude,
        height,
        position_covariance=reading.covariance.ravel(),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_KNOWN if known else NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
    return ros.serialize(message, "sensor_msgs/msg/NavSatFix")
