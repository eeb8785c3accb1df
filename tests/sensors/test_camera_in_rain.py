# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Streaks of rain and snow before a camera, drops and dust on its glass: sizes, speeds, seeds; labels stay."""

from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array
from fieldtruth.experiment.fields import Mount
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import WeatherConfig
from fieldtruth.kernels.camera import add_dust
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.air import rain, snow
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig, CameraSignal
from fieldtruth.sensors.camera.drops import APERTURE, Particles, drops_at, dust_of, fall_speed, particles_of, streak_of
from fieldtruth.sensors.camera.sensing import Camera, CameraImages

pytestmark = pytest.mark.usefixtures("small_sky")

FOCAL = 500.0
LENS = lenses.Lens("pinhole", FOCAL, FOCAL, 319.5, 179.5, (), np.pi)
STAMP = 2_000_000_000


def poses(seconds: float, speed: float = 0.0) -> Array:
    """Of a camera that looks along x, at the begin, middle and end of an exposure, and drives along x."""
    return np.stack([transforms.pose((speed * t, 0, 1.0)) @ OPTICAL for t in (-seconds / 2, 0.0, seconds / 2)])


@pytest.mark.parametrize(("depth", "seconds"), [(1.0, 0.01), (4.0, 0.01), (4.0, 0.003)])
def test_a_streak_is_as_long_as_the_drop_falls(depth: float, seconds: float) -> None:
    """Atlas, Srivastava and Sekhon (1973): a drop of 2 mm falls at 6.55 m/s."""
    drop = Particles(np.array([[0.0, 0.0, depth]]), np.array([2e-3]), fall_speed("rain", np.array([2.0])))
    ends, width, opacity = streak_of(drop, LENS, poses(seconds), seconds)
    fallen = 9.65 - 10.3 * np.exp(-1.2)
    assert fallen == pytest.approx(6.55, abs=0.01)
    length = FOCAL * fallen * seconds / depth
    assert ends[0, 1, 1] - ends[0, 0, 1] == pytest.approx(length, rel=1e-4)  # downwards in the image
    assert ends[0, 0, 0] == pytest.approx(ends[0, 1, 0], abs=1e-3)
    assert width[0] == pytest.approx(FOCAL * np.hypot(2e-3, APERTURE) / depth)  # out of focus
    area = opacity[0] * (length + width[0]) * max(width[0], 1.0)
    assert area == pytest.approx(np.pi / 4 * (FOCAL * 2e-3 / depth) ** 2, rel=1e-4)  # what it covers at any time


def test_drops_diverge_before_a_camera_that_drives() -> None:
    drops = Particles(np.array([[-0.5, 0.0, 2.0], [0.5, 0.0, 2.0]]), np.full(2, 1e-3), np.full(2, 4.0))
    ends = streak_of(drops, LENS, poses(0.02, 3.0), 0.02)[0]
    moved = ends[:, 1, 0] - ends[:, 0, 0]
    expected = FOCAL * 0.5 * (1 / (2 - 0.03) - 1 / (2 + 0.03))
    np.testing.assert_allclose(moved, [-expected, expected], rtol=1e-4)


def test_numbers_and_sizes_are_those_of_marshall_and_palmer() -> None:
    drops, half = rain(10.0, 550.0), 0.6
    found = particles_of("rain", drops, half, np.random.default_rng(1))
    distance = np.linalg.norm(found.position, axis=1)
    volume = 2 * np.pi / 3 * (1 - np.cos(half)) * (distance.max() ** 3 - 0.25**3)
    per_mm = 4.1 * 10.0**-0.21
    assert len(distance) / volume == pytest.approx(8000 / per_mm * np.exp(-per_mm), rel=0.03)
    assert 1e3 * found.diameter.mean() == pytest.approx(1 + 1 / per_mm, rel=0.02)
    assert np.arccos(found.position[:, 2] / distance).max() <= half
    flakes = particles_of("snow", snow(1.0), half, np.random.default_rng(1))
    assert flakes.diameter.min() == pytest.approx(
        1e-3 * (0.5**0.5 * 0.178 ** (-1 / 2.078)) * 0.5 ** (3 / 2.078), rel=0.01
    )
    assert flakes.speed.mean() < 1.5


@pytest.fixture(scope="module")
def scenes() -> dict[str, BakedScene]:
    scene = Scene(make_world((), side=40.0))
    return {name: bake(scene, None, WeatherConfig(**{name: 20.0} if name else {})) for name in ("", "rain_mm_h")}


def capture(scene: BakedScene, number: int = 0, **signal: Any) -> CameraImages:
    values = {"exposure_time_ms": 5.0, **signal}
    config = CameraConfig(width=320, height=184, mount=Mount(xyz=(0.0, 0.0, 0.0)), signal=CameraSignal(**values))

    def standing(stamps: Any) -> Array:
        pose = transforms.pose((0, 0, 1.0))
        return np.tile(pose, (len(stamps), 1, 1)) if isinstance(stamps, np.ndarray) else pose

    return Camera(config, scene, seed=3).capture(config.imagers()[0], number, STAMP + number * 40_000_000, standing)


def test_rain_is_of_the_photograph_alone_and_depends_on_its_number(scenes: dict[str, BakedScene]) -> None:
    first, again, second = (capture(scenes["rain_mm_h"], number) for number in (0, 0, 1))
    clear = capture(scenes[""])
    np.testing.assert_array_equal(first.photo, again.photo)
    assert (first.photo != second.photo).any(axis=-1).mean() > 0.05
    for name in ("label", "instance", "depth"):
        np.testing.assert_array_equal(getattr(first, name), getattr(clear, name))


def test_drops_on_the_glass_stay_and_slide_downwards() -> None:
    shape = (720, 1280)
    now, soon, later = (drops_at(7, "left", 200, t, shape) for t in (100.0, 100.04, 160.1))
    stays = (now[:, 0] == soon[:, 0]) & (now[:, 2] == soon[:, 2])
    assert stays.mean() > 0.98  # lives of 10 to 60 s
    moved = soon[stays, 1] - now[stays, 1]
    assert moved.min() >= 0.0
    assert 0.0 < moved.max() <= 0.03 * 720 * 0.04 * 1.001
    assert 0.4 < (moved == 0.0).mean() < 0.8
    assert (later[:, 0] != now[:, 0]).all()
    assert (drops_at(7, "right", 200, 100.0, shape)[:, 0] != now[:, 0]).all()


def test_what_is_on_the_glass_changes_the_photograph_alone(scenes: dict[str, BakedScene]) -> None:
    clear, glass, again = (capture(scenes[""], 3, **each) for each in ({}, *[{"lens_drops": 30, "lens_dust": 9}] * 2))
    np.testing.assert_array_equal(glass.photo, again.photo)
    assert 0.02 < (glass.photo != clear.photo).any(axis=-1).mean() < 0.8
    for name in ("label", "instance", "depth"):
        np.testing.assert_array_equal(getattr(glass, name), getattr(clear, name))


def test_a_speck_dims_its_middle_by_its_opacity() -> None:
    light = np.ones((90, 120, 3), np.float32)
    add_dust(light, np.array([[50.0, 40.0, 10.0, 0.2]]))
    assert light.min() == light[40, 50, 0] == pytest.approx(0.8)
    assert light[40, 60, 0] == pytest.approx(1 - 0.2 * np.exp(-2))
    specks = dust_of(1, "left", 50, (90, 120))
    assert (specks == dust_of(1, "left", 50, (90, 120))).all()
    assert specks[:, 3].max() <= 0.2
