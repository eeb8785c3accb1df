# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A rig with several sensors of each kind: two LiDARs, four cameras, a stereo pair, two IMUs, two GNSS antennas."""

from typing import Any

from fieldtruth.experiment.rig import Rig


def many_sensors() -> list[dict[str, Any]]:
    """Items of ``rig.sensors``; one camera is a fisheye, one a panorama, and all are small."""
    size = {"width": 160, "height": 96, "rate_hz": 5.0}
    return [
        {
            "kind": "lidar",
            "name": "top",
            "rate_hz": 10.0,
            "columns": 256,
            "rings": 16,
            "mount": {"xyz": [0.0, 0.0, 0.9]},
        },
        {
            "kind": "lidar",
            "name": "low",
            "model": "vlp_16",
            "rate_hz": 20.0,
            "mount": {"xyz": [0.55, 0.0, 0.2], "rpy_deg": [0.0, 15.0, 0.0]},
        },
        {"kind": "stereo", "name": "pair", "baseline": 0.1, "depth": True, "mount": {"xyz": [0.3, 0.0, 0.6]}, **size},
        {"kind": "camera", "name": "front", "instances": True, "mount": {"xyz": [0.4, 0.0, 0.7]}, **size},
        {
            "kind": "camera",
            "name": "rear",
            "depth": True,
            "mount": {"xyz": [-0.5, 0.0, 0.5], "rpy_deg": [0.0, 10.0, 180.0]},
            **size,
            "rate_hz": 10.0,
        },
        {"kind": "camera", "name": "fisheye", "mount": {"xyz": [0.5, 0.0, 0.4]}, **size, "model": "fisheye_190"},
        {
            "kind": "camera",
            "name": "panorama",
            "mount": {"xyz": [0.0, 0.0, 1.1]},
            **size,
            "lens": {"model": "equirectangular"},
        },
        {"kind": "imu", "name": "imu_front", "rate_hz": 200.0, "mount": {"xyz": [0.2, 0.0, 0.1]}},
        {
            "kind": "imu",
            "name": "imu_rear",
            "rate_hz": 100.0,
            "sampling": "instant",
            "mount": {"xyz": [-0.2, 0.1, 0.1], "rpy_deg": [180.0, 0.0, 0.0]},
        },
        {"kind": "gnss", "name": "antenna_left", "rate_hz": 5.0, "mount": {"xyz": [0.0, 0.25, 0.9]}},
        {"kind": "gnss", "name": "antenna_right", "rate_hz": 5.0, "mount": {"xyz": [0.0, -0.25, 0.9]}},
        {"kind": "wheel_odometry", "rate_hz": 20.0},
    ]


def many_rig() -> Rig:
    """The rig of ``many_sensors``."""
    return Rig.model_validate({"sensors": many_sensors()})
