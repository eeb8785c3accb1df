# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Daylight has the illuminance, the contrast and the colours that are published, for any sun and any clouds."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import label

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.experiment.light_config import PRESETS, Light, LightConfig, Preset
from fieldtruth.kernels.clouds import MAP_TEXEL
from fieldtruth.kernels.light import DISC, LIMB, RADIUS, Dome
from fieldtruth.kernels.tone_curve import FILMIC, FILMIC_TOP
from fieldtruth.render.daylight import (
    FULLEST,
    LUMINANCE,
    LUX_PER_UNIT,
    RGB_FROM_SPECTRUM,
    SEEN,
    SOLAR,
    Daylight,
    cumulus_map,
    daylight,
    directions_of,
    metered_daylight,
    passed_by,
)

SMALL = 256
LIKE_OTHERS = dict.fromkeys(("noon", "low_sun"), pytest.mark.slow)  # the clouds are those of summer_day and dusk
CLEAR = Light(180.0, 40.0, "none", 0.0, 2.5, 0.0)


@cache
def day(light: Light, workers: int = 2, seed: int = 0) -> Daylight:
    with ThreadPoolExecutor(workers) as pool:
        return daylight(light, (100.0, 100.0), np.random.default_rng(seed), pool, SMALL)


def sky_irradiance(dome: Dome, normals: Array) -> Array:
    """Irradiance (n, 3) by the sky, divided by pi, of surfaces with unit ``normals`` (n, 3); the ground is black."""
    step = len(dome.rgb) // 64
    small = dome.rgb.reshape(64, step, 64, step, 3).mean(axis=(1, 3))
    directions, weight = directions_of(64)
    seen = weight.ravel() > 0
    facing = np.maximum(np.asarray(normals) @ directions.reshape(-1, 3)[seen].T, 0.0)
    return np.asarray(facing * weight.ravel()[seen] @ small.reshape(-1, 3)[seen] / np.pi)


def lux(rgb: Array | Float32Array) -> float:
    return float(rgb @ LUMINANCE) * LUX_PER_UNIT


def test_sunlight_outside_the_air() -> None:
    """133.1 klx (Darula, Kittler and Gueymard 2005)."""
    assert lux(SOLAR @ RGB_FROM_SPECTRUM) == pytest.approx(133_100, rel=0.01)


@pytest.mark.parametrize(
    ("elevation", "expected", "factor"),
    [(60.0, 103_000, 1.1), (30.0, 52_000, 1.15), (10.0, 11_500, 1.25), (-0.83, 450, 1.5), (-6.0, 3.4, 1.7)],
)
def test_illuminance_of_level_ground_by_the_suns_elevation(elevation: float, expected: float, factor: float) -> None:
    """Clear sky: Brown (1952) and Seidelmann (1992, Explanatory Supplement, table 9.21), read to two digits."""
    found = lux(day(CLEAR._replace(elevation_deg=elevation)).level)
    assert expected / factor < found < expected * factor


