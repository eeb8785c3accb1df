# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sky as an image of the dome: clear air, clouds, and how much of the sun's disc they let through."""

from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.render.sky.atmosphere import (
    ABOVE,
    AEROSOL,
    AZIMUTHS,
    BELOW,
    ELEVATIONS,
    MOLECULES,
    Clear,
    aerosol_phase,
    molecule_phase,
)
from fieldtruth.render.sky.clouds import CloudLight, Clouds, Shade, march, shade_of
from fieldtruth.render.sky.layers import Layer, layer_light

SIZE: Final = 2048
"""Texels along each side of the dome that photographs show; below 500 the horizon would be outside of it."""
_ROWS: Final = 32  # at once
_EDGE: Final = 0.998
_SHARP: Final = 0.15
"""Difference between neighbours in what clouds stop, from which on their edge is marched for every texel."""
_LOWEST: Final = 0.012
"""Sine of the elevation below which haze hides clouds."""


class Dome(NamedTuple):
    """Radiance ``rgb`` (n, n, 3) of the upper half of the sky without the sun's disc.

    It is a paraboloid map (Heidrich and Seidel 1998): the direction (x, y, z) is at row x / (1 + z) and column
    y / (1 + z), both from -1 to 1, so that a lookup needs no angle.
    """

    rgb: Float32Array
    mean: Float32Array  # (3,) irradiance of level ground, divided by pi
    horizon: Float32Array  # (3,) radiance near the horizon, the colour of haze


class Sky(NamedTuple):
    """All that shapes the dome."""

    clear: Clear
    light: CloudLight
    clouds: Clouds | None
    layer: Layer | None
    level: Array  # (3,) irradiance of level ground by a thick layer
    haze: float  # share of its light that the air below the clouds scatters: less where they shade it


def make_dome(sky: Sky, pool: ThreadPoolExecutor, size: int) -> Dome:
    """Compute the dome of ``size`` texels along each side. The result does not depend on the threads of ``pool``."""
    rgb = np.zeros((size, size, 3), np.float32)
    starts = range(0, size, _ROWS)
    seen = None if sky.clouds is None else _clouds_seen(sky, sky.clouds, pool, size)

    def rows(start: int) -> None:
        _clear_rows(sky.clear, sky.light.sun, sky.haze, start, rgb[start : start + _ROWS])
        if seen is not None:
            _cloud_rows(
                sky.clear, sky.light.sun, sky.haze, start, seen[start : start + _ROWS], rgb[start : start + _ROWS]
            )
        if sky.layer is not None:
            _layer_rows(sky.clear, sky.layer, sky.light, sky.haze, sky.level, start, rgb[start : start + _ROWS])

    list(pool.map(rows, starts))
    return dome_of(rgb)


def dome_of(rgb: Float32Array) -> Dome:
    """Return the dome with the irradiance and the horizon of its image."""
    small = _averaged(rgb, min(len(rgb), 512))
    directions, weight = directions_of(len(small))
    z = directions[..., 2]
    mean = np.einsum("ijc,ij->c", small, weight * np.maximum(z, 0.0)) / np.pi
    horizon = small[(z > 0.005) & (z < 0.04) & (weight > 0)].mean(axis=0)
    return Dome(rgb, mean.astype(np.float32), horizon.astype(np.float32))


def _averaged(image: Float32Array, size: int) -> Float32Array:
    """Mean of the texels of an image (n, n, c) in each of (size, size) squares; n is a multiple of ``size``."""
    step = len(image) // size
    return np.asarray(image.reshape(size, step, size, step, -1).mean(axis=(1, 3)), np.float32)


def _enlarged(image: Float32Array, size: int) -> Float32Array:
    """Bilinear interpolation of an image (n, n, c) at the centres of (size, size) squares."""
    factor = size / len(image)
    return np.asarray(zoom(image, (factor, factor, 1), order=1, mode="nearest", grid_mode=True), np.float32)


def soft_dome(dome: Dome, texels: int = 32) -> Dome:
    """Return the dome as seen by few rays: averaged over ``texels`` along each side, with the same irradiance."""
    small = _averaged(dome.rgb, texels)
    soft = dome_of(_enlarged(small, len(dome.rgb)))
    gain = (dome.mean / np.maximum(soft.mean, np.float32(1e-9))).astype(np.float32)
    return Dome(soft.rgb * gain, dome.mean, dome.horizon)


def clear_mean(clear: Clear, sun: Array) -> Array:
    """Irradiance (3,) of level ground by the clear sky, divided by pi."""
    directions, weight = directions_of(128)
    total, radiance = np.zeros(3), np.zeros(3)
    for (x, y, z), share in zip(directions[weight > 0], weight[weight > 0], strict=True):
        radiance[:] = 0.0
        _add_air(clear, sun, (x, y, z), BELOW, 1.0, radiance)
        _add_air(clear, sun, (x, y, z), ABOVE, 1.0, radiance)
        total += share * z * radiance / np.pi
    return total


