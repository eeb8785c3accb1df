# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of a GNSS receiver: NavSatFix.

Covariances are all zero: the readings are exact. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatFix as NavSatFix
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatStatus as NavSatStatus

from fieldtruth.bag import types as ros
from fieldtruth.drive.track import GnssReadings


def navsat(k: int, readings: GnssReadings, frame: str) -> bytes:
    """Serialise sensor_msgs/NavSatFix of the antenna: latitude and longitude [deg], ellipsoidal height [m]."""
    latitude, longitude, height = map(float, readings.geodetic[k])
    message = NavSatFix(
        ros.header(k, int(readings.stamps_ns[k]), frame),
        NavSatStatus(NavSatStatus.STATUS_FIX, NavSatStatus.SERVICE_GPS),
        latitude,
        longitude,
        height,
        position_covariance=np.zeros(9),
        position_covariance_type=NavSatFix.COVARIANCE_TYPE_UNKNOWN,
    )
    return ros.serialize(message, "sensor_msgs/msg/NavSatFix")
