# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes and ids of hits: trails by their signed distance, meshes by their material, objects by their id."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import BOX_CORNERS, BOX_FACES, at, box, make_mesh, make_world, trace_rays

from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.model import Raster


def saddle() -> Raster:
    """A bilinear distance of exactly x * y / 10 on a square of 20 m."""
    return Raster(values=np.array([[10.0, -10.0], [-10.0, 10.0]], np.float32), spacing=20.0, x0=-10.0, y0=-10.0)


def from_above(scene: Scene, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.uint8]:
    origins = np.stack([x, y, np.full_like(x, 3.0)], axis=-1)
    return trace_rays(scene, origins, np.tile([0.0, 0.0, -1.0], (len(x), 1))).label


def test_trail_is_where_the_distance_is_negative() -> None:
    scene = Scene(make_world(side=20.0, trail=saddle()))
    x, y = np.random.default_rng(0).uniform(-9.9, 9.9, (2, 4000))
    expected = np.where(x * y < 0, Label.TRAIL, Label.GROUND)
    assert np.array_equal(from_above(scene, x, y), expected)
    assert np.array_equal(scene.world.terrain.label_at(x, y), expected)


@pytest.mark.parametrize("away", [2e-6, 1e-3])
def test_trail_border_is_exact(away: float) -> None:
    """On either side of the border y = 0; float32 resolves 0.2 um at coordinates of 2 m."""
    scene = Scene(make_world(side=20.0, trail=saddle()))
    x = np.linspace(0.5, 2.0, 50)
    assert set(from_above(scene, x, np.full_like(x, away))) == {Label.GROUND}
    assert set(from_above(scene, x, np.full_like(x, -away))) == {Label.TRAIL}


def test_trail_border_itself_is_ground() -> None:
    scene = Scene(make_world(side=20.0, trail=saddle()))
    assert from_above(scene, np.array([3.0, -3.0]), np.zeros(2)).tolist() == [Label.GROUND, Label.GROUND]


def test_lidar_camera_and_terrain_agree_on_trails() -> None:
    """A wavy distance on a grid of 0.5 m: LiDAR, camera and ``Terrain.label_at`` return the same class everywhere."""
    gx, gy = np.meshgrid(*2 * [np.linspace(-10, 10, 41)], indexing="ij")
    values = (np.sin(gx) + 0.3 * gy * np.cos(0.7 * gy)).astype(np.float32)
    scene = Scene(make_world(side=20.0, trail=Raster(values=values, spacing=0.5, x0=-10.0, y0=-10.0)))
    terrain = scene.world.terrain
    x, y = np.random.default_rng(1).uniform(-9.9, 9.9, (2, 4000))
    clear = np.abs(terrain.trail_distance.at(x, y)) > 1e-5
    assert clear.mean() > 0.999
    assert np.array_equal(from_above(scene, x, y)[clear], terrain.label_at(x, y)[clear])
    pose = np.diag([1.0, -1.0, -1.0, 1.0])  # looking down: image right is +x, image down is -y
    pose[:3, 3] = 0.3, -0.2, 6.0
    config = StereoConfig(width=320, height=240, horizontal_fov_deg=70, vertical_fov_deg=60)
    seen = LabelCamera(config, scene).label(pose)
    px = 0.3 + 6.0 * np.tan(np.radians(35)) * (2 * (np.arange(320) + 0.5) / 320 - 1)
    py = -0.2 - 6.0 * np.tan(np.radians(30)) * (2 * (np.arange(240)[:, None] + 0.5) / 240 - 1)
    clear = np.abs(terrain.trail_distance.at(px, py)) > 1e-5
    assert {int(Label.TRAIL), int(Label.GROUND)} == set(np.unique(seen.label).tolist())
    assert np.array_equal(seen.label[clear], terrain.label_at(px, py)[clear])


def test_class_is_that_of_the_face_and_id_that_of_the_object() -> None:
    """Two boxes with a material for each side, one of them rotated, and one plain box between."""
    sides = ["stone", "bark", "leaf", "wood", "gravel", "soil"]  # -x, +x, -y, +y, -z, +z
    labels = [Label.ROCK, Label.TRUNK, Label.TREETOP, Label.BENCH, Label.TRAIL, Label.GROUND]
    dice = make_mesh("dice", BOX_CORNERS, BOX_FACES, [name for name in sides for _ in range(2)])
    turned = at(0, 6, 2)
    turned[:3, :3] = 0.5 * np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])  # a quarter turn: its +x side faces +y
    scene = Scene(make_world([(dice, at(0, -6, 2)), (box("plain", (1, 1, 1), "wood"), at(0, 0, 2)), (dice, turned)]))
    axes = np.array([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], float)
    for centre, turn, object_id in ((turned[:3, 3], turned[:3, :3] / 0.5, 4), (np.array([0, -6, 2.0]), np.eye(3), 2)):
        outwards = axes @ turn.T
        # From 1.9 m, off the centre so that no ray hits an edge between two triangles.
        seen = trace_rays(scene, centre + 1.9 * outwards + [0.11, 0.07, 0.03], -outwards)
        assert seen.label.tolist() == labels
        assert set(seen.instance) == {object_id}
    seen = trace_rays(scene, np.array([[0.1, 0.2, 9.0], [9.1, 9.2, 9.0]]), np.tile([0.0, 0.0, -1.0], (2, 1)))
    assert seen.label.tolist() == [Label.BENCH, Label.GROUND]
    assert seen.instance.tolist() == [3, 1]


def test_object_ids_are_independent_of_the_order_of_instances() -> None:
    world = make_world([(box("a", (1, 1, 1)), at(0, -6, 2)), (box("b", (1, 1, 1), "bark"), at(0, 6, 2))])
    for instance, identity in zip(world.instances, (700, 41), strict=True):
        object.__setattr__(instance, "object_id", identity)
    seen = trace_rays(Scene(world), np.array([[0.1, -6, 9.0], [0.1, 6, 9.0]]), np.tile([0.0, 0.0, -1.0], (2, 1)))
    assert seen.instance.tolist() == [700, 41]
    assert seen.label.tolist() == [Label.ROCK, Label.TRUNK]
