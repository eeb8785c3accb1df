# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water in photographs: reflection and the visible bottom, weighted by Fresnel's equations.

Labels end at the surface. For a photograph, two more rays per pixel of water start there: one reflected, one refracted
to the bottom. Waves are a fixed sum of sines (the world is static), faded out where a pixel spans several of them.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.gbuffer import FIELDS, MIRROR
from fieldtruth.sense import embree
from fieldtruth.sense.hits import hit_top
from fieldtruth.sense.packets import IntArray, Packet, set_ray
from fieldtruth.sense.ray_batch import RayBatch, new_batch, seen_over_map

REFRACTION: Final = 1.0 / 1.333
"""Refractive index of air over that of water."""
ABSORPTION: Final = np.array([1.3, 0.75, 0.95], np.float32)
"""[1/m] of light in a lake in summer, rich in algae and humus: green penetrates deepest (Kirk 2011, Light and
Photosynthesis in Aquatic Ecosystems, attenuation of such waters about 1 per metre)."""
_WAVES: Final = 14
_FARTHEST: Final = 400.0  # [m]

_LANES, _FAR = embree.LANES, embree.TFAR
_PRIM, _U, _V = embree.PRIM_ID, embree.HIT_U, embree.HIT_V
_intersect: Any = embree.intersect


class SecondaryBatch(NamedTuple):
    """Rays that start on water, and the row of the batch that each belongs to. Threads must not share it."""

    batch: RayBatch
    gbuffer: Float32Array  # (n, FIELDS)
    colour: Float32Array  # (n, 3)
    row: IntArray  # (n,) of the point on the water
    share: Float32Array  # (n,) of the light that is reflected there


def new_secondary_batch(count: int) -> SecondaryBatch:
    """Allocate memory for ``count`` rays."""
    return SecondaryBatch(
        batch=new_batch(count),
        gbuffer=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        row=np.zeros(count, np.int32),
        share=np.zeros(count, np.float32),
    )


def _waves() -> Float32Array:
    """Rows of wave vector x, y [rad/m], slope, phase: ripples of 0.1 to 2.5 m that a light wind drives towards +x."""
    rng = np.random.default_rng(5)
    length = np.geomspace(0.12, 2.6, _WAVES)
    heading = rng.normal(0.35, 0.55, _WAVES)
    slope = 0.0125 * (length / 0.6).clip(0.5, 1.0)
    k = 2.0 * np.pi / length
    waves = [k * np.cos(heading), k * np.sin(heading), slope, rng.uniform(0.0, 2.0 * np.pi, _WAVES)]
    return np.stack(waves, axis=-1).astype(np.float32)


_RIPPLES = _waves()


@inlined
def _slope(x: float, y: float, footprint: float) -> tuple[float, float]:
    """Slope of the water along x and y; waves shorter than two footprints [m] of a pixel fade."""
    sx, sy = np.float32(0.0), np.float32(0.0)
    for n in range(_RIPPLES.shape[0]):
        kx, ky = _RIPPLES[n, 0], _RIPPLES[n, 1]
        wave_number = np.sqrt(kx * kx + ky * ky)
        fade = np.float32(1.6) - np.float32(0.5) * footprint * wave_number
        if fade <= 0.0:
            continue
        steep = _RIPPLES[n, 2] * min(fade, np.float32(1.0)) * np.cos(kx * x + ky * y + _RIPPLES[n, 3]) / wave_number
        sx += steep * kx
        sy += steep * ky
    return sx, sy  # type: ignore[return-value]


