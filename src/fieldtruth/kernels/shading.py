# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shading: the light that each hit sends to the camera, from the sun, the sky, the ground, and through water.

Labels end at the surface of water. For a photograph, further rays start there, see ``kernels.water``.
Snow covers the ground by its depth, and what faces up to the sky on everything else.
"""

from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels import packets
from fieldtruth.kernels.camera_rays import RayBatch, new_batch
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.kernels.gbuffer import (
    BLUE,
    FIELDS,
    GLOSS,
    GREEN,
    LIGHT,
    MESH_PASSES,
    MIRROR,
    NX,
    NY,
    NZ,
    RED,
    SUN,
    TERRAIN_PASSES,
    TRACE_SUN,
    Scratch,
    mesh_gbuffer,
    new_scratch,
    terrain_gbuffer,
)
from fieldtruth.kernels.light import (
    EXPOSURE,
    SHADOW_RANGE,
    LightTable,
    RobotTable,
    Shading,
    SnowTable,
    add_disc,
    add_glitter,
    dim,
    sky_radiance,
    sun_share,
)
from fieldtruth.kernels.packets import (
    TERRAIN,
    Grid,
    IntArray,
    Packet,
    new_packet,
    read_grid,
    set_shadow_ray,
)
from fieldtruth.kernels.robot import in_reach, sun_past_robot
from fieldtruth.kernels.water import (
    SecondaryBatch,
    blend_bottom,
    blend_reflection,
    blur_sky,
    find_slopes,
    new_secondary_batch,
    trace_secondary,
    water_rays,
)

PASSES: Final = (
    *TERRAIN_PASSES,
    *MESH_PASSES,
    "shadows of the sun on wood, rock and furniture",
    "sun, sky, translucency, highlights",
)
"""Passes of ``shade_hits``, in their order."""
WHITE: Final = (np.float32(0.80), np.float32(0.82), np.float32(0.85))
"""Albedo of settled snow of some days, in the visible (Wiscombe and Warren 1980, J. Atmos. Sci. 37, 2712-2745)."""
_GRASS: Final = np.float32(0.4)
"""Share of snow that blades and needles hold, relative to solid surfaces."""


@inlined
def _ragged(x: np.float32, y: np.float32, z: np.float32) -> np.float32:
    """Noise in [-1, 1] with wavelengths of 5 to 40 cm."""
    a = np.sin(np.float32(17.0) * x + np.float32(5.0) * z) * np.sin(np.float32(21.0) * y - np.float32(7.0) * z)
    b = np.sin(np.float32(61.0) * x - np.float32(23.0) * y) * np.sin(np.float32(53.0) * y + np.float32(71.0) * z)
    return np.float32(0.6) * a + np.float32(0.4) * b  # type: ignore[no-any-return]


@kernel
def cover_with_snow(
    snow: SnowTable, open_light: np.float32, batch: RayBatch, count: int, bodies: int, out: Float32Array
) -> None:
    """Mix snow into the rows of a G-buffer ``out`` (n, FIELDS), whose LIGHT is ``open_light`` below the whole sky.

    None lies on what moves, the top-level geometries from ``bodies`` on.
    """
    top, point, ground, on_top = batch.top, batch.point, snow.ground, snow.on_top
    zero, one, lit = np.float32(0.0), np.float32(1.0), np.float32(3.0) / open_light
    for k in range(count):
        if top[k] < 0 or top[k] >= bodies or out[k, MIRROR] > zero:
            continue
        x, y, z = point[0, k], point[1, k], point[2, k]
        noise = _ragged(x, y, z)
        if top[k] == TERRAIN:
            share = np.float32(read_grid(ground, x, y))
            share += np.float32(0.8) * noise * share * (one - share)
        else:
            open_sky = min(max(lit * out[k, LIGHT + 1] - np.float32(0.25), zero), one)
            share = (out[k, NZ] - np.float32(0.45) + np.float32(0.22) * noise) * np.float32(3.5)
            share = min(max(share, zero), one) * open_sky * on_top
            if out[k, SUN] != TRACE_SUN:  # leaves, whose share of the sun is known
                share *= _GRASS + (one - _GRASS) * noise * noise
        share = min(max(share, zero), one)
        bare, grain = one - share, one + np.float32(0.04) * noise
        out[k, RED] = bare * out[k, RED] + share * grain * WHITE[0]
        out[k, GREEN] = bare * out[k, GREEN] + share * grain * WHITE[1]
        out[k, BLUE] = bare * out[k, BLUE] + share * grain * WHITE[2]
        out[k, GLOSS] *= bare


_TERRAIN, _ALL = len(TERRAIN_PASSES), len(PASSES)
_EXPOSURE, _PER_PI = np.float32(EXPOSURE), np.float32(1.0 / np.pi)
_CUTICLE = np.float32(0.04)  # reflectance of wax and varnish at normal incidence: refractive index 1.5
_OFFSET = 0.002  # [m] between a surface and the origin of its shadow ray
_FINE = np.float32(0.006)
"""Width [m] of a pixel below which shadows of what is near, and so small that the map may lack it, are traced."""
_CLOSE = np.float32(1.0)  # [m] to what hides the sun, below which its shadow is sharp
_SOFT, _SOFTEST = np.float32(0.05), np.float32(0.3)
"""Radius [m] over which the map is read: the sun's disc seen past what is 11 m away; more for large pixels."""
_Vector = tuple[np.float32, np.float32, np.float32]
_LANES, _FAR, _OX, _OY, _OZ = packets.LANES, packets.TFAR, packets.ORG_X, packets.ORG_Y, packets.ORG_Z
_occluded: Any = packets.occluded


