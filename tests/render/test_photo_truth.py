# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Photographs show what the labels name: the same hits, and shadows where the sun's direction puts them."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, Thing, at, box, make_world, quad

from fieldtruth.core import frames
from fieldtruth.experiment.config import LightConfig
from fieldtruth.experiment.rig import OPTICAL, CameraConfig
from fieldtruth.render.bake import BakedScene, bake
from fieldtruth.render.camera import Camera, CameraImages
from fieldtruth.sense.scene import Scene

SMALL = CameraConfig(width=320, height=184)
SUNS = [(118.0, 41.0), (250.0, 30.0), (0.0, 45.0), (-40.0, 60.0)]


def cluttered() -> Scene:
    """Hilly ground, boxes at all angles, a roof of leaves."""
    rng = np.random.default_rng(5)
    things: list[Thing] = [
        (box(f"box_{k}", rng.uniform(0.1, 0.8, 3).tolist(), ["stone", "bark", "wood"][k % 3]),
         frames.pose((rng.uniform(3, 12), rng.uniform(-5, 5), rng.uniform(0, 2)), rng.uniform(0, 90, 3).tolist()))
        for k in range(25)
    ]  # fmt: skip
    things.append((quad("roof", [(4, -3, 3), (9, -3, 3.5), (9, 3, 3.5), (4, 3, 3)], "leaf"), at(0, 0, 0)))
    return Scene(make_world(things, height=lambda x, y: 0.1 * np.sin(x) * np.cos(y), side=30.0))


def same(a: CameraImages, b: CameraImages) -> bool:
    return all(np.array_equal(getattr(a, n), getattr(b, n)) for n in ("photo", "label", "instance", "depth"))


@pytest.fixture(scope="module")
def scene() -> BakedScene:
    return bake(cluttered())


POSE = frames.pose((0, 0.3, 1.1), (4, 8, -3)) @ OPTICAL


def test_labels_and_photographs_come_from_the_same_hits(scene: BakedScene) -> None:
    camera = Camera(SMALL, scene)
    labels, picture = camera.label(POSE), camera.render(POSE)
    assert len(np.unique(labels.instance)) > 15
    for name in ("label", "instance", "depth"):
        assert np.array_equal(getattr(labels, name), getattr(picture, name)), name
    assert picture.photo.shape == (184, 320, 3)
    assert picture.photo.dtype == np.uint8
    assert len(np.unique(picture.photo)) > 50


def test_same_picture_twice_by_two_cameras_and_in_two_threads(scene: BakedScene) -> None:
    camera, other = Camera(SMALL, scene), Camera(SMALL, scene)
    poses = [frames.pose((0, 0, 1), (0, 0, 10.0 * k)) @ OPTICAL for k in range(-3, 4)]
    first = [camera.render(pose) for pose in poses]
    again = [camera.render(pose) for pose in poses]
    with ThreadPoolExecutor(2) as pool:
        threads = list(pool.map(lambda c: [c.render(pose) for pose in poses], (camera, other)))
    for pictures in (again, *threads):
        assert all(same(a, b) for a, b in zip(first, pictures, strict=True))
    assert not same(first[0], first[1])


def test_another_scene_of_the_same_world_gives_the_same_picture(scene: BakedScene) -> None:
    assert same(Camera(SMALL, scene).render(POSE), Camera(SMALL, bake(cluttered())).render(POSE))


def overhead(azimuth: float, elevation: float) -> tuple[F8, F8, CameraImages]:
    """World x, y [m] of the ground in each pixel, and the picture of a box 0.6 x 0.6 x 1.5 m from 20 m above it."""
    light = LightConfig(sun_azimuth_deg=azimuth, sun_elevation_deg=elevation)
    scene = bake(Scene(make_world([(box("box", (0.3, 0.3, 0.75)), at(0, 0, 0.75))], side=24.0)), light)
    config = CameraConfig(width=320, height=320, horizontal_fov_deg=24.0, vertical_fov_deg=24.0)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, -1, 0], [-1, 0, 0], [0, 0, -1]])  # image right is world -y, image down is world -x
    pose[:3, 3] = 0, 0, 20
    steps = (2 * (np.arange(320) + 0.5) / 320 - 1) * np.tan(np.radians(12.0)) * 20
    y, x = np.meshgrid(-steps, -steps)
    return x, y, Camera(config, scene).render(pose)


