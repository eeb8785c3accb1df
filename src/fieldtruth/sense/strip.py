# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A strip of image points: traced together, then named, painted and lit in passes of their own.

Passes over some thousand points let each kernel unpack its tables once, and let shadow rays be packed densely.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.sense import embree
from fieldtruth.sense.hits import HitTable, classify
from fieldtruth.sense.kernel import kernel
from fieldtruth.sense.packets import Packet, set_ray
from fieldtruth.sense.pinhole import Pinhole

STRIP_ROWS: Final = embree.TILE_HEIGHT

_LANES, _WIDTH, _HEIGHT = embree.LANES, embree.TILE_WIDTH, embree.TILE_HEIGHT
_DX, _DY, _DZ, _GEOM, _INST = embree.DIR_X, embree.DIR_Y, embree.DIR_Z, embree.GEOM_ID, embree.INST_ID
_MISS = np.uint32(embree.MISS)
_FAR, _PRIM, _U, _V = embree.TFAR, embree.PRIM_ID, embree.HIT_U, embree.HIT_V
_intersect: Any = embree.intersect


class Strip(NamedTuple):
    """What the rays of n image points hit. Where ``top`` is -1 they hit nothing and only ``direction`` counts."""

    image: NDArray[np.float32]  # (2, n) image point (u, v) [pixel]
    direction: NDArray[np.float32]  # (3, n) unit, world frame
    cosine: NDArray[np.float64]  # (n,) of the angle to the optical axis
    top: NDArray[np.int32]  # (n,) row of the thing that was hit
    primitive: NDArray[np.int32]  # (n,) its triangle
    barycentric: NDArray[np.float32]  # (2, n) weights of the triangle's second and third corner
    reach: NDArray[np.float32]  # (n,) [m] along the ray
    point: NDArray[np.float32]  # (3, n) [m] world frame


def new_strip(count: int) -> Strip:
    """Room for ``count`` image points; a thread owns its own."""
    f4, count = np.float32, -(-count // _LANES) * _LANES
    return Strip(
        np.zeros((2, count), f4), np.zeros((3, count), f4), np.zeros(count), np.zeros(count, np.int32),
        np.zeros(count, np.int32), np.zeros((2, count), f4), np.zeros(count, f4), np.zeros((3, count), f4),
    )  # fmt: skip


@kernel
def pixel_row_points(first_row: int, width: int, image: NDArray[np.float32]) -> None:
    """Fill the image points of STRIP_ROWS whole rows of pixel centres, tile by tile."""
    k = 0
    for left in range(0, width, _WIDTH):
        for lane in range(_LANES):
            image[0, k], image[1, k] = left + lane % _WIDTH, first_row + lane // _WIDTH
            k += 1


@kernel
def trace(
    scene: np.uint64, packet: Packet, pose: NDArray[np.float64], lens: Pinhole, far: float, strip: Strip, count: int
) -> None:
    """Trace the rays through the first ``count`` image points of a strip, LANES neighbours at a time.

    Loops run over one field of the packet at a time, so that they become vector instructions; what all rays share is
    written once.
    """
    ray, words, valid = packet.ray, packet.words, packet.valid
    image, direction, cosine, top, primitive, barycentric, reach, point = strip
    m00, m01, m02, m10, m11, m12, m20, m21, m22 = (
        pose[0, 0], pose[0, 1], pose[0, 2], pose[1, 0], pose[1, 1], pose[1, 2], pose[2, 0], pose[2, 1], pose[2, 2],
    )  # fmt: skip
    x0, y0, z0 = np.float32(pose[0, 3]), np.float32(pose[1, 3]), np.float32(pose[2, 3])
    per_fx, per_fy, cx, cy = 1.0 / lens.fx, 1.0 / lens.fy, lens.cx, lens.cy
    for lane in range(_LANES):
        set_ray(packet, lane, float(x0), float(y0), float(z0), 0.0, 0.0, 1.0, 0.0, far)
    for first in range(0, count, _LANES):
        for lane in range(_LANES):
            a, b = (image[0, first + lane] - cx) * per_fx, (image[1, first + lane] - cy) * per_fy
            scale = 1.0 / np.sqrt(1.0 + a * a + b * b)
            cosine[first + lane] = scale
            direction[0, first + lane] = (m00 * a + m01 * b + m02) * scale
            direction[1, first + lane] = (m10 * a + m11 * b + m12) * scale
            direction[2, first + lane] = (m20 * a + m21 * b + m22) * scale
        for lane in range(_LANES):
            ray[_DX + lane] = direction[0, first + lane]
            ray[_DY + lane] = direction[1, first + lane]
            ray[_DZ + lane] = direction[2, first + lane]
            ray[_FAR + lane] = far
            words[_GEOM + lane] = _MISS
            words[_INST + lane] = _MISS
        for lane in range(count - first, _LANES):
            valid[lane] = 0
        _intersect(valid.ctypes, scene, ray.ctypes, packet.arguments.ctypes)
        for lane in range(_LANES):
            k = first + lane
            t = ray[_FAR + lane]
            reach[k] = t
            point[0, k] = x0 + t * direction[0, k]
            point[1, k] = y0 + t * direction[1, k]
            point[2, k] = z0 + t * direction[2, k]
            barycentric[0, k], barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            primitive[k] = np.int32(words[_PRIM + lane])
            geometry, instance = words[_GEOM + lane], words[_INST + lane]
            top[k] = np.int32(geometry if instance == _MISS else instance)  # MISS for both becomes -1


@kernel
def name_pixels(
    hits: HitTable, strip: Strip, count: int,
    label: NDArray[np.uint8], instance: NDArray[np.uint16], depth: NDArray[np.float32],
) -> None:  # fmt: skip
    """Write class, object and depth [m] of a strip of pixel centres into the images (h, w)."""
    image, tops, primitive, point, reach, cosine = (
        strip.image, strip.top, strip.primitive, strip.point, strip.reach, strip.cosine,
    )  # fmt: skip
    for k in range(count):
        u, v, top = int(image[0, k]), int(image[1, k]), tops[k]
        kind, thing = classify(hits, top, primitive[k], point[0, k], point[1, k])
        label[v, u], instance[v, u] = kind, thing
        depth[v, u] = reach[k] * cosine[k] if top >= 0 else 0.0


@kernel
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
