# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Wind: its spectrum, variance, direction and coherence; frequency and variance of what sways in it."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from sense_worlds import F8, at, box, make_world

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment, validated
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.sense import wind
from fieldtruth.sense.leaning import LEAN_KNOT_NS, Leaning
from fieldtruth.sense.wind import Waves, Wind, leaning_of, oscillators, share_below, sway_hertz
from fieldtruth.world.model import Collider, Material, World

BLOWING = WindConfig(speed_m_s=8.0, direction_deg=240.0, gusts=0.2)
HEIGHT, RADIUS = 16.0, 0.1
"""[m] of the tree and of its stem."""


@pytest.fixture(scope="module")
def world() -> World:
    """Two trees, and a tuft of grass 0.4 m high."""
    stem = box("stem", (RADIUS, RADIUS, HEIGHT / 2), "bark")
    vertices = stem.vertices + np.array([0, 0, HEIGHT / 2], np.float32)
    collider = Collider(shape="cylinder", size=(RADIUS, HEIGHT))
    tree = replace(stem, vertices=vertices, species=("oak",), colliders=(collider,))
    tuft = replace(box("tuft", (0.1, 0.1, 0.4), "blade"), species=("reed",), footprint=0.1)
    world = make_world([(tree, at(0, 0, 0)), (tree, at(15, 0, 0)), (tuft, at(3, 0, 0))])
    blade = Material(name="blade", label=Label.HIGH_GRASS, texture="grey")
    return replace(world, materials={**world.materials, "blade": blade})


def leaning(world: World, seed: int = 1, config: WindConfig = BLOWING) -> Leaning:
    found = leaning_of(config, world, seed)
    assert found is not None
    return found


def series(world: World, row: int, count: int, seed: int = 1) -> F8:
    """Leans (count, 2) [rad] of a plant, every knot."""
    return leaning(world, seed).vectors(np.array([row]), np.arange(count) * LEAN_KNOT_NS)[:, 0, :2]


def kaimal(hertz: F8, speed: float, scale: float) -> F8:
    """Spectral density over the variance [1/Hz] of Kaimal et al. (1972): 105 f / (1 + 33 f)^(5/3), and 17 and 9.5."""
    f = hertz * 10.0 / speed
    factor = {33.0: 105.0 / (105.0 * 3.0 / (2.0 * 33.0)), 9.5: 17.0 / (17.0 * 3.0 / (2.0 * 9.5))}[scale]
    return np.asarray(factor * f / (1.0 + scale * f) ** (5.0 / 3.0) / hertz)


@pytest.mark.parametrize("scale", [33.0, 9.5])
def test_shares_of_the_variance_are_the_integral_of_the_published_spectrum(scale: float) -> None:
    hertz = np.geomspace(1e-5, 3.0, 4000)
    density = kaimal(hertz, 8.0, scale)
    integral = np.sum(np.diff(hertz) * (density[1:] + density[:-1]) / 2)
    assert np.diff(share_below(hertz[[0, -1]], 8.0, scale)) == pytest.approx(integral, rel=1e-4)
    assert share_below(np.array([1e9]), 8.0, scale) == pytest.approx(1.0, abs=1e-3)
    ratio = (17.0 / 9.5) / (105.0 / 33.0)
    assert pytest.approx(ratio, rel=0.02) == wind.ACROSS**2


