# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The shadow of the robot that carries the camera lies where geometry puts it, and hides nothing but the sun."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import Delaunay
from sense_worlds import at, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import directions
from fieldtruth.drive.track import PoseAt
from fieldtruth.experiment.imaging_config import Imager
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Box, Cylinder, Rig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.robot import RobotView, part_table, robot_view
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera

ELEVATION_DEG, AZIMUTH_DEG, YAW_DEG = 40.0, 25.0, 70.0
"""The azimuth is clockwise from north, which is x; the heading is counterclockwise from x."""
SUN = LightConfig(sun_azimuth_deg=AZIMUTH_DEG, sun_elevation_deg=ELEVATION_DEG)
HALF = np.array([0.5, 0.3, 0.2])
BLOCK = Box(2.0 * HALF, np.array([0.0, 0.0, HALF[2]]))
SIGNAL = {"exposure": "fixed", "blur_samples": 4, "exposure_time_ms": 8.0, "readout_ms": 20.0}


def camera_over(part: Box | Cylinder, signal: dict[str, object] | None = None) -> tuple[Imager, RobotView]:
    """A camera 5 m above a robot that is one part, looking straight down."""
    mount = {"xyz": (0.0, 0.0, 5.0), "rpy_deg": (0.0, 90.0, 0.0)}
    sensor = {"kind": "camera", "mount": mount, "width": 320, "height": 240, "signal": signal}
    (imager,) = Rig.model_validate({"sensors": [sensor]}).imagers
    return imager, robot_view(part_table([part]), imager)


def towards_sun() -> Array:
    """Unit vector in the world."""
    elevation, azimuth = np.radians([ELEVATION_DEG, AZIMUTH_DEG])
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), -level * np.sin(azimuth), np.sin(elevation)])


def base_pose() -> Array:
    return transforms.pose((0.7, -0.4, 0.0), (0.0, 0.0, YAW_DEG))


def ground_points(imager: Imager) -> Array:
    """World x and y (h, w, 2) [m] of the level ground at each pixel's centre."""
    config, pose = imager.config, base_pose() @ imager.base_from_optical
    rays = directions(config.projection, np.arange(config.width), np.arange(config.height)[:, None]) @ pose[:3, :3].T
    return np.asarray((pose[:3, 3] - rays * (pose[2, 3] / rays[..., 2:]))[..., :2])


