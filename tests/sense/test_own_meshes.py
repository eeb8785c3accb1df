# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds of a user's own meshes: what sensors see in them in closed form, and which meshes are refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import BOX_CORNERS, BOX_FACES

import fieldtruth as ft
from fieldtruth.core.classes import GROUND_ID
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.build import read_world, save_world

pytestmark = pytest.mark.usefixtures("small_sky")

QUAD = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
"""A unit square whose outer side is up."""
HALF = np.array([4.0, 3.0, 1.5])
"""Half the length, width and height [m] of the room's inside."""
CLASSES = (ft.Label.BENCH, ft.Label.BENCH, ft.Label.ROCK, ft.Label.ROCK, ft.Label.GROUND, ft.Label.TREETOP)
FALLEN = [[0, 0, -1, 2], [0, 1, 0, 3], [1, 0, 0, 4], [0, 0, 0, 1]]


def box(half: Any, middle: Any) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    return BOX_CORNERS * half + np.asarray(middle), BOX_FACES


def room(*more: ft.MeshPart, without: int | None = None) -> ft.World:
    """Six slabs of 0.2 m about the origin, at -x, +x, -y, +y, -z, +z: ids 2 to 7 if none is left out."""
    parts = []
    for k in range(6):
        axis, sign = k // 2, 2 * (k % 2) - 1
        half, middle = HALF + 0.2, np.zeros(3)
        half[axis], middle[axis] = 0.1, sign * (HALF[axis] + 0.1)
        parts.append(ft.MeshPart(box(half, middle), CLASSES[k], f"side_{k}"))
    return ft.World.from_meshes([*(p for k, p in enumerate(parts) if k != without), *more])


def expected(directions: np.ndarray[Any, Any]) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Range [m] from the room's middle, and the side that is hit."""
    with np.errstate(divide="ignore"):
        to_side = HALF / np.abs(directions)
    axis = to_side.argmin(axis=1)
    rows = np.arange(len(directions))
    return to_side[rows, axis], 2 * axis + (directions[rows, axis] > 0)


def unit(count: int) -> np.ndarray[Any, Any]:
    ahead = np.random.default_rng(1).normal(size=(count, 3))
    return np.asarray(ahead / np.linalg.norm(ahead, axis=1, keepdims=True))


