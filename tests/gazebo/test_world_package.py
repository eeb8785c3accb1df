# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""World packages for Gazebo: read back, they have our triangles, names and classes; libsdformat finds nothing wrong."""

import errno
import re
import shutil
import subprocess
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from interchange_worlds import small_world
from scipy.spatial import KDTree
from sdf_reader import F8, Shape, matrix, resolve, shapes

from fieldtruth.core import parallel
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import GROUND_ID, PALETTE, Label
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.core.geodesy import geodetic_from_world
from fieldtruth.gazebo import DEFAULT_LAYOUT, worlds, write_gazebo
from fieldtruth.gazebo.robot import Flavour
from fieldtruth.gazebo.worlds import obj_text, write_worlds
from fieldtruth.interchange import ground
from fieldtruth.interchange.ground import ground_tiles
from fieldtruth.interchange.surfaces import Surface
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Collider, World

FILES: dict[Flavour, tuple[str, str]] = {
    "classic": ("small.world", "small_plain.world"),
    "gz": ("small.sdf", "small_plain.sdf"),
}
POST = Collider(shape="cylinder", size=(0.1, 0.8), position=(0.02, 0.0, -0.1))


@pytest.fixture(scope="module")
def world() -> World:
    made: World = small_world()
    meshes = dict(made.meshes) | {"tree": replace(made.meshes["tree"], colliders=(POST,))}
    return replace(made, name="small", meshes=meshes)


@pytest.fixture(scope="module")
def packages(world: World, tmp_path_factory: pytest.TempPathFactory) -> dict[Flavour, Path]:
    folder = tmp_path_factory.mktemp("package with a space")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ground, "GROUND_PIXELS", 64)
        made = {flavour: folder / flavour for flavour in FILES}
        write_worlds(made, world, beyond=True)
    return made


def by_class(world: World) -> dict[int, F8]:
    """Triangles of a world per class, by its own poses."""
    found: dict[int, list[F8]] = {}

    def add(mesh: str, pose: F8) -> None:
        data = world.backdrop if world.backdrop is not None and mesh == "backdrop" else world.meshes[mesh]
        corners = data.vertices[data.faces] @ pose[:3, :3].T + pose[:3, 3]
        for row, name in enumerate(data.materials):
            found.setdefault(world.materials[name].label, []).append(corners[data.material == row])

    for instance in world.instances:
        add(instance.mesh, instance.world_from_object)
    for swarm in world.swarms:
        for row, pose in zip(swarm.mesh, swarm.world_from_object, strict=True):
            add(swarm.meshes[row], pose)
    add("backdrop", np.eye(4))
    for tile in ground_tiles(world):
        for surface in tile.surfaces:
            found.setdefault(surface.label, []).append(surface.vertices[surface.faces].astype(np.float64))
    return {label: np.concatenate(parts) for label, parts in found.items()}


def check_triangles(world: World, package: Path, file: str) -> None:
    """Visuals of a package are the triangles of the world, class by class."""
    found: dict[int, list[F8]] = {}
    for shape in shapes(package, file):
        if shape.kind == "visual" and shape.corners is not None:
            found.setdefault(shape.retro, []).append(shape.corners)
    expected = by_class(world)
    assert found.keys() == expected.keys()
    for label, parts in found.items():
        there, here = np.concatenate(parts), expected[label]
        assert there.shape == here.shape
        for some, others in ((there, here), (here, there)):  # a triangle may begin with any of its corners
            turned = np.concatenate([np.roll(others, k, axis=1) for k in range(3)]).reshape(-1, 9)
            assert np.max(KDTree(turned).query(some.reshape(-1, 9))[0]) < 3e-4


@pytest.mark.parametrize("flavour", FILES)
def test_visuals_are_the_triangles_of_the_world_class_by_class(
    world: World, packages: dict[Flavour, Path], flavour: Flavour
) -> None:
    for file in FILES[flavour]:
        check_triangles(world, packages[flavour], file)


