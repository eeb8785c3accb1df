# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streams of messages from world, track and rig: each has its stamps and can make any of its readings.

A reading depends only on its number, so parts of a recording can be made in any order and by any thread.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import base_messages, robot_messages, sensor_messages, topics
from fieldtruth.core.arrays import Array
from fieldtruth.drive.state import poses_at, state_at
from fieldtruth.drive.track import Base, GnssReadings, ImuReadings, Stamps, Track, stamps_at_rate
from fieldtruth.experiment.camera_config import Imager
from fieldtruth.experiment.gnss_config import GnssConfig
from fieldtruth.experiment.imu_config import ImuConfig
from fieldtruth.experiment.lidar_config import LidarConfig
from fieldtruth.experiment.odometry_config import JOINT_STATES
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.sensor_config import MountedConfig
from fieldtruth.sense.beams import sweep_times_ns
from fieldtruth.sense.scene_sensor import SceneSensor
from fieldtruth.world.model import GROUND_ID, World

PoseAt = Callable[[int | Stamps], Array]
"""``world_from_base`` (4, 4) at a stamp [ns], or (n, 4, 4) at n."""


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

    def scan(self, world_from_lidar: Array, stamp_ns: int = 0) -> sensor_messages.Scan:
        """Scan from a pose (4, 4), or from those at each column's beginning and at the end, (columns + 1, 4, 4)."""
        ...


class Camera(Protocol):
    """A camera in a scene."""

    def render(self, world_from_optical: Array) -> CameraImages:
        """Render from a pose (4, 4)."""
        ...


class SignalCamera(Camera, Protocol):
    """A camera with the signal of a real one."""

    def capture(self, imager: Imager, number: int, stamp_ns: int, world_from_base: PoseAt) -> CameraImages:
        """Photograph ``number`` of a view at a stamp [ns]; the other images are those of the pose at the stamp."""
        ...


class Sensors(NamedTuple):
    """The sensors of one worker; they own buffers, so threads must not share them."""

    lidars: Mapping[str, Lidar] = MappingProxyType({})
    cameras: Mapping[str, Camera] = MappingProxyType({})
    others: Mapping[str, SceneSensor] = MappingProxyType({})
    """By name of the sensor; both views of a pair have the same camera."""
    wide_ids: bool = False
    """Whether instance ids of their world need more than 16 bits."""


class Stream(NamedTuple):
    """Readings of one source: reading k is taken at ``stamps_ns[k]`` and makes one message for each of ``topics``."""

    topics: tuple[str, ...]
    stamps_ns: Stamps
    messages: Callable[[int, Sensors], Iterable[bytes]]


def streams_of(world: World, track: Track, rig: Rig, *, latched: bool = False) -> list[Stream]:
    """Return every stream of a recording, in the order of ``topics_of``; ``latched``: static objects come once."""

    def stamps_at(rate_hz: float) -> Stamps:
        stamps = track.motion.stamps_ns
        return stamps if track.is_frames else stamps_at_rate(rate_hz, int(stamps[-1]))

    def world_from_base(stamp_ns: int | Stamps) -> Array:
        if isinstance(stamp_ns, np.ndarray):
            return poses_at(track.swept, stamp_ns)
        return state_at(track.swept, stamp_ns).world_from_base

    streams = _truth(world, track, rig, stamps_at(topics.POSE_RATE), latched=latched)
    if not track.is_frames:
        streams += _measured(track, rig)
    streams += [lidar_stream(each, stamps_at(each.rate_hz), world_from_base) for each in rig.lidars]
    streams += [
        imager_stream(each, stamps_at(each.config.rate_hz), world_from_base, stands=track.is_frames)
        for each in rig.imagers
    ]
    streams += [scene_stream(each, stamps_at(each.rate_hz), world_from_base) for each in rig.scene_sensors]
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


def _measured(track: Track, rig: Rig) -> list[Stream]:
    streams = [_imu_stream(config, track.imus[config.name]) for config in rig.imus]
    streams += [_gnss_stream(config, track.fixes[config.name]) for config in rig.antennas]
    return streams if track.base is None or rig.wheel_odometry is None else streams + _of_base(track.base, rig)


