# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A map of what the sun sees: how far towards it the first surface lies, on a grid across its rays.

What lies deeper than the map says is in shade (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978).
The mean of that over a small area is the soft border of a shadow (Reeves, Salesin and Cook, SIGGRAPH 1987). Shadows
of the sun from h metres away are 0.0093 h wide at their border, so that those of crowns have none that is sharp.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense import embree
from fieldtruth.sense.packets import Packet, new_packet, set_shadow_ray
from fieldtruth.sense.scene import Scene
from fieldtruth.world.grids import coarseness

TEXEL: Final = 0.04  # [m]
MARGIN: Final = 10.0
"""[m] beyond the world's edge up to which the map reaches."""
NOTHING: Final = np.float32(-1e9)
"""Depth where the sun meets no surface."""
OFFSET: Final = np.float32(0.5 * TEXEL)
"""[m] in front of a surface where its share is read, so that its own roughness does not shade it."""
_LEAST_FACING: Final = np.float32(0.2)  # cosine to the sun; surfaces that face it less have nearly no light of it
_TAPS: Final = 4
_TURN = 0.3 + 2.0 * np.pi * np.arange(_TAPS) / _TAPS
_TAP: Final = np.stack([np.cos(_TURN), np.sin(_TURN)], axis=-1).astype(np.float32)

Vector = tuple[np.float32, np.float32, np.float32]

_LANES, _FAR = embree.LANES, embree.TFAR
_intersect: Any = embree.intersect


class SunMap(NamedTuple):
    """The map, and where it lies; without texels where the sun is below the horizon."""

    depth: Float32Array  # (nu, nv) [m] along the direction to the sun, of the first surface that it meets
    axes: Float32Array  # (3, 3) unit vectors along u, along v and to the sun
    corner: tuple[float, float]  # [m] of the first texel's centre along u and v
    per_metre: float


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
        _trace_row(scene.rays.handle, new_packet(coherent=True), start, texel * axes[1], -axes[2], depth[i])

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


@kernel
def _trace_row(scene: np.uint64, packet: Packet, start: Array, step: Array, along: Array, out: Float32Array) -> None:
    """Distances (n,) to the first surface from points that are ``step`` (3,) [m] apart; infinite for none."""
    ray, direction = packet.ray, (along[0], along[1], along[2])
    for first in range(0, len(out), _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k >= len(out):
                packet.valid[lane] = 0
                continue
            origin = start[0] + k * step[0], start[1] + k * step[1], start[2] + k * step[2]
            set_shadow_ray(packet, lane, origin, direction, 0.0, np.inf)
        _intersect(packet.valid.ctypes, scene, ray.ctypes, packet.arguments.ctypes)
        for lane in range(min(_LANES, len(out) - first)):
            out[first + lane] = ray[_FAR + lane]


@inlined
def _texel(depth: Float32Array, i: np.uintp, j: np.uintp, own: np.float32) -> tuple[np.float32, np.float32]:
    """1 and 0 if a point of depth ``own`` sees the sun past a texel; if not, 0 and how far away what hides it is."""
    away = depth[i, j] - own
    hidden = away > np.float32(0.0)
    return np.float32(0.0 if hidden else 1.0), away if hidden else np.float32(0.0)


@inlined
def sun_share(sun_map: SunMap, point: Vector, normal: Vector, spread: np.float32) -> tuple[np.float32, np.float32]:
    """Share of the sun that a surface sees at a point [m], and how far away what hides it is.

    It is the mean over a circle of radius ``spread`` [m], in which the surface is the plane through the point with
    this unit normal, which faces the sun. The share is -1 outside the map.
    """
    axes, depth, per = sun_map.axes, sun_map.depth, np.float32(sun_map.per_metre)
    zero, one, texel = np.float32(0.0), np.float32(1.0), np.float32(1.0) / per
    x, y, z = point[0] + OFFSET * normal[0], point[1] + OFFSET * normal[1], point[2] + OFFSET * normal[2]
    u = (axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z - np.float32(sun_map.corner[0])) * per
    v = (axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z - np.float32(sun_map.corner[1])) * per
    radius, last_u, last_v = spread * per, np.float32(depth.shape[0] - 2), np.float32(depth.shape[1] - 2)
    if min(u, v) < radius or u > last_u - radius or v > last_v - radius:
        return -one, zero
    own = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z
    facing = axes[2, 0] * normal[0] + axes[2, 1] * normal[1] + axes[2, 2] * normal[2]
    per_facing = -texel / max(facing, _LEAST_FACING)
    along_u = (axes[0, 0] * normal[0] + axes[0, 1] * normal[1] + axes[0, 2] * normal[2]) * per_facing
    along_v = (axes[1, 0] * normal[0] + axes[1, 1] * normal[1] + axes[1, 2] * normal[2]) * per_facing
    share, away = zero, zero
    for tap in range(_TAPS):
        a, b = u + radius * _TAP[tap, 0], v + radius * _TAP[tap, 1]
        i, j = int(a), int(b)
        fu, fv = a - np.float32(i), b - np.float32(j)
        row, column, next_one = np.uintp(i), np.uintp(j), np.uintp(1)
        d00 = own + (np.float32(i) - u) * along_u + (np.float32(j) - v) * along_v
        s00, a00 = _texel(depth, row, column, d00)
        s01, a01 = _texel(depth, row, column + next_one, d00 + along_v)
        s10, a10 = _texel(depth, row + next_one, column, d00 + along_u)
        s11, a11 = _texel(depth, row + next_one, column + next_one, d00 + along_u + along_v)
        low, high = s00 + (s01 - s00) * fv, s10 + (s11 - s10) * fv
        share += low + (high - low) * fu
        away = max(away, max(max(a00, a01), max(a10, a11)))
    return share * np.float32(1.0 / _TAPS), away
