# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The weather in a laser beam against closed forms, an independent integral, and drops laid out one by one."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numba import njit
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.lidar_noise import Air, strongest_echo, transmitted
from fieldtruth.kernels.light import fog_length
from fieldtruth.sense.air import Beam, Drops, clear_extinction, extinction, fog_extinction, make_air, rain, snow

BEAM = Beam(wavelength_nm=850, width_m=0.01, divergence_rad=0.0023, pulse_ns=5, min_range=0.8, max_range=120)


def _loop(air: Air, power: float, range_m: float, draws: Array, beam: tuple[float, float]) -> Array:
    found = np.empty((len(draws), 3))
    for k in range(len(draws)):
        left = transmitted(air, range_m, beam[0], beam[1])
        echo, at, particle = strongest_echo(air, power * left, range_m, beam, draws[k, 0], draws[k, 1])
        found[k, 0], found[k, 1], found[k, 2] = echo, at, particle
    return found


_compile: Any = njit
_echoes = _compile(_loop)
LEVEL = (0.0, 0.0)


def _many(weather: dict[str, Any], power: float, range_m: float, count: int = 40_000) -> Array:
    draws = 1 - np.random.default_rng(3).random((count, 2))
    found: Array = _echoes(make_air(WeatherConfig(**weather), BEAM), power, range_m, draws, LEVEL)
    return found


def test_clear_air_changes_nothing() -> None:
    for weather in (None, WeatherConfig()):
        air = make_air(weather, BEAM)
        assert air.extinction == 0
        assert not air.has_echoes
        found = _echoes(air, 0.01, 5.0, np.full((10, 2), 1e-9), LEVEL)
        assert (found == (0.01, 5.0, 0.0)).all()


def test_visibility_is_where_contrast_is_five_percent() -> None:
    assert np.exp(-fog_extinction(80.0) * 80.0) == pytest.approx(0.05)
    assert fog_extinction(300.0, 850) == fog_extinction(300.0)  # droplets are larger than either wavelength
    assert fog_extinction(3000.0, 850) / fog_extinction(3000.0) == pytest.approx((850 / 550) ** -0.82)


@pytest.mark.parametrize("weather", [{"fog_visibility_m": 80.0}, {"dust_g_m3": 0.02}, {"snow_mm_h": 1.0}])
def test_power_falls_with_twice_the_range(weather: dict[str, Any]) -> None:
    alpha = extinction(WeatherConfig(**weather), 850)
    found = _many(weather, 1.0, 12.0, 500)
    np.testing.assert_array_equal(found, np.tile([np.exp(-24 * alpha), 12.0, 0.0], (500, 1)))


def test_kinds_add() -> None:
    each = [{"fog_visibility_m": 500.0}, {"rain_mm_h": 8.0}, {"snow_mm_h": 2.0}, {"dust_g_m3": 0.01}]
    every = WeatherConfig.model_validate({key: value for weather in each for key, value in weather.items()})
    assert extinction(every, 905) == pytest.approx(sum(extinction(WeatherConfig(**w), 905) for w in each))
    assert make_air(every, BEAM).soft_power[-1] > make_air(WeatherConfig(**each[0]), BEAM).soft_power[-1]


@pytest.mark.parametrize("rate", [2.0, 10.0, 40.0])
def test_rain_agrees_with_measured_attenuation(rate: float) -> None:
    measured = 1.076 * rate**0.67  # [dB/km] (Carbonneau and Wisely 1998; ITU-R P.1814)
    assert 10 / np.log(10) * 1000 * rain(rate, 850).extinction == pytest.approx(measured, rel=0.4)


def test_snow_agrees_with_measured_attenuation() -> None:
    rates = np.array([1.0, 2.0, 5.0])
    wet, dry = 3.872 * rates**0.72, 5.542 * rates**1.38  # [dB/km] at 850 nm (ITU-R P.1814)
    ours = [10 / np.log(10) * 1000 * snow(rate).extinction for rate in rates]
    assert (wet < ours).all()
    assert (ours < dry).all()


def test_flakes_keep_their_mass() -> None:
    scale, power = snow(1.0).size
    diameter = scale / np.sqrt(0.5) * 0.7**power  # [mm] of one of 0.7 mm melted
    assert 0.178 * diameter**-0.922 * diameter**3 == pytest.approx(0.7**3)


def test_rainfall_of_the_distribution_is_the_rate() -> None:
    drops = rain(5.0, 850)

    def flux(d: float) -> float:  # [mm/h] (fall speed of Atlas, Srivastava and Sekhon 1973)
        return float(np.pi / 6 * d**3 * (9.65 - 10.3 * np.exp(-0.6 * d)) * drops.per_m3_mm * np.exp(-drops.per_mm * d))

    assert quad(flux, 0.1, 10)[0] * 1e-9 * 3600 * 1000 == pytest.approx(5.0, rel=0.2)  # as is known of their fit


