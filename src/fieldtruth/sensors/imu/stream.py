# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The streams of an inertial measurement unit.

A whole series is measured at once, before recording, since a bias walks; so a message depends on its number only.
"""

from dataclasses import replace

from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import ImuReadings
from fieldtruth.record.clocks import clock_of
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.imu import message
from fieldtruth.sensors.imu.config import ImuConfig
from fieldtruth.sensors.imu.noise import ImuErrors


def imu_streams(config: ImuConfig, true: ImuReadings, seed: int) -> list[Stream]:
    """Readings of an IMU and, unless it is ideal, the ideal ones."""
    topic, stamps = config.true_topic(config.topic), true.stamps_ns
    ideal = Stream((topic,), stamps, lambda k, _: [message.imu(k, true, config.frame)])
    if config.is_ideal:
        return [ideal]
    read, covariances = true, message.UNKNOWN
    if config.signal is not None:
        read, *of = ImuErrors(config.signal, config.rate_hz, rng_of(seed, config.name)).extend(true)
        covariances = (of[0], of[1], of[2])
    clock = clock_of(config, stamps, seed)
    shown = replace(read, stamps_ns=clock.shown_ns)
    own = Stream((config.topic,), stamps, lambda k, _: [message.imu(k, shown, config.frame, covariances)])
    return [clock.without_lost(own), ideal]