class ShadingBuffers(NamedTuple):
    """Memory for shading one batch of rays. Threads must not share it."""

    packet: Packet
    shadow: Packet
    shadow_rows: IntArray  # (LANES,) row of the batch that each shadow ray starts from
    batch: RayBatch
    scratch: Scratch
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
        scratch=new_scratch(count),
        gbuffer=np.zeros((count, FIELDS), np.float32),
        colour=np.zeros((count, 3), np.float32),
        secondary=new_secondary_batch(count),
    )


@inlined
def shade_batch(shading: Shading, buffers: ShadingBuffers, count: int, pixel: float) -> None:
    """Compute ``colour`` of the traced rays; ``pixel`` is the angle [rad] of one pixel."""
    shade_hits(shading, buffers, buffers.batch, count, pixel, (buffers.gbuffer, buffers.colour), _ALL)
    add_disc(shading.light, shading.exposure, buffers.batch, count, buffers.colour)
    if shading.has_water:
        _shade_water(shading, buffers, count, pixel)
    dim(shading, buffers.batch, count, buffers.colour)


@inlined
def _shade_water(shading: Shading, buffers: ShadingBuffers, count: int, pixel: float) -> None:
    """Add the bottom and what is reflected to the colour of water."""
    second, hit = buffers.secondary, (buffers.batch, buffers.gbuffer)
    find_slopes(hit, shading.ripples, count, pixel, second)
    found = water_rays(hit, count, False, second)
    trace_secondary(shading.scene, shading.hits.geometry_top, buffers.packet, second, found)
    shade_hits(shading, buffers, second.batch, found, pixel, (second.gbuffer, second.colour), _ALL)
    blend_bottom(second, found, buffers.colour)
    found = water_rays(hit, count, True, second)
    trace_secondary(shading.scene, shading.hits.geometry_top, buffers.packet, second, found)
    shade_hits(shading, buffers, second.batch, found, pixel, (second.gbuffer, second.colour), _ALL)
    blur_sky(hit, second, found, shading.light.dome.rgb, _EXPOSURE * shading.exposure)
    add_glitter(shading.light, shading.exposure, second.batch, found, second.colour)
    dim(shading, second.batch, found, second.colour)
    blend_reflection(second, found, buffers.colour)


@kernel(inner=True)
def shade_hits(
    shading: Shading,
    buffers: ShadingBuffers,
    batch: RayBatch,
    count: int,
    pixel: float,
    out: tuple[Float32Array, Float32Array],
    passes: int,
) -> None:
    """Compute the G-buffer and colours ``out`` of the traced rays of a batch, without water and weather.

    ``passes`` is the number of PASSES that are made: fewer than all to measure what each costs.
    """
    gbuffer, colour = out
    terrain_gbuffer(shading, batch, count, pixel, buffers.scratch, gbuffer, passes)
    mesh_gbuffer(shading, batch, count, pixel, buffers.scratch, gbuffer, passes - _TERRAIN)
    if passes < _ALL - 1:
        return
    if shading.has_snow:
        bodies = shading.surfaces.top_rotation.shape[0] - shading.scene.axes.shape[1]
        cover_with_snow(shading.snow, shading.light.dome.mean[1], batch, count, bodies, gbuffer)
    _share_sun(shading, buffers.shadow, buffers.shadow_rows, batch, count, np.float32(pixel), gbuffer)
    if shading.scene.moving != np.uint64(0):
        _shade_by_bodies(shading, buffers.shadow, buffers.shadow_rows, batch, count, gbuffer)
    if len(shading.robot.parts) > 0:
        _shade_by_robot(shading.robot, buffers.scratch.robot, shading.light.sun, batch, count, gbuffer)
    if shading.light.has_cloud_shadow:
        _shade_by_clouds(shading.light.cloud_sun, batch, count, gbuffer)
    if passes == _ALL:
        _illuminate(batch, count, gbuffer, shading.light, shading.exposure, colour)


