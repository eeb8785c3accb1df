# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Filling packets of rays: the few lines that every kernel shares."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.sense import embree
from fieldtruth.sense.kernel import inlined

LANES = embree.LANES
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_NEAR, _TIME, _FAR, _MASK, _ID, _FLAGS = (
    embree.TNEAR, embree.TIME, embree.TFAR, embree.MASK, embree.ID, embree.FLAGS,
)  # fmt: skip
_GEOM, _INST, _INST_PRIM = embree.GEOM_ID, embree.INST_ID, embree.INST_PRIM_ID
_MISS, _SOLID = embree.MISS, embree.SOLID


class Packet(NamedTuple):
    """Memory of one packet; a thread owns its own. ``ray`` and ``words`` are the same bytes."""

    ray: NDArray[np.float32]
    words: NDArray[np.uint32]
    valid: NDArray[np.int32]
    arguments: NDArray[np.uint64]


def new_packet(*, coherent: bool) -> Packet:
    """Memory for one packet of LANES rays; ``coherent`` as in ``embree.arguments_block``."""
    ray = embree.aligned(embree.RAYHIT_WORDS)
    return Packet(ray, ray.view(np.uint32), embree.aligned(LANES, np.int32), embree.arguments_block(coherent=coherent))


@inlined
def set_ray(
    packet: Packet, lane: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, near: float, far: float
) -> None:
    """Put a ray into a lane: origin [m], unit direction, and the range of distances [m] in which it may hit."""
    ray, words = packet.ray, packet.words
    ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = ox, oy, oz
    ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane] = dx, dy, dz
    ray[_NEAR + lane], ray[_FAR + lane], ray[_TIME + lane] = near, far, 0.0
    words[_MASK + lane], words[_ID + lane], words[_FLAGS + lane] = _MISS, 0, 0
    words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS
    packet.valid[lane] = -1


@inlined
def set_light_ray(
    packet: Packet, lane: int, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, near: float, far: float
) -> None:
    """As ``set_ray``, for a ray that goes through water: it asks whether light arrives."""
    set_ray(packet, lane, ox, oy, oz, dx, dy, dz, near, far)
    packet.words[_MASK + lane] = _SOLID
