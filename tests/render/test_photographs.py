# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs and labels come from the same hits, and shadows follow the direction of the sun."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, Placed, at, box, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera, CameraImages

SMALL = StereoConfig(width=320, height=184)
SUNS = [(118.0, 41.0), (250.0, 30.0), (-40.0, 60.0)]


def cluttered() -> Scene:
    """Hilly ground, boxes in all orientations, a roof of leaves."""
    rng = np.random.default_rng(5)
    objects: list[Placed] = [
        (
            box(f"box_{k}", rng.uniform(0.1, 0.8, 3).tolist(), ["stone", "bark", "wood"][k % 3]),
            transforms.pose(
                (rng.uniform(3, 12), rng.uniform(-5, 5), rng.uniform(0, 2)), rng.uniform(0, 90, 3).tolist()
            ),
        )
        for k in range(25)
    ]
    objects.append((quad("roof", [(4, -3, 3), (9, -3, 3.5), (9, 3, 3.5), (4, 3, 3)], "leaf"), at(0, 0, 0)))
    return Scene(make_world(objects, height=lambda x, y: 0.1 * np.sin(x) * np.cos(y), side=30.0))


def equal(a: CameraImages, b: CameraImages) -> bool:
    return all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("photo", "label", "instance", "depth"))


@pytest.fixture(scope="module")
def scene() -> BakedScene:
    return bake(cluttered())


POSE = transforms.pose((0, 0.3, 1.1), (4, 8, -3)) @ OPTICAL


def test_labels_do_not_depend_on_rendering(scene: BakedScene) -> None:
    camera = Camera(SMALL, scene)
    labels, images = camera.label(POSE), camera.render(POSE)
    assert len(np.unique(labels.instance)) > 15
    for name in ("label", "instance", "depth"):
        assert np.array_equal(getattr(labels, name), getattr(images, name)), name
    assert images.photo.shape == (184, 320, 3)
    assert images.photo.dtype == np.uint8
    assert len(np.unique(images.photo)) > 50


def test_images_do_not_depend_on_camera_thread_or_order(scene: BakedScene) -> None:
    camera, other = Camera(SMALL, scene), Camera(SMALL, scene)
    poses = [transforms.pose((0, 0, 1), (0, 0, 10.0 * k)) @ OPTICAL for k in range(-3, 4)]
    first = [camera.render(pose) for pose in poses]
    again = [camera.render(pose) for pose in poses]
    with ThreadPoolExecutor(2) as pool:
        threads = list(pool.map(lambda c: [c.render(pose) for pose in poses], (camera, other)))
    for others in (again, *threads):
        assert all(equal(a, b) for a, b in zip(first, others, strict=True))
    assert not equal(first[0], first[1])


def test_scenes_of_the_same_world_give_the_same_image(scene: BakedScene) -> None:
    assert equal(Camera(SMALL, scene).render(POSE), Camera(SMALL, bake(cluttered())).render(POSE))


def overhead(azimuth: float, elevation: float) -> tuple[F8, F8, CameraImages]:
    """World x, y [m] of the ground in each pixel, and the images of a box 0.6 x 0.6 x 1.5 m from 20 m above it."""
    light = LightConfig(sun_azimuth_deg=azimuth, sun_elevation_deg=elevation)
    scene = bake(Scene(make_world([(box("box", (0.3, 0.3, 0.75)), at(0, 0, 0.75))], side=24.0)), light)
    config = StereoConfig(width=320, height=320, horizontal_fov_deg=24.0, vertical_fov_deg=24.0)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])  # image right is world -y, image down is world -x
    pose[:3, 3] = 0, 0, 20
    steps = (2 * (np.arange(320) + 0.5) / 320 - 1) * np.tan(np.radians(12.0)) * 20
    y, x = np.meshgrid(-steps, -steps)
    return x, y, Camera(config, scene).render(pose)