def _imu_stream(config: ImuConfig, readings: ImuReadings) -> Stream:
    return Stream((config.topic,), readings.stamps_ns, lambda k, _: [robot_messages.imu(k, readings, config.frame)])


def _gnss_stream(config: GnssConfig, readings: GnssReadings) -> Stream:
    return Stream((config.topic,), readings.stamps_ns, lambda k, _: [robot_messages.navsat(k, readings, config.frame)])


def _of_base(base: Base, rig: Rig) -> list[Stream]:
    tachometers, odometry, commands = base.tachometers, base.odometry, base.commands
    speeds = tachometers.wheel_speed
    config = rig.wheel_odometry
    assert config is not None
    return [
        Stream(
            rig.wheel_speed_topics,
            tachometers.stamps_ns,
            lambda k, _: map(base_messages.wheel_speed, speeds[k]),
        ),
        Stream(
            (JOINT_STATES, config.topic),
            odometry.stamps_ns,
            lambda k, _: [base_messages.joint_states(k, odometry), base_messages.wheel_odometry(k, odometry)],
        ),
        Stream((topics.COMMANDS,), commands.stamps_ns, lambda k, _: [base_messages.command(k, commands)]),
    ]


def lidar_stream(config: LidarConfig, stamps: Stamps, world_from_base: PoseAt) -> Stream:
    """Clouds at ``stamps`` [ns] of a LiDAR on a base that is at ``world_from_base(stamp_ns)``."""
    base_from_lidar = config.mount.base_from_sensor
    sweep_ns = sweep_times_ns(config)

    def scan(k: int, sensors: Sensors) -> Iterable[bytes]:
        stamp = int(stamps[k])
        pose = world_from_base(stamp + sweep_ns if config.spinning else stamp) @ base_from_lidar
        lidar = sensors.lidars[config.name]
        seen = lidar.scan(pose) if config.pattern is None else lidar.scan(pose, stamp)
        yield sensor_messages.point_cloud(
            k,
            stamp,
            seen,
            frame=config.frame,
            spinning=config.spinning,
            wide_ids=sensors.wide_ids,
            clock=config.time_field,
            maker=config.point_fields,
        )

    return Stream((config.topic,), stamps, scan)


def scene_stream(config: MountedConfig, stamps: Stamps, world_from_base: PoseAt) -> Stream:
    """Readings at ``stamps`` [ns] of a sensor whose kind another package has added."""
    base_from_sensor = config.mount.base_from_sensor

    def read(k: int, sensors: Sensors) -> Iterable[bytes]:
        sensor, stamp = sensors.others[config.name], int(stamps[k])
        return sensor.messages(k, stamp, sensor.read(world_from_base(stamp) @ base_from_sensor))

    return Stream(tuple(topic.name for topic in config.topics()), stamps, read)


def imager_stream(imager: Imager, stamps: Stamps, world_from_base: PoseAt, *, stands: bool = False) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a view on a base that is at ``world_from_base(stamp_ns)``.

    Where the base ``stands`` at each stamp, it has not moved there: exposure and metering have the pose at the stamp.
    """
    config, frame, base_from_optical = imager.config, imager.optical_frame, imager.base_from_optical

    def look(k: int, camera: Camera) -> CameraImages:
        if config.signal is None:
            return camera.render(world_from_base(int(stamps[k])) @ base_from_optical)
        pose_at = _standing_at(world_from_base(int(stamps[k]))) if stands else world_from_base
        return cast("SignalCamera", camera).capture(imager, k, int(stamps[k]), pose_at)

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        picture = look(k, sensors.cameras[config.name])
        yield sensor_messages.camera_info(k, stamps[k], imager)
        yield sensor_messages.photograph(k, stamps[k], frame, picture.photo, config.jpeg_quality)
        yield sensor_messages.tag(k, stamps[k], frame, picture.label)
        if config.depth:
            yield sensor_messages.depth(k, stamps[k], frame, picture.depth)
        if config.instances:
            yield sensor_messages.instances(k, stamps[k], frame, picture.instance, wide_ids=sensors.wide_ids)

    return Stream(tuple(imager.topics.values()), stamps, capture)


def _standing_at(pose: Array) -> PoseAt:
    return lambda stamps: np.tile(pose, (len(stamps), 1, 1)) if isinstance(stamps, np.ndarray) else pose
