# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The light volume: what sky, sunlit ground and leaves send through the air, as probes on a grid.

Each probe keeps, by channel, coefficients of the irradiance E on a surface with the unit normal n, over pi:
E(n) / pi = c0 + c1 . n + c2 max(nz, 0)^2, with c0 the mean radiance over all directions and c1 twice the mean of
radiance times direction (Ramamoorthi and Hanrahan 2001, the first two bands). For light from a half space, as over a
plane below an even sky, these are exact; below the CIE's overcast sky they give a level surface 7 % too little. So c2
is what a level surface receives in addition: exact for all that faces up. A leaf reads both of its sides with one
lookup, with n and with -n.

Probes are filled by shading what their rays hit as a photograph does, several times: each time adds a reflection, of
light that the volume of the time before brings.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import numpy as np
from scipy.ndimage import convolve1d

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel
from fieldtruth.render.gbuffer import NX, NY, NZ
from fieldtruth.render.shading import ShadingBuffers, new_shading_buffers, shade_hits
from fieldtruth.render.sky.dome import soft_dome
from fieldtruth.render.tables import AIR_BASE, AIR_LAYER, EXPOSURE, Shading
from fieldtruth.sense import embree
from fieldtruth.sense.hits import hit_top
from fieldtruth.sense.packets import set_shadow_ray
from fieldtruth.sense.ray_batch import seen_over_map

LAYERS: Final = 14
COEFFICIENTS: Final = 16
"""Floats per probe, one cache line: 4 of each channel (c0, then c1 along x, y, z), c2 of each channel, 1 unused."""
_UP: Final = 12  # first of the coefficients c2
RAYS: Final = (16, 16, 48)
"""Directions from each probe, for each reflection: light of the first ones is gathered again."""
NEAR: Final = 0.2
"""[m] from a probe within which objects are ignored: one leaf or twig must not shade a cubic metre. What is that near
to a surface is in its own share of open air, ``SurfaceTable.vertex``."""
_BLUR: Final = (0.25, 0.5, 0.25)
_FARTHEST: Final = 400.0  # [m]
_PROBES: Final = 64  # at once
_SETS: Final = 4

_LANES, _FAR, _PRIM, _U, _V = embree.LANES, embree.TFAR, embree.PRIM_ID, embree.HIT_U, embree.HIT_V
_intersect: Any = embree.intersect


def sphere(count: int, turn: float) -> Array:
    """Directions (count, 3) spread evenly over the sphere (spherical Fibonacci), turned about z by ``turn`` [rad]."""
    k = np.arange(count) + 0.5
    z, angle = 1.0 - 2.0 * k / count, k * np.pi * (3.0 - np.sqrt(5.0)) + turn
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)


def fill_volume(shading: Shading, veil: Float32Array, pool: ThreadPoolExecutor) -> Float32Array:
    """Fill the probes (nx, ny, LAYERS, COEFFICIENTS) of ``shading.light``, whose volume gives their number.

    ``veil`` (3,) is radiance of the air that comes from the whole sky in addition to that of the dome.
    """
    shading = shading._replace(light=shading.light._replace(dome=soft_dome(shading.light.dome)))  # rays are few
    for rays in RAYS:
        volume = _gathered(shading, veil, rays, pool)
        shading = shading._replace(light=shading.light._replace(volume=volume))
    return shading.light.volume


def _gathered(shading: Shading, veil: Float32Array, rays: int, pool: ThreadPoolExecutor) -> Float32Array:
    """Gather over all probes in ``rays`` directions, then blur; probes inside of solid objects have no weight."""
    light = shading.light
    nx, ny, nz, _ = light.volume.shape
    volume, inside = np.zeros_like(light.volume), np.zeros((nx, ny, nz), np.float32)
    x, y = (
        start + np.arange(n) / light.volume_per_metre for start, n in zip(light.volume_corner, (nx, ny), strict=True)
    )
    above = AIR_BASE + AIR_LAYER * np.arange(nz)
    sets = [sphere(rays, 2.0 * np.pi * k * 0.381966).astype(np.float32) for k in range(_SETS)]

    def column_row(i: int) -> None:
        buffers = new_shading_buffers(_PROBES * rays)
        for parity in range(_SETS):
            j, k = np.nonzero((np.arange(ny)[:, None] + 2 * i + np.arange(nz)) % _SETS == parity)
            points = np.stack([np.full(len(j), x[i]), y[j], light.volume_base[i, j] + above[k]], axis=-1)
            found, behind = np.zeros((len(j), COEFFICIENTS), np.float32), np.zeros(len(j), np.float32)
            heights = above[k].astype(np.float32)
            _probe(shading, buffers, points.astype(np.float32), heights, sets[parity], veil, found, behind)
            found[:, _UP : _UP + 3] -= found[:, 0:_UP:4] + found[:, 3:_UP:4]
            volume[i, j, k], inside[i, j, k] = found, behind

    list(pool.map(column_row, range(nx)))
    weight = np.maximum(1.0 - 3.0 * inside, np.float32(1e-3))
    volume *= weight[..., None]
    for axis in (0, 1):
        volume, weight = (convolve1d(each, _BLUR, axis=axis, mode="nearest") for each in (volume, weight))
    return np.ascontiguousarray(volume / weight[..., None], np.float32)


@kernel
def _probe(
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
    for first in range(0, len(points), _PROBES):
        probes = min(_PROBES, len(points) - first)
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
                found[row, _UP + channel] += two * two * value * max(d[2], zero)
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
