# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""glTF files read back by other libraries: every object, pose, triangle, class and colour of the world."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh
from gltf_readers import F8, InstancedFile, Part, read_plain
from interchange_worlds import pose, small_world
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from fieldtruth.core.classes import Label
from fieldtruth.interchange import write_scene
from fieldtruth.interchange.gltf import nearest_step
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World

pytestmark = pytest.mark.usefixtures("small_ground_images")


@pytest.fixture(scope="module")
def world() -> World:
    return small_world()


@pytest.fixture(scope="module")
def plain(world: World, tmp_path_factory: pytest.TempPathFactory) -> list[Part]:
    path = tmp_path_factory.mktemp("plain") / "small.glb"
    assert write_scene(world, path, to="gltf-plain") == path
    return read_plain(path)


@pytest.fixture(scope="module")
def instanced(world: World, tmp_path_factory: pytest.TempPathFactory) -> InstancedFile:
    return InstancedFile(write_scene(world, tmp_path_factory.mktemp("instanced") / "small.glb", to="gltf"))


def parts_of(parts: list[Part], name: str) -> list[Part]:
    """Parts of a node; trimesh adds a suffix to the nodes of a mesh with several materials."""
    return [part for part in parts if part.node == name or part.node.startswith(f"{name}_")]


def in_order(corners: F8) -> F8:
    rows = corners.reshape(-1, 9)
    return np.asarray(rows[np.lexsort(np.round(rows, 3).T)])


def nearest(poses: F8, ours: F8) -> NDArray[np.intp]:
    """Rows of ``ours`` (m, 4, 4) whose positions are nearest to those of ``poses`` (n, 4, 4)."""
    return np.asarray(cKDTree(ours[:, :3, 3]).query(poses[:, :3, 3])[1], np.intp)


def test_every_object_has_its_pose_and_its_triangles(world: World, plain: list[Part]) -> None:
    for instance in world.instances:
        mesh, found = world.meshes[instance.mesh], parts_of(plain, instance.name)
        assert len(found) == len(mesh.materials)
        for part in found:
            np.testing.assert_allclose(part.world_from_object, instance.world_from_object, atol=1e-9)
        pose = instance.world_from_object
        expected = mesh.vertices[mesh.faces] @ pose[:3, :3].T + pose[:3, 3]
        np.testing.assert_allclose(
            in_order(np.concatenate([part.corners for part in found])), in_order(expected), atol=1e-6
        )


def test_normals_point_out_of_the_triangles(plain: list[Part]) -> None:
    """The meshes are flat-shaded: at each corner the stored normal is that of the triangle."""
    for part in parts_of(plain, "tree_2") + parts_of(plain, "bench_1"):
        across = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
        cosine = np.einsum("fk,fck->fc", across, part.normals) / np.linalg.norm(across, axis=1)[:, None]
        scale = np.cbrt(np.linalg.det(part.world_from_object[:3, :3]))
        np.testing.assert_allclose(cosine, scale, atol=1e-5)


def test_every_member_of_a_swarm_is_a_node(world: World, plain: list[Part]) -> None:
    (swarm,) = world.swarms
    members = [part for part in plain if part.node.startswith("tufts.")]
    assert len(members) == 40
    for part in members:
        row = int(part.node.partition(".")[2])
        np.testing.assert_allclose(part.world_from_object, swarm.world_from_object[row], atol=1e-9)


def test_the_ground_is_that_of_the_terrain(world: World, plain: list[Part]) -> None:
    ground = parts_of(plain, "terrain_0_0")
    assert sorted(part.material for part in ground) == ["terrain_0_0_ground", "terrain_0_0_trail"]
    corners = np.concatenate([part.corners for part in ground])
    assert len(corners) == sum(len(s.faces) for tile in ground_tiles(world) for s in tile.surfaces)
    middle = corners.mean(axis=1)
    np.testing.assert_allclose(middle[:, 2], world.terrain.field.height_at(middle[:, 0], middle[:, 1]), atol=1e-5)
    assert np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2].min() > 0