def test_rays_in_a_room_hit_its_sides_where_they_are() -> None:
    ahead = unit(2000)
    hits = ft.Scene(room()).cast([0, 0, 0], ahead)
    far, side = expected(ahead)
    np.testing.assert_allclose(hits.range_m, far, atol=1e-5)
    np.testing.assert_array_equal(hits.instance, side + 2)
    np.testing.assert_array_equal(hits.label, np.array(CLASSES)[side])
    inwards = np.zeros_like(ahead)
    inwards[np.arange(len(side)), side // 2] = 1 - 2 * (side % 2)
    np.testing.assert_allclose(hits.normal, inwards, atol=1e-6)


def test_a_lidar_in_a_room_measures_the_distance_to_its_sides() -> None:
    scan = ft.Lidar(ft.LidarConfig(), ft.Scene(room())).scan(np.eye(4))
    far, side = expected(scan.xyz / np.linalg.norm(scan.xyz, axis=1, keepdims=True))
    assert len(scan.xyz) > 30_000
    inner = np.abs(np.sort(HALF - np.abs(scan.xyz), axis=1)[:, 1]) > 1e-3  # not on the edge of two sides
    np.testing.assert_allclose(scan.range_m, far, atol=1e-4)
    np.testing.assert_array_equal(scan.instance[inner], side[inner] + 2)
    np.testing.assert_array_equal(scan.label[inner], np.array(CLASSES)[side[inner]])


def test_a_camera_in_a_room_sees_depth_and_names() -> None:
    world = room(ft.MeshPart(box([0.5, 1, 0.4], [2.5, 0, 0]), "table", "desk", colour=(0.6, 0.1, 0.1)))
    camera = ft.Camera(ft.CameraConfig(width=64, height=36), ft.bake(ft.Scene(world)))
    images = camera.render(ft.transforms.pose((0, 0, 0), (0, 0, 0)) @ ft.OPTICAL)
    assert world.object_names[images.instance[18, 32]] == "desk"
    assert images.label[18, 32] == ft.Label.TABLE
    np.testing.assert_allclose(images.depth[18, 32], 2.0, atol=1e-5)
    np.testing.assert_allclose(images.depth[images.label == ft.Label.BENCH], HALF[0], atol=1e-5)
    assert (images.label == ft.Label.BENCH).sum() > 100
    assert images.photo[18, 32, 0] > images.photo[18, 32, 2] + 20


def test_what_leaves_a_room_hits_nothing() -> None:
    world = room(without=5)
    scene = ft.Scene(world)
    hits = scene.cast([0, 0, 0], [[0, 0, 1.0], [0, 0, -1.0]])
    assert hits.range_m.tolist() == [np.inf, np.float32(HALF[2])]
    assert hits.label.tolist() == [0, ft.Label.GROUND]
    assert scene.occluded([0, 0, 0], [[0, 0, 1.0], [0, 0, -1.0]]).tolist() == [False, True]
    below = scene.cast([20, 20, 0], unit(500) * [1, 1, -1])
    assert set(below.instance.tolist()) <= {0, *range(2, 7)}
    up = ft.transforms.pose((0, 0, 0), (0, -90, 0)) @ ft.OPTICAL
    images = ft.LabelCamera(ft.CameraConfig(width=32, height=18), scene).label(up)
    assert (images.label[9, 16], images.instance[9, 16]) == (ft.Label.SKY, 0)


def test_there_is_ground_only_where_it_is_asked_for(tmp_path: Path) -> None:
    part = ft.MeshPart(QUAD, "table", pose=[[1, 0, 0, 5], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]])
    with_ground, without = ft.World.from_meshes([part], ground=-1.0), ft.World.from_meshes([part])
    down = np.array([[0.0, 0, -1]])
    hit = ft.Scene(with_ground).cast([[15.9, 15.9, 0.0]], down)
    assert (hit.label[0], hit.instance[0]) == (ft.Label.GROUND, GROUND_ID)
    assert hit.range_m[0] == pytest.approx(1.0, abs=1e-7)  # some processors give one last digit less
    save_world(tmp_path / "world.npz", without)
    for world in (without, read_world(tmp_path / "world.npz")):
        assert np.isinf(ft.Scene(world).cast([[0.0, 0, 9]], down).range_m)
        assert list(ground_tiles(world)) == []
        traced = ReferenceTracer(world)
        assert traced.triangles == 2
        assert (
            len(traced.hits(np.array([[0.0, 0, 9], [5.5, 0.2, 9]]), down.repeat(2, axis=0), np.full(2, 99.0)).ray) == 1
        )


def test_parts_of_one_name_are_one_object_and_poses_move_them() -> None:
    trunk, crown = box([0.1, 0.1, 1], [0, 0, 1]), box([1, 1, 1], [0, 0, 3])
    parts = [ft.MeshPart(mesh, label, "tree", pose=FALLEN) for mesh, label in ((trunk, "trunk"), (crown, "Treetop"))]
    world = ft.World.from_meshes([ft.MeshPart(QUAD, 12), *parts, ft.MeshPart(QUAD, ft.Label.POST)])
    assert world.object_names[2:] == ("post_1", "tree", "post_2")
    hits = ft.Scene(world).cast([[1.0, 3, 9], [-1.0, 3, 9]], [0.0, 0, -1])
    np.testing.assert_allclose(hits.position[:, 2], [4.1, 5.0], atol=1e-5)
    assert hits.label.tolist() == [ft.Label.TRUNK, ft.Label.TREETOP]
    assert hits.instance.tolist() == [3, 3]


def test_a_mirror_keeps_the_outer_side() -> None:
    world = ft.World.from_meshes([ft.MeshPart(QUAD, "post", "a", pose=np.diag([-1.0, 1, 1, 1]))])
    np.testing.assert_array_equal(world.meshes["a"].normals, np.tile([0, 0, 1], (6, 1)))


def test_scenes_of_trimesh_have_the_names_of_their_nodes() -> None:
    trimesh = pytest.importorskip("trimesh")
    unit_box, scene = trimesh.creation.box((1, 1, 1)), trimesh.Scene()
    unit_box.metadata["label"] = "bench"
    for name, x in (("seat_b", 0.0), ("seat_a", 3.0), ("desk", 6.0)):
        scene.add_geometry(unit_box, node_name=name, transform=trimesh.transformations.translation_matrix([x, 0, 0]))
    world = ft.World.from_meshes(
        [ft.MeshPart(scene, {"desk": "table", "seat_*": "rock"}), unit_box.copy().apply_scale(0.5)]
    )
    assert world.object_names[2:] == ("desk", "seat_a", "seat_b", "bench_1")
    hits = ft.Scene(world).cast([[0.4, 0, 9], [3.0, 0, 9], [6.0, 0, 9]], [0.0, 0, -1])
    assert hits.instance.tolist() == [4, 3, 2]
    assert hits.label.tolist() == [ft.Label.ROCK, ft.Label.ROCK, ft.Label.TABLE]


