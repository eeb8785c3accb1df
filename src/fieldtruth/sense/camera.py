# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The camera: a pinhole whose photograph, labels and depth come from the same hit of the ray through each pixel's centre."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fieldtruth.classes import PALETTE
from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.sense import embree, photo
from fieldtruth.sense.hits import HitTable, classify, hit_top
from fieldtruth.sense.packets import Packet, new_packet
from fieldtruth.sense.pinhole import Pinhole, pinhole, set_pixel_ray
from fieldtruth.sense.scene import Scene

EXTRA_SAMPLES: Final = 3
"""Rays that an edge's pixel gets beyond the one through its centre."""

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.TILE_WIDTH, embree.TILE_HEIGHT
_OX, _OY, _DX, _DY, _FAR, _PRIM = (
    embree.ORG_X, embree.ORG_Y, embree.DIR_X, embree.DIR_Y, embree.TFAR, embree.PRIM_ID,
)  # fmt: skip
_intersect: Any = embree.intersect


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
    Free of noise, distortion and exposure time.
    """

    def __init__(self, config: CameraConfig, scene: Scene) -> None:
        self.config = config
        self.scene = scene
        self.pinhole = pinhole(config)
        self._packet, self._shadow = new_packet(coherent=True), new_packet(coherent=True)
        self._linear = np.zeros((0, 0, 3), np.float32)
        self._edges = np.zeros((0, 2), np.int32)

    def label(self, world_from_optical: NDArray[np.float64]) -> LabelImage:
        """Labels, object ids and depth as seen from a pose (4, 4)."""
        seen = self._blank()
        _label(
            self.scene.rays.handle, self.scene.hits, self._packet, _pose(world_from_optical), self.pinhole,
            self.config.far, seen.label, seen.instance, seen.depth,
        )  # fmt: skip
        return seen

    def shoot(self, world_from_optical: NDArray[np.float64]) -> Picture:
        """Take the photograph with its labels, object ids and depth from a pose (4, 4)."""
        seen, pose, studio = self._blank(), _pose(world_from_optical), self.scene.studio
        if not self._linear.size:
            self._linear = np.empty((*seen.label.shape, 3), np.float32)
            self._edges = np.empty((seen.label.size, 2), np.int32)
        rays = (studio, self._packet, self._shadow, pose, self.pinhole, self.config.far)
        photo.first_hits(*rays, seen.label, seen.instance, seen.depth, self._linear)
        count = photo.find_edges(self._linear, seen.instance, self._edges)
        photo.refine(*rays, self._edges, count, EXTRA_SAMPLES, self._linear)
        image = np.empty((*seen.label.shape, 3), np.uint8)
        photo.develop(studio.curve, self._linear, image)
        return Picture(label=seen.label, instance=seen.instance, depth=seen.depth, photo=image)

    def _blank(self) -> LabelImage:
        shape = (self.config.height, self.config.width)
        return LabelImage(
            label=np.empty(shape, np.uint8), instance=np.empty(shape, np.uint16), depth=np.empty(shape, np.float32)
        )


def tag_image(label: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Flat colours (h, w, 3) of class ids (h, w)."""
    return PALETTE[label]


def _pose(world_from_optical: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.ascontiguousarray(world_from_optical, np.float64)


@njit(nogil=True, cache=True)
def _label(
    scene: np.uint64, hits: HitTable, packet: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float,
    label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32],
) -> None:  # fmt: skip
    """Trace the ray through every pixel's centre, tile by tile."""
    height, width = label.shape
    cosine = np.zeros(_LANES)
    for upper in range(0, height, _HEIGHT):
        for left in range(0, width, _WIDTH):
            for lane in range(_LANES):
                u, v = left + lane % _WIDTH, upper + lane // _WIDTH
                cosine[lane] = set_pixel_ray(packet, lane, pose, lens, u, v, far)
            _intersect(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                u, v = left + lane % _WIDTH, upper + lane // _WIDTH
                top, reach = hit_top(packet.words, lane), packet.ray[_FAR + lane]
                x = packet.ray[_OX + lane] + reach * packet.ray[_DX + lane]
                y = packet.ray[_OY + lane] + reach * packet.ray[_DY + lane]
                kind, thing = classify(hits, top, packet.words[_PRIM + lane], x, y)
                label[v, u], instance[v, u] = kind, thing
                depth[v, u] = reach * cosine[lane] if top >= 0 else 0.0
