# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The message of a GNSS receiver: NavSatFix.

Covariances of ideal readings are all zero. ROS reads zeros as "unknown", so a filter must be given its own.
"""

import struct
from typing import Any, Final

import numpy as np
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatFix as NavSatFix
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__NavSatStatus as NavSatStatus

from fieldtruth.bag import messages as ros
from fieldtruth.core.readings import Fix
from fieldtruth.sensors.gnss.config import SERVICE

FIX: Final = int(NavSatStatus.STATUS_FIX)


def navsat(k: Any, reading: Fix, service: int = SERVICE["gps"]) -> list[bytes]:
    """Serialise sensor_msgs/NavSatFix of the antenna: latitude and longitude [deg], ellipsoidal height [m]."""
    count, known = np.size(k), reading.covariance.any(axis=(-2, -1))
    return ros.serialized(
        count,
        *ros.header_fields(k, reading.header_ns, reading.frame),
        np.asarray(reading.status, np.int8),
        struct.pack("<H", service),
        reading.geodetic,
        reading.covariance,
        np.where(known, NavSatFix.COVARIANCE_TYPE_KNOWN, NavSatFix.COVARIANCE_TYPE_UNKNOWN).astype(np.uint8),
    )
