# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water follows the laws of reflection, Snell and Fresnel; it returns no LiDAR pulse, and cameras label it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, make_world, quad
from water_probe import rays_on_water

from fieldtruth.core.classes import Label
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.kernels.camera_rays import new_batch
from fieldtruth.kernels.gbuffer import FIELDS, MIRROR
from fieldtruth.kernels.water import RIPPLES, new_secondary_batch
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar

COUNT = 48
F8 = NDArray[np.float64]


def secondary_rays(down_deg: float, *, reflected: bool, pixel: float = 1e-4) -> tuple[F8, F8, F8]:
    """Directions of rays that hit water at an angle below the horizon, of their secondary rays, and the share."""
    angle = np.radians(down_deg)
    heading = np.linspace(0.0, 2.0 * np.pi, COUNT, endpoint=False)
    batch, second = new_batch(COUNT), new_secondary_batch(COUNT)
    incoming = np.stack(
        [np.cos(angle) * np.cos(heading), np.cos(angle) * np.sin(heading), np.full(COUNT, -np.sin(angle))]
    )
    batch.direction[:] = incoming
    batch.point[:2] = np.random.default_rng(1).uniform(-30, 30, (2, COUNT))
    batch.top[:], batch.distance[:] = 1, 5.0
    gbuffer = np.zeros((COUNT, FIELDS), np.float32)
    gbuffer[:, MIRROR] = 0.02
    gbuffer[5, MIRROR] = 0.0  # not water
    batch.top[7] = -1  # a miss
    found = rays_on_water((batch, gbuffer), RIPPLES, COUNT, pixel, reflected, second)
    rows = second.row[:found]
    assert rows.tolist() == [k for k in range(COUNT) if k not in (5, 7)]
    return (
        batch.direction[:, rows].T.astype(float),
        second.batch.direction[:, :found].T.astype(float),
        second.share[:found].astype(float),
    )


def unit(v: F8) -> F8:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def test_reflected_and_refracted_rays_share_an_upward_normal() -> None:
    incoming, reflected, _ = secondary_rays(40.0, reflected=True)
    _, refracted, _ = secondary_rays(40.0, reflected=False)
    normal = unit(reflected - incoming)
    assert np.degrees(np.arccos(normal[:, 2])).max() < 15.0
    assert np.ptp(normal[:, 0]) > 0.01  # there are waves
    sine_above = np.linalg.norm(np.cross(normal, incoming), axis=1)
    sine_below = np.linalg.norm(np.cross(normal, refracted), axis=1)
    np.testing.assert_allclose(sine_above, 1.333 * sine_below, atol=1e-5)  # Snell
    np.testing.assert_allclose(unit(np.cross(normal, incoming)), unit(np.cross(normal, refracted)), atol=1e-3)
    assert (refracted[:, 2] < 0).all()
    assert (reflected[:, 2] > 0).all()


def test_reflected_share_matches_fresnel() -> None:
    """Unpolarized light at an index of 1.333; Schlick's approximation is within 0.03 of it without waves."""
    for down in (85.0, 60.0, 30.0, 15.0):
        *_, share = secondary_rays(down, reflected=True, pixel=10.0)
        incidence = np.radians(90.0 - down)
        inner = np.arcsin(np.sin(incidence) / 1.333)
        across = (np.cos(incidence) - 1.333 * np.cos(inner)) / (np.cos(incidence) + 1.333 * np.cos(inner))
        along = (1.333 * np.cos(incidence) - np.cos(inner)) / (1.333 * np.cos(incidence) + np.cos(inner))
        assert share == pytest.approx((across**2 + along**2) / 2, abs=0.03)


def test_water_is_flat_where_a_pixel_spans_many_waves() -> None:
    incoming, reflected, _ = secondary_rays(20.0, reflected=True, pixel=10.0)
    np.testing.assert_allclose(reflected, incoming * [1.0, 1.0, -1.0], atol=1e-6)


def lake(mirror: float) -> Scene:
    """A lake at height 0 over a bottom at -2 m, and a wall 3 m high of another class along x = 10 m."""
    water = quad("lake", [[-20, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0]], "water")
    world = make_world([(water, at(0, 0, 0)), (box("wall", [0.5, 15, 1.5], "wood"), at(10, 0, 1.5))], height=-2.0)
    materials = {**world.materials, "water": replace(world.materials["water"], mirror=mirror)}
    return Scene(replace(world, materials=materials, water_level=0.0))


def test_camera_labels_water_and_the_lidar_gets_no_return() -> None:
    scene = lake(0.02)
    pose = at(0, 0, 1.0)
    images = LabelCamera(StereoConfig(width=64, height=40), scene).label(pose @ OPTICAL)
    assert set(np.unique(images.label[28:])) == {Label.WATER}  # from below the horizon down to the lower edge
    assert images.label[19, 32] == Label.BENCH
    scan = IdealLidar(LidarConfig(columns=64, rings=16), scene).scan(pose)
    assert set(np.unique(scan.label)) == {Label.BENCH}


def photograph(scene: Scene) -> NDArray[np.float64]:
    camera = Camera(StereoConfig(width=640, height=400), bake(scene))
    return camera.render(at(-4, 0, 1.0) @ OPTICAL).photo.astype(np.float64)


def test_water_reflects_a_wall() -> None:
    """Below the wall the water differs in brightness from where it reflects the sky."""
    photo = photograph(lake(0.02))
    horizon, focus = 199.5, 320 / np.tan(np.radians(69 / 2))
    foot = horizon + focus * 1.0 / 13.5
    # The wall's top is 2 m above the camera; its reflection is 4 m below, at a distance of 13.5 m.
    reflected_top = horizon + focus * 4.0 / 13.5
    inside = photo[int(foot) + 4 : int(reflected_top) - 25, 300:340].mean()
    beyond = photo[int(reflected_top) + 25 :, 300:340].mean()
    dull = photograph(lake(0.0))
    assert abs(inside - beyond) > 8.0
    assert abs(dull[int(foot) + 4 : int(reflected_top) - 25, 300:340].mean() - dull[-20:, 300:340].mean()) < 4.0


def test_water_casts_no_shadow() -> None:
    """The ground below water is as bright as the same ground in the open."""
    light = bake(lake(0.02)).shading.light
    middle = light.ground_sun.values.shape[0] // 4
    assert light.ground_sun.values[middle, middle] == 1.0