def _fog_echo(visibility: float, at: float) -> float:
    """Power of fog at a range: the integral of Rasshofer et al. over what the pulse covers."""
    alpha, half = np.log(20) / visibility, 0.299792458 * 5 / 2

    def part(x: float) -> float:
        overlap = min(0.0023 * x / 0.01, 1.0) ** 2
        return float(np.cos(np.pi * (at - x) / 2 / half) ** 2 * overlap * np.exp(-2 * alpha * x) / x**2)

    points = sorted({max(0.8, at - half), min(max(0.01 / 0.0023, max(0.8, at - half)), at + half), at + half})
    return np.pi * 0.046 / visibility * sum(quad(part, a, b)[0] for a, b in pairwise(points))


@pytest.mark.parametrize("visibility", [30.0, 200.0])
def test_fog_returns_at_the_peak_of_the_convolution(visibility: float) -> None:
    best = minimize_scalar(lambda at: -_fog_echo(visibility, at), bounds=(0.85, 3.0), method="bounded")
    found = _many({"fog_visibility_m": visibility}, 0.0, 120.0, 500)
    assert (found[:, 2] == 1).all()
    assert (np.abs(found[:, 1] - best.x) <= 0.75).all()  # of the pulse, without noise
    np.testing.assert_allclose(found[:, 0], -best.fun, rtol=0.01)


def test_noise_of_photons_spreads_the_ranges_of_fog() -> None:
    """Counts of photons in cells of a pulse's length, drawn: most are counted where the table says."""
    gain, cell = 2_000_000.0, 0.299792458 * 5 / 2
    air = make_air(WeatherConfig(fog_visibility_m=300.0), BEAM._replace(gain=gain))
    found = _echoes(air, 0.0, 120.0, 1 - np.random.default_rng(3).random((20_000, 2)), LEVEL)[:, 1]
    edges = 0.8 + cell * np.arange(air.soft_share.shape[1] + 1)
    middles = np.linspace(edges[:-1], edges[1:], 11).T
    photons = [gain * max(_fog_echo(300.0, at) for at in inside) for inside in middles]
    counted = np.random.default_rng(4).poisson(photons, (20_000, len(photons)))
    expected = np.bincount(counted.argmax(axis=1), minlength=len(photons)) / 20_000
    shares = np.histogram(found, edges)[0] / 20_000
    assert 0.1 < shares.max() < 0.9
    np.testing.assert_allclose(shares, expected, atol=0.03)


def test_a_surface_returns_until_fog_is_stronger() -> None:
    fog = _many({"fog_visibility_m": 40.0}, 0.0, 120.0, 1)[0, 0]
    equal = brentq(lambda r: 0.3 * np.exp(-2 * np.log(20) / 40 * r) / r**2 - fog, 2.0, 40.0)
    for range_m, particle in ((equal - 0.05, 0), (equal + 0.05, 1)):
        assert _many({"fog_visibility_m": 40.0}, 0.3 / range_m**2, range_m, 1)[0, 2] == particle
    assert _many({"fog_visibility_m": 40.0}, 1e-9, 0.9, 1)[0, 1] <= 0.9  # never behind the surface


def _laid_out(drops: Drops, alpha: float, range_m: float, count: int) -> Array:
    """Power and range of the brightest particle in each of many beams, all particles laid out; 0 in an empty one."""
    rng = np.random.default_rng(8)
    wide = BEAM.width_m + BEAM.divergence_rad * range_m
    brightest = np.zeros((count, 2))
    per_beam = rng.poisson(drops.per_m3 * wide**2 * range_m, count)  # in a box around the beam
    for k, n in enumerate(per_beam):
        at, side = range_m * rng.random(n), wide * (rng.random((2, n)) - 0.5)
        width = BEAM.width_m + BEAM.divergence_rad * at
        melted = rng.exponential(1 / drops.per_mm, n)
        share = (drops.size[0] * melted ** drops.size[1] / 1000 / width) ** 2
        seen = (np.hypot(*side) < width / 2) & (at > BEAM.min_range) & (share < 1)
        overlap = np.minimum(0.0023 * at / 0.01, 1) ** 2
        power = np.where(seen, drops.reflectance * share * overlap * np.exp(-2 * alpha * at) / at**2, 0.0)
        if seen.any():
            brightest[k] = power.max(), at[power.argmax()]
    return brightest


@pytest.mark.parametrize("weather", [{"rain_mm_h": 20.0}, {"snow_mm_h": 1.0}])
def test_single_particles_as_if_laid_out_one_by_one(weather: dict[str, float]) -> None:
    drops = rain(20.0, 850) if "rain_mm_h" in weather else snow(1.0)
    truth = _laid_out(drops, extinction(WeatherConfig(**weather), 850), 15.0, 3000)
    found = _many(weather, 0.0, 15.0)
    for least in (1e-6, 3e-6, 1e-5):
        share, expected = np.mean(found[:, 0] > least), np.mean(truth[:, 0] > least)
        assert abs(share - expected) < 4 * np.sqrt(expected / 3000)
        assert expected > 0.01
    strong, expected_at = found[found[:, 0] > 3e-6, 1], truth[truth[:, 0] > 3e-6, 1]
    error = 4 * expected_at.std() / np.sqrt(len(expected_at))
    assert abs(strong.mean() - expected_at.mean()) < error
    assert abs(np.median(strong) - np.median(expected_at)) < error