NOT_FINITE = ([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0]], [[0, 1, 2]])


@pytest.mark.parametrize(
    ("meshes", "text"),
    [
        ([], r"meshes must hold one mesh at least, got none"),
        (5, r"meshes must be a list, got a int"),
        (["room.glb"], r"meshes\[0\]: expected \(vertices, faces\), or a mesh or scene of trimesh, got a str"),
        ([ft.MeshPart(NOT_FINITE, "rock")], r"meshes\[0\]: vertices must be finite; row 2 is \[nan, 1.0, 0.0\]"),
        (
            [ft.MeshPart(([[0, 0]], [[0, 0, 0]]), "rock")],
            r"must have the shape \(n, 3\), not empty, got \(1, 2\)",
        ),
        ([ft.MeshPart((QUAD[0], []), "rock")], r"meshes\[0\]: faces must have the shape"),
        ([ft.MeshPart((QUAD[0], [[0, 1, 2], [0, 1, 4]]), "rock")], r"faces must be .* 0 to 3.* row 1 is \[0, 1, 4\]"),
        ([ft.MeshPart((QUAD[0], [[0, 1, -1]]), "rock")], r"row 0 is \[0, 1, -1\]"),
        ([ft.MeshPart((QUAD[0], [[0, 1, 1.5]]), "rock")], r"row 0 is \[0.0, 1.0, 1.5\]"),
        ([ft.MeshPart(([["a", 0, 0]], [[0, 0, 0]]), "rock")], r"meshes\[0\]: vertices must be numbers"),
        (
            [ft.MeshPart(QUAD, "rok", "stone")],
            r"\(stone\): unknown class 'rok'; did you mean 'rock'\?.* rock,",
        ),
        ([ft.MeshPart(QUAD, "sky")], r"unknown class 'sky'"),
        ([ft.MeshPart(QUAD, 16)], r"unknown class '16'"),
        ([ft.MeshPart(QUAD, True)], r"unknown class 'True'"),
        ([QUAD], r"meshes\[0\]: label is missing; one of ground"),
        ([ft.MeshPart(QUAD, "rock", "husky")], r"name must not be 'husky', which the robot or the ground has"),
        ([ft.MeshPart(QUAD, "rock", colour=(1, 2, 0))], r"colour must be three numbers from 0 to 1"),
        ([ft.MeshPart(QUAD, "rock", pose=np.zeros((4, 4)))], r"pose must have a last row"),
        ([ft.MeshPart(QUAD, "rock", pose=np.diag([1e5, 1, 1, 1]))], r"within 10000 m of the origin, got 100000 m"),
    ],
)
def test_wrong_meshes_are_one_line(meshes: Any, text: str) -> None:
    with pytest.raises(ft.FieldtruthError, match=text) as error:
        ft.World.from_meshes(meshes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("ground", [True, np.nan, "low"])
def test_ground_is_a_height(ground: Any) -> None:
    with pytest.raises(ft.ConfigurationError, match="ground must be a height"):
        ft.World.from_meshes([ft.MeshPart(QUAD, "rock")], ground=ground)


def test_a_robot_drives_on_the_ground_among_meshes() -> None:
    world = ft.World.from_meshes([ft.MeshPart(box([0.1, 3, 1.5], [12, 0, 1.5]), "rock", "wall")], ground=0.0)
    sim = ft.Simulation(world=world, sensors=["lidar"])
    sim.reset()
    frame = sim.step(0.2)
    cloud = frame["lidar"]
    assert set(cloud.instance.tolist()) == {1, 2}
    lidar = next(each for each in sim.experiment.rig.sensors if each.name == "lidar")
    assert isinstance(lidar, ft.LidarConfig)
    world_from_lidar = frame.pose @ lidar.mount.base_from_sensor
    points = cloud.xyz[cloud.instance == 2] @ world_from_lidar[:3, :3].T + world_from_lidar[:3, 3]
    np.testing.assert_allclose(points[:, 0], 11.9, atol=0.05)  # the robot moves meanwhile
    assert len(points) > 100
