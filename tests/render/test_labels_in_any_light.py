# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Labels of photographs are the bytes of a camera that knows no light, in each light, weather, lens and signal.

One bake serves all: only what a light changes of it is replaced. The oracle, ``LabelCamera``, has neither bake nor
light, so that a label that depends on what is shaded fails; the scans fail where a bake or a photograph changes the
scene.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from sense_worlds import F8, at, box, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.lenses import FLAT
from fieldtruth.experiment.catalogue import preset_of
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import PRESETS, Preset, WeatherConfig
from fieldtruth.render import daylight
from fieldtruth.render.air import air_of, light_in
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.daylight import Daylight, metered_daylight
from fieldtruth.render.materials import material_table
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages
from fieldtruth.sensors.camera.sensing import Camera, CameraImages
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar

SIDE: Final = 60.0  # [m], of the world
POSE: Final = transforms.pose((0, 0.3, 1.1), (0, 4, 20))
LIGHTS: Final[tuple[Preset, ...]] = ("overcast", "dusk")
WEATHERS: Final = {
    "fog": WeatherConfig(fog_visibility_m=50),
    "low fog": WeatherConfig(fog_visibility_m=50, fog_height_m=3),
    "rain": WeatherConfig(rain_mm_h=20),
    "snow": WeatherConfig(snow_mm_h=5),
    "dust": WeatherConfig(dust_g_m3=1),
    "haze": WeatherConfig(visibility_m=5000),
}
LENSES: Final = {
    "pinhole": (),
    "plumb_bob": (-0.05, 0.01, 0.0, 0.0, 0.0),
    "rational_polynomial": (-0.05, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    "equidistant": (-0.01, 0.0, 0.0, 0.0),
    "equirectangular": (),
}


@pytest.fixture(scope="module")
def scene() -> Scene:
    """Leaves, stone and water: what lets light through, reflects it, and needs further rays."""
    pond = quad("pond", [[4, -6, 0.02], [16, -6, 0.02], [16, 1, 0.02], [4, 1, 0.02]], "water")
    leaf = quad("leaf", [[7, 2, 0.5], [7, 4, 0.5], [7, 4, 2.0], [7, 2, 2.0]], "leaf")
    stone = box("stone", (0.5, 0.5, 0.5))
    return Scene(make_world([(pond, at(0, 0, 0)), (leaf, at(0, 0, 0)), (stone, at(6, 1.5, 0.5))], side=SIDE))


@pytest.fixture(scope="module")
def baked(scene: Scene) -> BakedScene:
    return bake(scene)


def camera_config(**values: Any) -> CameraConfig:
    return CameraConfig(**{"width": 128, "height": 72, "normals": True, **values})


@cache
def day_of(preset: Preset) -> Daylight:
    with ThreadPoolExecutor(2) as pool:
        rng = np.random.default_rng(0)
        return metered_daylight(PRESETS[preset], (SIDE, SIDE), rng, pool, daylight.DOME_TEXELS)


def in_light(baked: BakedScene, preset: Preset = "summer_day", weather: WeatherConfig | None = None) -> BakedScene:
    """The bake with sun, sky, wetness and air of another light; its volume of probes stays."""
    world, light, day = baked.scene.world, PRESETS[preset], day_of(preset)
    table = baked.shading.light._replace(
        sun=day.sun, sun_rgb=day.sun_rgb, disc=day.disc, unit=day.unit, cloud_sun=day.cloud_sun, dome=day.dome
    )
    heights = world.terrain.surface.heights
    air = air_of(weather, table, heights)
    shading = baked.shading._replace(
        materials=material_table(world, day.sun, light.wetness),
        light=light_in(air, table, float(heights.mean())),
        air=air,
    )
    return BakedScene(scene=baked.scene, shading=shading, weather=weather or WeatherConfig())


def assert_same_labels(found: LabelImages, expected: LabelImages) -> None:
    for name in ("label", "instance", "depth", "normal"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def photographed(baked: BakedScene, config: CameraConfig) -> CameraImages:
    return Camera(config, baked).render(POSE @ OPTICAL)


@pytest.mark.slow  # eight skies
def test_labels_are_the_same_bytes_in_each_preset_of_light(baked: BakedScene) -> None:
    config = camera_config()
    expected = LabelCamera(config, baked.scene).label(POSE @ OPTICAL)
    assert len(np.unique(expected.label)) >= 4
    photos = []
    for preset in PRESETS:
        found = photographed(in_light(baked, preset), config)
        assert_same_labels(found, expected)
        photos.append(found.photo.astype(int))
    apart = [np.abs(a - b).mean() for k, a in enumerate(photos) for b in photos[:k]]
    assert min(apart) > 1.0  # each is another light


@pytest.mark.parametrize("name", WEATHERS)
def test_labels_are_the_same_bytes_in_each_weather(name: str, baked: BakedScene) -> None:
    config = camera_config()
    found, clear = photographed(in_light(baked, weather=WEATHERS[name]), config), photographed(in_light(baked), config)
    assert_same_labels(found, LabelCamera(config, baked.scene).label(POSE @ OPTICAL))
    assert (found.photo != clear.photo).any()


@pytest.mark.parametrize("model", LENSES)
def test_labels_are_the_same_bytes_with_each_lens_and_signal(model: Any, baked: BakedScene) -> None:
    config = camera_config(lens={"model": model, "coefficients": LENSES[model]})
    if model == "equirectangular":
        config = camera_config(lens={"model": model}, horizontal_fov_deg=360, vertical_fov_deg=180)
    expected = LabelCamera(config, baked.scene).label(POSE @ OPTICAL)
    assert_same_labels(photographed(baked, config), expected)
    if model not in FLAT:
        return  # the preset's signal is that of a flat lens
    real = CameraConfig.model_validate({**config.model_dump(), "signal": preset_of("camera", "robot")})
    wet = in_light(baked, "dusk", WEATHERS["rain"])

    def standing(stamps: Any) -> F8:
        return np.tile(POSE, (*np.shape(stamps), 1, 1))

    found = Camera(real, wet, seed=3).capture(real.imagers()[0], 0, 2_000_000_000, standing)
    assert_same_labels(found, expected)


def test_scan_is_the_same_bytes_before_and_after_photographs(scene: Scene, baked: BakedScene) -> None:
    """A LiDAR takes no light; a bake or a photograph that changed the scene would change it."""
    fresh = Scene(scene.world)
    config = LidarConfig(columns=256, rings=16)
    before = IdealLidar(config, fresh).scan(POSE)
    bake(fresh)
    for preset in LIGHTS:
        photographed(in_light(baked, preset), camera_config())
    for each in (fresh, scene):
        after = IdealLidar(config, each).scan(POSE)
        for name in ("range_m", "label", "instance", "column"):
            np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
