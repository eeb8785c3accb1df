# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Names of the topics of the paper's rig (Table 5), written out."""

from typing import Final

SIDES: Final = ("left", "right")
IMU: Final = "/imu/data"
NAVSAT: Final = "/navsat/fix"
POINTS: Final = "/os1_cloud_node/points"
WHEEL_ODOMETRY: Final = "/odometry/wheel"


def camera_info(side: str) -> str:
    return f"/stereo/camera/{side}/camera_info"


def photograph(side: str) -> str:
    return f"/stereo/camera/{side}/real/compressed"


def tag(side: str) -> str:
    return f"/stereo/camera/{side}/tag/img_raw"


def depth(side: str) -> str:
    return f"/stereo/camera/{side}/depth"


def instances(side: str) -> str:
    return f"/stereo/camera/{side}/instances"
