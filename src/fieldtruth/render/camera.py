# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera: photograph, labels and depth come from the same ray through each pixel's centre."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.render.bake import BakedScene
from fieldtruth.render.photo import new_darkroom, take
from fieldtruth.sense.label_camera import LabelCamera, LabelImages

EXTRA_SAMPLES: Final = 2
"""Rays per pixel at edges, in addition to the one through the pixel's centre."""


@dataclass(frozen=True, kw_only=True)
class CameraImages(LabelImages):
    """Label, instance and depth images, and the photograph ``photo`` (h, w, 3), sRGB, of the same rays."""

    photo: NDArray[np.uint8]


class Camera(LabelCamera):
    """A ``LabelCamera`` that also renders photographs of a baked scene.

    ``exposure`` is relative to that of an open meadow; None takes the exposure chosen for the world, which suits a
    camera near the ground.
    """

    def __init__(
        self, config: CameraConfig, baked: BakedScene, *, reuse: bool = False, exposure: float | None = None
    ) -> None:
        super().__init__(config, baked.scene, reuse=reuse)
        self._shading = baked.shading
        if exposure is not None:
            self._shading = self._shading._replace(gain=np.float32(exposure))
        self._darkroom = new_darkroom(config.height, config.width)
        self._images: CameraImages | None = None

    def render(self, world_from_optical: NDArray[np.float64]) -> CameraImages:
        """Photograph, label, instance and depth images from a pose (4, 4)."""
        images = self._images
        if images is None:
            shape = (self.config.height, self.config.width)
            images = CameraImages(
                label=np.empty(shape, np.uint8), instance=np.empty(shape, np.uint16),
                depth=np.empty(shape, np.float32), photo=np.empty((*shape, 3), np.uint8),
            )  # fmt: skip
        take(
            self._shading, self._darkroom, np.ascontiguousarray(world_from_optical, np.float64), self.pinhole,
            self.config.far, EXTRA_SAMPLES, images.label, images.instance, images.depth, images.photo,
        )  # fmt: skip
        if self._reuse:
            self._images = images
        return images
