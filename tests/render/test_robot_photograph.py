# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot in photographs: lit by the sun of the run, shaded by what stands over it, and nothing else is changed."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from sense_worlds import at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.experiment.imaging_config import Imager
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.experiment.rig import Box, Cylinder, Rig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.robot import RobotView, part_table, robot_view, robot_views
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import Camera, CameraImages

ROBOT = int(Label.ROBOT)
NORTH = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=40.0)
"""The sun is ahead of a robot that heads along x."""


def view_from(xyz: tuple[float, ...], rpy: tuple[float, ...]) -> tuple[Imager, RobotView]:
    mount = {"xyz": xyz, "rpy_deg": rpy}
    camera = {"kind": "camera", "mount": mount, "width": 256, "height": 192}
    rig = Rig.model_validate({"visible": True, "sensors": [camera]})
    (imager,), (view,) = rig.imagers, robot_views(rig).values()
    return imager, view


def photographed(baked: BakedScene, imager: Imager, view: RobotView | None, yaw: float = 0.0) -> CameraImages:
    pose = transforms.pose((0.0, 0.0, 0.13), (0.0, 0.0, yaw)) @ imager.base_from_optical
    assert isinstance(imager.config, CameraConfig)
    return Camera(imager.config, baked).render(pose, view)


def brightness(images: CameraImages, where: NDArray[np.bool_]) -> float:
    return float(images.photo[where].mean())


@pytest.fixture(scope="module")
def meadow() -> BakedScene:
    return bake(Scene(make_world(side=24.0)), NORTH)


def test_all_pixels_but_those_of_the_robot_and_their_neighbours_are_unchanged(meadow: BakedScene) -> None:
    imager, view = view_from((-0.6, 0.1, 0.9), (0.0, 40.0, 0.0))
    plain, seen = photographed(meadow, imager, None), photographed(meadow, imager, view)
    own = seen.label == ROBOT
    assert own.mean() > 0.1
    beyond = ~binary_dilation(own, iterations=2)  # an edge, and what the lens spills
    np.testing.assert_array_equal(plain.photo[beyond], seen.photo[beyond])
    assert (np.abs(plain.photo.astype(int) - seen.photo)[own].max(axis=-1) > 3).mean() > 0.9
    again = photographed(meadow, imager, view)
    np.testing.assert_array_equal(seen.photo, again.photo)


def test_the_side_towards_the_sun_is_brighter_whichever_way_the_robot_heads(meadow: BakedScene) -> None:
    """A camera ahead of the robot sees its front; the sun is in the north, and yaw turns the front away from it.

    The sky is brighter around the sun: a side at 90 deg sees half of that, the back none.
    """
    lit = lit_sides(meadow)
    assert lit[0.0] > 1.3 * lit[90.0] > 1.3 * lit[180.0]


@pytest.mark.xfail(strict=True, reason="probes of two bands give a side the mean of front and back: 1.3 times too much")
def test_the_side_across_the_sun_is_little_brighter_than_the_back(meadow: BakedScene) -> None:
    lit = lit_sides(meadow)
    assert lit[90.0] < 1.6 * lit[180.0]


def lit_sides(meadow: BakedScene) -> dict[float, float]:
    """Brightness of the robot's front by its yaw [deg]."""
    imager, _ = view_from((2.0, 0.0, 0.2), (0.0, 5.0, 180.0))
    front = robot_view(part_table([Box(np.array([1.0, 0.6, 0.3]), np.array([0.0, 0.0, 0.15]))]), imager)
    lit = {}
    for yaw in (0.0, 90.0, 180.0):
        images = photographed(meadow, imager, front, yaw)
        low = images.label == ROBOT
        low[: int(np.nonzero(low)[0].mean())] = False  # without the deck
        lit[yaw] = brightness(images, low)
    return lit


def test_a_roof_over_the_robot_shades_its_deck() -> None:
    imager, view = view_from((-0.6, 0.0, 0.9), (0.0, 50.0, 0.0))
    shade = box("roof", (0.8, 0.8, 0.05)), at(2.4, 0.0, 2.4)  # between deck and sun at 40 deg
    aside = box("roof", (0.8, 0.8, 0.05)), at(-2.4, 0.0, 2.4)
    found = [photographed(bake(Scene(make_world([roof], side=24.0)), NORTH), imager, view) for roof in (shade, aside)]
    own = found[0].label == ROBOT
    np.testing.assert_array_equal(own, found[1].label == ROBOT)
    assert brightness(found[0], own) < 0.75 * brightness(found[1], own)


def test_a_part_shades_another_one(meadow: BakedScene) -> None:
    """A wall ahead of a plate, towards the sun, and behind it."""
    imager, _ = view_from((0.0, 0.0, 2.0), (0.0, 90.0, 0.0))
    plate = Box(np.array([0.6, 0.6, 0.02]), np.array([0.0, 0.0, 0.01]))
    pictures = [
        photographed(meadow, imager, robot_view(part_table([plate, wall]), imager))
        for wall in (Box(np.array([0.02, 2.0, 1.0]), np.array([x, 0.0, 0.5])) for x in (0.45, -0.45))
    ]
    middle = np.zeros((192, 256), np.bool_)
    middle[86:106, 118:138] = True
    assert brightness(pictures[0], middle) < 0.8 * brightness(pictures[1], middle)


def test_edges_are_smooth(meadow: BakedScene) -> None:
    """The slanted rim of a wheel against the ground: between its colour and the ground's there are other colours."""
    imager, _ = view_from((0.0, -2.0, 0.3), (0.0, 5.0, 90.0))
    wheel = robot_view(part_table([Cylinder("wheel", np.array([0.0, 0.0, 0.3]), 0.3, 0.1)]), imager)
    shares = np.bincount(wheel.samples.pixel, wheel.samples.share, 192 * 256)
    partly = (shares > 0.1) & (shares < 0.9)
    radius = imager.config.projection.fx * 0.3 / 1.95
    assert 4 * radius < partly.sum() < 12 * radius  # a circle crosses about 8 r pixels