def in_shadow(x: F8, y: F8, azimuth: float, elevation: float, grow: float) -> NDArray[np.bool_]:
    """Ground whose ray to the sun meets the box, grown by ``grow`` [m]: slabs of the box along that ray."""
    # Azimuth runs clockwise from north; x is north and y is west, so that an eastern sun (90 deg) stands at -y.
    a, e = np.radians([azimuth, elevation])
    sx, sy, slope = np.cos(a), -np.sin(a), np.tan(e)
    way = np.linspace(0, 1.5 / slope, 200)  # level way towards the sun until its ray is higher than the box
    inside = [(np.abs(x + s * sx) < 0.3 + grow) & (np.abs(y + s * sy) < 0.3 + grow) for s in way]
    return np.asarray(np.any(inside, axis=0))


@pytest.mark.parametrize(("azimuth", "elevation"), SUNS)
def test_a_shadow_lies_where_the_sun_puts_it(azimuth: float, elevation: float) -> None:
    x, y, picture = overhead(azimuth, elevation)
    bright = picture.photo.astype(float).mean(axis=-1)
    ground = picture.instance == 1
    away = (np.abs(x) > 0.5) | (np.abs(y) > 0.5)  # the box itself, seen from above, and its rim
    dark = bright[ground & away & in_shadow(x, y, azimuth, elevation, -0.1)]
    lit = bright[ground & away & ~in_shadow(x, y, azimuth, elevation, 0.1)]
    assert len(dark) > 300
    assert len(lit) > 50_000
    assert dark.max() < 0.8 * lit.min()
    assert lit.max() < 1.15 * lit.min()  # even ground is evenly lit, but for the open sky beside the box


@pytest.mark.parametrize(("azimuth", "elevation"), [(90.0, 30.0), (270.0, 30.0)])
def test_the_side_towards_the_sun_is_the_bright_one(azimuth: float, elevation: float) -> None:
    """A box seen from its east (-y) and from its west: the sun stands in the east, then in the west."""
    light = LightConfig(sun_azimuth_deg=azimuth, sun_elevation_deg=elevation)
    scene = bake(Scene(make_world([(box("box", (1, 1, 1)), at(0, 0, 1.0))], side=30.0)), light)
    east = frames.pose((0, -6, 1), (0, 0, 90)) @ OPTICAL
    west = frames.pose((0, 6, 1), (0, 0, -90)) @ OPTICAL
    pictures = [Camera(SMALL, scene).render(pose) for pose in (east, west)]
    from_east, from_west = (float(p.photo[p.instance == 2].mean()) for p in pictures)
    bright, dim = (from_east, from_west) if azimuth == 90.0 else (from_west, from_east)
    assert bright > 1.3 * dim


def test_an_object_shades_another_object() -> None:
    """A wall in the west carries the shadow of a box before it while the sun stands in the east."""
    wall = quad("wall", [[-3, 2, 0], [3, 2, 0], [3, 2, 3], [-3, 2, 3]])
    things: list[Thing] = [(wall, at(0, 0, 0)), (box("box", (0.5, 0.2, 0.5)), at(0, 0, 1.655))]
    light = LightConfig(sun_azimuth_deg=90.0, sun_elevation_deg=20.0)
    scene = bake(Scene(make_world(things, side=30.0)), light)
    # 2.5 m before the wall and below the box, looking west: image right is north (+x).
    picture = Camera(SMALL, scene).render(frames.pose((0, -0.5, 1.0), (0, 0, 90)) @ OPTICAL)
    v, u = np.nonzero(picture.instance == 2)
    x = 2.5 * np.tan(np.radians(34.5)) * (2 * (u + 0.5) / 320 - 1)
    z = 1.0 - 2.5 * np.tan(np.radians(21.0)) * (2 * (v + 0.5) / 184 - 1)
    bright = picture.photo[v, u].astype(float).mean(axis=-1)
    drop = np.tan(np.radians(20.0))  # of the sun's rays from the box at y = -0.2 .. 0.2 to the wall at y = 2
    shaded = (np.abs(x) < 0.45) & (z > 1.155 - 1.8 * drop + 0.05) & (z < 2.155 - 2.2 * drop - 0.05)
    clear = (np.abs(x) > 0.6) & (np.abs(x) < 1.2) & (z > 0.4)
    assert shaded.sum() > 200
    assert clear.sum() > 200
    assert bright[shaded].max() < 0.8 * bright[clear].min()
