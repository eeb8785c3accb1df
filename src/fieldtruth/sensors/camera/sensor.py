# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera as a kind of sensor: calibration and images of its view, or of both views of a pair."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.readings import Image
from fieldtruth.drive.track import PoseAt
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.sense.robot import RobotView, part_table, robot_view
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera, CameraImages, Light, standing_at
from fieldtruth.sensors.kind import At, Sensor, SensorWorld


class CameraSensor(Sensor):
    """A camera, or a stereo pair, whose views share its buffers."""

    config_type = CameraConfig
    config: CameraConfig

    def __init__(self, config: CameraConfig, sensor_world: SensorWorld) -> None:
        super().__init__(config, sensor_world)
        self._camera = Camera(config, sensor_world.baked, reuse=sensor_world.reuse, seed=sensor_world.seed)
        self._views: dict[str, Imager] = {imager.side: imager for imager in config.imagers()}

    def truth(self, output: Output, at: At) -> Image | Light:
        """Render the images of a view; with a signal, collect the light of its photograph."""
        imager = self._views[output.part]
        if self.config.signal is None:
            pose = at.movement.pose(at.stamp_ns) @ imager.base_from_optical
            return self._image(self._camera.render(pose, self._robot(imager)), imager, at)
        return self._camera.light(imager, at.stamp_ns, _poses(at), self._robot(imager))

    def signal(self, output: Output, at: At, truth: Light) -> Image:
        """Develop the light that was collected last."""
        imager = self._views[output.part]
        return self._image(self._camera.develop(truth, imager, at.number, at.stamp_ns, _poses(at)), imager, at)

    def messages(self, output: Output, number: int, reading: Image) -> Iterable[bytes]:
        """Serialise calibration, photograph, tag image and what else the camera publishes."""
        config, stamp, frame = self.config, reading.header_ns, reading.frame
        assert reading.photo is not None
        assert reading.label is not None
        yield camera_info(number, stamp, self._views[output.part])
        yield photograph(number, stamp, frame, reading.photo, config)
        yield tag(number, stamp, frame, reading.label)
        if config.depth and reading.depth is not None:
            yield depth(number, stamp, frame, reading.depth)
        if config.instances and reading.instance is not None:
            yield instances(number, stamp, frame, reading.instance, wide_ids=self.sensor_world.wide_ids)
        if config.normals and reading.normal is not None:
            yield normals(number, stamp, frame, reading.normal)
        if config.flow and reading.flow is not None:
            yield flow(number, stamp, frame, reading.flow)

    def _image(self, images: CameraImages, imager: Imager, at: At) -> Image:
        return Image(
            **at.stamps,
            frame=imager.optical_frame,
            photo=images.photo,
            label=images.label,
            depth=np.where(images.depth > 0.0, images.depth, np.float32(np.inf)),
            instance=images.instance,
            normal=images.normal if self.config.normals else None,
            flow=self._flow(images, imager, at) if self.config.flow else None,
        )

    def _flow(self, images: CameraImages, imager: Imager, at: At) -> NDArray[np.float32]:
        """Flow to the next image of the view; unknown after the last."""
        if at.next_ns is None:
            return np.full((*images.depth.shape, 2), np.nan, np.float32)
        now, later = (at.movement.pose(stamp) @ imager.base_from_optical for stamp in (at.stamp_ns, at.next_ns))
        return self._camera.flow(images, now, later, self._robot(imager))

    def _robot(self, imager: Imager) -> RobotView | None:
        """Return the robot as the view sees it; None if it does not."""
        parts = self.sensor_world.robot_parts
        if not parts:
            return None
        return self.sensor_world.once(("robot in", imager.name), lambda: robot_view(part_table(parts), imager))


def _poses(at: At) -> PoseAt:
    """Motion around a reading; where the robot stands it has not moved, nor did it when the light was metered."""
    return standing_at(at.movement.pose(at.stamp_ns)) if at.movement.stands else at.movement.pose
