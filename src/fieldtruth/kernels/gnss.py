# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Paths of radio waves to satellites through a scene, see ``sensors.gnss.visibility``."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.packets import HitTable, Packet, classify, hit_top, set_ray

_NEXT: Final = 1e-3  # [m] beyond a leaf, where its ray goes on
_WEAK: Final = 1e-3  # share of the amplitude, 60 dB, below which nothing is left
OPEN, LEAF, OPAQUE = 0, 1, 2
_LANES = packets.LANES
Kinds = NDArray[np.uint8]
_X, _Y, _DX, _DY = packets.ORG_X, packets.ORG_Y, packets.DIR_X, packets.DIR_Y
_T, _PRIM = packets.TFAR, packets.PRIM_ID
_intersect: Any = packets.intersect


@kernel(allocates=True)
def trace_paths(
    scene: np.uint64, hits: HitTable, packet: Packet, paths: Array, surfaces: tuple[float, Kinds], out: Array
) -> None:
    """Follow rays along their ``paths``; ``out`` (n, rays) is the share of the amplitude that arrives."""
    leaf, kinds = surfaces
    ray, words, valid, arguments = packet
    count, rays, corners, _ = paths.shape
    total = count * rays
    part, near = np.zeros(_LANES, np.int64), np.zeros(_LANES)
    for first in range(0, total, _LANES):
        for lane in range(_LANES):
            part[lane], near[lane] = (0 if first + lane < total else corners), 0.0
            if first + lane < total:
                out[(first + lane) // rays, (first + lane) % rays] = 1.0
        running = True
        while running:
            running = False
            for lane in range(_LANES):
                k = min(first + lane, total - 1)
                i, j, s = k // rays, k % rays, min(part[lane], corners - 2)
                x, y, z = paths[i, j, s, 0], paths[i, j, s, 1], paths[i, j, s, 2]
                dx, dy, dz = paths[i, j, s + 1, 0] - x, paths[i, j, s + 1, 1] - y, paths[i, j, s + 1, 2] - z
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                set_ray(packet, lane, (x, y, z), (dx / length, dy / length, dz / length), near[lane], length)
                valid[lane] = -1 if part[lane] < corners - 1 else 0
                running |= valid[lane] != 0
            if not running:
                break
            _intersect(valid.ctypes, scene, ray.ctypes, arguments.ctypes)
            for lane in range(_LANES):
                if valid[lane] == 0:
                    continue
                top = hit_top(hits.geometry_top, words, lane)
                if top < 0:
                    part[lane], near[lane] = part[lane] + 1, 0.0
                    continue
                i, j, far = (first + lane) // rays, (first + lane) % rays, ray[_T + lane]
                x, y = ray[_X + lane] + far * ray[_DX + lane], ray[_Y + lane] + far * ray[_DY + lane]
                class_id, _ = classify(hits, top, words[_PRIM + lane], x, y)
                near[lane] = far * (1.0 + 1e-6) + _NEXT
                if kinds[class_id] == LEAF:
                    out[i, j] *= leaf
                if kinds[class_id] == OPAQUE or out[i, j] < _WEAK:
                    out[i, j], part[lane] = 0.0, corners
