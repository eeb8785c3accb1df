# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a view of a camera: calibration and images."""

from collections.abc import Iterable

from fieldtruth.drive.track import Stamps
from fieldtruth.record.stream import PoseAt, Sensors, Stream
from fieldtruth.sensors.camera import message
from fieldtruth.sensors.camera.config import Imager


def imager_stream(imager: Imager, stamps: Stamps, world_from_base: PoseAt, shown: Stamps | None = None) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a view on a base that is at ``world_from_base(stamp_ns)``.

    Their headers have these stamps, or those that its clock has ``shown``.
    """
    shown = stamps if shown is None else shown
    config, frame, base_from_optical = imager.config, imager.optical_frame, imager.base_from_optical

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        camera, pose = sensors.cameras[config.name], world_from_base(int(stamps[k])) @ base_from_optical
        robot = sensors.robot.get(imager.name)
        picture = camera.render(pose) if robot is None else camera.render(pose, robot)
        yield message.camera_info(k, shown[k], imager)
        yield message.photograph(k, shown[k], frame, picture.photo, config.jpeg_quality)
        yield message.tag(k, shown[k], frame, picture.label)
        if config.depth:
            yield message.depth(k, shown[k], frame, picture.depth)
        if config.instances:
            yield message.instances(k, shown[k], frame, picture.instance, wide_ids=sensors.wide_ids)

    return Stream(tuple(imager.topics.values()), stamps, capture)
