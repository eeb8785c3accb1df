# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a GNSS receiver as a pure function of the true motion, without noise."""

from fieldtruth.drive.controller import antenna_geodetic
from fieldtruth.drive.track import STEP_NS, GnssReadings, Motion, steps_at_rate
from fieldtruth.sensors.gnss.config import GnssConfig


class GnssTruth:
    """True positions of an antenna, which go on as a motion grows."""

    def __init__(self, config: GnssConfig) -> None:
        self._config, self._until_ns = config, 0

    def extend(self, motion: Motion) -> GnssReadings:
        """Return the geodetic positions that are due since the call before."""
        config, end_ns = self._config, int(motion.stamps_ns[-1])
        rows = steps_at_rate(config.rate_hz, end_ns, self._until_ns) - int(motion.stamps_ns[0]) // STEP_NS
        self._until_ns = end_ns
        geodetic = antenna_geodetic(motion.position[rows], motion.quaternion_wxyz[rows], config.mount)
        return GnssReadings(stamps_ns=motion.stamps_ns[rows], geodetic=geodetic)


def read_gnss(motion: Motion, config: GnssConfig) -> GnssReadings:
    """Return the geodetic positions of the antenna along a motion."""
    return GnssTruth(config).extend(motion)