def test_the_triangles_are_as_many_as_the_worlds(world: World, plain: list[Part], instanced: InstancedFile) -> None:
    faces = {name: len(mesh.faces) for name, mesh in world.meshes.items()}
    (swarm,) = world.swarms
    assert world.backdrop is not None
    expected = sum(len(s.faces) for tile in ground_tiles(world) for s in tile.surfaces) + len(world.backdrop.faces)
    expected += sum(faces[i.mesh] for i in world.instances) + sum(faces[swarm.meshes[row]] for row in swarm.mesh)
    assert sum(len(part.corners) for part in plain) == expected
    single = [n for n in instanced.gltf.nodes if n.mesh is not None and not n.extensions]
    count = sum(instanced.triangle_count(n.mesh) for n in single)
    assert count + sum(faces[member.mesh] for member in instanced.members("tufts")) == expected


def test_the_extension_holds_every_member_with_pose_and_tint(world: World, instanced: InstancedFile) -> None:
    (swarm,) = world.swarms
    members = list(instanced.members("tufts"))
    assert len(members) == len(swarm.mesh)
    rows = nearest(np.array([m.world_from_object for m in members]), swarm.world_from_object)
    assert sorted(rows.tolist()) == list(range(40))
    for row, member in zip(rows, members, strict=True):
        assert member.mesh == swarm.meshes[swarm.mesh[row]]
        np.testing.assert_allclose(member.world_from_object, swarm.world_from_object[row], atol=2e-6)
        np.testing.assert_array_equal(member.tint, swarm.tint[row])
    assert instanced.gltf.extensionsRequired == ["EXT_mesh_gpu_instancing"]


def test_the_same_world_gives_the_same_bytes(world: World, tmp_path: Path) -> None:
    one, two = (write_scene(world, tmp_path / name, to="gltf").read_bytes() for name in ("one.glb", "two.glb"))
    assert one == two


def test_names_ids_and_classes(world: World, instanced: InstancedFile) -> None:
    assert instanced.roots == ["terrain_0_0", "backdrop", "tree_1", "tree_2", "bench_1", "pond", "tufts"]
    ids = {name: instanced.nodes[name].extras["instance_id"] for name in instanced.roots}
    assert ids == {"terrain_0_0": 1, "backdrop": 1, "tree_1": 2, "tree_2": 3, "bench_1": 4, "pond": 5, "tufts": 6}
    assert instanced.nodes["tree_1"].extras["kind"] == "tree"
    assert instanced.nodes["tree_1"].extras["class_names"] == ["trunk and branch", "treetop"]
    assert instanced.class_ids(instanced.nodes["tree_2"].mesh) == [Label.TRUNK, Label.TREETOP]
    assert instanced.class_ids(instanced.nodes["terrain_0_0"].mesh) == [Label.GROUND, Label.TRAIL]
    assert instanced.class_ids(instanced.nodes["pond"].mesh) == [Label.WATER]


def test_meshes_share_their_arrays(instanced: InstancedFile) -> None:
    """Both trees have the vertices of one mesh, with materials of different brightness."""
    one, two = (instanced.gltf.meshes[instanced.nodes[name].mesh] for name in ("tree_1", "tree_2"))
    assert one.name != two.name
    for a, b in zip(one.primitives, two.primitives, strict=True):
        assert (a.attributes.POSITION, a.indices) == (b.attributes.POSITION, b.indices)
        assert a.material != b.material


def colour(instanced: InstancedFile, material: int) -> F8:
    """Mean linear colour of a material: its factor times its texture."""
    surface = instanced.gltf.materials[material].pbrMetallicRoughness
    image = instanced.gltf.images[instanced.gltf.textures[surface.baseColorTexture.index].source]
    view = instanced.gltf.bufferViews[image.bufferView]
    pixels = Image.open(BytesIO(instanced.gltf.binary_blob()[view.byteOffset :][: view.byteLength]))
    linear = ((np.asarray(pixels, np.float64) / 255 + 0.055) / 1.055) ** 2.4
    return np.asarray(linear.mean(axis=(0, 1)) * surface.baseColorFactor[:3])


def test_colours_are_texture_times_tints(world: World, instanced: InstancedFile) -> None:
    grey = ((120 / 255 + 0.055) / 1.055) ** 2.4
    tree = instanced.gltf.meshes[instanced.nodes["tree_2"].mesh]  # tint (0.8, 1.2, 0.9) is rounded to 2^(1/4)
    np.testing.assert_allclose(colour(instanced, tree.primitives[1].material), 3 * [grey * 2**0.25], rtol=0.02)
    bench = instanced.gltf.meshes[instanced.nodes["bench_1"].mesh]
    np.testing.assert_allclose(colour(instanced, bench.primitives[0].material), 3 * [grey], rtol=0.02)
    factors = [m.pbrMetallicRoughness.baseColorFactor for m in instanced.gltf.materials]
    assert np.max(factors) <= 1