def test_number_of_stronger_particles_is_poisson() -> None:
    """No echo above a power happens with exp(-mean), mean the integral over beam and diameters."""
    drops, range_m, least = rain(30.0, 850), 40.0, 5e-5
    alpha = drops.extinction

    def per_metre(at: float) -> float:
        width, overlap = BEAM.width_m + BEAM.divergence_rad * at, min(0.0023 * at / 0.01, 1.0) ** 2
        covered = np.sqrt(least * at**2 * np.exp(2 * alpha * at) / drops.reflectance / overlap)
        number = np.exp(-drops.per_mm * 1000 * width * covered) - np.exp(-drops.per_mm * 1000 * width)
        return float(max(number, 0) * drops.per_m3 * np.pi / 4 * width**2)

    mean = quad(per_metre, 0.80001, range_m, points=[2, 4.3478], limit=200)[0]
    share = np.mean(_many({"rain_mm_h": 30.0}, least * np.exp(2 * alpha * range_m), range_m)[:, 2])
    assert share == pytest.approx(1 - np.exp(-mean), abs=4 * np.sqrt(share / 40_000))


@pytest.mark.parametrize(("key", "values"), [("rain_mm_h", (2.0, 10.0, 50.0)), ("snow_mm_h", (0.2, 1.0, 5.0))])
def test_more_rain_and_snow_more_particles(key: str, values: tuple[float, ...]) -> None:
    shares = [np.mean(_many({key: value}, 1e-4, 40.0)[:, 2]) for value in values]
    assert shares[0] * 1.5 < shares[1] < shares[2] / 1.5


def test_particles_lie_between_the_sensor_and_the_surface() -> None:
    found = _many({"rain_mm_h": 50.0, "snow_mm_h": 5.0}, 1e-6, 3.0)
    assert found[:, 2].mean() > 0.1
    assert found[:, 1].min() >= BEAM.min_range
    assert found[:, 1].max() <= 3.0


@pytest.mark.parametrize(
    ("above", "rise", "length"),
    [(0.0, 4.0, 60.0), (30.0, -29.0, 200.0), (5.0, 1e-3, 50.0), (9.0, 0.0, 10.0), (2.0, 0.3, 9.0)],
)
@pytest.mark.parametrize("scale", [3.0, 25.0, 500.0])
def test_length_in_fog_that_thins_is_the_integral_of_its_density(
    above: float, rise: float, length: float, scale: float
) -> None:
    expected = quad(lambda s: np.exp(-(above + rise * s / length) / scale), 0.0, length)[0]
    assert fog_length(above, rise, length, scale) == pytest.approx(expected, rel=2e-6)
    assert fog_length(above, rise, length, 0.0) == length


def test_fog_that_thins_returns_less_to_a_beam_that_climbs() -> None:
    """Its echo is that of the convolution with the density along the beam."""
    weather = {"fog_visibility_m": 100.0, "fog_height_m": 4.0}
    air, slope, start = make_air(WeatherConfig(**weather), BEAM), 0.5, 2.0
    found = _echoes(air, 0.0, 120.0, np.full((1, 2), 0.5), (start, slope))[0]
    alpha, half = np.log(20) / 100.0, 0.299792458 * 5 / 2

    def density(x: float) -> float:
        return float(np.exp(-(start + slope * x) / 4.0))

    def echo(at: float) -> float:
        def part(x: float) -> float:
            seen = min(0.0023 * x / 0.01, 1.0) ** 2 * density(x) / x**2
            return float(np.cos(np.pi * (at - x) / 2 / half) ** 2 * seen * np.exp(-2 * alpha * quad(density, 0, x)[0]))

        return np.pi * 0.046 / 100.0 * quad(part, max(0.8, at - half), at + half, limit=60)[0]

    assert found[2] == 1.0
    assert found[0] == pytest.approx(echo(found[1]), rel=0.12)  # the density at the range stands for all of the pulse


def test_clear_air_has_its_visibility_and_scatters_blue_most() -> None:
    red, green, blue = (clear_extinction(20_000.0, each) for each in (610.0, 550.0, 465.0))
    assert np.exp(-green * 20_000.0) == pytest.approx(0.05)
    assert red < green < blue
    pure = clear_extinction(300_000.0, 465.0) / clear_extinction(300_000.0, 550.0)
    assert pure == pytest.approx((550 / 465) ** 4.09, rel=0.03)  # next to no aerosol is left
