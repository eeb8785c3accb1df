# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A map of what the sun sees: how far towards it the first surface lies, on a grid across its rays.

What lies deeper than the map says is in shade (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978).
The mean of that over a small area is the soft border of a shadow (Reeves, Salesin and Cook, SIGGRAPH 1987). Shadows
of the sun from h metres away are 0.0093 h wide at their border, so that those of crowns have none that is sharp.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.baking import trace_sun_row
from fieldtruth.kernels.light import TEXEL, SunMap
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.scene import Scene
from fieldtruth.world.grids import coarseness

MARGIN: Final = 10.0
"""[m] beyond the world's edge up to which the map reaches."""
NOTHING: Final = np.float32(-1e9)
"""Depth where the sun meets no surface."""


def make_sun_map(scene: Scene, sun: Array, pool: ThreadPoolExecutor) -> SunMap:
    """Trace a map from the sun in the direction of the unit vector ``sun``."""
    if sun[2] <= 0.0:
        return SunMap(np.zeros((0, 0), np.float32), np.zeros((3, 3), np.float32), (0.0, 0.0), 1.0)
    corners, texel = _corners(scene), TEXEL * coarseness(scene.world.size)
    axes = _axes(sun, corners)
    low, high = (corners @ axes.T).min(axis=0), (corners @ axes.T).max(axis=0)
    u, v = (np.arange(low[k], high[k] + texel, texel) for k in range(2))
    depth = np.empty((len(u), len(v)), np.float32)

    def trace_row(i: int) -> None:
        start = u[i] * axes[0] + low[1] * axes[1] + (high[2] + 1.0) * axes[2]
        trace_sun_row(scene.rays.handle, new_packet(coherent=True), start, texel * axes[1], -axes[2], depth[i])

    list(pool.map(trace_row, range(len(u))))
    depth = np.where(np.isfinite(depth), np.float32(high[2] + 1.0) - depth, NOTHING)
    return SunMap(depth, axes.astype(np.float32), (float(low[0]), float(low[1])), 1.0 / texel)


def _corners(scene: Scene) -> Array:
    """Corners (8, 3) of a box around the world with its margin."""
    heights, highest = scene.world.terrain.surface.heights, []
    for mesh, pose, *_ in scene.tops:
        if mesh is not None and mesh is not scene.world.backdrop:
            highest.append(pose[2, 3] + np.abs(mesh.vertices @ pose[2, :3]).max())
    x, y = (side / 2.0 + MARGIN for side in scene.world.size)
    top = max([float(heights.max()), *highest])
    return np.array([(a, b, c) for a in (-x, x) for b in (-y, y) for c in (float(heights.min()), top)])


def _axes(sun: Array, corners: Array) -> Array:
    """Axes (3, 3) of the map, turned about the sun's direction so that its rectangle is the smallest."""
    side = np.cross([0.0, 0.0, 1.0] if sun[2] < 0.99 else [0.0, 1.0, 0.0], sun)
    side /= np.linalg.norm(side)
    other, best, least = np.cross(sun, side), np.eye(3), np.inf
    for turn in np.radians(np.arange(90)):
        u, v = np.cos(turn) * side + np.sin(turn) * other, np.cos(turn) * other - np.sin(turn) * side
        area = np.ptp(corners @ u) * np.ptp(corners @ v)
        if area < least:
            best, least = np.stack([u, v, sun]), area
    return best
