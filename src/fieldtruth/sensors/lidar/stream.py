# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a LiDAR: its point clouds."""

from collections.abc import Iterable

from fieldtruth.drive.track import Stamps
from fieldtruth.record.stream import PoseAt, Sensors, Stream
from fieldtruth.sensors.lidar.beams import sweep_times_ns
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.message import point_cloud


def lidar_stream(config: LidarConfig, stamps: Stamps, world_from_base: PoseAt, shown: Stamps | None = None) -> Stream:
    """Clouds at ``stamps`` [ns] of a LiDAR on a base that is at ``world_from_base(stamp_ns)``.

    Their headers have these stamps, or those that its clock has ``shown``.
    """
    shown = stamps if shown is None else shown
    base_from_lidar = config.mount.base_from_sensor
    sweep_ns = sweep_times_ns(config)

    def scan(k: int, sensors: Sensors) -> Iterable[bytes]:
        stamp = int(stamps[k])
        pose = world_from_base(stamp + sweep_ns if config.spinning else stamp) @ base_from_lidar
        lidar = sensors.lidars[config.name]
        yield point_cloud(k, int(shown[k]), lidar.scan(pose, stamp, k), config, wide_ids=sensors.wide_ids)

    return Stream((config.topic,), stamps, scan)
