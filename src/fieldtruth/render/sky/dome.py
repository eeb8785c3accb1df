# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sky as an image of the dome: clear air, clouds, and how much of the sun's disc they let through."""

from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.atmosphere import (
    ABOVE,
    BELOW,
    Clear,
)
from fieldtruth.kernels.clouds import CloudLight, Clouds, Layer
from fieldtruth.kernels.light import Dome
from fieldtruth.kernels.sky import EDGE, add_air, clear_rows, cloud_rows, layer_rows, march_rows
from fieldtruth.render.sky.clouds import shade_of

SIZE: Final = 2048
"""Texels along each side of the dome that photographs show; below 500 the horizon would be outside of it."""
_ROWS: Final = 32  # at once
_SHARP: Final = 0.15
"""Difference between neighbours in what clouds stop, from which on their edge is marched for every texel."""


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
        clear_rows(sky.clear, sky.light.sun, sky.haze, start, rgb[start : start + _ROWS])
        if seen is not None:
            cloud_rows(
                sky.clear, sky.light.sun, sky.haze, start, seen[start : start + _ROWS], rgb[start : start + _ROWS]
            )
        if sky.layer is not None:
            layer_rows(sky.clear, sky.layer, sky.light, sky.haze, sky.level, start, rgb[start : start + _ROWS])

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
        add_air(clear, sun, (x, y, z), BELOW, 1.0, radiance)
        add_air(clear, sun, (x, y, z), ABOVE, 1.0, radiance)
        total += share * z * radiance / np.pi
    return total


def directions_of(size: int) -> tuple[Array, Array]:
    """Unit vectors (size, size, 3) of the texels of a paraboloid map, and the solid angle [sr] of each."""
    nodes = _node(np.arange(float(size)), size)
    p, q = np.meshgrid(nodes, nodes, indexing="ij")
    radius = np.minimum(p * p + q * q, 1.0)
    directions = np.stack([2.0 * p, 2.0 * q, 1.0 - radius], axis=-1) / (1.0 + radius)[..., None]
    weight = np.where(p * p + q * q < 1.0, 4.0 / (1.0 + radius) ** 2, 0.0) * (2.0 / (size * EDGE)) ** 2
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
    return (index - (size - 1) / 2) / (size / 2 * EDGE)


def _clouds_seen(sky: Sky, clouds: Clouds, pool: ThreadPoolExecutor, size: int) -> Float32Array:
    """Light of clouds and what they stop (size, size, 4): marched for a quarter of the texels, and for all at edges."""
    shade = shade_of(clouds, sky.light.sun, pool)

    def fill(seen: Float32Array, chosen: NDArray[np.bool_]) -> None:
        def rows(start: int) -> None:
            part = slice(start, start + _ROWS)
            march_rows(clouds, shade, sky.light, start, chosen[part], seen[part])

        list(pool.map(rows, range(0, len(seen), _ROWS)))

    half = np.zeros((size // 2, size // 2, 4), np.float32)
    fill(half, np.ones(half.shape[:2], np.bool_))
    stopped = half[..., 3]
    edges = maximum_filter(stopped, 3) - minimum_filter(stopped, 3) > _SHARP
    seen = _enlarged(half, size)
    fill(seen, edges.repeat(2, axis=0).repeat(2, axis=1))
    return seen
