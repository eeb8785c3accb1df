# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ray packets: the memory that Embree reads, and the functions that put rays into it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined
from fieldtruth.sense import embree

LANES = embree.LANES
_OX, _OY, _OZ, _DX, _DY, _DZ = embree.ORG_X, embree.ORG_Y, embree.ORG_Z, embree.DIR_X, embree.DIR_Y, embree.DIR_Z
_NEAR, _TIME, _FAR = embree.TNEAR, embree.TIME, embree.TFAR
_MASK, _ID, _FLAGS = embree.MASK, embree.ID, embree.FLAGS
_GEOM, _INST, _INST_PRIM = embree.GEOM_ID, embree.INST_ID, embree.INST_PRIM_ID
_MISS, _SHADOWS = embree.MISS, embree.SOLID | embree.THIN

IntArray = NDArray[np.int32]
Scalar = float | np.float32
Vector = tuple[Scalar, Scalar, Scalar]


class Packet(NamedTuple):
    """Memory of one packet, not to be shared by threads. ``ray`` and ``words`` view the same bytes."""

    ray: Float32Array
    words: NDArray[np.uint32]
    valid: IntArray
    arguments: NDArray[np.uint64]


def new_packet(*, coherent: bool) -> Packet:
    """Allocate a packet of LANES rays; ``coherent`` as in ``embree.arguments_block``."""
    ray = embree.aligned(embree.RAYHIT_WORDS)
    return Packet(ray, ray.view(np.uint32), embree.aligned(LANES, np.int32), embree.arguments_block(coherent=coherent))


@inlined
def set_ray(packet: Packet, lane: int, origin: Vector, direction: Vector, near: float, far: float) -> None:
    """Put a ray into a lane: origin [m], unit direction, least and greatest distance [m] of a hit."""
    ray, words = packet.ray, packet.words
    ray[_OX + lane], ray[_OY + lane], ray[_OZ + lane] = origin
    ray[_DX + lane], ray[_DY + lane], ray[_DZ + lane] = direction
    ray[_NEAR + lane], ray[_FAR + lane], ray[_TIME + lane] = near, far, 0.0
    words[_MASK + lane], words[_ID + lane], words[_FLAGS + lane] = _MISS, 0, 0
    words[_GEOM + lane], words[_INST + lane], words[_INST_PRIM + lane] = _MISS, _MISS, _MISS
    packet.valid[lane] = -1


@inlined
def set_shadow_ray(packet: Packet, lane: int, origin: Vector, direction: Vector, near: float, far: float) -> None:
    """Put a ray into a lane as ``set_ray`` does; it passes through water, as light does."""
    set_ray(packet, lane, origin, direction, near, far)
    packet.words[_MASK + lane] = _SHADOWS
