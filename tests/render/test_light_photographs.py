# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs under presets of light: labels stay, a grey card has the model's radiance, the disc is seen."""

import numpy as np
import pytest
from sense_worlds import at, box, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig, Preset
from fieldtruth.kernels.light import EXPOSURE, Shading
from fieldtruth.render.bake import LONGEST, PARK_LEVEL, SHORTEST, BakedScene, bake, exposure
from fieldtruth.render.daylight import LUMINANCE
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera

SMALL = StereoConfig(width=320, height=184)
NAMES: tuple[Preset, ...] = ("clear_morning", "dusk", "overcast")


@pytest.fixture(scope="module")
def scene() -> Scene:
    card = quad("card", [[17.5, -0.5, 1.0], [18.5, -0.5, 1.0], [18.5, 0.5, 1.0], [17.5, 0.5, 1.0]])
    return Scene(make_world([(card, at(0, 0, 0)), (box("box", (0.5, 0.5, 0.5)), at(6, 2, 0.5))], side=44.0))


@pytest.fixture(scope="module")
def baked(scene: Scene) -> dict[str, BakedScene]:
    return {name: bake(scene, LightConfig(preset=name)) for name in NAMES}


def test_labels_are_the_same_bytes_in_every_light(baked: dict[str, BakedScene]) -> None:
    pose = transforms.pose((0, 0.3, 1.1), (0, 4, 20)) @ OPTICAL
    first, *others = (Camera(SMALL, each).render(pose) for each in baked.values())
    assert len(np.unique(first.instance)) > 2
    for other in others:
        assert np.abs(first.photo.astype(int) - other.photo).mean() > 3
        for name in ("label", "instance", "depth"):
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name))


def _dark_ground(shading: Shading, share: float) -> Shading:
    """With the exposure of ground that reflects this share of what it does."""
    materials = shading.materials._replace(
        ground=shading.materials.ground * np.float32(share), tint=shading.materials.tint * np.float32(share)
    )
    return shading._replace(materials=materials, exposure=exposure(shading.light, materials, shading.snow))


@pytest.mark.parametrize("name", NAMES)
def test_exposed_level_ground_is_as_bright_in_any_light(name: Preset, baked: dict[str, BakedScene]) -> None:
    """The meter: open ground without anything on it has the same share of what white ground would have."""
    shading = _dark_ground(baked[name].shading, 0.3)
    camera = Camera(SMALL, BakedScene(scene=baked[name].scene, shading=shading))
    camera.render(transforms.pose((-15, -15, 3.0), (0, 90, 0)) @ OPTICAL)
    light = shading.light
    white = light.sun_rgb * max(float(light.sun[2]), 0.0) / np.pi + light.dome.mean
    found = camera._framebuffer.linear @ LUMINANCE
    assert found.mean() == pytest.approx(EXPOSURE * PARK_LEVEL * float(white @ LUMINANCE), rel=0.05)


def test_exposure_follows_the_reflectance_of_the_ground(baked: dict[str, BakedScene]) -> None:
    pale, dark, black = (_dark_ground(baked["overcast"].shading, share).exposure for share in (0.3, 0.1, 1e-4))
    assert dark / pale == pytest.approx(3.0, rel=1e-3)
    assert black == LONGEST
    assert _dark_ground(baked["overcast"].shading, 3.0).exposure == SHORTEST


def test_disc_of_half_a_degree_is_seen_in_a_clear_sky(baked: dict[str, BakedScene]) -> None:
    scene = baked["clear_morning"]
    sun = LightConfig(preset="clear_morning").values
    config = StereoConfig(width=240, height=240, horizontal_fov_deg=3.0, vertical_fov_deg=3.0)
    camera = Camera(config, scene)
    camera.render(transforms.pose((0, 0, 1.5), (0, -sun.elevation_deg, -sun.azimuth_deg)) @ OPTICAL)
    light = scene.shading.light
    linear = camera._framebuffer.linear / (EXPOSURE * scene.shading.exposure)
    seen = linear[..., 0] > 0.1 * light.disc[0]
    rows, columns = np.nonzero(seen)
    middle, limb = linear[118:122, 118:122, 0].mean(), linear[seen][:, 0].min()
    assert np.sqrt(seen.sum() / np.pi) / 80.0 == pytest.approx(0.266, rel=0.03)  # 80 pixels per degree
    assert (rows.mean(), columns.mean()) == pytest.approx((119.5, 119.5), abs=1.0)
    assert middle == pytest.approx(light.disc[0], rel=0.02)
    assert 0.35 < limb / middle < 0.6


def test_level_card_has_the_radiance_of_the_model(baked: dict[str, BakedScene]) -> None:
    """Its light over that of sun and sky is its albedo over pi, the same in every light and below 1 over pi."""
    albedos = []
    for each in baked.values():
        shading = each.shading
        dull = shading.materials._replace(gloss=np.zeros_like(shading.materials.gloss))
        camera = Camera(SMALL, BakedScene(scene=each.scene, shading=shading._replace(materials=dull)))
        images = camera.render(transforms.pose((18.0, 0.0, 1.9), (0, 90, 0)) @ OPTICAL)
        card = images.instance == images.instance[92, 160]
        assert card.mean() > 0.5
        light = shading.light
        level = light.sun_rgb * max(float(light.sun[2]), 0.0) / np.pi + light.dome.mean
        albedos.append(camera._framebuffer.linear[card].mean(axis=0) / (EXPOSURE * shading.exposure * level))
    assert 0.05 < albedos[0].min() <= albedos[0].max() < 0.9
    for albedo in albedos[1:]:
        np.testing.assert_allclose(albedo, albedos[0], rtol=0.02)