def shadow_of_block(points: Array) -> Mask:
    """Return whether points (..., 2) on the ground are in the shadow: the hull of the base and of the top's shadow."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]) * HALF
    world, sun = transforms.transform(base_pose(), corners), towards_sun()
    hull = Delaunay(world[:, :2] - world[:, 2:] * sun[:2] / sun[2])
    return np.asarray(hull.find_simplex(points) >= 0)


def darkened(baked: BakedScene, imager: Imager, view: RobotView, poses: PoseAt | None = None) -> tuple[Array, Mask]:
    """Light of the ground with the robot over that without it, and the pixels that do not show the robot."""
    assert isinstance(imager.config, CameraConfig)
    camera, light = Camera(imager.config, baked), list[NDArray[np.float32]]()
    for robot in (None, view):
        if poses is None:
            images = camera.render(base_pose() @ imager.base_from_optical, robot)
        else:
            images = camera.capture(imager, 0, 500_000_000, poses, robot)
        light.append(camera.linear[..., 1].copy())
    return (light[1] / light[0]).astype(np.float64), np.asarray(images.label != Label.ROBOT)


def check_shadow(found: tuple[Array, Mask], shadow: Mask, within: float = 1.0) -> None:
    """Check all pixels that show neither the robot nor an edge ``within`` [pixel]."""
    share, ground = found
    sure = (distance_transform_edt(shadow) > within) | (distance_transform_edt(~shadow) > within)
    sure &= ground & (distance_transform_edt(ground) > 2.0)
    assert (shadow & sure).sum() > 1000
    np.testing.assert_allclose(share[~shadow & sure], 1.0, atol=1e-5)
    assert share[shadow & sure].max() < 0.5


@pytest.fixture(scope="module")
def plain() -> BakedScene:
    return bake(Scene(make_world(side=24.0)), SUN)


def test_the_edge_of_the_shadow_is_where_geometry_puts_it(plain: BakedScene) -> None:
    """A box of 1.0 x 0.6 x 0.4 m on a plane, heading 70 deg, the sun at 40 deg."""
    imager, view = camera_over(BLOCK)
    check_shadow(darkened(plain, imager, view), shadow_of_block(ground_points(imager)))


def test_the_shadow_of_a_wheel_in_the_air(plain: BakedScene) -> None:
    """Rays from the ground to the sun pass through it, in steps of 1 mm."""
    radius, width, centre = 0.3, 0.5, np.array([0.0, 0.0, 0.8])
    imager, view = camera_over(Cylinder("base_link", centre, radius, width))
    points = ground_points(imager)
    near = np.hypot(*(points - base_pose()[:2, 3] + towards_sun()[:2] / towards_sun()[2] * 0.8).T).T < 1.0
    level = np.column_stack([points[near], np.zeros(near.sum())])
    start = transforms.transform(transforms.inverse(base_pose()), level) - centre
    sun, shadow = base_pose()[:3, :3].T @ towards_sun(), np.zeros(near.shape, bool)
    steps = start[:, None] + np.linspace(0.6, 2.0, 1401)[:, None] * sun
    inside = (np.hypot(steps[..., 0], steps[..., 2]) < radius) & (np.abs(steps[..., 1]) < width / 2)
    shadow[near] = inside.any(axis=1)
    check_shadow(darkened(plain, imager, view), shadow)


def test_no_shadow_without_sun() -> None:
    cloudy = bake(Scene(make_world(side=24.0)), LightConfig(preset="overcast"))
    imager, view = camera_over(BLOCK)
    share, ground = darkened(cloudy, imager, view)
    np.testing.assert_array_equal(share[ground & (distance_transform_edt(ground) > 2.0)], 1.0)


def test_a_leaf_lit_from_behind_loses_the_sun_that_it_lets_through() -> None:
    """Seen from above; its mesh hangs so that it faces away from the sun."""
    sun, middle = towards_sun(), base_pose()[:2, 3]
    x, y = sun[:2] / np.hypot(*sun[:2])
    steep = 0.1 * np.array([x * np.cos(0.9), y * np.cos(0.9), np.sin(0.9)])
    across = np.array([-y, x, 0.0])
    corners = [steep + 0.1 * across, steep - 0.1 * across, -steep - 0.1 * across, -steep + 0.1 * across]
    leaf = quad("leaf", corners, "leaf"), at(middle[0] - 0.55 * x, middle[1] - 0.55 * y, 0.1)
    baked = bake(Scene(make_world([leaf], side=24.0)), SUN)
    imager, view = camera_over(BLOCK)
    assert isinstance(imager.config, CameraConfig)
    label = Camera(imager.config, baked).render(base_pose() @ imager.base_from_optical, view).label
    share, _ = darkened(baked, imager, view)
    seen = label == Label.TREETOP
    assert seen.sum() > 10
    assert share[seen].max() < 0.7


def test_the_shadow_moves_with_the_robot(plain: BakedScene) -> None:
    """At 4 m/s and rows that are read for 20 ms, the robot's shadow is where it is in the camera that stands."""
    imager, view = camera_over(BLOCK, SIGNAL)

    def poses(stamps_ns: int | NDArray[np.int64]) -> Array:
        seconds = np.atleast_1d(np.asarray(stamps_ns)) / 1e9 - 0.5
        found = np.tile(base_pose(), (len(seconds), 1, 1))
        found[:, 0, 3] += 4.0 * seconds
        return found[0] if np.ndim(stamps_ns) == 0 else found

    check_shadow(darkened(plain, imager, view, poses), shadow_of_block(ground_points(imager)), within=1.5)
