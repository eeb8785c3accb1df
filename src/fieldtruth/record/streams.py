# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of messages from world, track and rig: each has its stamps and can make any of its readings.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from fieldtruth.bag import base_messages, robot_messages, topics
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.drive.state import poses_at, state_at
from fieldtruth.drive.track import Stamps, Track, stamps_at_rate
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import MountedConfig, SensorConfig
from fieldtruth.record.clocks import clock_of
from fieldtruth.record.stream import PoseAt, Sensors, Stream
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.stream import imager_stream
from fieldtruth.sensors.gnss.stream import gnss_streams
from fieldtruth.sensors.imu.stream import imu_streams
from fieldtruth.sensors.lidar.stream import lidar_stream
from fieldtruth.sensors.wheel_odometry.stream import wheel_streams
from fieldtruth.world.model import World


def streams_of(world: World, track: Track, rig: Rig, *, latched: bool = False) -> list[Stream]:
    """Return every stream of a recording, in the order of ``topics_of``; ``latched``: static objects come once."""

    def stamps_at(rate_hz: float) -> Stamps:
        stamps = track.motion.stamps_ns
        return stamps if track.is_frames else stamps_at_rate(rate_hz, int(stamps[-1]))

    def world_from_base(stamp_ns: int | Stamps) -> Array:
        if isinstance(stamp_ns, np.ndarray):
            return poses_at(track.swept, stamp_ns)
        return state_at(track.swept, stamp_ns).world_from_base

    def camera_stream(config: CameraConfig) -> Callable[..., Stream]:
        kept = clock_of(config, stamps_at(config.rate_hz), world.seed).kept
        return partial(imager_stream, stands=track.is_frames, kept=kept)

    streams = _truth(world, track, rig, stamps_at(topics.POSE_RATE), latched=latched)
    if not track.is_frames:
        streams += _measured(track, rig, world.seed)
    seeing: list[tuple[Any, SensorConfig, Callable[..., Stream]]] = [
        *((each, each, lidar_stream) for each in rig.lidars),
        *((each, each.config, camera_stream(each.config)) for each in rig.imagers),
        *((each, each, scene_stream) for each in rig.scene_sensors),
    ]
    for each, config, make in seeing:
        stamps = stamps_at(config.rate_hz)
        clock = clock_of(config, stamps, world.seed)
        streams.append(clock.without_lost(make(each, stamps, world_from_base, clock.shown_ns)))
    return streams


def _truth(world: World, track: Track, rig: Rig, poses: Stamps, *, latched: bool) -> list[Stream]:
    motion, base = track.motion, track.base
    objects = robot_messages.ModelStatesWriter(world)
    states = robot_messages.ModelStatesWriter(world, rows=GROUND_ID + 1) if latched else objects
    fixed = robot_messages.fixed_transforms(rig)
    every_step = motion.stamps_ns
    rows = np.searchsorted(every_step, poses)

    def tf(k: int, _: Sensors) -> list[bytes]:
        wheels = {} if base is None else base_messages.wheel_transforms(rig, base.wheels.angle[rows[k]])
        return [robot_messages.tf(k, poses[k], state_at(motion, int(poses[k])), wheels)]

    return [
        Stream((topics.CLOCK,), every_step, lambda k, _: [robot_messages.clock(every_step[k])]),
        Stream((topics.TF_STATIC,), every_step[:1], lambda k, _: [robot_messages.tf_static(every_step[k], fixed)]),
        *[Stream((topics.STATIC_MODEL_STATES,), every_step[:1], lambda k, _: [objects.message(k, motion)])] * latched,
        Stream((topics.MODEL_STATES,), every_step, lambda k, _: [states.message(k, motion)]),
        Stream(
            (topics.ODOMETRY,),
            poses,
            lambda k, _: [robot_messages.odometry(k, poses[k], state_at(motion, int(poses[k])))],
        ),
        Stream((topics.TF,), poses, tf),
    ]


def _measured(track: Track, rig: Rig, seed: int) -> list[Stream]:
    streams = [stream for each in rig.imus for stream in imu_streams(each, track.imus[each.name], seed)]
    streams += [stream for each in rig.antennas for stream in gnss_streams(each, track.fixes[each.name], seed)]
    base, wheels = track.base, rig.wheel_odometry
    if base is None or wheels is None:
        return streams
    commands = base.commands
    return [
        *streams,
        *wheel_streams(wheels, rig, base, track.motion.stamps_ns, seed),
        Stream((topics.COMMANDS,), commands.stamps_ns, lambda k, _: [base_messages.command(k, commands)]),
    ]


def scene_stream(config: MountedConfig, stamps: Stamps, world_from_base: PoseAt, shown: Stamps | None = None) -> Stream:
    """Readings at ``stamps`` [ns] of a sensor whose kind another package has added; ``shown`` as in lidar_stream."""
    shown = stamps if shown is None else shown
    base_from_sensor = config.mount.base_from_sensor

    def read(k: int, sensors: Sensors) -> Iterable[bytes]:
        sensor, stamp = sensors.others[config.name], int(stamps[k])
        return sensor.messages(k, int(shown[k]), sensor.read(world_from_base(stamp) @ base_from_sensor))

    return Stream(tuple(topic.name for topic in config.topics()), stamps, read)
