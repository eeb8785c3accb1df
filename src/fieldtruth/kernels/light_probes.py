# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Gathering of light in the probes of the light volume, see ``render.volume``."""

from typing import Any, Final

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import seen_over_map
from fieldtruth.kernels.compile import kernel
from fieldtruth.kernels.gbuffer import NX, NY, NZ
from fieldtruth.kernels.light import EXPOSURE, Shading
from fieldtruth.kernels.packets import hit_top, set_shadow_ray
from fieldtruth.kernels.shading import ShadingBuffers, shade_hits

UP: Final = 12  # first of the coefficients c2
NEAR: Final = 0.2
"""[m] from a probe within which objects are ignored: one leaf or twig must not shade a cubic metre. What is that near
to a surface is in its own share of open air, ``SurfaceTable.vertex``."""
_FARTHEST: Final = 400.0  # [m]
PROBES: Final = 64  # at once
_LANES, _FAR, _PRIM, _U, _V = packets.LANES, packets.TFAR, packets.PRIM_ID, packets.HIT_U, packets.HIT_V
_intersect: Any = packets.intersect


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
        shade_hits(shading, buffers, batch, total, pixel, buffers.gbuffer, colour)
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
        _intersect(packet.valid.ctypes, shading.scene, ray.ctypes, packet.arguments.ctypes)
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
