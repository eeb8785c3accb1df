# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels of what is baked once per scene: open directions, what the sun sees, light in the air, light on relief."""

from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import seen_over_map
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.gbuffer import NX, NY, NZ
from fieldtruth.kernels.light import EXPOSURE, Shading
from fieldtruth.kernels.packets import Packet, hit_top, set_shadow_ray
from fieldtruth.kernels.shading import PASSES, ShadingBuffers, shade_hits
from fieldtruth.kernels.textures import Atlas, Relief, ground_texels, sample_lit, view_terms

UP: Final = 12  # first of the coefficients c2
NEAR: Final = 0.2
"""[m] from a probe within which objects are ignored: one leaf or twig must not shade a cubic metre. What is that near
to a surface is in its own share of open air, ``SurfaceTable.vertex``."""
PROBES: Final = 64  # at once
RELIEF_STEPS: Final = 48
_FARTHEST: Final = 400.0  # [m]
_PIXEL: Final = np.float32(0.001)
_LANES, _FAR, _PRIM, _U, _V = packets.LANES, packets.TFAR, packets.PRIM_ID, packets.HIT_U, packets.HIT_V
_ALL: Final = len(PASSES)
_occluded: Any = packets.occluded
_intersect: Any = packets.intersect


@inlined
def _weight(n: Float32Array, dx: float, dy: float, dz: float) -> float:
    if n[0] == 0.0 and n[1] == 0.0 and n[2] == 0.0:
        return 1.0
    return n[0] * dx + n[1] * dy + n[2] * dz  # type: ignore[no-any-return]


@kernel(allocates=True)
def fill_visibility(
    scene: np.uint64,
    packet: Packet,
    points: Float32Array,
    normals: Float32Array,
    directions: Array,
    near: float,
    reach: float,
    result: Float32Array,
) -> None:
    """Trace packets of neighbouring points in one direction at a time, which keeps the rays parallel."""
    free, total = np.zeros(_LANES, np.float32), np.zeros(_LANES, np.float32)
    for first in range(0, len(points), _LANES):
        free[:], total[:] = 0.0, 0.0
        for k in range(len(directions)):
            dx, dy, dz = directions[k, 0], directions[k, 1], directions[k, 2]
            for lane in range(_LANES):
                packet.valid[lane] = 0
                row = first + lane
                if row >= len(points):
                    continue
                weight = _weight(normals[row], dx, dy, dz)
                if weight <= 0.0:
                    continue
                p = points[row]
                set_shadow_ray(packet, lane, (p[0], p[1], p[2]), (dx, dy, dz), near, reach)
                total[lane] += weight
                free[lane] += weight
            _occluded(packet.valid.ctypes, scene, packet.ray.ctypes, packet.arguments.ctypes)
            for lane in range(_LANES):
                if packet.valid[lane] != 0 and packet.ray[_FAR + lane] < 0.0:
                    free[lane] -= _weight(normals[first + lane], dx, dy, dz)
        for lane in range(min(_LANES, len(points) - first)):
            result[first + lane] = max(free[lane] / total[lane], 0.0) if total[lane] > 0.0 else 0.5


@kernel
def trace_sun_row(scene: np.uint64, packet: Packet, start: Array, step: Array, along: Array, out: Float32Array) -> None:
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


