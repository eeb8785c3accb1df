# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree: the same primary rays, traced in every packet mode, of whose hits nothing but the distance is kept.

It does less than any sensor could: directions stand ready in single precision in the order of the packets, and what
does not change from ray to ray is written once. So a ratio to it never flatters.
"""

import ctypes
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import binding as llvm
from numba import njit, types
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.sense import embree

Rays = NDArray[np.float32]

llvm.add_symbol("rtcIntersect1", ctypes.cast(embree._library().rtcIntersect1, ctypes.c_void_p).value)

# Field f of lane k stands at f * lanes + k for any number of lanes; a single ray is a packet of one.
_FIELD: Final = {
    name: getattr(embree, name) // embree.LANES
    for name in ("ORG_X", "ORG_Y", "ORG_Z", "TNEAR", "DIR_X", "DIR_Y", "DIR_Z", "TFAR", "MASK", "GEOM_ID", "INST_ID")
}
_WORDS: Final = embree.RAYHIT_WORDS // embree.LANES


class Mode(NamedTuple):
    """How rays are packed: ``lanes`` of them, in tiles of ``rows`` x lanes / rows; ``coherent`` is Embree's flag."""

    lanes: int
    rows: int
    coherent: bool


MODES: Final = (
    Mode(1, 1, False),  # the flag changes nothing for a single ray
    *(Mode(8, rows, coherent) for rows in (1, 2, 4, 8) for coherent in (False, True)),
    *(Mode(16, rows, coherent) for rows in (1, 2, 4, 8, 16) for coherent in (False, True)),
)


class BareTracer:
    """Traces rays of fixed ``directions`` (rows, columns, 3), unit, in the sensor's frame, as far as ``far`` [m].

    A tile must divide rows and columns, or ValueError is raised.
    """

    def __init__(self, scene: np.uint64, directions: Rays, far: float, mode: Mode) -> None:
        rows, columns, lanes = mode.rows, mode.lanes // mode.rows, mode.lanes
        height, width = directions.shape[:2]
        if height % rows or width % columns:
            raise ValueError(f"tiles of {rows} x {columns} do not divide {height} x {width} rays")
        self._tiles = (height // rows, rows, width // columns, columns)
        tiles = directions.reshape(*self._tiles, 3).transpose(0, 2, 4, 1, 3)
        self._directions = np.ascontiguousarray(tiles, np.float32).reshape(-1, 3, lanes)
        self._reach = np.zeros((len(self._directions), lanes), np.float32)
        self._ray = embree.aligned(_WORDS * lanes)
        self._words = self._ray.view(np.uint32)
        self._words[_FIELD["MASK"] * lanes :][:lanes] = embree.MISS
        self._valid = embree.aligned(lanes, np.int32)
        self._valid[:] = -1
        self._arguments = embree.arguments_block(coherent=mode.coherent)
        self._kernel = _KERNELS[lanes]
        self._scene, self._far = scene, np.float32(far)

    def trace(self, world_from_sensor: Array) -> None:
        """Trace all rays from a pose (4, 4)."""
        self._kernel(
            self._scene, self._ray, self._words, self._ray.ctypes.data, self._valid.ctypes.data,
            self._arguments.ctypes.data, world_from_sensor.astype(np.float32), self._directions, self._far, self._reach,
        )  # fmt: skip

    @property
    def distances(self) -> Rays:
        """Distance [m] (rows, columns) to the last trace's hits; ``far`` where there was none."""
        tall, rows, wide, columns = self._tiles
        return self._reach.reshape(tall, wide, rows, columns).transpose(0, 2, 1, 3).reshape(tall * rows, wide * columns)


def best_mode(scene: np.uint64, directions: Rays, far: float, poses: Sequence[Array]) -> Mode:
    """Return the mode that traces the rays fastest: all run from the first pose, and the leaders from all ``poses``."""

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

    leaders = sorted(MODES, key=lambda mode: seconds(mode, poses[:1]))[:5]
    return min(leaders, key=lambda mode: seconds(mode, poses))


def _make_kernel(lanes: int) -> Callable[..., None]:
    """Compile for a number of lanes, so that they are constants. Addresses go as numbers: no reference is counted."""
    address = types.uint64
    intersect: Any
    if lanes == 1:
        intersect = types.ExternalFunction("rtcIntersect1", types.void(address, address, address))
    else:
        intersect = types.ExternalFunction(f"rtcIntersect{lanes}", types.void(address, address, address, address))
    ox, oy, oz, near, dx, dy, dz, tfar, _, geometry, instance = (field * lanes for field in _FIELD.values())
    single, miss = lanes == 1, np.uint32(embree.MISS)

    @njit(error_model="numpy", nogil=True, cache=True)
    def trace(
        scene: np.uint64, ray: Rays, words: NDArray[np.uint32], ray_at: int, valid_at: int, arguments_at: int,
        pose: Rays, directions: Rays, far: float, reach: Rays,
    ) -> None:  # fmt: skip
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
                reach[k, lane] = ray[tfar + lane]

    kernel: Callable[..., None] = trace
    return kernel


_KERNELS: Final = {lanes: _make_kernel(lanes) for lanes in (1, 8, 16)}
