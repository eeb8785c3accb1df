# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water obeys the laws of reflection, of Snell and of Fresnel; it gives the LiDAR nothing and cameras its class."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, box, make_world, quad

from fieldtruth.core.classes import Label
from fieldtruth.experiment.rig import OPTICAL, CameraConfig, LidarConfig
from fieldtruth.render.bake import bake
from fieldtruth.render.camera import Camera
from fieldtruth.render.shade import FIELDS, MIRROR
from fieldtruth.render.water import leave_water, new_second
from fieldtruth.sense.label_camera import LabelCamera
from fieldtruth.sense.lidar import Lidar
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.strip import new_strip

COUNT = 48
F8 = NDArray[np.float64]


def leave(down_deg: float, *, mirrored: bool, pixel: float = 1e-4) -> tuple[F8, F8, F8]:
    """Directions of rays that meet the water at an angle below the horizon, of their second rays, and the share."""
    angle = np.radians(down_deg)
    heading = np.linspace(0.0, 2.0 * np.pi, COUNT, endpoint=False)
    strip, second = new_strip(COUNT), new_second(COUNT)
    came = np.stack([np.cos(angle) * np.cos(heading), np.cos(angle) * np.sin(heading), np.full(COUNT, -np.sin(angle))])
    strip.direction[:] = came
    strip.point[:2] = np.random.default_rng(1).uniform(-30, 30, (2, COUNT))
    strip.top[:], strip.reach[:] = 1, 5.0
    surface = np.zeros((COUNT, FIELDS), np.float32)
    surface[:, MIRROR] = 0.02
    surface[5, MIRROR] = 0.0  # no water there
    strip.top[7] = -1  # nor there
    found = leave_water(strip, surface, COUNT, pixel, mirrored, second)
    rows = second.row[:found]
    assert rows.tolist() == [k for k in range(COUNT) if k not in (5, 7)]
    return (
        strip.direction[:, rows].T.astype(float),
        second.strip.direction[:, :found].T.astype(float),
        second.share[:found].astype(float),
    )


def unit(v: F8) -> F8:
    return np.asarray(v / np.linalg.norm(v, axis=1, keepdims=True))


def test_mirrored_rays_and_refracted_ones_share_a_normal_that_points_up() -> None:
    came, mirrored, _ = leave(40.0, mirrored=True)
    _, refracted, _ = leave(40.0, mirrored=False)
    normal = unit(mirrored - came)
    assert np.degrees(np.arccos(normal[:, 2])).max() < 15.0
    assert np.ptp(normal[:, 0]) > 0.01  # there are waves
    sine_above = np.linalg.norm(np.cross(normal, came), axis=1)
    sine_below = np.linalg.norm(np.cross(normal, refracted), axis=1)
    np.testing.assert_allclose(sine_above, 1.333 * sine_below, atol=1e-5)  # Snell
    np.testing.assert_allclose(unit(np.cross(normal, came)), unit(np.cross(normal, refracted)), atol=1e-3)
    assert (refracted[:, 2] < 0).all()
    assert (mirrored[:, 2] > 0).all()


def test_share_of_mirrored_light_follows_fresnel() -> None:
    """Exact for unpolarised light at an index of 1.333; Schlick's form is within 0.03 of it where waves are faded."""
    for down in (85.0, 60.0, 30.0, 15.0):
        *_, share = leave(down, mirrored=True, pixel=10.0)
        incidence = np.radians(90.0 - down)
        inner = np.arcsin(np.sin(incidence) / 1.333)
        across = (np.cos(incidence) - 1.333 * np.cos(inner)) / (np.cos(incidence) + 1.333 * np.cos(inner))
        along = (1.333 * np.cos(incidence) - np.cos(inner)) / (1.333 * np.cos(incidence) + np.cos(inner))
        assert share == pytest.approx((across**2 + along**2) / 2, abs=0.03)


def test_where_a_pixel_spans_many_waves_the_water_is_flat() -> None:
    came, mirrored, _ = leave(20.0, mirrored=True, pixel=10.0)
    np.testing.assert_allclose(mirrored, came * [1.0, 1.0, -1.0], atol=1e-6)


def lake(mirror: float) -> Scene:
    """A lake at height 0 over a bottom at -2 m, and a wall 3 m high of another class along x = 10 m."""
    water = quad("lake", [[-20, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0]], "water")
    world = make_world([(water, at(0, 0, 0)), (box("wall", [0.5, 15, 1.5], "wood"), at(10, 0, 1.5))], height=-2.0)
    materials = {**world.materials, "water": replace(world.materials["water"], mirror=mirror)}
    return Scene(replace(world, materials=materials, water_level=0.0))


def test_a_camera_sees_water_and_the_lidar_nothing_there() -> None:
    scene = lake(0.02)
    pose = at(0, 0, 1.0)
    picture = LabelCamera(CameraConfig(width=64, height=40), scene).label(pose @ OPTICAL)
    assert set(np.unique(picture.label[28:])) == {Label.WATER}  # from below the horizon down to the lower edge
    assert picture.label[19, 32] == Label.BENCH
    scan = Lidar(LidarConfig(columns=64, rings=16), scene).scan(pose)
    assert set(np.unique(scan.label)) == {Label.BENCH}


def photograph(scene: Scene) -> NDArray[np.float64]:
    camera = Camera(CameraConfig(width=640, height=400), bake(scene))
    return camera.render(at(-4, 0, 1.0) @ OPTICAL).photo.astype(np.float64)


def test_the_wall_stands_in_the_water_upside_down() -> None:
    """Below the wall the water is not as bright as beside it, where it mirrors the sky."""
    photo = photograph(lake(0.02))
    horizon, focus = 199.5, 320 / np.tan(np.radians(69 / 2))
    foot = horizon + focus * 1.0 / 13.5
    # The top is 2 m above the camera; in the mirror it is 4 m below it, seen over 13.5 m.
    mirrored_top = horizon + focus * 4.0 / 13.5
    inside = photo[int(foot) + 4 : int(mirrored_top) - 25, 300:340].mean()
    beyond = photo[int(mirrored_top) + 25 :, 300:340].mean()
    dull = photograph(lake(0.0))
    assert abs(inside - beyond) > 8.0
    assert abs(dull[int(foot) + 4 : int(mirrored_top) - 25, 300:340].mean() - dull[-20:, 300:340].mean()) < 4.0


def test_light_reaches_the_bottom() -> None:
    """Water casts no shadow: the ground below it is as bright as the same ground in the open."""
    light = bake(lake(0.02)).shading.light
    middle = light.ground_sun.values.shape[0] // 4
    assert light.ground_sun.values[middle, middle] == 1.0