def in_shadow(x: F8, y: F8, azimuth: float, elevation: float, grow: float) -> NDArray[np.bool_]:
    """Ground whose ray to the sun hits the box enlarged by ``grow`` [m], from slabs of the box along that ray."""
    # Azimuth is clockwise from north; x is north and y is west, so that an eastern sun (90 deg) is at -y.
    a, e = np.radians([azimuth, elevation])
    sx, sy, slope = np.cos(a), -np.sin(a), np.tan(e)
    steps = np.linspace(0, 1.5 / slope, 200)  # horizontal distances towards the sun, until its ray is above the box
    inside = [(np.abs(x + s * sx) < 0.3 + grow) & (np.abs(y + s * sy) < 0.3 + grow) for s in steps]
    return np.asarray(np.any(inside, axis=0))


@pytest.mark.parametrize(("azimuth", "elevation"), SUNS)
def test_shadow_on_the_ground_matches_closed_form(azimuth: float, elevation: float) -> None:
    x, y, images = overhead(azimuth, elevation)
    bright = images.photo.astype(float).mean(axis=-1)
    ground = images.instance == 1
    away = (np.abs(x) > 0.5) | (np.abs(y) > 0.5)  # the box itself, seen from above, and its rim
    dark = bright[ground & away & in_shadow(x, y, azimuth, elevation, -0.1)]
    lit = bright[ground & away & ~in_shadow(x, y, azimuth, elevation, 0.1)]
    assert len(dark) > 300
    assert len(lit) > 50_000
    assert dark.max() < 0.8 * lit.min()
    assert lit.max() < 1.15 * lit.min()  # level ground is evenly lit, apart from the sky that the box hides


def test_side_that_faces_the_sun_is_brighter() -> None:
    """A box seen from the east (-y) and from the west, with the sun in the east."""
    light = LightConfig(sun_azimuth_deg=90.0, sun_elevation_deg=30.0)
    scene = bake(Scene(make_world([(box("box", (1, 1, 1)), at(0, 0, 1.0))], side=30.0)), light)
    east = transforms.pose((0, -6, 1), (0, 0, 90)) @ OPTICAL
    west = transforms.pose((0, 6, 1), (0, 0, -90)) @ OPTICAL
    images = [Camera(SMALL, scene).render(pose) for pose in (east, west)]
    from_east, from_west = (float(p.photo[p.instance == 2].mean()) for p in images)
    assert from_east > 1.3 * from_west


def test_shadow_on_another_object_matches_closed_form() -> None:
    """A wall in the west receives the shadow of a box in front of it from a sun in the east."""
    wall = quad("wall", [[-3, 2, 0], [3, 2, 0], [3, 2, 3], [-3, 2, 3]])
    objects: list[Placed] = [(wall, at(0, 0, 0)), (box("box", (0.5, 0.2, 0.5)), at(0, 0, 1.655))]
    light = LightConfig(sun_azimuth_deg=90.0, sun_elevation_deg=20.0)
    scene = bake(Scene(make_world(objects, side=30.0)), light)
    # The camera is 2.5 m from the wall, below the box, and looks west: image right is north (+x).
    images = Camera(SMALL, scene).render(transforms.pose((0, -0.5, 1.0), (0, 0, 90)) @ OPTICAL)
    v, u = np.nonzero(images.instance == 2)
    x = 2.5 * np.tan(np.radians(34.5)) * (2 * (u + 0.5) / 320 - 1)
    z = 1.0 - 2.5 * np.tan(np.radians(21.0)) * (2 * (v + 0.5) / 184 - 1)
    bright = images.photo[v, u].astype(float).mean(axis=-1)
    drop = np.tan(np.radians(20.0))  # of the sun's rays from the box at y = -0.2 .. 0.2 to the wall at y = 2
    shaded = (np.abs(x) < 0.45) & (z > 1.155 - 1.8 * drop + 0.05) & (z < 2.155 - 2.2 * drop - 0.05)
    clear = (np.abs(x) > 0.6) & (np.abs(x) < 1.2) & (z > 0.4)
    assert shaded.sum() > 200
    assert clear.sum() > 200
    assert bright[shaded].max() < 0.8 * bright[clear].min()
