# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree: primary rays in every packet mode, of whose hits only the distance is kept.

It does less than any sensor: directions are prepared in single precision in packet order, and what all rays share is
set once. A sensor's time is therefore always compared with a lower bound.
"""

import ctypes
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import binding as llvm
from numba import types
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.sense import embree

llvm.add_symbol("rtcIntersect1", ctypes.cast(embree._library().rtcIntersect1, ctypes.c_void_p).value)

# Field f of lane k is word f * lanes + k for any number of lanes; a single ray is a packet of one.
_FIELD: Final = {
    name: getattr(embree, name) // embree.LANES
    for name in ("ORG_X", "ORG_Y", "ORG_Z", "TNEAR", "DIR_X", "DIR_Y", "DIR_Z", "TFAR", "MASK", "GEOM_ID", "INST_ID")
}
_WORDS: Final = embree.RAYHIT_WORDS // embree.LANES


class Mode(NamedTuple):
    """Packets of ``lanes`` rays in tiles of ``rows`` x lanes / rows, with or without Embree's flag ``coherent``."""

    lanes: int
    rows: int
    coherent: bool


MODES: Final = (
    Mode(1, 1, False),  # the flag does not affect single rays
    *(Mode(8, rows, coherent) for rows in (1, 2, 4, 8) for coherent in (False, True)),
    *(Mode(16, rows, coherent) for rows in (1, 2, 4, 8, 16) for coherent in (False, True)),
)


class _Packet(NamedTuple):
    """Memory of a packet; addresses are integers, so that the kernel counts no references."""

    ray: Float32Array
    words: NDArray[np.uint32]
    ray_at: int
    valid_at: int
    arguments_at: int


class BareTracer:
    """Traces rays of fixed unit ``directions`` (rows, columns, 3) in the sensor's frame, up to ``far`` [m].

    Raises:
        ValueError: rows and columns are not multiples of the tile.
    """

    def __init__(self, scene: np.uint64, directions: Float32Array, far: float, mode: Mode) -> None:
        rows, columns, lanes = mode.rows, mode.lanes // mode.rows, mode.lanes
        height, width = directions.shape[:2]
        if height % rows or width % columns:
            raise ValueError(f"rays must be a multiple of tiles of {rows} x {columns}, got {height} x {width}")
        self._tiles = (height // rows, rows, width // columns, columns)
        tiles = directions.reshape(*self._tiles, 3).transpose(0, 2, 4, 1, 3)
        self._directions = np.ascontiguousarray(tiles, np.float32).reshape(-1, 3, lanes)
        self._distance = np.zeros((len(self._directions), lanes), np.float32)
        ray, valid = embree.aligned(_WORDS * lanes), embree.aligned(lanes, np.int32)
        words, arguments = ray.view(np.uint32), embree.arguments_block(coherent=mode.coherent)
        words[_FIELD["MASK"] * lanes :][:lanes] = embree.MISS
        valid[:] = -1
        self._packet = _Packet(ray, words, ray.ctypes.data, valid.ctypes.data, arguments.ctypes.data)
        self._kept = valid, arguments  # the packet has their addresses
        self._kernel = _KERNELS[lanes]
        self._scene, self._far = scene, np.float32(far)

    def trace(self, world_from_sensor: Array) -> None:
        """Trace all rays from a pose (4, 4)."""
        pose = world_from_sensor.astype(np.float32)
        self._kernel(self._scene, self._packet, pose, self._directions, self._far, self._distance)

    @property
    def distances(self) -> Float32Array:
        """Distances [m] (rows, columns) of the last trace's hits; ``far`` for a miss."""
        tall, rows, wide, columns = self._tiles
        return (
            self._distance.reshape(tall, wide, rows, columns).transpose(0, 2, 1, 3).reshape(tall * rows, wide * columns)
        )


def best_mode(scene: np.uint64, directions: Float32Array, far: float, poses: Sequence[Array]) -> Mode:
    """Find the fastest mode: all whose tiles fit are tried from the first pose, the five best from all ``poses``."""

    def seconds(mode: Mode, poses: Sequence[Array]) -> float:
        tracer = BareTracer(scene, directions, far, mode)
        total = 0.0
        for pose in poses:
            times = []
            for _ in range(2):
                start = perf_counter()
                tracer.trace(pose)
                times.append(perf_counter() - start)
            total += min(times)
        return total

    height, width = directions.shape[:2]
    fitting = [mode for mode in MODES if height % mode.rows == 0 and width % (mode.lanes // mode.rows) == 0]
    leaders = sorted(fitting, key=lambda mode: seconds(mode, poses[:1]))[:5]
    return min(leaders, key=lambda mode: seconds(mode, poses))


def _make_kernel(lanes: int) -> Callable[..., None]:
    """Compile for a number of lanes, so that it is a constant."""
    address = types.uint64
    intersect: Any
    if lanes == 1:
        intersect = types.ExternalFunction("rtcIntersect1", types.void(address, address, address))
    else:
        intersect = types.ExternalFunction(f"rtcIntersect{lanes}", types.void(address, address, address, address))
    ox, oy, oz, near, dx, dy, dz, tfar, _, geometry, instance = (field * lanes for field in _FIELD.values())
    single, miss = lanes == 1, np.uint32(embree.MISS)

    @kernel
    def trace(
        scene: np.uint64, packet: _Packet, pose: Float32Array, directions: Float32Array, far: float, out: Float32Array
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


_KERNELS: Final = {lanes: _make_kernel(lanes) for lanes in (1, 8, 16)}