@kernel
def water_rays(
    batch: RayBatch, gbuffer: Float32Array, count: int, pixel: float, reflected: bool, second: SecondaryBatch
) -> int:
    """Collect the reflected or refracted rays of all hits on water; returns their number.

    ``share`` is Schlick's (1994) approximation of Fresnel reflectance, exact at normal and at grazing incidence.
    """
    top, point, direction, distance, image = batch.top, batch.point, batch.direction, batch.distance, batch.image
    out, n, one = second.batch, 0, np.float32(1.0)
    for k in range(count):
        if top[k] <= 0 or gbuffer[k, MIRROR] <= 0.0:
            continue
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        if dz >= 0.0:
            continue
        footprint = np.float32(distance[k] * pixel) / np.sqrt(max(-dz, np.float32(0.02)))
        sx, sy = _slope(point[0, k], point[1, k], footprint)
        scale = one / np.sqrt(one + sx * sx + sy * sy)
        nx, ny, nz = -sx * scale, -sy * scale, scale
        cosine = max(-(dx * nx + dy * ny + dz * nz), np.float32(0.01))
        away = one - cosine
        away *= away * away * away * away
        share = gbuffer[k, MIRROR] + (one - gbuffer[k, MIRROR]) * away
        if reflected:
            rx, ry, rz = dx + 2 * cosine * nx, dy + 2 * cosine * ny, dz + 2 * cosine * nz
            rz = max(rz, np.float32(0.004))
        else:
            if share > np.float32(0.85):
                continue
            ratio = np.float32(REFRACTION)
            inner = np.sqrt(one - ratio * ratio * (one - cosine * cosine))
            rx = ratio * dx + (ratio * cosine - inner) * nx
            ry = ratio * dy + (ratio * cosine - inner) * ny
            rz = min(ratio * dz + (ratio * cosine - inner) * nz, np.float32(-0.05))
        scale = one / np.sqrt(rx * rx + ry * ry + rz * rz)
        out.direction[0, n], out.direction[1, n], out.direction[2, n] = rx * scale, ry * scale, rz * scale
        out.point[0, n], out.point[1, n], out.point[2, n] = point[0, k], point[1, k], point[2, k]
        out.image[0, n], out.image[1, n] = image[0, k], image[1, k]
        second.row[n], second.share[n] = k, share
        n += 1
    return n


@kernel
def trace_secondary(scene: np.uint64, tops: IntArray, packet: Packet, second: SecondaryBatch, count: int) -> None:
    """Trace the first ``count`` rays from ``point``, which becomes that of the hit; ``tops`` as for ``trace``."""
    ray, words, valid, batch = packet.ray, packet.words, packet.valid, second.batch
    for first in range(0, count, _LANES):
        for lane in range(_LANES):
            k = first + lane
            if k >= count:
                valid[lane] = 0
                continue
            origin = batch.point[0, k], batch.point[1, k], batch.point[2, k]
            direction = batch.direction[0, k], batch.direction[1, k], batch.direction[2, k]
            set_ray(packet, lane, origin, direction, 0.01, _FARTHEST)
        _intersect(valid.ctypes, scene, ray.ctypes, packet.arguments.ctypes)
        for lane in range(min(_LANES, count - first)):
            k = first + lane
            t = ray[_FAR + lane]
            batch.distance[k], batch.foreshortening[k] = t, seen_over_map(ray, lane)
            for axis in range(3):
                batch.point[axis, k] += t * batch.direction[axis, k]
            batch.barycentric[0, k], batch.barycentric[1, k] = ray[_U + lane], ray[_V + lane]
            batch.primitive[k] = np.int32(words[_PRIM + lane])
            batch.top[k] = hit_top(tops, words, lane)


@kernel
def blend_reflection(second: SecondaryBatch, count: int, colour: Float32Array) -> None:
    """Blend reflected light into the colour of the water by the Fresnel share."""
    for n in range(count):
        k, share = second.row[n], second.share[n]
        for channel in range(3):
            colour[k, channel] += (second.colour[n, channel] - colour[k, channel]) * share


@kernel
def blend_bottom(second: SecondaryBatch, count: int, colour: Float32Array) -> None:
    """Blend the bottom into the colour of the water by the light that is not absorbed."""
    for n in range(count):
        k, depth = second.row[n], second.batch.distance[n]
        if second.batch.top[n] < 0:
            continue
        for channel in range(3):
            left = np.exp(-ABSORPTION[channel] * np.float32(1.6) * depth)  # both down and up
            colour[k, channel] += (np.float32(0.9) * second.colour[n, channel] - colour[k, channel]) * left