def test_rays_at_grazing_incidence_find_the_ground_where_it_is(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where grass, which no wheel feels, is the ground that rays meet."""
    monkeypatch.setattr(ground, "GROUND_PIXELS", 64)
    terrain = replace(world.terrain, layer=np.full(world.terrain.field.heights.shape, 0.0371234, np.float32))
    write_worlds({"classic": tmp_path}, replace(world, terrain=terrain, instances=(), swarms=()), beyond=False)
    grounds = [shape for shape in shapes(tmp_path, "small.world") if shape.model == world.object_names[GROUND_ID]]
    assert len(grounds) == 6  # ground and trail: seen, hit, and the soil below
    for shape, field in zip(grounds, [*[terrain.surface] * 4, *[terrain.field] * 2], strict=True):
        assert shape.corners is not None
        x, y, z = shape.corners.reshape(-1, 3).T
        assert np.abs(z - field.height_at(x, y)).max() < 1.2e-5


def test_numbers_of_obj_files_are_the_shortest_of_nine_digits() -> None:
    """Also very small ones, which are written with an exponent, and whole ones, which have no decimals."""
    steps = np.array([0, 1, -1, 9, -9, 10, 99, -100_001, 1_000_000, 1_200_003, -10_000_001, 123_456_789], np.float64)
    xyz = np.stack([steps, np.roll(steps, 1), np.roll(steps, 5)], axis=1) / 1e5
    flat = np.zeros((12, 3), np.float32) + np.array([0, 0, 1], np.float32)
    faces = np.arange(12, dtype=np.int32).reshape(4, 3)
    uv = (xyz[:, :2] * 100).astype(np.float32)
    surface = Surface(
        material="bark", label=Label.TRUNK, vertices=xyz.astype(np.float32), normals=flat, uv=uv, faces=faces
    )
    lines = [line.split() for line in obj_text(surface, "bark.mtl").decode().splitlines()]
    texts = [word for key, *words in lines if key in ("v", "vt", "vn") for word in words]
    assert texts == [f"{float(text):.9g}" for text in texts]
    assert {"0", "1e-05", "-9e-05", "0.0001", "-1.00001", "10", "12.00003"} <= set(texts)
    read = np.array([words for key, *words in lines if key == "v"], np.float64)
    rows = np.array([[int(word.split("/")[0]) for word in words] for key, *words in lines if key == "f"])
    expected = surface.vertices.astype(np.float64).round(5)
    np.testing.assert_array_equal(np.sort(read[rows - 1].reshape(-1, 3), axis=0), np.sort(expected, axis=0))


def shorter_diagonal(corners: Array) -> int:
    """Corner from which a reader that takes the shorter diagonal divides a quad (4, 3): 0 or 1."""
    return int(np.linalg.norm(corners[0] - corners[2]) > np.linalg.norm(corners[1] - corners[3]))


def first_ear(corners: Array) -> int:
    """Corner before the first ear in the plane of two axes that is nearest to the first three corners."""
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    axis = int(np.abs(normal).argmax())
    flat = np.delete(corners, axis, axis=1)

    def area(p: Array, q: Array, r: Array) -> float:
        return float((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]))

    whole = sum(area(np.zeros(2), flat[k], flat[(k + 1) % 4]) for k in range(4))
    for k in range(4):
        p, q, r, other = (flat[(k + step) % 4] for step in range(4))
        sides = [area(p, q, other), area(q, r, other), area(r, p, other)]
        if area(p, q, r) * whole > 0 and not (min(sides) > 0 or max(sides) < 0):
            return k
    return 0


def concave_corner(corners: Array) -> int:
    """Corner whose angles to the diagonal sum to more than half a turn, where Assimp begins; else the first."""
    for k in range(4):
        sides = [corners[(k + step) % 4] - corners[k] for step in (1, 2, 3)]
        left, diagonal, right = (side / np.linalg.norm(side) for side in sides)
        if np.arccos(np.clip(left @ diagonal, -1, 1)) + np.arccos(np.clip(right @ diagonal, -1, 1)) > np.pi:
            return k
    return 0


def test_a_quad_is_divided_again_into_its_two_triangles_by_every_rule() -> None:
    """Of folded and bent pairs of triangles; those that a rule would divide otherwise stay triangles."""
    rng, merged = np.random.default_rng(5), 0
    for _ in range(800):
        points = rng.normal(size=(4, 3)) * (1.0, 1.0, rng.choice([0.0, 0.1, 1.0]))
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        up, uv = np.tile(np.array([0, 0, 1], np.float32), (4, 1)), np.zeros((4, 2), np.float32)
        surface = Surface(
            material="bark", label=Label.TRUNK, vertices=points.astype(np.float32), normals=up, uv=uv, faces=faces
        )
        lines = [line.split() for line in obj_text(surface, "bark.mtl").decode().splitlines()]
        read = np.array([words for key, *words in lines if key == "v"], np.float64)
        rows = [[int(word.split("/")[0]) - 1 for word in words] for key, *words in lines if key == "f"]
        expected = {
            frozenset(map(tuple, points.astype(np.float32).astype(np.float64).round(5)[face])) for face in faces
        }
        for rule in (lambda _: 0, shorter_diagonal, first_ear, concave_corner):
            found = set()
            for row in rows:
                corners = read[row]
                start = rule(corners) if len(row) == 4 else 0
                for step in range(len(row) - 2):
                    turned = [row[(start + k) % len(row)] for k in (0, step + 1, step + 2)]
                    found.add(frozenset(map(tuple, read[turned])))
            assert found == expected, (rule, points)
        merged += len(rows) == 1
    assert merged > 100


def test_members_of_swarms_that_share_files_are_the_same_triangles(
    world: World, packages: dict[Flavour, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worlds, "SMALL", 0)
    monkeypatch.setattr(ground, "GROUND_PIXELS", 64)
    write_worlds({"classic": tmp_path}, world, beyond=True)
    assert any(packages["classic"].glob("models/tufts/meshes/*"))
    assert not any(tmp_path.glob("models/tufts/meshes/*"))
    check_triangles(world, tmp_path, "small.world")


def test_models_have_the_names_and_poses_of_our_objects(world: World, packages: dict[Flavour, Path]) -> None:
    models = ET.parse(packages["classic"] / "worlds/small.world").getroot().findall("world/model")
    poses = {model.attrib["name"]: matrix(model.findtext("pose")) for model in models}
    assert set(poses) == {*world.object_names[1:], "small_backdrop", "tufts_beyond"}
    assert all(model.findtext("static") == "1" for model in models)
    for instance in world.instances:
        expected = instance.world_from_object.copy()
        expected[:3, :3] /= np.cbrt(np.linalg.det(expected[:3, :3]))
        np.testing.assert_allclose(poses[instance.name], expected, atol=1e-8)


def test_rays_of_gazebo_11_hit_what_cameras_see(packages: dict[Flavour, Path]) -> None:
    found: dict[str, list[Shape]] = {"visual": [], "collision": []}
    for shape in shapes(packages["classic"], "small.world"):
        found[shape.kind].append(shape)
    assert Label.WATER in {shape.retro for shape in found["collision"]}
    for seen, hit in zip(found["visual"], found["collision"], strict=True):
        assert (hit.model, hit.retro) == (seen.model, seen.retro)
        np.testing.assert_array_equal(hit.corners, seen.corners)


def test_the_robot_passes_through_leaves_swarms_and_water_only(packages: dict[Flavour, Path]) -> None:
    soft = set()
    for shape in shapes(packages["classic"], "small.world"):
        mask = shape.element.findtext("surface/contact/collide_bitmask")
        assert mask in (None, "0")
        if shape.kind == "collision" and mask == "0":
            soft.add((shape.model, Label(shape.retro)))
    assert soft == {
        ("tree_1", Label.TREETOP),
        ("tree_2", Label.TREETOP),
        ("tufts", Label.HIGH_GRASS),
        ("tufts_beyond", Label.HIGH_GRASS),
        ("pond", Label.WATER),
    }


def test_objects_of_the_newer_gazebo_have_the_primitive_shapes_of_our_physics(packages: dict[Flavour, Path]) -> None:
    tree = ET.parse(packages["gz"] / "worlds/small.sdf").getroot().find("world/model[@name='tree_2']")
    assert tree is not None
    [collision] = tree.findall("link/collision")
    pose = matrix(collision.findtext("pose"))
    np.testing.assert_allclose(pose[:3, 3], 1.3 * np.array([0.02, 0.0, -0.1 + 0.4]), atol=1e-9)
    assert float(collision.findtext("geometry/cylinder/radius", "")) == pytest.approx(0.13)
    assert float(collision.findtext("geometry/cylinder/length", "")) == pytest.approx(1.04)


def test_labels_of_the_newer_gazebo_are_class_ids(packages: dict[Flavour, Path]) -> None:
    for shape in shapes(packages["gz"], "small.sdf"):
        if shape.kind == "visual":
            assert shape.element.findtext("plugin/label") == str(shape.retro)


def test_the_plain_twins_have_the_flat_colours_of_the_classes(packages: dict[Flavour, Path]) -> None:
    script = (packages["classic"] / "models/small_materials/materials/scripts/small_materials.material").read_text()
    blocks = dict(re.findall(r"material (\S+)\n(.*?\n)}\n", script, re.DOTALL))
    for flavour, (_, plain) in FILES.items():
        root = ET.parse(packages[flavour] / "worlds" / plain).getroot()
        assert root.find("world/light") is None
        background = np.array(root.findtext("world/scene/background", "").split(), np.float64)[:3]
        np.testing.assert_array_equal(np.rint(background * 255), PALETTE[Label.SKY])
        assert root.findtext("world/scene/shadows") == "0"
        for shape in shapes(packages[flavour], plain):
            if shape.kind == "visual":
                if flavour == "classic":
                    block = blocks[shape.element.findtext("material/script/name", "")]
                    emitted = re.findall(r"emissive (.*)\n", block)[0]
                    assert "texture_unit" not in block
                    assert "cull_hardware none" in block
                else:
                    emitted = shape.element.findtext("material/emissive", "")
                    assert shape.element.findtext("material/diffuse") == "0 0 0 1"
                rgb = np.array(emitted.split()[:3], np.float64) * 255
                np.testing.assert_allclose(rgb, PALETTE[shape.retro], atol=1e-9)


@pytest.mark.parametrize("flavour", FILES)
def test_every_file_that_is_named_exists(packages: dict[Flavour, Path], flavour: Flavour) -> None:
    package = packages[flavour]
    files = [*(package / "worlds").iterdir(), *package.glob("models/*/model.sdf")]
    uris = {uri for file in files for uri in re.findall(r"model://[^<]+", file.read_text())}
    assert len(uris) >= 12  # seven meshes with their materials
    assert all(resolve(package, uri).exists() for uri in uris)
    for library in package.glob("models/*/meshes/*.mtl"):
        [texture] = re.findall(r"map_Kd (\S+)", library.read_text())
        assert (library.parent / texture).is_file()
    textures = [path.name for path in package.glob("models/*/materials/textures/*")]
    assert textures
    assert all(name.startswith("small_") for name in textures)
    for config in package.glob("models/*/model.config"):
        assert (config.parent / ET.parse(config).getroot().findtext("sdf", "")).is_file()


def test_textures_have_the_same_way_up_as_ours(world: World, packages: dict[Flavour, Path]) -> None:
    bark = world.meshes["tree"]
    faces = bark.faces[bark.material == bark.materials.index("bark")]
    expected = np.concatenate([bark.vertices[faces], bark.uv[faces]], axis=2)
    turned = KDTree(np.concatenate([np.roll(expected, k, axis=1) for k in range(3)]).reshape(-1, 15))
    obj = trimesh.load(packages["classic"] / "models/tree/meshes/bark.obj", process=False, force="mesh")
    glb = trimesh.load(packages["gz"] / "models/tree/meshes/bark.glb", process=False, force="mesh")
    for loaded in (obj, glb):  # trimesh has v up, as we do, whatever the format
        assert isinstance(loaded, trimesh.Trimesh)
        uv = np.asarray(loaded.visual.uv)[loaded.faces]  # type: ignore[union-attr]
        assert len(uv) == len(faces)
        corners = np.concatenate([np.asarray(loaded.vertices)[loaded.faces], uv], axis=2)
        assert np.max(turned.query(corners.reshape(-1, 15))[0]) < 2e-3


def test_x_is_north_and_y_west_in_spherical_coordinates(packages: dict[Flavour, Path]) -> None:
    """Gazebo: east = x cos(h) - y sin(h), north = x sin(h) + y cos(h); h is the heading."""
    for flavour, (file, _) in FILES.items():
        sphere = ET.parse(packages[flavour] / "worlds" / file).getroot().find("world/spherical_coordinates")
        assert sphere is not None
        heading = np.radians(float(sphere.findtext("heading_deg", "")))
        x, y = 10.0, 20.0
        east, north = x * np.cos(heading) - y * np.sin(heading), x * np.sin(heading) + y * np.cos(heading)
        latitude, longitude, _ = geodetic_from_world([x, y, 0.0])
        assert north == pytest.approx((latitude - float(sphere.findtext("latitude_deg", ""))) * 111_240, abs=0.02)
        assert east == pytest.approx((longitude - float(sphere.findtext("longitude_deg", ""))) * 71_850, abs=0.02)


# ---------------------------------------------------------------------------------------------------------------------
# Validity


def complaints(file: Path) -> str:
    """Complaints of libsdformat about a file, without a line about a missing library of its own."""
    tool = shutil.which("ign") or shutil.which("gz")
    if tool is None:
        pytest.skip("needs libsdformat's command (Debian: ignition-tools, libsdformat-dev)")
    ended = subprocess.run([tool, "sdf", "-k", str(file)], capture_output=True, text=True)
    lines = (ended.stdout + ended.stderr).splitlines()
    return "\n".join(line for line in lines if line != "Valid." and "ignition-tools-backward" not in line)


@pytest.mark.parametrize("flavour", FILES)
def test_libsdformat_finds_nothing_wrong(packages: dict[Flavour, Path], flavour: Flavour) -> None:
    package = packages[flavour]
    for file in [*(package / "worlds").iterdir(), package / "models/tree/model.sdf"]:
        assert complaints(file) == ""


def test_libsdformat_would_find_an_error(tmp_path: Path) -> None:
    (tmp_path / "wrong.sdf").write_text("<sdf version='1.7'><world name='a'><model name='b'/></world></sdf>")
    assert "must have at least one link" in complaints(tmp_path / "wrong.sdf")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("environment", "flavours", "layout"),
    [("lake", ("classic",), {}), ("forest", ("gz",), {"size": (50.0, 30.0)})],
)
def test_packages_of_the_environments_are_valid_and_small(
    environment: str, flavours: tuple[Flavour, ...], layout: dict[str, Any], tmp_path: Path
) -> None:
    """The lake has most kinds of things, water, poles and cables among them; the forest is the densest."""
    world = load_world(environment, 0, DEFAULT_LAYOUT | layout)
    for flavour in flavours:
        write_gazebo(world, tmp_path / "out" / flavour, flavour=flavour, beyond=False)
        package = tmp_path / "out" / flavour
        world_file, plain = (package / "worlds" / name.replace("small", environment) for name in FILES[flavour])
        models = sorted(package.glob("models/*/model.sdf"))
        twins = [plain] if environment == "lake" else []  # differs in colours only; a small one is checked above
        for file in [world_file, *twins, *models[:: len(models) // 3]]:
            assert complaints(file) == ""
        assert sum(path.stat().st_size for path in package.rglob("*") if path.is_file()) < 300e6


# ---------------------------------------------------------------------------------------------------------------------
# Bad input


def test_bad_input_is_one_line_and_writes_nothing(world: World, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="unknown flavour 'clasic'; did you mean 'classic'"):
        write_gazebo(world, tmp_path / "out", flavour="clasic")
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("do not remove")
    with pytest.raises(OutputError, match="already exists; choose another --out, or use --overwrite"):
        write_gazebo(world, mine)
    with pytest.raises(OutputError, match="does not hold a package for Gazebo"):
        write_gazebo(world, mine, overwrite=True)
    assert [path.name for path in tmp_path.rglob("*")] == ["mine", "thesis.txt"]


def test_a_world_larger_than_the_memory_is_refused(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parallel, "available_memory", lambda: 50_000_000)
    with pytest.raises(OutputError, match=r"^format 'gazebo' of small needs about .* GB of memory, .*--no-beyond"):
        write_gazebo(world, tmp_path / "out")
    assert not any(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing_behind(world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(worlds, "write_textures", full)
    with pytest.raises(OutputError, match=r"cannot write .*out: no space left"):
        write_gazebo(world, tmp_path / "out")
    assert not any(tmp_path.iterdir())
