# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of a GNSS receiver: NavSatFix.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatFix as NavSatFix
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatStatus as NavSatStatus

from fieldtruth.bag import types as ros
from fieldtruth.drive.track import GnssFixes, GnssReadings


def navsat(k: int, readings: GnssReadings, frame: str, fixes: GnssFixes | None = None) -> bytes:
    """Serialise sensor_msgs/NavSatFix of the antenna: latitude and longitude [deg], ellipsoidal height [m].

    It is the true position, or with ``fixes`` the measured one, NaN without a position.
    """
    status, kind = NavSatStatus(NavSatStatus.STATUS_FIX, NavSatStatus.SERVICE_GPS), NavSatFix.COVARIANCE_TYPE_UNKNOWN
    covariance, geodetic = np.zeros(9), readings.geodetic
    if fixes is not None:
        status, geodetic = NavSatStatus(int(fixes.status[k]), fixes.service), fixes.geodetic
        covariance = fixes.covariance[k].ravel()
        kind = NavSatFix.COVARIANCE_TYPE_KNOWN if covariance.any() else kind
    latitude, longitude, height = map(float, geodetic[k])
    message = NavSatFix(
        ros.header(k, int(readings.stamps_ns[k]), frame),
        status,
        latitude,
        longitude,
        height,
        position_covariance=covariance,
        position_covariance_type=kind,
    )
    return ros.serialize(message, "sensor_msgs/msg/NavSatFix")
