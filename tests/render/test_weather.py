# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather in photographs: contrast falls as the visibility says, the sky and reflections too, labels stay."""

import numpy as np
import pytest
from sense_worlds import at, make_world, quad

from fieldtruth.core import frames
from fieldtruth.core.arrays import Float32Array
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.weather_config import WeatherConfig
from fieldtruth.render.air import WAVELENGTHS_NM, air_of
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.air import extinction
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import OPTICAL
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.camera.stereo_config import StereoConfig

SMALL = StereoConfig(width=320, height=184)
POSE = frames.pose((0, 0, 5.0), (0, 0, 0)) @ OPTICAL
WALL = 60.0  # [m]
U, V = 60, 88  # pixel of it
FX = 160 / np.tan(np.radians(SMALL.horizontal_fov_deg / 2))
RANGE = WALL * np.sqrt(1 + ((U + 0.5 - 160) / FX) ** 2 + ((V + 0.5 - 92) / FX) ** 2)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A wall in the left half of the image, and level ground."""
    wall = quad("wall", [[WALL, 40, 0], [WALL, 0, 0], [WALL, 0, 40], [WALL, 40, 40]])
    return Scene(make_world([(wall, at(0, 0, 0))], side=150.0))


def _black(baked: BakedScene) -> BakedScene:
    materials = baked.shading.materials
    dark = materials._replace(tint=np.zeros_like(materials.tint), gloss=np.zeros_like(materials.gloss))
    return BakedScene(scene=baked.scene, shading=baked.shading._replace(materials=dark))


def _linear(baked: BakedScene) -> tuple[Float32Array, Float32Array]:
    """Light from the wall and from the sky beside it, before tonemapping."""
    camera = Camera(SMALL, baked)
    camera.render(POSE)
    linear = camera._framebuffer.linear
    return linear[V, U], linear[V, 260]


@pytest.mark.parametrize("visibility", [WALL / 2, WALL, 2 * WALL, 4 * WALL])
def test_contrast_of_a_black_object_is_five_percent_at_the_visibility(scene: Scene, visibility: float) -> None:
    wall, sky = _linear(_black(bake(scene, LightConfig(), WeatherConfig(fog_visibility_m=visibility))))
    np.testing.assert_allclose((sky - wall) / sky, 0.05 ** (RANGE / visibility), rtol=0.02, atol=1e-4)


def test_rain_snow_and_dust_dim_by_their_extinction(scene: Scene) -> None:
    weather = WeatherConfig(rain_mm_h=50, snow_mm_h=2, dust_g_m3=0.01)
    (before, _), (after, sky) = (_linear(_black(bake(scene, LightConfig(), each))) for each in (None, weather))
    left = np.exp(-extinction(weather, 550) * RANGE)
    np.testing.assert_allclose(sky - after, left * (sky - before), rtol=0.01)


def test_clear_weather_leaves_every_byte_and_labels_stay_in_fog(scene: Scene) -> None:
    weathers = None, WeatherConfig(), WeatherConfig(fog_visibility_m=50)
    plain, clear, fog = (Camera(SMALL, bake(scene, LightConfig(), each)).render(POSE) for each in weathers)
    np.testing.assert_array_equal(plain.photo, clear.photo)
    assert np.abs(plain.photo.astype(int) - fog.photo).mean() > 10
    for name in ("label", "instance", "depth"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(fog, name))


def test_light_of_the_air_is_the_horizons(scene: Scene) -> None:
    """In dense fog every pixel beyond some metres has the same light, the sky above as well."""
    photo = Camera(SMALL, bake(scene, LightConfig(), WeatherConfig(fog_visibility_m=10))).render(POSE).photo
    far = photo[:100]
    assert np.ptp(far.reshape(-1, 3).astype(int), axis=0).max() <= 1


def test_no_shadow_of_the_sun_in_fog_and_as_much_light(scene: Scene) -> None:
    clear, fog = (
        bake(scene, LightConfig(), each).shading.light for each in (None, WeatherConfig(fog_visibility_m=100))
    )
    assert fog.sun_rgb.max() < 1e-6
    on_ground = clear.dome.mean + clear.sun_rgb * clear.sun[2] / np.pi
    np.testing.assert_allclose(fog.dome.mean, on_ground, rtol=1e-5)


def test_haze_of_long_visibility_is_bluer() -> None:
    """Small droplets scatter blue more; large ones every wavelength alike."""
    fog, mist = (air_of(WeatherConfig(fog_visibility_m=each)) for each in (100.0, 4000.0))
    assert fog[0] == fog[2]
    assert mist[0] < mist[1] < mist[2]
    assert len(WAVELENGTHS_NM) == 3
    assert not air_of(None).any()