def directions_of(size: int) -> tuple[Array, Array]:
    """Unit vectors (size, size, 3) of the texels of a paraboloid map, and the solid angle [sr] of each."""
    nodes = _node(np.arange(float(size)), size)
    p, q = np.meshgrid(nodes, nodes, indexing="ij")
    radius = np.minimum(p * p + q * q, 1.0)
    directions = np.stack([2.0 * p, 2.0 * q, 1.0 - radius], axis=-1) / (1.0 + radius)[..., None]
    weight = np.where(p * p + q * q < 1.0, 4.0 / (1.0 + radius) ** 2, 0.0) * (2.0 / (size * _EDGE)) ** 2
    return directions, weight * (2.0 * np.pi / weight.sum())


def sky_irradiance(dome: Dome, normals: Array) -> Array:
    """Irradiance (n, 3) by the sky, divided by pi, of surfaces with unit ``normals`` (n, 3); the ground is black."""
    step = len(dome.rgb) // 64
    small = dome.rgb.reshape(64, step, 64, step, 3).mean(axis=(1, 3))
    directions, weight = directions_of(64)
    seen = weight.ravel() > 0
    facing = np.maximum(np.asarray(normals) @ directions.reshape(-1, 3)[seen].T, 0.0)
    return np.asarray(facing * weight.ravel()[seen] @ small.reshape(-1, 3)[seen] / np.pi)


def _node(index: Array, size: int) -> Array:
    return (index - (size - 1) / 2) / (size / 2 * _EDGE)


@inlined
def _ray(row: int, column: int, size: int) -> tuple[float, float, float]:
    """Unit vector of a texel; outside the disc, that of the horizon."""
    p = (row - (size - 1) / 2) / (size / 2 * _EDGE)
    q = (column - (size - 1) / 2) / (size / 2 * _EDGE)
    radius = p * p + q * q
    if radius > 1.0:
        length = np.sqrt(radius)
        return p / length, q / length, 0.0
    scale = 1.0 / (1.0 + radius)
    return 2.0 * p * scale, 2.0 * q * scale, (1.0 - radius) * scale


@inlined
def _grid(ray: tuple[float, float, float], sun: Array) -> tuple[float, float]:
    """Row and column of a direction in the tables of the clear sky."""
    row = np.sqrt(np.arcsin(min(ray[2], 1.0)) * (2.0 / np.pi)) * (ELEVATIONS - 1)
    along = ray[0] * sun[0] + ray[1] * sun[1]
    across = ray[0] * sun[1] - ray[1] * sun[0]
    return row, np.arctan2(abs(across), along) / np.pi * (AZIMUTHS - 1)


@kernel
def _add_air(clear: Clear, sun: Array, ray: tuple[float, float, float], part: int, gain: float, out: Array) -> None:
    """Add ``gain`` times the light (3,) that the air below or above clouds scatters along a ray."""
    row, column = _grid(ray, sun)
    i, j = min(int(row), ELEVATIONS - 2), min(int(column), AZIMUTHS - 2)
    u, v = row - i, column - j
    cosine = min(max(ray[0] * sun[0] + ray[1] * sun[1] + ray[2] * sun[2], -1.0), 1.0)
    table = clear.scattered
    for what in range(3):
        phase = gain
        if what == MOLECULES:
            phase *= molecule_phase(cosine)
        elif what == AEROSOL:
            phase *= aerosol_phase(cosine)
        for channel in range(3):
            near = table[i, j, part, what, channel] * (1.0 - v) + table[i, j + 1, part, what, channel] * v
            far = table[i + 1, j, part, what, channel] * (1.0 - v) + table[i + 1, j + 1, part, what, channel] * v
            out[channel] += phase * (near + (far - near) * u)


@kernel(allocates=True)
def _clear_rows(clear: Clear, sun: Array, haze: float, start: int, rgb: Float32Array) -> None:
    """Fill rows from ``start`` on with the clear sky."""
    out = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            ray = _ray(start + i, j, rgb.shape[1])
            out[:] = 0.0
            _add_air(clear, sun, ray, BELOW, haze, out)
            _add_air(clear, sun, ray, ABOVE, 1.0, out)
            rgb[i, j] = out


@kernel
def _through(clear: Clear, z: float, channel: int) -> float:
    """Share of the light of clouds that the air lets through."""
    row = np.sqrt(np.arcsin(min(z, 1.0)) * (2.0 / np.pi)) * (ELEVATIONS - 1)
    i = min(int(row), ELEVATIONS - 2)
    return clear.through[i, channel] * (1.0 - row + i) + clear.through[i + 1, channel] * (row - i)  # type: ignore[no-any-return]


