# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Erosion of a heightfield: streams cut gullies, soil creeps, and slopes that are too steep collapse into scree.

Streams follow the stream power law dh/dt = -K A^0.5 S (A the area drained, S the slope), solved implicitly from the
outlets upwards (Braun and Willett, Geomorphology 180, 2013), after hollows are filled to their lowest rim
(Barnes, Lehman and Mulla, Computers and Geosciences 62, 2014). Creep is linear diffusion (Culling, Journal of Geology
68, 1960). Collapse is the thermal weathering of Musgrave, Kolb and Mace (SIGGRAPH 1989): material above the angle
of repose moves to the lower neighbours. Material cut by streams is removed. Nothing here is random.
"""

from typing import NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.erosion import diffuse, incise, route, slide


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
        route(h, order, receiver, drained, spacing)
        incise(h.reshape(-1), power.reshape(-1), order, receiver, drained, spacing, h.shape[1])
        for _ in range(parts):
            diffuse(h, share / parts)
    h = collapsed(h, spacing, repose_deg=repose_deg, steps=steps)
    route(h, order, receiver, drained, spacing)
    return Eroded(h, drained.reshape(h.shape).copy())


def collapsed(heights: Array, spacing: float, *, repose_deg: float, steps: int = 30) -> Array:
    """Collapse slopes above ``repose_deg`` [deg] into the lower neighbours; the volume inside the border is kept."""
    h = np.array(heights, np.float64)
    moved = np.empty_like(h)
    for _ in range(steps):
        slide(h, moved, float(np.tan(np.radians(repose_deg))), spacing)
        h += moved
    return h
