# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a GNSS receiver."""

from fieldtruth.drive.track import GnssReadings
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.gnss import message
from fieldtruth.sensors.gnss.config import GnssConfig


def gnss_stream(config: GnssConfig, readings: GnssReadings) -> Stream:
    """Fixes of a receiver."""
    return Stream((config.topic,), readings.stamps_ns, lambda k, _: [message.navsat(k, readings, config.frame)])