@kernel(inner=True)
def _share_sun(
    shading: Shading, shadow: Packet, rows: IntArray, batch: RayBatch, count: int, pixel: np.float32,
    gbuffer: Float32Array,
) -> None:  # fmt: skip
    """Find the share of the sun for each hit whose SUN requests it: from the sun's map, or near ones by shadow rays.

    A ray has the fine shadow of what is near; the map has the soft one of what is far away.
    """
    sun, sun_map = shading.light.sun, shading.light.sun_map
    sx, sy, sz, filled = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2]), 0
    top, point, distance, ray = batch.top, batch.point, batch.distance, shadow.ray
    offset, zero, one = np.float32(_OFFSET), np.float32(0.0), np.float32(1.0)
    for lane in range(_LANES):
        set_shadow_ray(shadow, lane, (zero, zero, zero), (sx, sy, sz), _OFFSET, SHADOW_RANGE)
    for k in range(count):
        if top[k] > TERRAIN and gbuffer[k, SUN] == TRACE_SUN:
            nx, ny, nz, side = gbuffer[k, NX], gbuffer[k, NY], gbuffer[k, NZ], distance[k] * pixel
            share, away = zero, one
            if nx * sx + ny * sy + nz * sz > zero:
                at, spread = (point[0, k], point[1, k], point[2, k]), min(_SOFTEST, _SOFT + np.float32(0.5) * side)
                share, away = sun_share(sun_map, at, (nx, ny, nz), spread)
                if share < zero or (side < _FINE and (share == one or away < _CLOSE)):
                    ray[_OX + filled] = point[0, k] + offset * nx
                    ray[_OY + filled] = point[1, k] + offset * ny
                    ray[_OZ + filled] = point[2, k] + offset * nz
                    ray[_FAR + filled] = SHADOW_RANGE
                    rows[filled], share = k, zero
                    filled += 1
            gbuffer[k, SUN] = share
        if filled == _LANES or (k == count - 1 and filled > 0):
            for lane in range(filled, _LANES):
                shadow.valid[lane] = 0
            _occluded(shadow.valid.ctypes, shading.scene.still, ray.ctypes, shadow.arguments.ctypes)
            if shading.scene.plants != np.uint64(0):
                _occluded(shadow.valid.ctypes, shading.scene.plants, ray.ctypes, shadow.arguments.ctypes)
            if shading.scene.ground != np.uint64(0):
                _occluded(shadow.valid.ctypes, shading.scene.ground, ray.ctypes, shadow.arguments.ctypes)
            for lane in range(filled):
                if ray[_FAR + lane] >= zero:
                    gbuffer[rows[lane], SUN] = one
            filled = 0


@kernel(inner=True)
def _shade_by_bodies(
    shading: Shading, shadow: Packet, rows: IntArray, batch: RayBatch, count: int, gbuffer: Float32Array
) -> None:
    """Take the sun from hits from which a body that moves hides it; the maps of the sun have what stands still."""
    sun, top, point, ray, filled = shading.light.sun, batch.top, batch.point, shadow.ray, 0
    sx, sy, sz = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2])
    offset, zero = np.float32(_OFFSET), np.float32(0.0)
    for lane in range(_LANES):
        set_shadow_ray(shadow, lane, (zero, zero, zero), (sx, sy, sz), _OFFSET, SHADOW_RANGE)
    for k in range(count):
        nx, ny, nz = gbuffer[k, NX], gbuffer[k, NY], gbuffer[k, NZ]
        if top[k] >= 0 and gbuffer[k, SUN] > zero and nx * sx + ny * sy + nz * sz > zero:
            ray[_OX + filled] = point[0, k] + offset * nx
            ray[_OY + filled] = point[1, k] + offset * ny
            ray[_OZ + filled] = point[2, k] + offset * nz
            ray[_FAR + filled] = SHADOW_RANGE
            rows[filled] = k
            filled += 1
        if filled == _LANES or (k == count - 1 and filled > 0):
            for lane in range(filled, _LANES):
                shadow.valid[lane] = 0
            _occluded(shadow.valid.ctypes, shading.scene.moving, ray.ctypes, shadow.arguments.ctypes)
            for lane in range(filled):
                if ray[_FAR + lane] < zero:
                    gbuffer[rows[lane], SUN] = zero
            filled = 0