def test_clear_sky_has_a_quarter_of_the_suns_light_and_a_bright_pale_horizon() -> None:
    found = day(CLEAR._replace(turbidity=2.0))
    ratio = lux(found.sun_rgb) * found.sun[2] / lux(np.pi * found.dome.mean)
    assert 3.2 < ratio < 5.0
    zenith = found.dome.rgb[SMALL // 2, SMALL // 2]
    assert 1.5 < lux(found.dome.horizon) / lux(zenith) < 5.0
    assert zenith[2] / zenith[0] > 1.8 > 1.1 * found.dome.horizon[2] / found.dome.horizon[0]


def test_the_lower_the_sun_the_redder_it_is() -> None:
    suns = [day(CLEAR._replace(elevation_deg=each)).sun_rgb for each in (60.0, 10.0, 2.0)]
    blues = [float(each[2] / each[0]) for each in suns]
    assert 1.0 > blues[0] > 2.0 * blues[1] > 4.0 * blues[2] >= 0.0
    assert day(CLEAR._replace(elevation_deg=-1.0)).sun_rgb.max() == 0.0


def test_disc_has_the_irradiance_of_the_sun() -> None:
    edges = np.linspace(0.0, RADIUS, 2001)
    r = (edges[1:] + edges[:-1]) / 2
    limb = 1.0 - LIMB * (1.0 - np.sqrt(1.0 - (r / RADIUS) ** 2))
    assert float((DISC * limb * 2.0 * np.pi * r).sum() * (edges[1] - edges[0])) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("name", [pytest.param(name, marks=LIKE_OTHERS.get(name, ())) for name in PRESETS])
def test_every_preset_is_finite_and_its_level_is_that_of_dome_and_sun(name: Preset) -> None:
    found = day(PRESETS[name])
    assert np.isfinite(found.dome.rgb).all()
    assert found.dome.rgb.min() >= 0.0
    directions, weight = directions_of(SMALL)
    sky = np.einsum("ijc,ij->c", found.dome.rgb, weight * directions[..., 2])
    level = sky + found.sun_rgb * max(found.sun[2], 0.0)
    np.testing.assert_allclose(found.level, level, rtol=1e-4)
    np.testing.assert_allclose(sky_irradiance(found.dome, np.array([[0.0, 0.0, 1.0]]))[0], found.dome.mean, rtol=0.01)


def test_irradiance_by_direction_is_greatest_towards_the_sun() -> None:
    found = day(PRESETS["clear_morning"])
    x, y = found.sun[:2] / np.linalg.norm(found.sun[:2])
    towards, away = sky_irradiance(found.dome, np.array([[x, y, 0.0], [-x, -y, 0.0]]))
    assert lux(towards) > 1.5 * lux(away)


@pytest.mark.parametrize("elevation", [-6.0, 90.0])
def test_extreme_suns_are_finite(elevation: float) -> None:
    found = day(Light(0.0, elevation, "cirrus", 0.5, 10.0, 0.0))
    assert all(np.isfinite(each).all() for each in (found.dome.rgb, found.sun_rgb, found.level, found.cloud_sun.values))


def test_overcast_has_no_sun_and_is_three_times_as_bright_overhead() -> None:
    """Moon and Spencer (1942); the layer lets through what two streams say."""
    light = CLEAR._replace(clouds="overcast", cover=1.0)
    found, clear = day(light), day(light._replace(clouds="none"))
    z = directions_of(SMALL)[0][..., 2]
    high, low = (np.mean(found.dome.rgb[(z > a) & (z < b)] @ LUMINANCE) for a, b in ((0.85, 1.0), (0.25, 0.35)))
    assert found.sun_rgb.max() == 0.0
    assert high / low == pytest.approx((1 + 2 * 0.925) / (1 + 2 * 0.3), rel=0.15)
    assert lux(found.level) / lux(clear.level) == pytest.approx(passed_by(24.0), rel=0.15)


@pytest.mark.parametrize("cover", [0.2, 0.6])
def test_more_cover_is_more_cloud_and_clouds_are_white(cover: float) -> None:
    light = CLEAR._replace(clouds="cumulus", cover=cover, turbidity=2.0)
    found, clear = day(light), day(light._replace(clouds="none"))
    z = directions_of(SMALL)[0][..., 2]
    changed = np.abs(found.dome.rgb / clear.dome.rgb - 1.0).max(axis=-1) > 0.3
    assert changed[z > 0.8].mean() == pytest.approx(cover, abs=0.2)
    cloud = found.dome.rgb[(z > 0.8) & changed]
    blue = clear.dome.rgb[(z > 0.8) & changed]
    assert np.median(cloud[:, 2] / cloud[:, 0]) < 1.25 < 1.8 < np.median(blue[:, 2] / blue[:, 0])


@pytest.mark.parametrize(
    ("cover", "reached"), [(0.1, 0.1), (0.5, 0.5), pytest.param(1.0, FULLEST, marks=pytest.mark.slow)]
)
def test_cumulus_have_the_cover(cover: float, reached: float) -> None:
    amount = cumulus_map(np.random.default_rng(2), cover, 900.0)
    assert amount.max() <= 1.0
    assert (amount > SEEN).mean() == pytest.approx(reached, abs=0.05)


def test_many_more_cumulus_are_small_than_large() -> None:
    found, count = label(cumulus_map(np.random.default_rng(2), 0.1, 900.0) > SEEN)
    widths = np.sqrt(np.bincount(found.ravel())[1:]) * MAP_TEXEL
    assert count > 50
    assert (widths < 300.0).sum() > 3 * (widths > 600.0).sum() > 0


def test_fair_weather_clouds_leave_the_sun_and_broken_ones_shade_a_part() -> None:
    assert day(PRESETS["summer_day"]).cloud_sun.values.min() > 0.9
    broken = day(PRESETS["after_rain"]).cloud_sun.values
    assert broken.min() < 0.2
    assert broken.max() > 0.9
    steps = [np.abs(np.diff(broken, axis=axis)).max() for axis in (0, 1)]
    assert max(steps) < 0.5  # soft, 8 m apart


def test_result_depends_on_the_seed_but_not_on_workers() -> None:
    light = PRESETS["after_rain"]
    one, two, other = day(light, 1), day(light, 2), day(light, 2, seed=1)
    np.testing.assert_array_equal(one.dome.rgb, two.dome.rgb)
    np.testing.assert_array_equal(one.cloud_sun.values, two.cloud_sun.values)
    assert np.abs(one.dome.rgb - other.dome.rgb).max() > 0.1


def test_meter_darkens_dusk_by_about_a_stop_and_unit_gives_lux() -> None:
    with ThreadPoolExecutor(2) as pool:
        for name, lowest in (("noon", 0.85), ("dusk", 0.4)):
            light = LightConfig(preset=name).values._replace(clouds="none")  # type: ignore[arg-type]
            metered = metered_daylight(light, (50.0, 50.0), np.random.default_rng(0), pool, SMALL)
            true = daylight(light, (50.0, 50.0), np.random.default_rng(0), pool, SMALL)
            assert lowest < float(metered.level @ LUMINANCE) < 1.0
            np.testing.assert_allclose(metered.level * metered.unit, true.level, rtol=1e-5)


def test_clear_sky_has_no_bands() -> None:
    """Bytes of neighbouring texels, each two pixels wide, differ by at most two levels, away from the sun."""
    with ThreadPoolExecutor(2) as pool:
        found = metered_daylight(CLEAR, (50.0, 50.0), np.random.default_rng(0), pool, 1024)
    steps = (len(FILMIC) - 1) / np.sqrt(FILMIC_TOP)
    photo = FILMIC[(np.sqrt(3.9 * found.dome.rgb) * steps + 0.5).astype(int)].astype(int)
    directions, weight = directions_of(1024)
    inside = (weight > 0) & (directions[..., 2] > 0.1) & (directions @ found.sun < 0.9)
    for axis in (0, 1):
        both = inside & np.roll(inside, -1, axis)
        assert np.abs(np.roll(photo, -1, axis) - photo)[both].max() <= 2
