# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shading: the light that each hit sends to the camera, from the sun, the sky, the ground, and through water."""

from typing import Any, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.render.air import dim
from fieldtruth.render.gbuffer import (
    FIELDS,
    GLOSS,
    NX,
    NY,
    NZ,
    RED,
    SKY,
    SUN,
    TRACE_SUN,
    TRANSLUCENCY,
    terrain_gbuffer,
)
from fieldtruth.render.mesh_gbuffer import mesh_gbuffer
from fieldtruth.render.sky import sky_radiance
from fieldtruth.render.tables import EXPOSURE, HAZE_PER_METRE, LightTable, Shading
from fieldtruth.render.visibility import SHADOW_RANGE
from fieldtruth.render.water import (
    SecondaryBatch,
    blend_bottom,
    blend_reflection,
    new_secondary_batch,
    trace_secondary,
    water_rays,
)
from fieldtruth.sense import embree
from fieldtruth.sense.hits import TERRAIN
from fieldtruth.sense.kernel import inlined, kernel, light_kernel
from fieldtruth.sense.packets import IntArray, Packet, new_packet, set_shadow_ray
from fieldtruth.sense.ray_batch import RayBatch, new_batch

_EXPOSURE, _PER_PI, _HAZE = np.float32(EXPOSURE), np.float32(1.0 / np.pi), np.float32(HAZE_PER_METRE)
_LEAF_GLOW = np.array([2.6, 2.8, 1.0], np.float32)  # light through a leaf is yellower than light from it
_OFFSET = 0.002  # [m] between a surface and the origin of its shadow ray

_Vector = tuple[np.float32, np.float32, np.float32]

_LANES, _FAR, _OX, _OY, _OZ = embree.LANES, embree.TFAR, embree.ORG_X, embree.ORG_Y, embree.ORG_Z
_occluded: Any = embree.occluded


class ShadingBuffers(NamedTuple):
    """Memory for shading one batch of rays. Threads must not share it."""

    packet: Packet
    shadow: Packet
    shadow_rows: IntArray  # (LANES,) row of the batch that each shadow ray starts from
    batch: RayBatch
    gbuffer: Float32Array  # (n, FIELDS)
    colour: Float32Array  # (n, 3) linear and exposed
    secondary: SecondaryBatch  # rays that continue from water


def new_shading_buffers(count: int) -> ShadingBuffers:
    """Allocate memory for batches of ``count`` rays."""
    return ShadingBuffers(
        packet=new_packet(coherent=True),
        shadow=new_packet(coherent=True),
        shadow_rows=np.zeros(_LANES, np.int32),
        batch=new_batch(count),
        gbuffer=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        secondary=new_secondary_batch(count),
    )


@kernel
def shade_batch(shading: Shading, buffers: ShadingBuffers, count: int, pixel: float) -> None:
    """Compute ``colour`` of the traced rays; ``pixel`` is the angle [rad] of one pixel."""
    _shade(shading, buffers, buffers.batch, count, pixel, buffers.gbuffer, buffers.colour)
    if shading.has_water:
        _shade_water(shading, buffers, count, pixel)
    if shading.has_weather:
        dim(shading, buffers.batch, count, buffers.colour)


@kernel
def _shade_water(shading: Shading, buffers: ShadingBuffers, count: int, pixel: float) -> None:
    """Add the bottom and what is reflected to the colour of water."""
    second = buffers.secondary
    found = water_rays(buffers.batch, buffers.gbuffer, count, pixel, False, second)
    trace_secondary(shading.scene, shading.hits.geometry_top, buffers.packet, second, found)
    _shade(shading, buffers, second.batch, found, pixel, second.gbuffer, second.colour)
    blend_bottom(second, found, buffers.colour)
    found = water_rays(buffers.batch, buffers.gbuffer, count, pixel, True, second)
    trace_secondary(shading.scene, shading.hits.geometry_top, buffers.packet, second, found)
    _shade(shading, buffers, second.batch, found, pixel, second.gbuffer, second.colour)
    if shading.has_weather:
        dim(shading, second.batch, found, second.colour)
    blend_reflection(second, found, buffers.colour)


@kernel
def _shade(
    shading: Shading,
    buffers: ShadingBuffers,
    batch: RayBatch,
    count: int,
    pixel: float,
    gbuffer: Float32Array,
    colour: Float32Array,
) -> None:
    terrain_gbuffer(shading, batch, count, pixel, gbuffer)
    mesh_gbuffer(shading, batch, count, pixel, gbuffer)
    _trace_sun(shading.scene, buffers.shadow, buffers.shadow_rows, shading.light.sun, batch, count, gbuffer)
    _illuminate(batch, count, gbuffer, shading.light, shading.exposure, colour)


