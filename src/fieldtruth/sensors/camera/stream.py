# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a view of a camera: calibration and images."""

from collections.abc import Iterable

from fieldtruth.drive.track import Stamps
from fieldtruth.record.stream import PoseAt, Sensors, Stream
from fieldtruth.sensors.camera import message
from fieldtruth.sensors.camera.config import Imager


def imager_stream(imager: Imager, stamps: Stamps, world_from_base: PoseAt) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a view on a base that is at ``world_from_base(stamp_ns)``."""
    config, frame, base_from_optical = imager.config, imager.optical_frame, imager.base_from_optical

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        camera, pose = sensors.cameras[config.name], world_from_base(int(stamps[k])) @ base_from_optical
        robot = sensors.robot.get(imager.name)
        picture = camera.render(pose) if robot is None else camera.render(pose, robot)
        yield message.camera_info(k, stamps[k], imager)
        yield message.photograph(k, stamps[k], frame, picture.photo, config.jpeg_quality)
        yield message.tag(k, stamps[k], frame, picture.label)
        if config.depth:
            yield message.depth(k, stamps[k], frame, picture.depth)
        if config.instances:
            yield message.instances(k, stamps[k], frame, picture.instance, wide_ids=sensors.wide_ids)

    return Stream(tuple(imager.topics.values()), stamps, capture)
