# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of the sensors of a rig that measure its motion, each by its kind's module ``sensing``."""

import math

from fieldtruth.drive.physics import STEP_NS
from fieldtruth.drive.track import GnssReadings, ImuReadings, Motion
from fieldtruth.experiment.rig import Rig
from fieldtruth.sensors.gnss.sensing import read_gnss
from fieldtruth.sensors.imu.sensing import read_imu


def sweep_steps(rig: Rig) -> int:
    """Physics steps from a stamp until the last rays of its scan or photograph leave.

    It is 0 unless a LiDAR spins or a camera has a signal with a shutter.
    """
    late_ns = [1e9 / each.rate_hz for each in rig.lidars if each.spinning]
    late_ns += [1e9 * each.signal.late_s for each in rig.cameras if each.signal is not None]
    return math.ceil(max(late_ns, default=0.0) / STEP_NS)


def read_imus(motion: Motion, rig: Rig) -> dict[str, ImuReadings]:
    """Return the readings of every IMU by its name."""
    return {config.name: read_imu(motion, config) for config in rig.imus}


def read_fixes(motion: Motion, rig: Rig) -> dict[str, GnssReadings]:
    """Return the readings of every GNSS receiver by its name."""
    return {config.name: read_gnss(motion, config) for config in rig.antennas}
