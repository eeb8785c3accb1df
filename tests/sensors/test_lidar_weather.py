# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Scans in weather: particles in front of surfaces, weaker surfaces, and the truth that stays as it is."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, floating, quad

from fieldtruth.core.classes import Label
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.lidar_noise import Reading
from fieldtruth.kernels.light import fog_length
from fieldtruth.sense.air import extinction
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig, LidarSignal
from fieldtruth.sensors.lidar.sensing import Lidar

signal_of = LidarSignal.model_validate

WALL = 15.0  # [m]
POSE = at(0, 0, 0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A wall in front, nothing else."""
    return floating((quad("wall", [[WALL, -9, -9], [WALL, 9, -9], [WALL, 9, 9], [WALL, -9, 9]]), POSE))


def config(**signal: Any) -> LidarConfig:
    """An OS1-64 of few columns with its data sheet, but for ``signal``."""
    sheet = LidarConfig.model_validate({"model": "os1_64_gen1", "signal": "datasheet"}).signal
    assert sheet is not None
    return LidarConfig(model="os1_64_gen1", columns=256, signal=signal_of(sheet.model_dump() | signal))


def scan(scene: Scene, number: int = 0, weather: dict[str, Any] | None = None, **signal: Any) -> Reading:
    found = Lidar(config(**signal), scene, weather=WeatherConfig(**weather or {})).scan(POSE, 0, number)
    assert isinstance(found, Reading)
    return found


def rays(reading: Reading) -> NDArray[np.int64]:
    return reading.column.astype(np.int64) * 64 + reading.ring


def test_clear_weather_gives_the_same_bytes(scene: Scene) -> None:
    plain = Lidar(config(), scene).scan(POSE, 0, 3)
    for a, b in zip(plain, scan(scene, 3), strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_ideal_lidar_sees_no_weather(scene: Scene) -> None:
    ideal = LidarConfig(columns=256)
    found = Lidar(ideal, scene, weather=WeatherConfig(fog_visibility_m=20)).scan(POSE)
    for a, b in zip(found, Lidar(ideal, scene).scan(POSE), strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("weather", [{"fog_visibility_m": 60.0}, {"snow_mm_h": 2.0}, {"rain_mm_h": 100.0}])
@pytest.mark.parametrize("sub_rays", [1, 7])
def test_truth_of_particles_and_of_surfaces(scene: Scene, weather: dict[str, Any], sub_rays: int) -> None:
    clear, found = scan(scene, sub_rays=sub_rays), scan(scene, weather=weather, sub_rays=sub_rays)
    particle = found.label == Label.PARTICLE
    assert particle.sum() > 20
    assert (found.instance[particle] == 0).all()
    behind = found.true_range[particle]
    assert (found.range_m[particle] < np.where(behind > 0, behind, 120.0) + 0.5).all()  # noise
    left, known = rays(found)[~particle], rays(clear)
    rows = np.searchsorted(known, left)
    same = known[rows.clip(0, len(known) - 1)] == left
    assert same.mean() > 0.99  # weaker surfaces do not return more often, but for their noise
    for name in ("label", "instance", "true_range"):
        values, expected = getattr(found, name)[~particle][same], getattr(clear, name)[rows[same]]
        np.testing.assert_array_equal(values, expected)
    rows = np.searchsorted(known, rays(found)[particle]).clip(0, len(known) - 1)
    there = (behind > 0) & (known[rows] == rays(found)[particle])
    np.testing.assert_array_equal(behind[there], clear.true_range[rows[there]])
    assert there.sum() > 5 or "snow_mm_h" not in weather


def test_surfaces_fade_with_twice_their_range(scene: Scene) -> None:
    weather = {"fog_visibility_m": 100.0}
    clear, found = scan(scene), scan(scene, weather=weather)
    ahead = [(r.label != Label.PARTICLE) & (np.abs(r.range_m - WALL) < 0.5) for r in (clear, found)]
    ratio = found.signal[ahead[1]].mean() / clear.signal[ahead[0]].mean()
    assert ratio == pytest.approx(np.exp(-2 * extinction(WeatherConfig(**weather), 850) * WALL), rel=0.05)


@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("fog_visibility_m", (200.0, 80.0, 30.0)),
        ("snow_mm_h", (0.5, 2.0, 8.0)),
        ("rain_mm_h", (10.0, 50.0, 200.0)),
        ("dust_g_m3", (0.01, 0.03, 0.1)),
    ],
)
def test_worse_weather_more_particles_and_fewer_surfaces(scene: Scene, key: str, values: tuple[float, ...]) -> None:
    particles, surfaces = [], []
    for value in (None, *values):
        lidar = Lidar(config(), scene, weather=WeatherConfig(**{} if value is None else {key: value}))
        label = np.concatenate([lidar.scan(POSE, 0, k).label for k in range(4)])
        particles.append(int((label == Label.PARTICLE).sum()))
        surfaces.append(int((label != Label.PARTICLE).sum()))
    assert particles[0] == 0
    assert particles == sorted(particles)
    assert particles[1] < particles[-1]
    assert surfaces == sorted(surfaces, reverse=True)
    assert surfaces[-1] < surfaces[0] or key == "rain_mm_h"


def test_a_scan_depends_on_its_number_alone(scene: Scene) -> None:
    weather = {"snow_mm_h": 2.0}
    lidar = Lidar(config(), scene, weather=WeatherConfig(**weather))
    later, first = (lidar.scan(POSE, 0, k) for k in (5, 0))
    for k, reading in ((0, first), (5, later)):
        for a, b in zip(reading, scan(scene, k, weather), strict=True):
            np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first.range_m, later.range_m)


def test_two_returns_are_particle_and_surface(scene: Scene) -> None:
    found = scan(scene, weather={"snow_mm_h": 5.0}, returns="two")
    ray, particle = rays(found), found.label == Label.PARTICLE
    both = np.flatnonzero(ray[1:] == ray[:-1])
    mixed = both[particle[both] & ~particle[both + 1]]
    assert len(mixed) > 50
    assert (found.range_m[mixed] < found.range_m[mixed + 1]).all()
    assert (found.echo[mixed] == 0).all()


def test_the_last_return_sees_through_snow(scene: Scene) -> None:
    """Where the wall can be detected, it is the last echo; in the open a flake is."""
    found = scan(scene, weather={"snow_mm_h": 5.0}, returns="last")
    particle = found.label == Label.PARTICLE
    assert particle.sum() > 100
    strongest = scan(scene, weather={"snow_mm_h": 5.0})
    hidden = [(r.label == Label.PARTICLE) & (r.true_range > 0) for r in (found, strongest)]
    assert hidden[0].sum() < 0.2 * hidden[1].sum()


def test_surfaces_fade_as_in_photographs_where_fog_thins_with_height(scene: Scene) -> None:
    """The sensor is at the lowest ground; the wall's upper part, 20 deg above it, is in thinner fog."""
    weather = {"fog_visibility_m": 60.0, "fog_height_m": 2.0}
    clear, found = scan(scene), scan(scene, weather=weather)
    known = np.searchsorted(rays(clear), rays(found)).clip(0, len(rays(clear)) - 1)
    same = (rays(clear)[known] == rays(found)) & (found.label != Label.PARTICLE)
    high = same & (found.xyz[:, 2] > 2.0)
    ratio = (found.signal[high] / clear.signal[known[high]]).mean()
    lowest = float(scene.world.terrain.surface.heights.min())
    alpha = extinction(WeatherConfig(**weather), 850)
    left = [
        np.exp(-2 * alpha * fog_length(-lowest, z, r, 2.0))
        for z, r in zip(found.xyz[high, 2], found.range_m[high], strict=True)
    ]
    assert high.sum() > 50
    assert ratio == pytest.approx(np.mean(left), rel=0.05)
