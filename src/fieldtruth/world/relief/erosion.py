# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Erosion of a heightfield: streams cut gullies, soil creeps, and slopes that are too steep collapse into scree.

Streams follow the stream power law dh/dt = -K A^0.5 S (A the area drained, S the slope), solved implicitly from the
outlets upwards (Braun and Willett, Geomorphology 180, 2013), after hollows are filled to their lowest rim
(Barnes, Lehman and Mulla, Computers and Geosciences 62, 2014). Creep is linear diffusion (Culling, Journal of Geology
68, 1960). Collapse is the thermal weathering of Musgrave, Kolb and Mace (SIGGRAPH 1989): material above the angle
of repose moves to the lower neighbours. Material cut by streams is removed. Nothing here is random.
"""

import heapq
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.compile import kernel

_DI: Final = np.array([-1, -1, -1, 0, 0, 1, 1, 1])
_DJ: Final = np.array([-1, 0, 1, -1, 1, -1, 0, 1])
_AWAY: Final = np.hypot(_DI, _DJ)


class Eroded(NamedTuple):
    """Heights (nx, ny) [m] after erosion, and the area [m^2] that drains through each node."""

    heights: Array
    drained: Array


def eroded(
    heights: Array,
    spacing: float,
    *,
    strength: Array | float = 0.02,
    creep: float = 0.02,
    repose_deg: float = 36.0,
    steps: int = 30,
) -> Eroded:
    """Erode heights (nx, ny) [m] on a grid of ``spacing`` [m]; the border is unchanged.

    ``strength`` is K dt, a number or one per node: the depth [m] that a stream which drains 1 m^2 cuts into a slope of
    1 in a step. ``creep`` is D dt [m^2] per step. ``repose_deg`` [deg] limits the slope of the result.
    """
    h = np.array(heights, np.float64)
    power = np.ascontiguousarray(np.broadcast_to(np.asarray(strength, np.float64), h.shape))
    share = creep / spacing**2
    parts = max(1, int(np.ceil(share / 0.2)))
    order, receiver, drained = np.zeros(h.size, np.int64), np.zeros(h.size, np.int64), np.zeros(h.size)
    for _ in range(steps):
        _route(h, order, receiver, drained, spacing)
        _incise(h.reshape(-1), power.reshape(-1), order, receiver, drained, spacing, h.shape[1])
        for _ in range(parts):
            _diffuse(h, share / parts)
    h = collapsed(h, spacing, repose_deg=repose_deg, steps=steps)
    _route(h, order, receiver, drained, spacing)
    return Eroded(h, drained.reshape(h.shape).copy())


def collapsed(heights: Array, spacing: float, *, repose_deg: float, steps: int = 30) -> Array:
    """Collapse slopes above ``repose_deg`` [deg] into the lower neighbours; the volume inside the border is kept."""
    h = np.array(heights, np.float64)
    moved = np.empty_like(h)
    for _ in range(steps):
        _slide(h, moved, float(np.tan(np.radians(repose_deg))), spacing)
        h += moved
    return h


# (float64[:, ::1], int64[::1], int64[::1], float64[::1], float64) -> None
@kernel(allocates=True)
def _route(h: Array, order: NDArray[np.int64], receiver: NDArray[np.int64], drained: Array, spacing: float) -> None:
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


# (float64[::1], float64[::1], int64[::1], int64[::1], float64[::1], float64, int64) -> None
@kernel
def _incise(
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


# (float64[:, ::1], float64) -> None
@kernel(allocates=True)
def _diffuse(h: Array, share: float) -> None:
    """One explicit step of diffusion inside the border; ``share`` at most 0.25."""
    nx, ny = h.shape
    before = h.copy()
    for i in range(1, nx - 1):
        for j in range(1, ny - 1):
            around = before[i - 1, j] + before[i + 1, j] + before[i, j - 1] + before[i, j + 1]
            h[i, j] += share * (around - 4.0 * before[i, j])


# (float64[:, ::1], float64[:, ::1], float64, float64) -> None
@kernel
def _slide(h: Array, moved: Array, steepest: float, spacing: float) -> None:
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
