# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Instances that move during a reading, as a geometry of Embree whose elements are placed here.

Embree's own instances with motion take 2.3 times as long to build as those at rest, for a hierarchy whose boxes move,
too. Plants move by much less than their size in 0.1 s: here each box holds its element from the interval's begin to
its end, and rays are turned into the element's frame at their own times. Embree calls ``meet`` and ``block`` for
each packet and box, and ``bound`` when it builds (``rtcore_geometry.h`` of Embree 4.4: arguments of eight bytes each).
"""

from typing import Any, Final

import numpy as np
from numba import types
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.addresses import at, singles_at, words_at
from fieldtruth.kernels.compile import callback, inlined, kernel
from fieldtruth.kernels.packets import LANES, RAY_WORDS, SPARE

_FORWARD = types.void(types.voidptr, types.voidptr, types.uint64, types.voidptr, types.uint32, types.uint32)
_intersect: Any = types.ExternalFunction(f"rtcForwardIntersect{LANES}Ex", _FORWARD)
_occluded: Any = types.ExternalFunction(f"rtcForwardOccluded{LANES}Ex", _FORWARD)
BEGIN, END, SCENES, BOUNDS = range(4)
"""Words of what describes a geometry: the addresses of poses (n, 12) at its begin and end, by column, of the handles
(n,) of its elements' scenes, and of their boxes (n, 8)."""
_VALID, _GEOMETRY, _ELEMENT, _CONTEXT, _RAYS, _NUMBER = range(6)  # words of the arguments
_LOW: Final = np.uint64(0xFFFFFFFF)
_HALF: Final = np.uint64(32)
_TIME = 7 * LANES


@kernel(inner=True)
def _turn(begin: Any, end: Any, ray: Any, out: Any) -> None:
    """Write the rays of a packet in the frame of an element whose pose (12,) changes linearly in time.

    The inverse of its matrix is that of its cofactors. All lanes are written, valid or not, so that the loop is one of
    vectors.
    """
    b0, b1, b2, b3, b4, b5 = begin[0], begin[1], begin[2], begin[3], begin[4], begin[5]
    b6, b7, b8, bx, by, bz = begin[6], begin[7], begin[8], begin[9], begin[10], begin[11]
    e0, e1, e2, e3, e4, e5 = end[0] - b0, end[1] - b1, end[2] - b2, end[3] - b3, end[4] - b4, end[5] - b5
    e6, e7, e8, ex, ey, ez = end[6] - b6, end[7] - b7, end[8] - b8, end[9] - bx, end[10] - by, end[11] - bz
    for lane in range(LANES):
        t = ray[_TIME + lane]
        a00, a10, a20 = b0 + t * e0, b1 + t * e1, b2 + t * e2
        a01, a11, a21 = b3 + t * e3, b4 + t * e4, b5 + t * e5
        a02, a12, a22 = b6 + t * e6, b7 + t * e7, b8 + t * e8
        c00, c01, c02 = a11 * a22 - a12 * a21, a02 * a21 - a01 * a22, a01 * a12 - a02 * a11
        c10, c11, c12 = a12 * a20 - a10 * a22, a00 * a22 - a02 * a20, a02 * a10 - a00 * a12
        c20, c21, c22 = a10 * a21 - a11 * a20, a01 * a20 - a00 * a21, a00 * a11 - a01 * a10
        per = np.float32(1.0) / (a00 * c00 + a01 * c10 + a02 * c20)
        x, y, z = ray[lane] - (bx + t * ex), ray[LANES + lane] - (by + t * ey), ray[2 * LANES + lane] - (bz + t * ez)
        out[lane] = (c00 * x + c01 * y + c02 * z) * per
        out[LANES + lane] = (c10 * x + c11 * y + c12 * z) * per
        out[2 * LANES + lane] = (c20 * x + c21 * y + c22 * z) * per
        x, y, z = ray[4 * LANES + lane], ray[5 * LANES + lane], ray[6 * LANES + lane]
        out[4 * LANES + lane] = (c00 * x + c01 * y + c02 * z) * per
        out[5 * LANES + lane] = (c10 * x + c11 * y + c12 * z) * per
        out[6 * LANES + lane] = (c20 * x + c21 * y + c22 * z) * per
        out[3 * LANES + lane] = ray[3 * LANES + lane]
    for k in range(_TIME, RAY_WORDS):
        out[k] = ray[k]


@inlined
def _enter(given: Any) -> tuple[Any, Any, np.uint32, np.uint32]:
    """Write the rays of a packet in the frame of an element; return its scene, these rays, and the two numbers."""
    geometry, element = words_at(given[_GEOMETRY]), given[_ELEMENT] & _LOW
    offset = np.uint64(48) * element
    begin, end = singles_at(geometry[BEGIN] + offset), singles_at(geometry[END] + offset)
    rays = given[_CONTEXT] + np.uint64(SPARE)
    _turn(begin, end, singles_at(given[_RAYS]), singles_at(rays))
    scene = words_at(geometry[SCENES] + np.uint64(8) * element)[0]
    return scene, at(rays), np.uint32(given[_NUMBER] >> _HALF), np.uint32(element)


@callback
def meet(address: Any) -> None:
    """Find the first hits of a packet on an element (RTCIntersectFunctionN)."""
    given = words_at(address)
    scene, rays, number, element = _enter(given)
    _intersect(at(given[_VALID]), at(address), scene, rays, number, element)


@callback
def block(address: Any) -> None:
    """Find which rays of a packet an element blocks (RTCOccludedFunctionN)."""
    given = words_at(address)
    scene, rays, number, element = _enter(given)
    _occluded(at(given[_VALID]), at(address), scene, rays, number, element)


@callback
def bound(address: Any) -> None:
    """Copy the box of an element (RTCBoundsFunction)."""
    given = words_at(address)
    boxes, out = words_at(given[0])[BOUNDS], singles_at(given[2])
    box = singles_at(boxes + np.uint64(32) * (given[1] & _LOW))
    for k in range(8):
        out[k] = box[k]


@kernel
def swept_boxes(columns: Float32Array, which: NDArray[np.uint32], boxes: Array, out: Float32Array) -> None:
    """Write boxes that hold elements at poses (steps, n, 12) and on straight lines between them: ``out`` (n, 8).

    ``boxes`` (m, 2, 3) [m] are those of the elements' scenes ``which`` (n,). A margin covers rounding.
    """
    for g in range(len(which)):
        box = boxes[which[g]]
        for i in range(3):
            low, high = np.inf, -np.inf
            for step in range(len(columns)):
                middle, half = np.float64(columns[step, g, 9 + i]), 0.0
                for j in range(3):
                    entry = np.float64(columns[step, g, 3 * j + i])
                    middle += entry * 0.5 * (box[0, j] + box[1, j])
                    half += abs(entry) * 0.5 * (box[1, j] - box[0, j])
                half += 1e-4 + 1e-5 * half + 1e-6 * abs(middle)
                low, high = min(low, middle - half), max(high, middle + half)
            out[g, i], out[g, 4 + i] = low, high
