# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weather in photographs: contrast falls as the visibility says, the sky and reflections too, labels stay."""

import numpy as np
import pytest
from kept_worlds import KEPT
from sense_worlds import at, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Float32Array
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig, WeatherConfig
from fieldtruth.kernels.light import AZIMUTHS, EXPOSURE, azimuth_of, fog_length, sky_radiance
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.daylight import sun_direction
from fieldtruth.sense.air import extinction
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera

SMALL = StereoConfig(width=320, height=184)
POSE = transforms.pose((0, 0, 5.0), (0, 0, 0)) @ OPTICAL
WALL = 20.0  # [m]
U, V = 60, 88  # pixel of it
FX = 160 / np.tan(np.radians(SMALL.horizontal_fov_deg / 2))
RANGE = WALL * np.sqrt(1 + ((U + 0.5 - 160) / FX) ** 2 + ((V + 0.5 - 92) / FX) ** 2)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A wall in the left half of the image, and level ground."""
    wall = quad("wall", [[WALL, 20, 0], [WALL, 0, 0], [WALL, 0, 20], [WALL, 20, 20]])
    return Scene(make_world([(wall, at(0, 0, 0))], side=42.0))


def _lit(scene: Scene, weather: WeatherConfig | None) -> BakedScene:
    """The scene in weather, made once."""
    return KEPT.bake(scene, LightConfig(), weather)


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


def test_contrast_of_a_black_object_is_five_percent_at_the_visibility(scene: Scene) -> None:
    visibility = 2 * WALL
    wall, sky = _linear(_black(_lit(scene, WeatherConfig(fog_visibility_m=visibility))))
    np.testing.assert_allclose((sky - wall) / sky, 0.05 ** (RANGE / visibility), rtol=0.02, atol=1e-4)


def _left(baked: BakedScene, towards: Float32Array) -> Float32Array:
    """Share of the light that is left of a black wall's ray: what the air adds over what it would add if thick."""
    air = baked.shading.air
    at = float(azimuth_of(float(towards[0]), float(towards[1]))) * AZIMUTHS / 4
    glow = np.array([np.interp(at, np.arange(AZIMUTHS + 1), air.light[:, channel]) for channel in range(3)])
    wall = _linear(_black(baked))[0]
    return np.asarray(1 - wall / (EXPOSURE * glow), np.float32)


RAY = POSE[:3, :3] @ np.array([(U + 0.5 - 160) / FX, (V + 0.5 - 92) / FX, 1.0]) * WALL / RANGE
"""Unit vector of the pixel of the wall."""


def test_rain_snow_and_dust_dim_by_their_extinction(scene: Scene) -> None:
    weather = WeatherConfig(rain_mm_h=50, snow_mm_h=2, dust_g_m3=0.01)
    before, after = (_left(_lit(scene, each), RAY) for each in (None, weather))
    np.testing.assert_allclose(after / before, np.exp(-extinction(weather, 550) * RANGE), rtol=0.003)


def test_clear_air_has_its_visibility(scene: Scene) -> None:
    """The contrast at a distance d is 0.05^(d / visibility) in green, less in blue, more in red."""
    visibility = 5000.0
    left = _left(_lit(scene, WeatherConfig(visibility_m=visibility)), RAY)
    assert 1 - left[1] == pytest.approx(1 - 0.05 ** (RANGE / visibility), rel=0.02)
    assert left[0] > left[1] > left[2]


def test_the_air_is_as_bright_as_the_horizon_in_its_azimuth(scene: Scene) -> None:
    light = LightConfig(sun_azimuth_deg=40.0, sun_elevation_deg=15.0)
    baked = bake(scene, light)
    sun = sun_direction(40.0, 15.0)
    table, towards = baked.shading.air.light, baked.shading.light.dome.rgb
    assert azimuth_of(1.0, 0.0) == 0.0
    assert azimuth_of(-0.5, -0.5) == pytest.approx(2.5)
    green = [table[round(float(azimuth_of(s * sun[0], s * sun[1])) * AZIMUTHS / 4), 1] for s in (1.0, -1.0)]
    sky = [sky_radiance(towards, s * sun[0] * 1.03, s * sun[1] * 1.03, 0.02)[1] for s in (1.0, -1.0)]
    assert green[0] > 1.3 * green[1]
    np.testing.assert_allclose(green, sky, rtol=0.2)


def test_fog_that_thins_with_height_dims_by_its_integral(scene: Scene) -> None:
    """The same function as of LiDARs."""
    weather = WeatherConfig(fog_visibility_m=80.0, fog_height_m=5.0)
    before, after = (_left(_lit(scene, each), RAY) for each in (None, weather))
    ground = scene.world.terrain.surface.heights.min()
    length = fog_length(POSE[2, 3] - ground, RAY[2] * RANGE, RANGE, 5.0)
    assert length < 0.6 * RANGE
    alpha = extinction(weather, 550) - baked_clear(before, RANGE)
    np.testing.assert_allclose(after / before, np.exp(-alpha * length), rtol=0.003)


def baked_clear(left: Float32Array, range_m: float) -> Float32Array:
    """Extinction [1/m] of clear air, which is part of the fog's visibility."""
    return np.asarray(-np.log(left) / range_m, np.float32)


def test_clear_weather_leaves_every_byte_and_labels_stay_in_fog(scene: Scene) -> None:
    scenes = bake(scene), bake(scene, LightConfig(), WeatherConfig()), _lit(scene, WeatherConfig(fog_visibility_m=50))
    plain, clear, fog = (Camera(SMALL, each).render(POSE) for each in scenes)
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
    clear, fog = (_lit(scene, each).shading.light for each in (None, WeatherConfig(fog_visibility_m=100)))
    assert fog.sun_rgb.max() < 1e-6
    on_ground = clear.dome.mean + clear.sun_rgb * clear.sun[2] / np.pi
    np.testing.assert_allclose(fog.dome.mean, on_ground, rtol=1e-5)


def test_haze_of_long_visibility_is_bluer(scene: Scene) -> None:
    """Small droplets scatter blue more; large ones every wavelength alike."""
    fog, mist = (_lit(scene, WeatherConfig(fog_visibility_m=each)).shading.air for each in (100.0, 4000.0))
    np.testing.assert_allclose(fog.even + fog.clear, fog.even[0] + fog.clear[0], rtol=1e-5)
    total = mist.even + mist.clear
    assert total[0] < total[1] < total[2]
    assert not _lit(scene, None).shading.air.has_weather
