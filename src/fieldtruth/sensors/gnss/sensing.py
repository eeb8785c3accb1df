# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a GNSS receiver as a pure function of the true motion, without noise."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.frames import rotation_from_quaternion_wxyz
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.drive.steps import steps_at_rate
from fieldtruth.drive.track import GnssReadings, Motion
from fieldtruth.experiment.fields import Mount
from fieldtruth.sensors.gnss.config import GnssConfig


def read_gnss(motion: Motion, config: GnssConfig) -> GnssReadings:
    """Return the geodetic position of the antenna."""
    rows = steps_at_rate(config.rate_hz, int(motion.stamps_ns[-1])) - 1
    geodetic = antenna_geodetic(motion.position[rows], motion.quaternion_wxyz[rows], config.mount)
    return GnssReadings(stamps_ns=motion.stamps_ns[rows], geodetic=geodetic)


def antenna_geodetic(position: Array, quaternion_wxyz: Array, mount: Mount) -> Array:
    """Latitude [deg], longitude [deg], height [m] (n, 3) of the antenna for poses of base_link (n, 3) and (n, 4)."""
    lever = rotation_from_quaternion_wxyz(quaternion_wxyz) @ np.array(mount.xyz)
    return geodetic_from_world(position + lever)