@kernel(allocates=True)
def _cover(
    clear: Clear,
    sun: Array,
    haze: float,
    ray: tuple[float, float, float],
    cloud: Array,
    left: float,
    pixel: Float32Array,
) -> None:
    """Replace a pixel (3,) by clouds with light ``cloud``, of which ``left`` of the light from beyond passes."""
    air = np.zeros(3)
    _add_air(clear, sun, ray, BELOW, haze, air)
    for channel in range(3):
        beyond = pixel[channel] - air[channel]
        pixel[channel] = air[channel] + _through(clear, ray[2], channel) * cloud[channel] + left * beyond


@kernel(allocates=True)
def _march_rows(
    clouds: Clouds, shade: Shade, light: CloudLight, start: int, chosen: NDArray[np.bool_], seen: Float32Array
) -> None:
    """Fill the chosen texels of rows of ``seen`` (.., size, 4): light of clouds, and the share that they stop."""
    cloud = np.zeros(3)
    for i in range(seen.shape[0]):
        for j in range(seen.shape[1]):
            ray = _ray(start + i, j, seen.shape[1])
            if ray[2] < _LOWEST or not chosen[i, j]:
                continue
            cloud[:] = 0.0
            seen[i, j, 3] = 1.0 - march(clouds, shade, light, ray, cloud)
            seen[i, j, :3] = cloud


def _clouds_seen(sky: Sky, clouds: Clouds, pool: ThreadPoolExecutor, size: int) -> Float32Array:
    """Light of clouds and what they stop (size, size, 4): marched for a quarter of the texels, and for all at edges."""
    shade = shade_of(clouds, sky.light.sun, pool)

    def fill(seen: Float32Array, chosen: NDArray[np.bool_]) -> None:
        def rows(start: int) -> None:
            part = slice(start, start + _ROWS)
            _march_rows(clouds, shade, sky.light, start, chosen[part], seen[part])

        list(pool.map(rows, range(0, len(seen), _ROWS)))

    half = np.zeros((size // 2, size // 2, 4), np.float32)
    fill(half, np.ones(half.shape[:2], np.bool_))
    stopped = half[..., 3]
    edges = maximum_filter(stopped, 3) - minimum_filter(stopped, 3) > _SHARP
    seen = _enlarged(half, size)
    fill(seen, edges.repeat(2, axis=0).repeat(2, axis=1))
    return seen


@kernel(allocates=True)
def _cloud_rows(clear: Clear, sun: Array, haze: float, start: int, seen: Float32Array, rgb: Float32Array) -> None:
    """Draw clouds with volume over rows of the dome."""
    cloud = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            if seen[i, j, 3] > 0.0:
                ray = _ray(start + i, j, rgb.shape[1])
                fade = min(max(ray[2] - _LOWEST, 0.0) / 0.03, 1.0)
                for channel in range(3):
                    cloud[channel] = fade * seen[i, j, channel]
                _cover(clear, sun, haze, ray, cloud, 1.0 - fade * seen[i, j, 3], rgb[i, j])


@kernel(allocates=True)
def _layer_rows(
    clear: Clear, layer: Layer, light: CloudLight, haze: float, level: Array, start: int, rgb: Float32Array
) -> None:
    """Draw a layer of clouds over rows of the dome."""
    cloud = np.zeros(3)
    for i in range(rgb.shape[0]):
        for j in range(rgb.shape[1]):
            ray = _ray(start + i, j, rgb.shape[1])
            cloud[:] = 0.0
            left = layer_light(layer, light, level, ray, cloud)
            _cover(clear, light.sun, haze, ray, cloud, left, rgb[i, j])


@kernel
def sky_radiance(g: Float32Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Radiance of a dome's image ``g`` in a unit direction; below the horizon, the horizon's."""
    half, one = np.float32(0.5 * g.shape[0]), np.float32(1.0)
    flat = max(np.float32(z), np.float32(0.0))
    scale = half * np.float32(0.998) / (flat + np.sqrt(x * x + y * y + flat * flat))
    u, v = half - np.float32(0.5) + x * scale, half - np.float32(0.5) + y * scale
    i, j = int(u), int(v)
    fu, fv = u - np.float32(i), v - np.float32(j)
    a, b, c, d = (one - fu) * (one - fv), (one - fu) * fv, fu * (one - fv), fu * fv
    return (
        g[i, j, 0] * a + g[i, j + 1, 0] * b + g[i + 1, j, 0] * c + g[i + 1, j + 1, 0] * d,
        g[i, j, 1] * a + g[i, j + 1, 1] * b + g[i + 1, j, 1] * c + g[i + 1, j + 1, 1] * d,
        g[i, j, 2] * a + g[i, j + 1, 2] * b + g[i + 1, j, 2] * c + g[i + 1, j + 1, 2] * d,
    )
