# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bare Embree: primary rays in every packet mode, of whose hits only the distance is kept.

It does less than any sensor: directions are prepared in single precision in packet order, and what all rays share is
set once. A sensor's time is therefore always compared with a lower bound.
"""

from collections.abc import Sequence
from time import perf_counter
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.bare import FIELDS, TRACERS, BarePacket

_WORDS: Final = packets.RAYHIT_WORDS // packets.LANES


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
        ray, valid = packets.aligned(_WORDS * lanes), packets.aligned(lanes, np.int32)
        words, arguments = ray.view(np.uint32), packets.arguments_block(coherent=mode.coherent)
        words[FIELDS["MASK"] * lanes :][:lanes] = packets.MISS
        valid[:] = -1
        self._packet = BarePacket(ray, words, ray.ctypes.data, valid.ctypes.data, arguments.ctypes.data)
        self._kept = valid, arguments  # the packet has their addresses
        self._kernel = TRACERS[lanes]
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
    """Find the fastest mode: all whose tiles fit are tried from the first pose, the three best from all ``poses``."""

    def seconds(mode: Mode, poses: Sequence[Array]) -> float:
        tracer = BareTracer(scene, directions, far, mode)
        tracer.trace(poses[0])  # compiled, and its memory used, before the clock runs
        start = perf_counter()
        for pose in poses:
            tracer.trace(pose)
        return perf_counter() - start

    height, width = directions.shape[:2]
    fitting = [mode for mode in MODES if height % mode.rows == 0 and width % (mode.lanes // mode.rows) == 0]
    leaders = sorted(fitting, key=lambda mode: seconds(mode, poses[:1]))[:3]
    return min(leaders, key=lambda mode: seconds(mode, poses))
