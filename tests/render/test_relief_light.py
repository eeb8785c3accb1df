# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Light on fine ground: relief shades itself by its normals and pits, without specks; its shape casts shadows."""

import numpy as np
import pytest
from sense_worlds import F8, make_world

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.render.bake import bake
from fieldtruth.render.light import bake_light
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera

SUN = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=40.0)  # in the north, at +x
WAVE = 0.4  # [m]


def waves(x: F8, _y: F8) -> F8:
    return np.asarray(0.02 * np.sin(2 * np.pi * x / WAVE))


def photograph(height: float) -> tuple[F8, F8]:
    """x [m] and mean brightness of the rows of an image from straight above waves."""
    config = StereoConfig(width=64, height=400, horizontal_fov_deg=4.0, vertical_fov_deg=24.0)
    scene = bake(Scene(make_world(height=waves, side=8.0, spacing=0.05)), SUN)
    photo = Camera(config, scene).render(transforms.pose((0, 0, height), (0, 90, 0)) @ OPTICAL).photo
    x = -(2 * (np.arange(400) + 0.5) / 400 - 1) * np.tan(np.radians(12.0)) * height
    return x, np.asarray(photo.astype(float).mean(axis=(1, 2)))


def test_flanks_towards_the_sun_are_bright_and_far_waves_fade() -> None:
    """The slope is a cosine, which the sun at +x makes dark where the ground rises to +x."""
    x, bright = photograph(4.0)
    rising = np.cos(2 * np.pi * x / WAVE)
    assert np.corrcoef(bright, rising)[0, 1] < -0.9
    contrast = np.ptp(bright) / bright.mean()
    assert contrast > 0.2
    x, bright = photograph(1500.0)
    seen = bright[np.abs(x) < 3.5]  # a pixel is as wide as four waves
    assert len(seen) == 4
    assert np.ptp(seen) / seen.mean() < 0.2 * contrast


def test_relief_puts_no_specks_on_sunlit_ground() -> None:
    rng = np.random.default_rng(1)
    rough = make_world(height=lambda x, y: 0.3 * x + rng.normal(0.0, 0.008, x.shape), side=6.0, spacing=0.05)
    light = bake_light(Scene(rough), SUN, 1)
    inside = slice(10, -10)
    assert light.ground_sun.values[inside, inside].min() == pytest.approx(1.0, abs=1e-6)
    assert light.ground_near.values[inside, inside].min() > 0.9


def test_a_ridge_of_the_ground_casts_its_shadow() -> None:
    """A ridge of 0.5 m at x = 0 shades the ground behind it for 0.5 m / tan 40 deg."""
    ridge = make_world(height=lambda x, _: np.where(np.abs(x) < 0.06, 0.5, 0.0), side=6.0, spacing=0.05)
    sun = bake_light(Scene(ridge), SUN, 1).ground_sun.values[:, 60]
    x = -3.0 + 0.05 * np.arange(len(sun))
    assert sun[(x > -0.45) & (x < -0.3)].max() < 0.05
    assert sun[(x < -0.8) | (x > 0.3)].min() > 0.99


def test_pits_are_darker_than_bumps_under_the_sky() -> None:
    """Waves from above: pits and crests have the same slope, 0, and differ in the sky that they see."""
    pits = make_world(height=lambda x, _: 0.02 * np.cos(2 * np.pi * x / 0.2), side=4.0, spacing=0.05)
    camera = Camera(
        StereoConfig(width=64, height=400, horizontal_fov_deg=4.0, vertical_fov_deg=24.0), bake(Scene(pits), SUN)
    )
    photo = camera.render(transforms.pose((0, 0, 2.0), (0, 90, 0)) @ OPTICAL).photo.astype(float).mean(axis=(1, 2))
    x = -(2 * (np.arange(400) + 0.5) / 400 - 1) * np.tan(np.radians(12.0)) * 2.0
    phase = np.mod(x / 0.2, 1.0)
    crest, pit = (np.abs(phase - 0.5) > 0.45), np.abs(phase - 0.5) < 0.05
    assert photo[pit].mean() < 0.95 * photo[crest].mean()
