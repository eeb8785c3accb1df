# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The stream of a view of a camera: calibration and images."""

from collections.abc import Iterable
from typing import cast

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive.track import Stamps
from fieldtruth.record.stream import Camera, CameraImages, PoseAt, Sensors, SignalCamera, Stream
from fieldtruth.sense.robot_view import RobotView
from fieldtruth.sensors.camera import message
from fieldtruth.sensors.camera.config import Imager
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages


def imager_stream(
    imager: Imager,
    stamps: Stamps,
    world_from_base: PoseAt,
    shown: Stamps | None = None,
    *,
    stands: bool = False,
    kept: NDArray[np.int64] | None = None,
) -> Stream:
    """Calibration and images at ``stamps`` [ns] of a view on a base that is at ``world_from_base(stamp_ns)``.

    Their headers have these stamps, or those that its clock has ``shown``. Where the base ``stands`` at each stamp, it
    has not moved there: exposure and metering have the pose at the stamp. Flow leads to the next reading; if some are
    lost, those are left whose numbers are ``kept``.
    """
    shown = stamps if shown is None else shown
    following = _following(stamps, kept)
    config, frame, base_from_optical = imager.config, imager.optical_frame, imager.base_from_optical

    def look(k: int, camera: Camera, robot: RobotView | None) -> CameraImages:
        pose = world_from_base(int(stamps[k]))
        if config.signal is None:
            return camera.render(pose @ base_from_optical, robot)
        pose_at = _standing_at(pose) if stands else world_from_base
        return cast("SignalCamera", camera).capture(imager, k, int(stamps[k]), pose_at, robot)

    def flow(k: int, camera: Camera, picture: CameraImages, robot: RobotView | None) -> NDArray[np.float32]:
        if following[k] < 0:
            return np.full((*picture.depth.shape, 2), np.nan, np.float32)
        now, later = (world_from_base(int(stamps[i])) @ base_from_optical for i in (k, following[k]))
        return cast("LabelCamera", camera).flow(cast("LabelImages", picture), now, later, robot)

    def capture(k: int, sensors: Sensors) -> Iterable[bytes]:
        camera, robot = sensors.cameras[config.name], sensors.robot.get(imager.name)
        picture = look(k, camera, robot)
        yield message.camera_info(k, shown[k], imager)
        yield message.photograph(k, shown[k], frame, picture.photo, config)
        yield message.tag(k, shown[k], frame, picture.label)
        if config.depth:
            yield message.depth(k, shown[k], frame, picture.depth)
        if config.instances:
            yield message.instances(k, shown[k], frame, picture.instance, wide_ids=sensors.wide_ids)
        if config.normals:
            yield message.normals(k, shown[k], frame, cast("LabelImages", picture).normal)
        if config.flow:
            yield message.flow(k, shown[k], frame, flow(k, camera, picture, robot))

    return Stream(tuple(imager.topics.values()), stamps, capture)


def _following(stamps: Stamps, kept: NDArray[np.int64] | None) -> NDArray[np.int64]:
    """Number of the reading that is kept after each one (n,); -1 after the last."""
    kept = np.arange(len(stamps)) if kept is None else kept
    return np.append(kept, -1)[np.searchsorted(kept, np.arange(len(stamps)), side="right")]


def _standing_at(pose: Array) -> PoseAt:
    return lambda stamps: np.tile(pose, (len(stamps), 1, 1)) if isinstance(stamps, np.ndarray) else pose
