# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water and gravity on a grid of heights, see ``world.relief.erosion`` for the laws and their sources."""

import heapq
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.compile import kernel

_DI: Final = np.array([-1, -1, -1, 0, 0, 1, 1, 1])
_DJ: Final = np.array([-1, 0, 1, -1, 1, -1, 0, 1])
_AWAY: Final = np.hypot(_DI, _DJ)


@kernel(allocates=True)
def route(h: Array, order: NDArray[np.int64], receiver: NDArray[np.int64], drained: Array, spacing: float) -> None:
    """Fill ``order`` (downstream first), each node's ``receiver``, and the area ``drained`` through it [m^2]."""
    nx, ny = h.shape
    level = h.copy()
    seen = np.zeros((nx, ny), np.bool_)
    heap = [(h[0, 0], 0)]
    seen[0, 0] = True
    receiver[0] = 0
    for i in range(nx):
        for j in range(ny):
            if (i == 0 or j == 0 or i == nx - 1 or j == ny - 1) and not seen[i, j]:
                seen[i, j] = True
                receiver[i * ny + j] = i * ny + j
                heapq.heappush(heap, (h[i, j], i * ny + j))
    count = 0
    while len(heap) > 0:
        z, node = heapq.heappop(heap)
        order[count] = node
        count += 1
        i, j = node // ny, node % ny
        for k in range(8):
            a, b = i + _DI[k], j + _DJ[k]
            if 0 <= a < nx and 0 <= b < ny and not seen[a, b]:
                seen[a, b] = True
                receiver[a * ny + b] = node
                level[a, b] = max(h[a, b], z)
                heapq.heappush(heap, (level[a, b], a * ny + b))
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            steepest = 0.0
            for k in range(8):
                a, b = i + _DI[k], j + _DJ[k]
                slope = (level[i, j] - level[a, b]) / _AWAY[k]
                if slope > steepest:
                    steepest = slope
                    receiver[i * ny + j] = a * ny + b
    drained[:] = spacing * spacing
    for k in range(count - 1, -1, -1):
        node = order[k]
        if receiver[node] != node:
            drained[receiver[node]] += drained[node]


@kernel
def incise(
    h: Array,
    power: Array,
    order: NDArray[np.int64],
    receiver: NDArray[np.int64],
    drained: Array,
    spacing: float,
    ny: int,
) -> None:
    """Lower each node towards its receiver, which comes before it in ``order`` (equation 23 of Braun and Willett)."""
    for k in range(len(order)):
        node = order[k]
        down = receiver[node]
        if down != node and h[node] > h[down]:
            away = spacing * np.hypot(node // ny - down // ny, node % ny - down % ny)
            cut = power[node] * np.sqrt(drained[node]) / away
            h[node] = (h[node] + cut * h[down]) / (1.0 + cut)


@kernel(allocates=True)
def diffuse(h: Array, share: float) -> None:
    """One explicit step of diffusion inside the border; ``share`` at most 0.25."""
    nx, ny = h.shape
    before = h.copy()
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            around = before[i - 1, j] + before[i + 1, j] + before[i, j - 1] + before[i, j + 1]
            h[i, j] += share * (around - 4.0 * before[i, j])


@kernel
def slide(h: Array, moved: Array, steepest: float, spacing: float) -> None:
    """Fill ``moved`` with the gain or loss of each node in one step; a quarter of the excess moves."""
    nx, ny = h.shape
    moved[:] = 0.0
    for i in range(nx):
        for j in range(ny):
            total, most = 0.0, 0.0
            for k in range(8):
                a, b = i + _DI[k], j + _DJ[k]
                if 0 <= a < nx and 0 <= b < ny:
                    excess = h[i, j] - h[a, b] - steepest * spacing * _AWAY[k]
                    if excess > 0.0:
                        total += excess
                        most = max(most, excess)
            if total > 0.0:
                moved[i, j] -= 0.25 * most
                for k in range(8):
                    a, b = i + _DI[k], j + _DJ[k]
                    if 0 <= a < nx and 0 <= b < ny:
                        excess = h[i, j] - h[a, b] - steepest * spacing * _AWAY[k]
                        if excess > 0.0:
                            moved[a, b] += 0.25 * most * excess / total