def test_tints_are_rounded_to_the_nearest_step() -> None:
    greys = np.array([0.1, 0.8, 1.0, 1.09, 1.1, 9.0])
    assert nearest_step(np.repeat(greys[:, None], 3, axis=1)).tolist() == [0, 1, 2, 2, 3, 4]


def test_the_land_beyond_the_edge_is_optional(world: World, tmp_path: Path) -> None:
    inside = InstancedFile(write_scene(world, tmp_path / "inside.glb", to="gltf", beyond=False))
    assert "backdrop" not in inside.roots
    assert len(list(inside.members("tufts"))) == 30


def test_rays_hit_the_classes_that_our_camera_labels(world: World, plain: list[Part], instanced: InstancedFile) -> None:
    """trimesh's rays through the file, and our label image, from above the edge of the ring."""
    ids = {m.name: m.extras["class_id"] for m in instanced.gltf.materials}
    config = StereoConfig(width=160, height=96, horizontal_fov_deg=90.0, vertical_fov_deg=62.0)
    camera = LabelCamera(config, Scene(world))
    world_from_optical = pose(-9.0, -2.0, 4.0, yaw_deg=15.0, tilt_deg=25.0) @ np.array(
        [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]], np.float64
    )
    u, v = np.meshgrid(np.arange(config.width), np.arange(config.height))
    lens = camera.intrinsics
    rays = np.stack([(u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, np.ones(u.shape)], axis=-1).reshape(-1, 3)
    corners = np.concatenate([part.corners for part in plain])
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    origins = np.repeat(world_from_optical[None, :3, 3], len(rays), axis=0)
    hit = mesh.ray.intersects_first(origins, rays @ world_from_optical[:3, :3].T)
    classes = np.concatenate([np.full(len(part.corners), ids[part.material]) for part in plain])
    found = np.where(hit < 0, Label.SKY, classes[hit]).reshape(u.shape)
    ours = camera.label(world_from_optical).label
    assert {Label.GROUND, Label.TRAIL, Label.TRUNK, Label.BENCH, Label.HIGH_GRASS, Label.SKY} <= set(ours.ravel())
    assert (found != ours).mean() < 1e-3


def test_texture_coordinates_point_down(world: World, tmp_path: Path) -> None:
    """trimesh turns v up again, so that it reads ours."""
    scene = trimesh.load_scene(write_scene(world, tmp_path / "small.glb", to="gltf-plain"), process=False)
    mesh = scene.geometry["pond"]
    expected = world.meshes["pond"].uv
    np.testing.assert_allclose(mesh.visual.uv, expected, atol=1e-6)


@pytest.mark.slow
def test_a_real_world_is_read_back(tmp_path: Path) -> None:
    world = load_world("park")
    found = InstancedFile(write_scene(world, tmp_path / "instanced.glb", to="gltf"))
    for instance in world.instances:
        node = found.nodes[instance.name]
        assert node.extras["instance_id"] == instance.object_id
        assert found.triangle_count(node.mesh) == len(world.meshes[instance.mesh].faces)
    for swarm in world.swarms:
        members = list(found.members(swarm.name))
        assert len(members) == len(swarm.mesh)
        poses = np.array([member.world_from_object for member in members])
        rows = nearest(poses, swarm.world_from_object)
        assert len(np.unique(rows)) == len(rows)
        assert np.abs(poses - swarm.world_from_object[rows]).max() < 2e-5  # float32 at 400 m
    plain = trimesh.load_scene(write_scene(world, tmp_path / "plain.glb", to="gltf-plain"), process=False)
    assert world.backdrop is not None
    faces = {name: len(mesh.faces) for name, mesh in world.meshes.items()}
    count = sum(len(s.faces) for tile in ground_tiles(world) for s in tile.surfaces) + len(world.backdrop.faces)
    count += sum(faces[i.mesh] for i in world.instances)
    count += sum(faces[swarm.meshes[row]] for swarm in world.swarms for row in swarm.mesh)
    parts = [plain.geometry[plain.graph[node][1]] for node in plain.graph.nodes_geometry]
    assert sum(len(part.faces) for part in parts) == count
