# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Daylight: the sun, the dome of the sky, and the clouds between them, from the words of an experiment's ``light``.

The sky is an image of the dome: clear air, clouds, and how much of the sun's disc they let through.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter, zoom

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.experiment.light_config import Light
from fieldtruth.kernels.atmosphere import ABOVE, BELOW, Clear
from fieldtruth.kernels.clouds import MAP, MAP_TEXEL, CloudLight, Clouds, Layer, depth_at, shadows
from fieldtruth.kernels.light import DISC, Dome
from fieldtruth.kernels.packets import Grid
from fieldtruth.kernels.sky import EDGE, add_air, clear_rows, cloud_rows, layer_rows, march_rows
from fieldtruth.render.atmosphere import LUMINANCE, clear_sky
from fieldtruth.render.clouds import SEEN, billows, cirrus, cumulus_map, passed_by, shade_of, thick_layer

DOME_TEXELS: Final = 2048
"""Texels along each side of the dome that photographs show; below 500 the horizon would be outside of it."""
SUN_RADIUS_DEG: Final = 0.266
_BASE: Final = {"cumulus": 1300.0, "broken": 1000.0, "cirrus": 9000.0, "stratus": 450.0, "overcast": 1200.0}
"""Height of the base of clouds above the ground [m]."""
LEVEL: Final = 0.93
"""Irradiance of open level ground for which a camera's exposure is 1."""
METER: Final = 0.12
WHITE: Final = 0.5
_SHIFTS: Final = 256
_OVERHEAD: Final = 3000.0
"""[m] along each side of the part of the sky whose cover is most like that of the whole."""
SHADOW_TEXEL: Final = 8.0  # [m] of the clouds' shadow on the ground
_ROWS: Final = 32  # at once
_SHARP: Final = 0.15
"""Difference between neighbours in what clouds stop, from which on their edge is marched for every texel."""


class Daylight(NamedTuple):
    """Light of the sky above a world."""

    sun: Array  # (3,) unit vector towards the sun
    sun_rgb: Float32Array  # (3,) irradiance of a surface that faces it, where no cloud with volume shades it
    disc: Float32Array  # (3,) radiance in the middle of its disc, seen from the middle of the world
    dome: Dome
    level: Float32Array  # (3,) irradiance of open level ground by all light
    cloud_sun: Grid  # share of sunlight that clouds with volume let through, at the ground
    unit: Float32Array  # (3,) irradiance [100 klx] of each channel that stands for 1


def sun_direction(azimuth_deg: float, elevation_deg: float) -> Array:
    """Unit vector (3,) towards the sun in the world frame (x north, y west, z up); azimuth clockwise from north."""
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    return np.array([np.cos(azimuth) * np.cos(elevation), -np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])


