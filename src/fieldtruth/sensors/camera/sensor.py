# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera as a kind of sensor: calibration and images of its view, or of both views of a pair."""

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.lenses import directions
from fieldtruth.core.readings import Image
from fieldtruth.drive.track import PoseAt
from fieldtruth.experiment.sensor_config import Output
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.sense.robot import RobotView, part_table, robot_view
from fieldtruth.sensors.camera import message
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import Camera, CameraImages, IdealCamera, Light, standing_at
from fieldtruth.sensors.kind import At, Rays, Sensor, SensorWorld

_STEP = transforms.pose((0.01, 0.0, 0.04), (0.0, 0.5, 0.0))
"""From an optical frame to that of the next image: 1 m/s and 12 deg/s at 25 Hz."""


def pixel_directions(config: CameraConfig) -> Float32Array:
    """Unit directions (h, w, 3) through the pixel centres in the optical frame.

    Pixels for which the lens has no ray get the optical axis, because bare Embree traces rows and columns.
    """
    u, v = np.arange(config.width), np.arange(config.height)[:, None]
    found = np.asarray(directions(config.projection, u, v), np.float32)
    return np.where(np.isnan(found), np.array([0.0, 0.0, 1.0], np.float32), found)


class CameraSensor(Sensor):
    """A camera, or a stereo pair, whose views share its buffers."""

    config_type = CameraConfig
    config: CameraConfig

    def __init__(self, config: CameraConfig, sensor_world: SensorWorld) -> None:
        super().__init__(config, sensor_world)
        self._views: dict[str, Imager] = {imager.side: imager for imager in config.imagers()}

    @cached_property
    def _camera(self) -> Camera:
        made = self.sensor_world
        return Camera(self.config, made.baked, reuse=made.reuse, seed=made.seed)

    @cached_property
    def _labels(self) -> LabelCamera:
        return LabelCamera(self.config, self.sensor_world.scene, reuse=self.sensor_world.reuse)

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

    def labels(self, output: Output, at: At) -> NDArray[np.uint8]:
        """Trace the class ids of a view, for which no light needs to be baked."""
        imager = self._views[output.part]
        pose = at.movement.pose(at.stamp_ns) @ imager.base_from_optical
        return self._labels.label(pose, self._robot(imager)).label

    def rays(self) -> Rays:
        """Rays through the pixels' centres; they give label images, photographs, normals and optical flow."""
        camera = IdealCamera(self.config, self.sensor_world.baked, reuse=True)
        geometry = LabelCamera(self.config.model_copy(update={"normals": True}), self.sensor_world.scene, reuse=True)

        def flow(pose: Array) -> object:  # from the labels that were just made from the same pose
            assert geometry.last is not None
            return geometry.flow(geometry.last, pose, pose @ _STEP)

        return Rays(
            pixel_directions(self.config),
            self.config.far,
            ({"label_image": camera.label}, {"photograph": camera.render}, {"normals": geometry.label, "flow": flow}),
        )

    def messages(self, output: Output, number: int, reading: Image) -> Iterable[bytes]:
        """Serialise calibration, photograph, tag image and what else the camera publishes."""
        config, stamp, frame = self.config, reading.header_ns, reading.frame
        assert reading.photo is not None
        assert reading.label is not None
        yield message.camera_info(number, stamp, self._views[output.part])
        yield message.photograph(number, stamp, frame, reading.photo, config)
        yield message.tag(number, stamp, frame, reading.label)
        if config.depth and reading.depth is not None:
            yield message.depth(number, stamp, frame, reading.depth)
        if config.instances and reading.instance is not None:
            yield message.instances(number, stamp, frame, reading.instance, wide_ids=self.sensor_world.wide_ids)
        if config.normals and reading.normal is not None:
            yield message.normals(number, stamp, frame, reading.normal)
        if config.flow and reading.flow is not None:
            yield message.flow(number, stamp, frame, reading.flow)

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