@kernel
def _trace_sun(
    scene: np.uint64, shadow: Packet, rows: IntArray, sun: Array, batch: RayBatch, count: int, gbuffer: Float32Array
) -> None:
    """Trace a shadow ray for each hit whose SUN requests it. What all of them share is set once."""
    sx, sy, sz, filled = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2]), 0
    top, point, ray, offset, zero = batch.top, batch.point, shadow.ray, np.float32(_OFFSET), np.float32(0.0)
    for lane in range(_LANES):
        set_shadow_ray(shadow, lane, (zero, zero, zero), (sx, sy, sz), _OFFSET, SHADOW_RANGE)
    for k in range(count):
        if top[k] > TERRAIN and gbuffer[k, SUN] == TRACE_SUN:
            nx, ny, nz = gbuffer[k, NX], gbuffer[k, NY], gbuffer[k, NZ]
            gbuffer[k, SUN] = zero
            if nx * sx + ny * sy + nz * sz > zero:
                ray[_OX + filled] = point[0, k] + offset * nx
                ray[_OY + filled] = point[1, k] + offset * ny
                ray[_OZ + filled] = point[2, k] + offset * nz
                ray[_FAR + filled] = SHADOW_RANGE
                rows[filled] = k
                filled += 1
        if filled == _LANES or (k == count - 1 and filled > 0):
            for lane in range(filled, _LANES):
                shadow.valid[lane] = 0
            _occluded(shadow.valid.ctypes, scene, ray.ctypes, shadow.arguments.ctypes)
            for lane in range(filled):
                if ray[_FAR + lane] >= zero:
                    gbuffer[rows[lane], SUN] = 1.0
            filled = 0


@inlined
def _half_vector_cosine(normal: _Vector, sun: _Vector, view: _Vector) -> np.float32:
    """Cosine of the angle between the normal and the half vector of sun and camera (Blinn 1977); 0 if negative."""
    hx, hy, hz = sun[0] - view[0], sun[1] - view[1], sun[2] - view[2]
    dot = normal[0] * hx + normal[1] * hy + normal[2] * hz
    return max(dot / np.sqrt(hx * hx + hy * hy + hz * hz), np.float32(0.0))


@light_kernel
def _illuminate(
    batch: RayBatch, count: int, gbuffer: Float32Array, light: LightTable, exposure: np.float32, colour: Float32Array
) -> None:
    """Sum the light along each ray: sun, sky, reflection from the ground, highlight, and haze in between."""
    top, direction, distance, glow = batch.top, batch.direction, batch.distance, _LEAF_GLOW
    dome, sun_rgb, bounce, mean = light.dome.rgb, light.sun_rgb, light.bounce, light.dome.mean
    horizon = light.dome.horizon / np.sqrt(exposure)  # less light is scattered where less falls
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    zero, one, half, scale = np.float32(0.0), np.float32(1.0), np.float32(0.5), _EXPOSURE * exposure
    for k in range(count):
        dx, dy, dz = direction[0, k], direction[1, k], direction[2, k]
        if top[k] < 0:
            if dx * dx + dy * dy + dz * dz < half:  # the lens has no ray here
                colour[k, 0], colour[k, 1], colour[k, 2] = zero, zero, zero
                continue
            r, g, b = sky_radiance(dome, dx, dy, dz)
            colour[k, 0], colour[k, 1], colour[k, 2] = scale * r, scale * g, scale * b
            continue
        nx, ny, nz, sun = gbuffer[k, NX], gbuffer[k, NY], gbuffer[k, NZ], gbuffer[k, SUN]
        facing = nx * sx + ny * sy + nz * sz
        front = max(facing, zero) * sun * _PER_PI
        behind = max(-facing, zero) * sun * gbuffer[k, TRANSLUCENCY] * _PER_PI
        up = half + half * nz
        sky = gbuffer[k, SKY] * up
        below = (np.float32(0.35) + np.float32(0.65) * gbuffer[k, SKY]) * (one - up)
        gloss = zero
        if gbuffer[k, GLOSS] > zero and sun > zero and facing > zero:
            power = _half_vector_cosine((nx, ny, nz), (sx, sy, sz), (dx, dy, dz))
            for _ in range(4):
                power *= power
            gloss = np.float32(0.25) * gbuffer[k, GLOSS] * sun * power * power  # cosine to the power of 32
        haze = min(distance[k] * _HAZE, half)  # the first terms of 1 - exp(-x)
        haze -= half * haze * haze
        for channel in range(3):
            irradiance = (
                sun_rgb[channel] * (front + behind * glow[channel]) + mean[channel] * sky + bounce[channel] * below
            )
            value = gbuffer[k, RED + channel] * irradiance + gloss * sun_rgb[channel]
            if haze > np.float32(0.01):
                value = value + (horizon[channel] - value) * haze
            colour[k, channel] = scale * value