def test_the_wind_has_its_mean_its_direction_and_its_variance() -> None:
    blown = Wind(BLOWING, 3).at(np.array([[1.0, 2.0]]), np.arange(0.0, 20_000.0, 0.4))[:, 0]
    along, across = np.array(BLOWING.heading), np.array([-BLOWING.heading[1], BLOWING.heading[0]])
    assert blown.mean(axis=0) == pytest.approx(8.0 * along, abs=0.1)
    for direction, share, scale in ((along, 1.0, 33.0), (across, 0.75, 9.5)):  # without what is above the band
        in_band = share_below(np.array(wind.BAND_HZ[1]), 8.0, scale)
        assert (blown @ direction).std() == pytest.approx(8.0 * 0.2 * share * np.sqrt(in_band), rel=0.01)
    for degrees, heading in ((0, (-1, 0)), (90, (0, 1)), (180, (1, 0)), (270, (0, -1))):  # x is north, y is west
        assert WindConfig(speed_m_s=1, direction_deg=degrees).heading == pytest.approx(heading, abs=1e-12)
    steady = Wind(WindConfig(speed_m_s=5, direction_deg=0, gusts=0), 3).at(np.zeros((2, 2)), np.arange(3.0))
    np.testing.assert_allclose(steady, np.tile([-5.0, 0.0], (3, 2, 1)), atol=1e-12)


def test_gusts_are_carried_by_the_mean_wind_and_lose_coherence_across_it() -> None:
    """Frozen turbulence along the wind, exactly; Davenport's exponential across it, over many draws."""
    blowing, xy = Wind(BLOWING, 5), np.array([[2.0, -1.0]])
    along, across = np.array(BLOWING.heading), np.array([-BLOWING.heading[1], BLOWING.heading[0]])
    np.testing.assert_allclose(
        blowing.at(xy + 8.0 * 2.5 * along, np.array([2.5])), blowing.at(xy, np.array([0.0])), atol=1e-9
    )
    drawn = [Waves.drawn(BLOWING, False, np.random.default_rng(k)) for k in range(400)]
    for distance in (1.0, 5.0, 20.0):
        cross = np.array([np.cos(each.k @ across * distance) for each in drawn])
        expected = np.exp(-wind.DECAY * np.array([each.omega for each in drawn]) / (2 * np.pi) * distance / 8.0)
        assert np.abs(cross.mean(axis=0) - expected.mean(axis=0)).max() < 0.15
        assert (cross - expected).mean() == pytest.approx(0.0, abs=0.01)


def test_a_tree_sways_at_the_published_frequency_of_its_size(world: World) -> None:
    kinds = oscillators(world, leaning(world).plants, np.random.default_rng(0))
    published = 0.0948 + 3.4317 * 100 * 2 * RADIUS / HEIGHT**2
    assert kinds.hertz[0] == pytest.approx(published)
    assert 0.2 < published < 0.6
    assert sway_hertz(np.array([0.36]), np.array([24.0]))[0] == pytest.approx(0.309, abs=1e-3)
    power, count = np.zeros(2049), 1 << 12
    for seed in range(6):  # the waves of one wind are few near the frequency
        lean = series(world, 0, count, seed) @ [BLOWING.heading[1] * -1.0, BLOWING.heading[0]]
        power = power + np.abs(np.fft.rfft((lean - lean.mean()) * np.hanning(count))) ** 2
    hertz = np.fft.rfftfreq(count, LEAN_KNOT_NS / 1e9)
    bands = np.geomspace(0.05, 2.0, 24)
    energy = [power[(hertz >= a) & (hertz < b)].sum() for a, b in pairwise(bands)]
    peak = int(np.argmax(energy))
    assert bands[peak] / 1.1 < published < bands[peak + 1] * 1.1