@kernel(inner=True)
def _shade_by_robot(
    robot: RobotTable, place: Array, sun: Array, batch: RayBatch, count: int, gbuffer: Float32Array
) -> None:
    """Take the sun from hits from which the robot that carries the camera hides it."""
    top, point, zero = batch.top, batch.point, np.float32(0.0)
    for k in range(count):
        x, y, z = point[0, k], point[1, k], point[2, k]
        if top[k] >= 0 and gbuffer[k, SUN] > zero and in_reach(place, x, y, z, sun):
            gbuffer[k, SUN] *= sun_past_robot(robot, place, x, y, z)


@kernel
def _shade_by_clouds(cloud_sun: Grid, batch: RayBatch, count: int, gbuffer: Float32Array) -> None:
    """Multiply the sun that objects see by what clouds let through; the ground's has it."""
    for k in range(count):
        if batch.top[k] > TERRAIN and gbuffer[k, SUN] > np.float32(0.0):
            gbuffer[k, SUN] *= read_grid(cloud_sun, batch.point[0, k], batch.point[1, k])


@inlined
def _highlight(normal: _Vector, sun: _Vector, view: _Vector) -> np.float32:
    """Light that a broad highlight sends back, over the sun's irradiance on a surface that faces it.

    Normalized Blinn-Phong reflection with the exponent 16, times the cosine to the sun, with Schlick's (1994) Fresnel
    reflectance at the angle between the half vector and the camera. ``sun`` is towards it, ``view`` from the camera.
    """
    zero, one = np.float32(0.0), np.float32(1.0)
    hx, hy, hz = sun[0] - view[0], sun[1] - view[1], sun[2] - view[2]
    length = np.sqrt(max(hx * hx + hy * hy + hz * hz, np.float32(1e-6)))
    power = max((normal[0] * hx + normal[1] * hy + normal[2] * hz) / length, zero)
    away = one - np.float32(0.5) * length
    fresnel = _CUTICLE + (one - _CUTICLE) * away * away * away * away * away
    power *= power
    power *= power
    power *= power
    power *= power
    facing = normal[0] * sun[0] + normal[1] * sun[1] + normal[2] * sun[2]
    return fresnel * np.float32(24.0 / (8.0 * np.pi)) * power * facing  # type: ignore[no-any-return]


@kernel(inner=True)
def _illuminate(
    batch: RayBatch, count: int, gbuffer: Float32Array, light: LightTable, exposure: np.float32, colour: Float32Array
) -> None:
    """Sum the light that each hit sends towards the camera: of sun, sky and surroundings, and the highlight."""
    top, direction = batch.top, batch.direction
    dome, sun_rgb = light.dome.rgb, light.sun_rgb
    sx, sy, sz = np.float32(light.sun[0]), np.float32(light.sun[1]), np.float32(light.sun[2])
    zero, half, one, scale = np.float32(0.0), np.float32(0.5), np.float32(1.0), _EXPOSURE * exposure
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
        gloss, sheen = zero, zero
        if gbuffer[k, GLOSS] > zero:
            strength = np.sqrt(gbuffer[k, GLOSS])
            away = one - min(abs(nx * dx + ny * dy + nz * dz), one)
            sheen = strength * (_CUTICLE + np.float32(0.3) * away * away * away * away)
            if sun > zero and facing > zero:
                gloss = strength * sun * _highlight((nx, ny, nz), (sx, sy, sz), (dx, dy, dz))
        for channel in range(3):
            around = gbuffer[k, LIGHT + channel]
            value = gbuffer[k, RED + channel] * (sun_rgb[channel] * front + around)
            value += gloss * sun_rgb[channel] + sheen * around
            colour[k, channel] = scale * value
