# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of IMUs, GNSS receivers and wheels, and where these are not ideal, of the ideal readings after them.

A whole series is measured at once, before recording, since a bias walks; so a message depends on its number only.
"""

from dataclasses import replace

from fieldtruth.bag import base_messages, robot_messages
from fieldtruth.core.arrays import Array
from fieldtruth.core.random import rng_of
from fieldtruth.drive.track import Base, GnssReadings, ImuReadings, Stamps, TachometerReadings, WheelOdometry
from fieldtruth.experiment.gnss_config import GnssConfig
from fieldtruth.experiment.imu_config import ImuConfig
from fieldtruth.experiment.odometry_config import JOINT_STATES, WheelOdometryConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.clocks import Parts, clock_of
from fieldtruth.sensors.imu.noise import measured_imu
from fieldtruth.sensors.wheel_odometry.noise import measured_wheels


def imu_parts(config: ImuConfig, true: ImuReadings, seed: int) -> list[Parts]:
    """Return the stream of an IMU and, unless it is ideal, that of its ideal readings."""
    ideal: Parts = (
        (config.true_topic(config.topic),),
        true.stamps_ns,
        lambda k, _: [robot_messages.imu(k, true, config.frame)],
    )
    if config.is_ideal:
        return [ideal]
    read, covariances = true, robot_messages.NO_COVARIANCES
    if config.signal is not None:
        read, *of = measured_imu(true, config.signal, config.rate_hz, rng_of(seed, config.name))
        covariances = (of[0], of[1], of[2])
    clock = clock_of(config, true.stamps_ns, seed)
    shown = replace(read, stamps_ns=clock.shown_ns)
    own: Parts = (
        (config.topic,),
        true.stamps_ns,
        lambda k, _: [robot_messages.imu(k, shown, config.frame, covariances)],
    )
    return [clock.without_lost(own), ideal]


def gnss_parts(config: GnssConfig, true: GnssReadings, seed: int) -> list[Parts]:
    """Return the stream of a GNSS receiver and, unless it is ideal, that of its ideal readings."""
    ideal: Parts = (
        (config.true_topic(config.topic),),
        true.stamps_ns,
        lambda k, _: [robot_messages.navsat(k, true, config.frame)],
    )
    if config.is_ideal:
        return [ideal]
    clock = clock_of(config, true.stamps_ns, seed)
    shown = replace(true, stamps_ns=clock.shown_ns)
    own: Parts = (
        (config.topic,),
        true.stamps_ns,
        lambda k, _: [robot_messages.navsat(k, shown, config.frame, true.fixes)],
    )
    return [clock.without_lost(own), ideal]


def wheel_parts(config: WheelOdometryConfig, base: Base, every_step: Stamps, rig: Rig, seed: int) -> list[Parts]:
    """Return the streams of tachometers and of odometry and, unless they are ideal, those of ideal ones."""
    ideal = _of_wheels(config, rig, base.tachometers, base.odometry, config.true_topic(""))
    if config.is_ideal:
        return ideal
    tachometers, odometry, covariances = base.tachometers, base.odometry, None
    if config.signal is not None:
        measured = measured_wheels(base, every_step, rig.wheels, config.signal, rng_of(seed, config.name))
        tachometers, odometry = measured.tachometers, measured.odometry
        covariances = (measured.pose_covariance, measured.twist_covariance)
    slow = clock_of(config, tachometers.stamps_ns, seed, "tachometers")
    clock = clock_of(config, odometry.stamps_ns, seed)
    shown = replace(odometry, stamps_ns=clock.shown_ns)
    speeds, (topics, _, messages) = _of_wheels(config, rig, tachometers, shown, "", covariances)
    return [slow.without_lost(speeds), clock.without_lost((topics, odometry.stamps_ns, messages)), *ideal]


def _of_wheels(
    config: WheelOdometryConfig,
    rig: Rig,
    tachometers: TachometerReadings,
    odometry: WheelOdometry,
    ending: str,
    covariances: tuple[Array, Array] | None = None,
) -> list[Parts]:
    """Return the streams of wheels, whose topics have an ending."""
    speeds = tachometers.wheel_speed
    return [
        (
            tuple(topic + ending for topic in rig.wheel_speed_topics),
            tachometers.stamps_ns,
            lambda k, _: map(base_messages.wheel_speed, speeds[k]),
        ),
        (
            (JOINT_STATES + ending, config.topic + ending),
            odometry.stamps_ns,
            lambda k, _: [
                base_messages.joint_states(k, odometry),
                base_messages.wheel_odometry(k, odometry, covariances),
            ],
        ),
    ]