def test_the_variance_of_a_lean_is_the_integral_of_spectrum_and_response(world: World) -> None:
    blowing, kinds = leaning(world), oscillators(world, leaning(world).plants, np.random.default_rng(0))
    along, across = np.array(BLOWING.heading), np.array([-BLOWING.heading[1], BLOWING.heading[0]])
    for row in (0, 2):
        mean = np.linalg.norm(blowing.causes[0]._mean[row])  # type: ignore[attr-defined]
        lean = np.stack([series(world, row, 3000, seed) for seed in range(4)])
        towards = np.stack([lean[..., 1], -lean[..., 0]], axis=-1)  # a plant that leans to +x turns about +y
        assert (towards @ along).mean() == pytest.approx(mean, rel=0.03)
        assert (towards @ across).mean() == pytest.approx(0.0, abs=0.05 * float(mean))
        hertz = np.geomspace(1e-4, wind.BAND_HZ[1], 20_000)
        own = kinds.hertz[row], kinds.damping[row]
        answer = np.abs(1.0 / (1.0 - (hertz / own[0]) ** 2 + 2j * own[1] * hertz / own[0])) ** 2
        for scale, direction, gain in ((33.0, along, 1.3 * 0.2), (9.5, across, 0.75 * 0.2)):
            density = kaimal(hertz, 8.0, scale) * answer
            integral = np.sum(np.diff(hertz) * (density[1:] + density[:-1]) / 2)
            assert (towards @ direction).std(axis=1).mean() == pytest.approx(gain * mean * np.sqrt(integral), rel=0.12)


def test_the_mean_lean_grows_with_the_drag_of_plants_that_streamline(world: World) -> None:
    steady = (leaning(world, 1, WindConfig(speed_m_s=speed, gusts=0)) for speed in (4.0, 8.0))
    leans = [np.linalg.norm(each.vectors(each.rows, np.zeros(1, np.int64)), axis=-1)[0] for each in steady]
    np.testing.assert_allclose(leans[1] / leans[0], 2.0**1.3, rtol=1e-6)
    assert 0.01 < leans[1][0] < 0.06 < leans[1][2] < 0.4


def test_the_lean_is_a_pure_function_of_seed_plant_and_time(world: World) -> None:
    one, knots = leaning(world), np.array([0, 7, 12, 4000]) * LEAN_KNOT_NS
    every = one.vectors(one.rows, knots)
    np.testing.assert_array_equal(every, leaning(world).vectors(one.rows, knots))
    for row in one.rows.tolist():
        for k in range(len(knots)):
            np.testing.assert_allclose(one.vectors(np.array([row]), knots[k : k + 1])[0, 0], every[k, row], atol=1e-7)
    assert np.abs(every - leaning(world, 2).vectors(one.rows, knots)).max() > 1e-3
    assert one.with_cause(one.causes[0], one.causes[0]).ripples is one.ripples is not None
    assert leaning_of(None, world, 1) is None
    assert leaning_of(WindConfig(speed_m_s=0), world, 1) is None


EXPERIMENT: dict[str, Any] = {
    "name": "windy",
    "environment": "park",
    "route": {"metres": {"start": (0.0, 0.0), "waypoints": [(8.0, 0.0)]}},
}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"speed_m_s": -1}, r"wind\.speed_m_s must be .*between 0 and 40, got -1"),
        ({"speed_m_s": 41}, r"wind\.speed_m_s must be .*between 0 and 40, got 41"),
        ({"speed_m_s": 5, "direction_deg": float("inf")}, r"wind\.direction_deg must be .*, got inf"),
        ({"speed_m_s": 5, "direction_deg": float("nan")}, r"wind\.direction_deg must be .*, got nan"),
        ({"speed_m_s": 5, "gusts": 0.6}, r"wind\.gusts must be .*, got 0\.6"),
        ({"speed_m_s": 5, "speed": 6}, r"unknown key 'wind\.speed'; did you mean 'wind\.speed_m_s'\?"),
        ({}, r"wind\.speed_m_s is required"),
        ("strong", r"wind must be .*, got 'strong'"),
    ],
)
def test_bad_winds_are_one_line(given: Any, message: str) -> None:
    with pytest.raises(ConfigurationError, match=message) as found:
        validated(EXPERIMENT | {"wind": given}, "")
    assert "\n" not in str(found.value)


def test_an_experiment_without_wind_has_the_same_file_as_before() -> None:
    still, windy = (Experiment.model_validate(EXPERIMENT | more) for more in ({}, {"wind": {"speed_m_s": 5}}))
    assert "\nwind:" not in dump_experiment(still)
    assert parse_experiment(dump_experiment(windy)) == windy
