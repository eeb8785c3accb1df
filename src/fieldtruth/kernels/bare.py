# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree in every packet mode: the distances of primary rays, and nothing else, see ``bench.sensors``."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.compile import kernel

# Field f of lane k is word f * lanes + k for any number of lanes; a single ray is a packet of one.
FIELDS: Final = {
    name: getattr(packets, name) // packets.LANES
    for name in ("ORG_X", "ORG_Y", "ORG_Z", "TNEAR", "DIR_X", "DIR_Y", "DIR_Z", "TFAR", "MASK", "GEOM_ID", "INST_ID")
}


class BarePacket(NamedTuple):
    """Memory of a packet; addresses are integers, so that the kernel counts no references."""

    ray: Float32Array
    words: NDArray[np.uint32]
    ray_at: int
    valid_at: int
    arguments_at: int


def _make_kernel(lanes: int) -> Callable[..., None]:
    """Compile for a number of lanes, so that it is a constant."""
    address = types.uint64
    intersect: Any
    if lanes == 1:
        intersect = types.ExternalFunction("rtcIntersect1", types.void(address, address, address))
    else:
        intersect = types.ExternalFunction(f"rtcIntersect{lanes}", types.void(address, address, address, address))
    ox, oy, oz, near, dx, dy, dz, tfar, _, geometry, instance = (field * lanes for field in FIELDS.values())
    single, miss = lanes == 1, np.uint32(packets.MISS)

    @kernel
    def trace(
        scene: np.uint64,
        packet: BarePacket,
        pose: Float32Array,
        directions: Float32Array,
        far: float,
        out: Float32Array,
    ) -> None:
        ray, words, ray_at, valid_at, arguments_at = packet
        xx, xy, xz, yx, yy, yz = pose[0, 0], pose[0, 1], pose[0, 2], pose[1, 0], pose[1, 1], pose[1, 2]
        zx, zy, zz = pose[2, 0], pose[2, 1], pose[2, 2]
        for lane in range(lanes):
            ray[ox + lane], ray[oy + lane], ray[oz + lane] = pose[0, 3], pose[1, 3], pose[2, 3]
            ray[near + lane] = 0.0
        for k in range(len(directions)):
            for lane in range(lanes):
                x, y, z = directions[k, 0, lane], directions[k, 1, lane], directions[k, 2, lane]
                ray[dx + lane] = xx * x + xy * y + xz * z
                ray[dy + lane] = yx * x + yy * y + yz * z
                ray[dz + lane] = zx * x + zy * y + zz * z
                ray[tfar + lane] = far
                words[geometry + lane], words[instance + lane] = miss, miss
            if single:
                intersect(scene, ray_at, arguments_at)
            else:
                intersect(valid_at, scene, ray_at, arguments_at)
            for lane in range(lanes):
                out[k, lane] = ray[tfar + lane]

    result: Callable[..., None] = trace
    return result


TRACERS: Final = {lanes: _make_kernel(lanes) for lanes in (1, 8, 16)}
