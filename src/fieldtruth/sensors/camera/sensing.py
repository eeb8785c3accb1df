# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ideal camera: photograph, labels and depth come from the same ray through each pixel's centre."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_families import ImagingConfig
from fieldtruth.kernels.camera import tonemap
from fieldtruth.kernels.packets import LabelBuffers
from fieldtruth.kernels.photograph import new_framebuffer, render_linear
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.robot import paint_robot
from fieldtruth.sense.robot import RobotView, hide_world
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages


@dataclass(frozen=True, kw_only=True)
class CameraImages(LabelImages):
    """Label, instance and depth images, and the photograph ``photo`` (h, w, 3), sRGB, of the same rays."""

    photo: NDArray[np.uint8]


class IdealCamera(LabelCamera):
    """A ``LabelCamera`` that also renders ideal photographs of a baked scene, whatever its configuration's signal.

    ``exposure`` is relative to that of an open meadow; None takes the exposure chosen for the world, which suits a
    camera near the ground.
    """

    def __init__(
        self, config: ImagingConfig, baked: BakedScene, *, reuse: bool = False, exposure: float | None = None
    ) -> None:
        super().__init__(config, baked.scene, reuse=reuse)
        self._shading = baked.shading
        if exposure is not None:
            self._shading = self._shading._replace(exposure=np.float32(exposure))
        buffers = new_framebuffer(config.height, config.width)
        self._framebuffer = buffers._replace(shading=buffers.shading._replace(batch=self._batch))
        self._images: CameraImages | None = None

    def render(self, world_from_optical: Array, robot: RobotView | None = None) -> CameraImages:
        """Photograph, label, instance and depth images from a pose (4, 4), with what the view sees of the robot."""
        images = self._own_images()
        labels = self._buffers(images)
        shading, buffers, view = self._shading, self._framebuffer, self._view(world_from_optical)
        render_linear(shading, buffers, view, labels)
        if robot is not None:
            self._paint(robot, world_from_optical, labels)
        tonemap(buffers.linear, images.photo)
        return images

    def _paint(self, robot: RobotView, world_from_optical: Array, labels: LabelBuffers) -> None:
        """Put the robot before the world, in the light and in the labels."""
        world_from_base = world_from_optical @ robot.optical_from_base
        paint_robot(self._shading, robot, world_from_base, labels.depth, self._framebuffer.linear)
        hide_world(robot, labels)

    def _own_images(self) -> CameraImages:
        """Arrays of images, new ones unless they are reused."""
        if self._images is not None:
            return self._images
        h, w = self.config.height, self.config.width
        images = CameraImages(
            label=np.empty((h, w), np.uint8),
            instance=np.empty((h, w), np.uint32),
            depth=np.empty((h, w), np.float32),
            normal=self._own_normals(),
            photo=np.empty((h, w, 3), np.uint8),
        )
        if self._reuse:
            self._images = images
        return images
