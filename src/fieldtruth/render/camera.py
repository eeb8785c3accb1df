# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera: a pinhole whose photograph, labels and depth come from one hit of the ray through each pixel's centre."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import PALETTE
from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.render.photo import Darkroom, new_darkroom, take
from fieldtruth.sense.packets import new_packet
from fieldtruth.sense.pinhole import pinhole
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.strip import STRIP_ROWS, label_image, new_strip

EXTRA_SAMPLES: Final = 2
"""Rays that an edge's pixel gets beyond the one through its centre."""


@dataclass(frozen=True, kw_only=True)
class LabelImage:
    """What is seen: class id ``label`` (h, w), object id ``instance`` (h, w), and ``depth`` (h, w) [m].

    Depth is measured along the optical axis and is 0 where the sky is seen. The sky's object id is 0.
    """

    label: NDArray[np.uint8]
    instance: NDArray[np.uint16]
    depth: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Picture(LabelImage):
    """A label image and the photograph ``photo`` (h, w, 3), sRGB, of the same hits."""

    photo: NDArray[np.uint8]


class Camera:
    """A camera in a scene. One thread at a time may use it; make one per thread, they are cheap.

    The origin is the optical frame of REP-103: x right, y down, z forward. The ray of pixel (row v, column u) leaves
    through the pixel's centre in the direction ((u - cx) / fx, (v - cy) / fy, 1). What is farther than ``far`` is sky.
    Free of noise, distortion and exposure time. With ``reuse`` each image overwrites the arrays of the one before: in a
    long row of images, fresh memory was measured to cost a tenth of the time. ``gain`` is the exposure relative to that
    on an open meadow; None takes the world's own, which suits a robot on its ground.
    """

    def __init__(self, config: CameraConfig, scene: Scene, *, reuse: bool = False, gain: float | None = None) -> None:
        self.config = config
        self.scene = scene
        self.pinhole = pinhole(config)
        self._packet, self._strip = new_packet(coherent=True), new_strip(STRIP_ROWS * config.width)
        self._darkroom: Darkroom | None = None
        self._reuse = reuse
        self._gain = gain
        self._last: Picture | None = None

    def label(self, world_from_optical: NDArray[np.float64]) -> LabelImage:
        """Labels, object ids and depth as seen from a pose (4, 4)."""
        seen = self._room()
        label_image(
            self.scene.rays.handle, self.scene.hits, self._packet, _pose(world_from_optical), self.pinhole,
            self.config.far, self._strip, seen.label, seen.instance, seen.depth,
        )  # fmt: skip
        return seen

    def shoot(self, world_from_optical: NDArray[np.float64]) -> Picture:
        """Take the photograph with its labels, object ids and depth from a pose (4, 4)."""
        if self._darkroom is None:
            self._darkroom = new_darkroom(self.config.height, self.config.width)
        seen, studio = self._room(), self.scene.studio
        if self._gain is not None:
            studio = studio._replace(gain=np.float32(self._gain))
        take(
            studio, self._darkroom, _pose(world_from_optical), self.pinhole, self.config.far,
            EXTRA_SAMPLES, seen.label, seen.instance, seen.depth, seen.photo,
        )  # fmt: skip
        return seen

    def _room(self) -> Picture:
        if self._last is not None:
            return self._last
        shape = (self.config.height, self.config.width)
        room = Picture(
            label=np.empty(shape, np.uint8), instance=np.empty(shape, np.uint16), depth=np.empty(shape, np.float32),
            photo=np.empty((*shape, 3), np.uint8),
        )  # fmt: skip
        if self._reuse:
            self._last = room
        return room


def tag_image(label: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Flat colours (h, w, 3) of class ids (h, w)."""
    return np.take(PALETTE, label, axis=0)


def _pose(world_from_optical: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.ascontiguousarray(world_from_optical, np.float64)
