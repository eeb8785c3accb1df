# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a view of a camera: calibration and images."""

from collections.abc import Iterable
from typing import cast

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Stamps
from fieldtruth.record.stream import Camera, CameraImages, PoseAt, Sensors, SignalCamera, Stream
from fieldtruth.sense.robot_view import RobotView
from fieldtruth.sensors.camera import message
from fieldtruth.sensors.camera.config import Imager


def imager_stream(
    imager: Imager, stamps: Stamps, world_from_base: PoseAt, shown: Stamps | None = None, *, stands: bool = False
) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a view on a base that is at ``world_from_base(stamp_ns)``.

    Their headers have these stamps, or those that its clock has ``shown``. Where the base ``stands`` at each stamp, it
    has not moved there: exposure and metering have the pose at the stamp.
    """
    shown = stamps if shown is None else shown
    config, frame, base_from_optical = imager.config, imager.optical_frame, imager.base_from_optical

    def look(k: int, camera: Camera, robot: RobotView | None) -> CameraImages:
        pose = world_from_base(int(stamps[k]))
        if config.signal is None:
            return camera.render(pose @ base_from_optical, robot)
        pose_at = _standing_at(pose) if stands else world_from_base
        return cast("SignalCamera", camera).capture(imager, k, int(stamps[k]), pose_at, robot)

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        picture = look(k, sensors.cameras[config.name], sensors.robot.get(imager.name))
        yield message.camera_info(k, shown[k], imager)
        yield message.photograph(k, shown[k], frame, picture.photo, config.jpeg_quality)
        yield message.tag(k, shown[k], frame, picture.label)
        if config.depth:
            yield message.depth(k, shown[k], frame, picture.depth)
        if config.instances:
            yield message.instances(k, shown[k], frame, picture.instance, wide_ids=sensors.wide_ids)

    return Stream(tuple(imager.topics.values()), stamps, capture)


def _standing_at(pose: Array) -> PoseAt:
    return lambda stamps: np.tile(pose, (len(stamps), 1, 1)) if isinstance(stamps, np.ndarray) else pose
