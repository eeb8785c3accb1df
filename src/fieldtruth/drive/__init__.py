# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated drive of a Husky in MuJoCo: physics, waypoint follower, route planning, IMU, GNSS and tachometers."""

from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.drive.husky import Command
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import (
    GnssReadings,
    ImuReadings,
    Motion,
    TachometerReadings,
    Track,
    stamps_at_rate,
)

__all__ = [
    "Command",
    "GnssReadings",
    "ImuReadings",
    "Motion",
    "TachometerReadings",
    "Track",
    "WaypointFollower",
    "drive",
    "plan_route",
    "stamps_at_rate",
]
