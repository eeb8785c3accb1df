# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of messages from world, track and rig: each has its stamps and can make any of its readings.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

import numpy as np

from fieldtruth.bag import messages, topics
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.drive.track import Commands, Stamps, Track, stamps_at_rate, state_at
from fieldtruth.experiment.rig import Rig
from fieldtruth.record.sensors import series_along, stream_of
from fieldtruth.record.stream import Sensors, Stream
from fieldtruth.sensors.kind import Movement, movement_of
from fieldtruth.world.model import World


def streams_of(
    world: World,
    track: Track,
    rig: Rig,
    *,
    latched: bool = False,
    movement: Movement | None = None,
    seed: int | None = None,
) -> list[Stream]:
    """Return every stream of a recording, in the order of ``topics_of``.

    Args:
        world: what the sensors are in.
        track: the drive.
        rig: the sensors.
        latched: whether static objects come once.
        movement: that of the track, if it was made; it keeps what sensors have measured.
        seed: of the sensors' clocks; None for the world's.
    """
    end_ns, movement = int(track.motion.stamps_ns[-1]), movement or movement_of(track)
    poses = track.motion.stamps_ns if track.is_frames else stamps_at_rate(topics.POSE_RATE, end_ns)
    streams = _truth(world, track, rig, poses, latched=latched)
    for config in rig.in_order():
        series = series_along(config, rig, track, world.seed if seed is None else seed)
        streams += [stream_of(each, movement) for each in series]
        if config.needs_wheels and track.base is not None:
            streams.append(_commands(track.base.commands))
    return streams


def _commands(commands: Commands) -> Stream:
    return Stream((topics.COMMANDS,), commands.stamps_ns, lambda k, _: [messages.command(k, commands)])


def _truth(world: World, track: Track, rig: Rig, poses: Stamps, *, latched: bool) -> list[Stream]:
    motion, base = track.motion, track.base
    objects = messages.ModelStatesWriter(world)
    states = messages.ModelStatesWriter(world, rows=GROUND_ID + 1) if latched else objects
    fixed = messages.fixed_transforms(rig)
    every_step = motion.stamps_ns
    rows = np.searchsorted(every_step, poses)

    def tf(k: int, _: Sensors) -> list[bytes]:
        wheels = {} if base is None else messages.wheel_transforms(rig, base.wheels.angle[rows[k]])
        return [messages.tf(k, poses[k], state_at(motion, int(poses[k])), wheels)]

    return [
        Stream((topics.CLOCK,), every_step, lambda k, _: [messages.clock(every_step[k])]),
        Stream((topics.TF_STATIC,), every_step[:1], lambda k, _: [messages.tf_static(every_step[k], fixed)]),
        *[Stream((topics.STATIC_MODEL_STATES,), every_step[:1], lambda k, _: [objects.message(k, motion)])] * latched,
        Stream((topics.MODEL_STATES,), every_step, lambda k, _: [states.message(k, motion)]),
        Stream(
            (topics.ODOMETRY,),
            poses,
            lambda k, _: [messages.odometry(k, poses[k], state_at(motion, int(poses[k])))],
        ),
        Stream((topics.TF,), poses, tf),
    ]