def daylight(
    light: Light, size: tuple[float, float], rng: np.random.Generator, pool: ThreadPoolExecutor, texels: int
) -> Daylight:
    """Compute the light of the sky over a world.

    Args:
        light: sun, clouds and haze.
        size: sides of the world [m] along x and y.
        rng: shapes the clouds.
        pool: threads; the result does not depend on them.
        texels: of the dome along each side.
    """
    sun = sun_direction(light.azimuth_deg, light.elevation_deg)
    clear = clear_sky(np.radians(light.elevation_deg), light.turbidity, _BASE.get(light.clouds, 1200.0) / 1000.0)
    mean = clear_mean(clear, sun)
    level = np.pi * mean + clear.sun * max(sun[2], 0.0)
    shone = CloudLight(sun, clear.sun_above, mean, level)
    clouds = _volume(light, sun, size, rng)
    layer = _layer(light, rng)
    cloud_sun = _cloud_sun(clouds, sun, size)
    sun_rgb, haze, under = clear.sun, 1.0 - 0.5 * light.cover, level
    if layer is not None and layer.thick:
        under = level * passed_by(layer.mean)
        sun_rgb, haze = np.zeros(3), passed_by(layer.mean)
    elif layer is not None:
        sun_rgb, haze = clear.sun * _through_at_sun(layer, sun), 1.0
    elif clouds is None:
        haze = 1.0
    dome = make_dome(Sky(clear, shone, clouds, layer, under, haze), pool, texels)
    total = np.pi * dome.mean + sun_rgb * max(sun[2], 0.0)
    at_middle = float(cloud_sun.values[cloud_sun.values.shape[0] // 2, cloud_sun.values.shape[1] // 2])
    disc, one = DISC * at_middle * sun_rgb, np.ones(3, np.float32)
    rgb32, disc32, level32 = (np.asarray(each, np.float32) for each in (sun_rgb, disc, total))
    return Daylight(sun, rgb32, disc32, dome, level32, cloud_sun, one)


def metered_daylight(
    light: Light, size: tuple[float, float], rng: np.random.Generator, pool: ThreadPoolExecutor, texels: int
) -> Daylight:
    """Return ``daylight`` divided by ``unit``, which a camera's meter and white balance select for open level ground.

    The meter leaves METER of the range of daylight in the photographs, so that dusk is darker than noon; the white
    balance removes WHITE of the light's colour (von Kries).
    """
    day = daylight(light, size, rng, pool, texels)
    bright = float(day.level @ LUMINANCE)
    target = LEVEL * (bright / LEVEL) ** METER
    unit = (bright / target * (day.level / bright) ** WHITE).astype(np.float32)
    rgb, mean, horizon = (value / unit for value in day.dome)
    rgb = rgb.astype(np.float16).astype(np.float32)  # as it is kept on disk
    return day._replace(
        sun_rgb=day.sun_rgb / unit,
        disc=day.disc / unit,
        level=day.level / unit,
        dome=Dome(rgb, mean, horizon),
        unit=unit,
    )


def _volume(light: Light, sun: Array, size: tuple[float, float], rng: np.random.Generator) -> Clouds | None:
    """Clouds with volume. Fair-weather cumulus leave the sun over the world free; broken clouds shade a part of it."""
    if light.clouds not in ("cumulus", "broken") or light.cover == 0.0:
        return None
    fair = light.clouds == "cumulus"
    thickness = 900.0 if fair else 1400.0
    amount = cumulus_map(rng, light.cover, thickness)
    clouds = Clouds(amount, billows(), _BASE[light.clouds], thickness, 0.06, (0.0, 0.0))
    nodes = rng.integers(0, MAP, (_SHIFTS, 2))
    overhead = uniform_filter((amount > SEEN).astype(np.float32), int(_OVERHEAD / MAP_TEXEL), mode="wrap")
    differs = np.abs(overhead[nodes[:, 0], nodes[:, 1]] - light.cover)
    shifts = MAP_TEXEL * nodes[np.argsort(differs, kind="stable")]
    if sun[2] <= 0.0:
        return clouds._replace(shift=(float(shifts[0, 0]), float(shifts[0, 1])))
    points = _points(size, 9)
    best, chosen = -1.0, clouds
    for x, y in shifts:
        trial = clouds._replace(shift=(float(x), float(y)))
        seen = np.empty(len(points), np.float32)
        shadows(trial, sun, points, seen)
        score = float(seen.min()) if fair else float(seen.max() - seen.min())
        if score > best:
            best, chosen = score, trial
        if score > 0.99:
            break
    return chosen


def _layer(light: Light, rng: np.random.Generator) -> Layer | None:
    if light.clouds == "cirrus" and light.cover > 0.0:
        return cirrus(rng, light.cover, _BASE["cirrus"])
    if light.clouds == "stratus":
        return thick_layer(rng, _BASE["stratus"], 16.0, 900.0, 0.8)
    if light.clouds == "overcast":
        return thick_layer(rng, _BASE["overcast"], 24.0, 2200.0, 0.35)
    return None


def _through_at_sun(layer: Layer, sun: Array) -> float:
    """Share of sunlight that a thin layer lets through: half of what it scatters stays near the beam."""
    distance = layer.height / max(sun[2] + 0.02, 0.02)
    return float(np.exp(-0.5 * depth_at(layer, distance * sun[0], distance * sun[1]) / max(sun[2], 0.08)))


def _points(size: tuple[float, float], count: int) -> Array:
    axes = [np.linspace(-side / 2, side / 2, count) for side in size]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _cloud_sun(clouds: Clouds | None, sun: Array, size: tuple[float, float]) -> Grid:
    """Shadow of the clouds on the world, blurred over the width of the sun's disc."""
    nodes = [max(2, int(np.ceil(side / SHADOW_TEXEL)) + 1) for side in size]
    shape = (nodes[0], nodes[1])
    corner = -(shape[0] - 1) * SHADOW_TEXEL / 2, -(shape[1] - 1) * SHADOW_TEXEL / 2
    share = np.ones(shape, np.float32)
    if clouds is not None and sun[2] > 0.0:
        x, y = (np.arange(n) * SHADOW_TEXEL + c for n, c in zip(shape, corner, strict=True))
        points, total = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), np.zeros(shape)
        wide = np.tan(np.radians(SUN_RADIUS_DEG)) * clouds.base / sun[2]
        for angle in np.arange(6) * np.pi / 3:
            seen = np.empty(len(points), np.float32)
            shadows(clouds, sun, points + 0.7 * wide * np.array([np.cos(angle), np.sin(angle)]), seen)
            total += seen.reshape(shape) / 6.0
        share = total.astype(np.float32)
    return Grid(share, float(corner[0]), float(corner[1]), 1.0 / SHADOW_TEXEL)


class Sky(NamedTuple):
    """The air and clouds that make the dome."""

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


def _node(index: Array, size: int) -> Array:
    return (index - (size - 1) / 2) / (size / 2 * EDGE)
