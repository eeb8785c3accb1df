# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A strip of image points: traced together, then named, painted and lit in passes of their own.

Passes over some thousand points let each kernel unpack its tables once, and let shadow rays be packed densely.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, classify, hit_top
from fieldtruth.sense.packets import Packet
from fieldtruth.sense.pinhole import Pinhole, set_pixel_ray

STRIP_ROWS: Final = embree.TILE_HEIGHT

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.TILE_WIDTH, embree.TILE_HEIGHT
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_FAR, _PRIM, _U, _V = embree.TFAR, embree.PRIM_ID, embree.HIT_U, embree.HIT_V
_intersect: Any = embree.intersect


class Strip(NamedTuple):
    """What the rays of n image points hit. Where ``top`` is -1 they hit nothing and only ``direction`` counts."""

    image: NDArray[np.float32]  # (n, 2) image point (u, v) [pixel]
    direction: NDArray[np.float32]  # (n, 3) unit, world frame
    cosine: NDArray[np.float64]  # (n,) of the angle to the optical axis
    top: NDArray[np.int32]  # (n,) row of the thing that was hit
    primitive: NDArray[np.int32]  # (n,) its triangle
    barycentric: NDArray[np.float32]  # (n, 2) weights of the triangle's second and third corner
    reach: NDArray[np.float32]  # (n,) [m] along the ray
    point: NDArray[np.float32]  # (n, 3) [m] world frame


def new_strip(count: int) -> Strip:
    """Room for ``count`` image points; a thread owns its own."""
    f4 = np.float32
    return Strip(
        np.zeros((count, 2), f4), np.zeros((count, 3), f4), np.zeros(count), np.zeros(count, np.int32),
        np.zeros(count, np.int32), np.zeros((count, 2), f4), np.zeros(count, f4), np.zeros((count, 3), f4),
    )  # fmt: skip


@njit(error_model="numpy", nogil=True, cache=True)
def pixel_row_points(first_row: int, width: int, image: NDArray[np.float32]) -> None:
    """Fill the image points of STRIP_ROWS whole rows of pixel centres, tile by tile."""
    k = 0
    for left in range(0, width, _WIDTH):
        for lane in range(_LANES):
            image[k, 0], image[k, 1] = left + lane % _WIDTH, first_row + lane // _WIDTH
            k += 1


@njit(error_model="numpy", nogil=True, cache=True)
def trace(
    scene: np.uint64, packet: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float, strip: Strip, count: int
) -> None:
    """Trace the rays through the first ``count`` image points of a strip, LANES neighbours at a time."""
    ray, words, valid = packet.ray, packet.words, packet.valid
    image, direction, cosine, top, primitive, barycentric, reach, point = strip
    for first in range(0, count, _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k < count:
                cosine[k] = set_pixel_ray(packet, lane, pose, lens, image[k, 0], image[k, 1], far)
            else:
                valid[lane] = 0
        _intersect(valid.ctypes, scene, ray.ctypes, packet.arguments.ctypes)
        for lane in range(min(_LANES, count - first)):
            k = first + lane
            dx, dy, dz, t = ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane], ray[_FAR + lane]
            direction[k, 0], direction[k, 1], direction[k, 2] = dx, dy, dz
            top[k], reach[k] = hit_top(words, lane), t
            if top[k] >= 0:
                primitive[k] = words[_PRIM + lane]
                barycentric[k, 0], barycentric[k, 1] = ray[_U + lane], ray[_V + lane]
                point[k, 0], point[k, 1], point[k, 2] = (
                    ray[_OX + lane] + t * dx, ray[_OY + lane] + t * dy, ray[_OZ + lane] + t * dz,
                )  # fmt: skip


@njit(error_model="numpy", nogil=True, cache=True)
def name_pixels(
    hits: HitTable, strip: Strip, count: int,
    label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32],
) -> None:  # fmt: skip
    """Write class, object and depth [m] of a strip of pixel centres into the images (h, w)."""
    for k in range(count):
        u, v, top = int(strip.image[k, 0]), int(strip.image[k, 1]), strip.top[k]
        kind, thing = classify(hits, top, strip.primitive[k], strip.point[k, 0], strip.point[k, 1])
        label[v, u], instance[v, u] = kind, thing
        depth[v, u] = strip.reach[k] * strip.cosine[k] if top >= 0 else 0.0


@njit(error_model="numpy", nogil=True, cache=True)
def label_image(
    scene: np.uint64, hits: HitTable, packet: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float,
    strip: Strip, label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32],
) -> None:  # fmt: skip
    """Class, object and depth of the ray through every pixel's centre."""
    height, width = label.shape
    count = STRIP_ROWS * width
    for row in range(0, height, STRIP_ROWS):
        pixel_row_points(row, width, strip.image)
        trace(scene, packet, pose, lens, far, strip, count)
        name_pixels(hits, strip, count, label, instance, depth)