@kernel
def gather_probes(
    shading: Shading,
    buffers: ShadingBuffers,
    points: Float32Array,
    heights: Float32Array,
    directions: Float32Array,
    veil: Float32Array,
    found: Float32Array,
    inside: Float32Array,
) -> None:
    """Coefficients (n, COEFFICIENTS) of probes at ``points`` (n, 3) [m], which are ``heights`` (n,) above the ground.

    ``inside`` (n,) is the share of rays that meet the back of an opaque face.
    """
    count, per = len(directions), np.float32(1.0 / (len(directions) * EXPOSURE))
    pixel = np.sqrt(4.0 * np.pi / count)  # [rad], of the cone of a ray
    batch, colour = buffers.batch, buffers.colour
    two, zero = np.float32(2.0), np.float32(0.0)
    for first in range(0, len(points), PROBES):
        probes = min(PROBES, len(points) - first)
        total = _trace_probes(shading, buffers, points[first : first + probes], heights[first:], directions)
        shade_hits(shading, buffers, batch, total, pixel, (buffers.gbuffer, colour), _ALL)
        for k in range(total):
            row, d = first + k % probes, directions[k // probes]
            for channel in range(3):
                value = colour[k, channel] * per
                if batch.top[k] < 0:
                    value = value + veil[channel] / count if d[2] > zero else zero
                at = 4 * channel
                found[row, at] += value
                for axis in range(3):
                    found[row, at + 1 + axis] += two * value * d[axis]
                found[row, UP + channel] += two * two * value * max(d[2], zero)
            if batch.top[k] > 0:
                g = buffers.gbuffer[k]
                if g[NX] * d[0] + g[NY] * d[1] + g[NZ] * d[2] > np.float32(0.2):
                    inside[row] += np.float32(1.0 / count)


@kernel
def _trace_probes(
    shading: Shading, buffers: ShadingBuffers, points: Float32Array, heights: Float32Array, directions: Float32Array
) -> int:
    """Trace all directions of some probes, one direction after the other; returns the number of rays."""
    packet, batch, tops = buffers.packet, buffers.batch, shading.hits.geometry_top
    ray, words, probes = packet.ray, packet.words, len(points)
    total = probes * len(directions)
    for first in range(0, total, _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k >= total:
                packet.valid[lane] = 0
                continue
            p, d = points[k % probes], directions[k // probes]
            near = np.float32(NEAR)
            if d[2] < 0.0:
                near = min(near, np.float32(0.8) * heights[k % probes] / -d[2])
            set_shadow_ray(packet, lane, (p[0], p[1], p[2]), (d[0], d[1], d[2]), float(near), _FARTHEST)
        _intersect(packet.valid.ctypes, shading.scene.still, ray.ctypes, packet.arguments.ctypes)
        for lane in range(min(_LANES, total - first)):
            k, t = first + lane, ray[_FAR + lane]
            p, d = points[k % probes], directions[k // probes]
            batch.distance[k], batch.foreshortening[k] = t, seen_over_map(ray, lane)
            batch.image[0, k], batch.image[1, k] = np.float32(k), np.float32(0.0)
            for axis in range(3):
                batch.direction[axis, k], batch.point[axis, k] = d[axis], p[axis] + t * d[axis]
            batch.barycentric[0, k], batch.barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            batch.primitive[k] = np.int32(words[_PRIM + lane])
            batch.top[k] = hit_top(tops, words, lane)
    return total


@kernel
def fill_in_light(height: Float32Array, highest: float, step: Float32Array, least: float, seen: Float32Array) -> None:
    """Share of the sun that each texel sees, by steps of ``least`` texels or one; ``step`` is (column, row, rise)."""
    n = len(height)
    mask, one = n - 1, np.float32(1.0)
    size = max(one, np.float32(least))
    for i in range(n):
        for j in range(n):
            base, share = height[i, j], one
            for k in range(1, RELIEF_STEPS + 1):
                run = size * np.float32(k)
                if base + run * step[2] >= highest:
                    break
                row, column = (
                    int(np.floor(i + run * step[1] + 0.5)) & mask,
                    int(np.floor(j + run * step[0] + 0.5)) & mask,
                )
                # The sun's disc and blurred edges: the shadow sets in over a quarter of a texel, more when far away.
                above = height[row, column] - base - run * step[2]
                if above > np.float32(0.0):
                    share = min(share, max(one - above / (np.float32(0.25) + np.float32(0.05) * run), np.float32(0.0)))
                    if share <= np.float32(0.0):
                        break
            seen[i, j] = share


@kernel
def seen_means(
    atlas: Atlas, texture: int, relief: Relief, points: Float32Array, views: Float32Array, out: Float32Array
) -> None:
    """Mean brightness, and mean sunlit brightness, of ``points`` (m, 2) [m] in each of the ``views`` (n, 3)."""
    row = np.uintp(texture)
    for n in range(len(views)):
        total, lit = np.float32(0.0), np.float32(0.0)
        for m in range(len(points)):
            view = views[n, 0], views[n, 1], views[n, 2]
            texels = ground_texels(atlas, row, relief, points[m, 0], points[m, 1], view, _PIXEL)
            red, green, blue, sun = sample_lit(atlas, row, texels.u, texels.v, 0)
            bright = red + green + blue
            total, lit = total + bright, lit + bright * sun
        out[n, 0], out[n, 1] = total / np.float32(len(points)), lit / np.float32(len(points))


@kernel
def fill_terms(views: Float32Array, sun_x: np.float32, sun_y: np.float32, out: Float32Array) -> None:
    """Set the terms (n, TERMS) of views (n, 3)."""
    for n in range(len(views)):
        out[n, 0], out[n, 1], out[n, 2], out[n, 3], out[n, 4] = view_terms(
            views[n, 0], views[n, 1], views[n, 2], sun_x, sun_y
        )
