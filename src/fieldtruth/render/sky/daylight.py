# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Daylight: the sun, the dome of the sky, and the clouds between them, from the words of an experiment's ``light``."""

from concurrent.futures import ThreadPoolExecutor
from typing import Final, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.experiment.light_config import Light
from fieldtruth.kernels.clouds import MAP, MAP_TEXEL, CloudLight, Clouds, Layer, depth_at, shadows
from fieldtruth.kernels.light import DISC, Dome
from fieldtruth.kernels.packets import Grid
from fieldtruth.render.sky.atmosphere import clear_sky
from fieldtruth.render.sky.clouds import SEEN, billows, cirrus, cumulus_map, passed_by, thick_layer
from fieldtruth.render.sky.dome import Sky, clear_mean, make_dome
from fieldtruth.render.sky.spectrum import LUMINANCE

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
    light: Light,
    size: tuple[float, float],
    rng: np.random.Generator,
    pool: ThreadPoolExecutor,
    texels: int,
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
    light: Light,
    size: tuple[float, float],
    rng: np.random.Generator,
    pool: ThreadPoolExecutor,
    texels: int,
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
