# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The streams of a GNSS receiver."""

from dataclasses import replace

from fieldtruth.drive.track import GnssReadings
from fieldtruth.record.clocks import clock_of
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.gnss import message
from fieldtruth.sensors.gnss.config import GnssConfig


def gnss_streams(config: GnssConfig, true: GnssReadings, seed: int) -> list[Stream]:
    """Fixes of a receiver and, unless it is ideal, the ideal ones."""
    topic, stamps = config.true_topic(config.topic), true.stamps_ns
    ideal = Stream((topic,), stamps, lambda k, _: [message.navsat(k, true, config.frame)])
    if config.is_ideal:
        return [ideal]
    clock = clock_of(config, stamps, seed)
    shown = replace(true, stamps_ns=clock.shown_ns)
    own = Stream((config.topic,), stamps, lambda k, _: [message.navsat(k, shown, config.frame, true.fixes)])
    return [clock.without_lost(own), ideal]
