# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of messages from world, track and rig: each has its stamps and can make any of its readings.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import base_messages, robot_messages, sensor_messages, topics
from fieldtruth.core.arrays import Array
from fieldtruth.drive.state import state_at
from fieldtruth.drive.track import Base, Stamps, Track, stamps_at_rate
from fieldtruth.experiment.camera_config import CAMERA_FROM_OPTICAL, CameraConfig
from fieldtruth.experiment.lidar_config import LidarConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.beams import column_times_ns
from fieldtruth.world.model import GROUND_ID, World

PoseAt = Callable[[int], Array]
"""``world_from_base`` (4, 4) at a stamp [ns]."""


class CameraImages(Protocol):
    """Result of a camera: ``photo`` (h, w, 3) RGB, and ``label``, ``instance``, ``depth`` (h, w)."""

    @property
    def photo(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def label(self) -> NDArray[np.uint8]: ...  # noqa: D102
    @property
    def instance(self) -> NDArray[np.uint32]: ...  # noqa: D102
    @property
    def depth(self) -> NDArray[np.float32]: ...  # noqa: D102


class Lidar(Protocol):
    """A LiDAR in a scene."""

    def scan(self, world_from_lidar: Array) -> sensor_messages.Scan:
        """Scan from a pose (4, 4), or from a pose for each column, (columns, 4, 4)."""
        ...


class Camera(Protocol):
    """A camera in a scene."""

    def render(self, world_from_optical: Array) -> CameraImages:
        """Render from a pose (4, 4)."""
        ...


class Sensors(NamedTuple):
    """The sensors of one worker; they own buffers, so threads must not share them."""

    lidar: Lidar | None = None
    camera: Camera | None = None
    wide_ids: bool = False
    """Whether instance ids of their world need more than 16 bits."""


class Stream(NamedTuple):
    """Readings of one source: reading k is taken at ``stamps_ns[k]`` and makes one message for each of ``topics``."""

    topics: tuple[str, ...]
    stamps_ns: Stamps
    messages: Callable[[int, Sensors], Iterable[bytes]]


def streams_of(world: World, track: Track, rig: Rig, *, latched: bool = False) -> list[Stream]:
    """Return every stream of a recording, in the order of the topic table; ``latched``: static objects come once."""

    def stamps_at(rate_hz: float) -> Stamps:
        stamps = track.motion.stamps_ns
        return stamps if track.is_frames else stamps_at_rate(rate_hz, int(stamps[-1]))

    def world_from_base(stamp_ns: int) -> Array:
        return state_at(track.swept, stamp_ns).world_from_base

    streams = _truth(world, track, rig, stamps_at(topics.POSE_RATE), latched=latched)
    if not track.is_frames:
        streams += _measured(track)
    if rig.lidar.enabled:
        streams.append(lidar_stream(rig.lidar, stamps_at(rig.lidar.rate_hz), world_from_base))
    if rig.cameras.enabled:
        stamps = stamps_at(rig.cameras.rate_hz)
        streams += [camera_stream(rig.cameras, side, stamps, world_from_base) for side in topics.SIDES]
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


def _measured(track: Track) -> list[Stream]:
    imu, gnss = track.imu, track.gnss
    streams = [
        Stream((topics.IMU,), imu.stamps_ns, lambda k, _: [robot_messages.imu(k, imu)]),
        Stream((topics.NAVSAT,), gnss.stamps_ns, lambda k, _: [robot_messages.navsat(k, gnss)]),
    ]
    return streams if track.base is None else streams + _of_base(track.base)


def _of_base(base: Base) -> list[Stream]:
    tachometers, odometry, commands = base.tachometers, base.odometry, base.commands
    speeds = tachometers.wheel_speed
    return [
        Stream(topics.WHEEL_SPEEDS, tachometers.stamps_ns, lambda k, _: map(base_messages.wheel_speed, speeds[k])),
        Stream(
            (topics.JOINT_STATES, topics.WHEEL_ODOMETRY),
            odometry.stamps_ns,
            lambda k, _: [base_messages.joint_states(k, odometry), base_messages.wheel_odometry(k, odometry)],
        ),
        Stream((topics.COMMANDS,), commands.stamps_ns, lambda k, _: [base_messages.command(k, commands)]),
    ]


def lidar_stream(config: LidarConfig, stamps: Stamps, world_from_base: PoseAt) -> Stream:
    """Clouds at ``stamps`` [ns] of a LiDAR on a base that is at ``world_from_base(stamp_ns)``, (4, 4)."""
    base_from_lidar = config.mount.base_from_sensor
    sweep_ns = column_times_ns(config)

    def pose_at(stamp_ns: int) -> Array:
        return world_from_base(stamp_ns) @ base_from_lidar

    def scan(k: int, sensors: Sensors) -> Iterable[bytes]:
        assert sensors.lidar is not None
        stamp = int(stamps[k])
        pose = np.stack([pose_at(stamp + int(t)) for t in sweep_ns]) if config.spinning else pose_at(stamp)
        seen = sensors.lidar.scan(pose)
        clock = config.time_field
        yield sensor_messages.point_cloud(
            k, stamp, seen, spinning=config.spinning, wide_ids=sensors.wide_ids, clock=clock
        )

    return Stream((topics.POINTS,), stamps, scan)


def camera_stream(config: CameraConfig, side: sensor_messages.Side, stamps: Stamps, world_from_base: PoseAt) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a camera on a base that is at ``world_from_base(stamp_ns)``."""
    mount = config.left if side == "left" else config.right
    base_from_optical = mount.base_from_sensor @ CAMERA_FROM_OPTICAL

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        assert sensors.camera is not None
        picture = sensors.camera.render(world_from_base(int(stamps[k])) @ base_from_optical)
        yield sensor_messages.camera_info(k, stamps[k], side, config)
        yield sensor_messages.photograph(k, stamps[k], side, picture.photo, config.jpeg_quality)
        yield sensor_messages.tag(k, stamps[k], side, picture.label)
        if config.depth:
            yield sensor_messages.depth(k, stamps[k], side, picture.depth)
        if config.instances:
            yield sensor_messages.instances(k, stamps[k], side, picture.instance, wide_ids=sensors.wide_ids)

    names = [topics.camera_info(side), topics.photograph(side), topics.tag(side)]
    names += [topics.depth(side)] * config.depth + [topics.instances(side)] * config.instances
    return Stream(tuple(names), stamps, capture)
