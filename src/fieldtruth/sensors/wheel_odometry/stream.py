# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The streams of wheel encoders: wheel speeds, and joint states with wheel odometry.

A whole drive is measured at once, before recording; so a message depends on its number only.
"""

from dataclasses import replace

import numpy as np

from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import Base, Stamps, TachometerReadings, WheelOdometry
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.clocks import clock_of
from fieldtruth.record.stream import Stream
from fieldtruth.sensors.wheel_odometry import message
from fieldtruth.sensors.wheel_odometry.config import JOINT_STATES, WheelOdometryConfig
from fieldtruth.sensors.wheel_odometry.noise import WheelErrors


def wheel_streams(config: WheelOdometryConfig, rig: Rig, base: Base, every_step: Stamps, seed: int) -> list[Stream]:
    """Speeds of the wheels, one topic each, and what the robot's driver computes from their angles.

    Unless the encoders are ideal, the ideal ones follow. ``every_step`` are the stamps [ns] of the true angles.
    """
    speeds, odometry = base.tachometers, base.odometry
    names = [tuple(map(config.true_topic, topics)) for topics in (rig.wheel_speed_topics, (JOINT_STATES, config.topic))]
    ideal = [_speeds(names[0], speeds), _odometry(names[1], odometry, odometry.stamps_ns)]
    if config.is_ideal:
        return ideal
    covariances = None
    if config.signal is not None:
        slow_angle = base.wheels.angle[np.searchsorted(every_step, speeds.stamps_ns)]
        noise = WheelErrors(rig.wheels, config.signal, rng_of(seed, config.name))
        read = noise.extend(speeds, odometry, slow_angle)
        speeds, odometry, covariances = read.tachometers, read.odometry, (read.pose_covariance, read.twist_covariance)
    slow = clock_of(config, speeds.stamps_ns, seed, "tachometers")
    clock = clock_of(config, odometry.stamps_ns, seed)
    shown = replace(odometry, stamps_ns=clock.shown_ns)
    own = _odometry((JOINT_STATES, config.topic), shown, odometry.stamps_ns, covariances)
    return [slow.without_lost(_speeds(rig.wheel_speed_topics, speeds)), clock.without_lost(own), *ideal]


def _speeds(topics: tuple[str, ...], readings: TachometerReadings) -> Stream:
    speeds = readings.wheel_speed
    return Stream(topics, readings.stamps_ns, lambda k, _: map(message.wheel_speed, speeds[k]))


def _odometry(
    topics: tuple[str, ...],
    odometry: WheelOdometry,
    stamps_ns: Stamps,
    covariances: message.Covariances | None = None,
) -> Stream:
    """Joint states and odometry at true stamps; those of ``odometry`` are in the headers."""
    return Stream(
        topics,
        stamps_ns,
        lambda k, _: [message.joint_states(k, odometry), message.wheel_odometry(k, odometry, covariances)],
    )
