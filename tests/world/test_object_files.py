# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files of own objects: size, axes, unit, sides and materials as they were made; what is wrong is one clear line."""

import json
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from object_files import HEIGHT, RADIUS, SIDES, Y_UP, bales, barrel, entry, trimesh
from PIL import Image
from pydantic import ValidationError

from fieldtruth.core.classes import NOT_OF_WORLDS, Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, FieldtruthWarning
from fieldtruth.sensors.lidar.sensing import Reflectance, reflectance_of
from fieldtruth.world.model import Material, Mesh
from fieldtruth.world.objects import files
from fieldtruth.world.objects.config import ObjectConfig
from fieldtruth.world.objects.files import read_file, with_named
from fieldtruth.world.objects.make import OwnObject, make_object


def made(config: ObjectConfig) -> OwnObject:
    """An object without a repair."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", FieldtruthWarning)
        return make_object(config, "layout.objects[0]")


def volume(mesh: Mesh) -> float:
    """Volume [m3] by the divergence theorem: below 0 if sides are inside out."""
    return float(np.linalg.det(mesh.vertices[mesh.faces].astype(np.float64)).sum()) / 6


def refusal(path: Path, **values: Any) -> str:
    with pytest.raises(FieldtruthError) as error:
        make_object(entry(path, **values), "layout.objects[0]")
    assert "\n" not in str(error.value)
    assert path.name in str(error.value)
    return str(error.value)


def test_a_barrel_stands_upright_on_its_base(tmp_path: Path) -> None:
    own = made(entry(barrel(tmp_path / "barrel.glb")))
    low, high = own.mesh.vertices.min(axis=0), own.mesh.vertices.max(axis=0)
    np.testing.assert_allclose(low, (-RADIUS, -RADIUS, 0), atol=1e-6)
    np.testing.assert_allclose(high, (RADIUS, RADIUS, HEIGHT), atol=1e-6)
    prism = SIDES / 2 * RADIUS**2 * np.sin(2 * np.pi / SIDES) * HEIGHT
    assert volume(own.mesh) == pytest.approx(prism, rel=1e-6)
    assert own.mesh.footprint == pytest.approx(RADIUS, abs=1e-6)
    [circle] = own.circles
    np.testing.assert_allclose(circle, (0, 0, RADIUS * np.sqrt(2)), atol=1e-6)


def test_its_side_is_round_and_its_rim_an_edge(tmp_path: Path) -> None:
    mesh = made(entry(barrel(tmp_path / "barrel.glb"))).mesh
    level = np.abs(mesh.normals[:, 2]) < 0.5
    radial = mesh.vertices[level, :2] / np.linalg.norm(mesh.vertices[level, :2], axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals[level, :2], radial, atol=0.05)  # of the cylinder that the prism stands for
    np.testing.assert_allclose(np.abs(mesh.normals[~level, 2]), 1.0, atol=1e-6)


def test_the_texture_of_the_file_is_that_of_the_material(tmp_path: Path) -> None:
    own = made(entry(barrel(tmp_path / "barrel.glb"), reflectance=0.37))
    [material] = own.materials.values()
    assert (material.name, material.label) == ("barrel_blue_paint_0", Label.TRASH_BIN)
    assert material.gloss == pytest.approx(1.0)
    assert reflectance_of(material) == Reflectance(0.37)
    image = own.textures[material.texture]
    assert image.shape == (64, 64, 3)
    np.testing.assert_array_equal(image[4, 10], (30, 80, 160))
    v = HEIGHT / 2 + 1.0 - 0.45 + np.array([0.0])  # what trimesh wrote: v is the height in the file
    assert own.mesh.uv[:, 1].min() == pytest.approx(v[0] - HEIGHT / 2, abs=1e-6)


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1000.0), ("cm", 100.0), ("in", 1 / 0.0254), ("ft", 1 / 0.3048)])
@pytest.mark.parametrize("ending", ["stl", "ply", "obj"])
def test_units_and_formats_give_the_same_mesh(tmp_path: Path, unit: str, factor: float, ending: str) -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    if ending == "obj":
        box.apply_transform(Y_UP)
    box.apply_scale(factor)
    box.export(tmp_path / f"crate.{ending}")
    mesh = made(entry(tmp_path / f"crate.{ending}", unit=unit)).mesh
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (-0.5, -1.0, 0.0), atol=1e-5)
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (0.5, 1.0, 3.0), atol=1e-5)
    assert volume(mesh) == pytest.approx(6.0, rel=1e-5)


def test_a_file_in_another_unit_is_refused_and_the_key_is_named(tmp_path: Path) -> None:
    trimesh.creation.box((400.0, 10.0, 10.0)).export(tmp_path / "crate.stl")
    assert "got 400 m; say unit: one of m, cm, mm, in, ft" in refusal(tmp_path / "crate.stl")
    assert "must be 0.001 m to 200 m long, got 0.0004 m" in refusal(tmp_path / "crate.stl", unit="m", scale=1e-6)


@pytest.mark.parametrize(("flipped", "text"), [(range(12), "12 of 12"), ([5], "1 of 12"), ([0, 3, 7], "3 of 12")])
def test_sides_that_are_inside_out_are_turned_and_stated(tmp_path: Path, flipped: list[int], text: str) -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    faces = box.faces.copy()
    faces[list(flipped)] = faces[list(flipped), ::-1]
    trimesh.Trimesh(box.vertices, faces, process=False).export(tmp_path / "crate.ply")
    with pytest.warns(FieldtruthWarning, match=f"crate.ply.*{text} triangles showed their inside and were turned"):
        own = make_object(entry(tmp_path / "crate.ply"), "layout.objects[0]")
    assert volume(own.mesh) == pytest.approx(1.0, rel=1e-6)
    middle = own.mesh.vertices[own.mesh.faces].mean(axis=1) - (0, 0, 0.5)
    assert (np.einsum("ij,ij->i", middle, own.mesh.normals[own.mesh.faces[:, 0]]) > 0).all()


def test_bodies_that_touch_are_turned_together(tmp_path: Path) -> None:
    wall = trimesh.load(bales(tmp_path / "bales.stl"))
    trimesh.Trimesh(wall.vertices, wall.faces[:, ::-1], process=False).export(tmp_path / "inside_out.stl")
    with pytest.warns(FieldtruthWarning, match="72 of 72 triangles"):
        own = make_object(entry(tmp_path / "inside_out.stl"), "layout.objects[0]")
    for mesh in (own.mesh, made(entry(tmp_path / "bales.stl")).mesh):
        assert volume(mesh) == pytest.approx(6 * 1.2 * 0.5 * 0.5, rel=1e-6)


def test_an_open_mesh_is_stated_with_its_edges(tmp_path: Path) -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    top = box.triangles_center[:, 2] > 0.49
    trimesh.Trimesh(box.vertices, box.faces[~top], process=False).export(tmp_path / "tub.ply")
    with pytest.warns(FieldtruthWarning, match="the mesh is open: 4 edges belong to one triangle only"):
        make_object(entry(tmp_path / "tub.ply"), "layout.objects[0]")


def test_a_surface_with_one_side_is_left_as_it_is(tmp_path: Path) -> None:
    turn = 2 * np.pi * np.arange(20) / 20
    across = np.stack([np.cos(turn / 2) * np.cos(turn), np.cos(turn / 2) * np.sin(turn), np.sin(turn / 2)], axis=1)
    middle = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    vertices = np.concatenate([middle + 0.3 * across, middle - 0.3 * across])
    k, after = np.arange(20), np.r_[1:20, 20]  # the last edge joins the first one upside down
    vertices = np.concatenate([vertices[:20], vertices[20:21], vertices[20:], vertices[:1]])
    one, other = np.arange(21), 21 + np.arange(21)
    faces = np.concatenate(
        [np.stack([one[k], other[k], one[after]], 1), np.stack([other[k], other[after], one[after]], 1)]
    )
    trimesh.Trimesh(vertices, faces, process=False).export(tmp_path / "strip.ply")
    with pytest.warns(FieldtruthWarning, match="the mesh is open") as caught:
        make_object(entry(tmp_path / "strip.ply"), "layout.objects[0]")
    assert "turned" not in str(caught[0].message)


def test_classes_by_the_names_of_nodes_and_materials(tmp_path: Path) -> None:
    crown, stem = trimesh.creation.icosphere(radius=1.0), trimesh.creation.box((0.2, 0.2, 2.0))
    crown.apply_translation((0, 0, 3))
    scene = trimesh.Scene()
    for name, part in (("stem_1", stem), ("crown_1", crown)):
        part.apply_transform(Y_UP)
        scene.add_geometry(part, node_name=name, geom_name=name)
    scene.export(tmp_path / "own_tree.glb")
    own = made(entry(tmp_path / "own_tree.glb", label={"stem*": "trunk", "crown*": "treetop"}))
    labels = np.array([own.materials[name].label for name in own.mesh.materials])[own.mesh.material]
    assert (labels == Label.TRUNK).sum() == 12
    assert (labels == Label.TREETOP).sum() == len(crown.faces)
    assert "no class for the node 'crown_1'" in refusal(tmp_path / "own_tree.glb", label={"stem*": "trunk"})
    assert "unknown class 'trnk'" in refusal(tmp_path / "own_tree.glb", label="trnk")


def test_colours_of_vertices_become_materials(tmp_path: Path) -> None:
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    box.visual.face_colors = np.where((box.triangles_center[:, 2] > 0)[:, None], (255, 0, 0, 255), (0, 0, 188, 255))
    box.export(tmp_path / "cube.ply")
    tints = {m.tint for m in made(entry(tmp_path / "cube.ply")).materials.values()}
    reds = sorted(tint[0] for tint in tints)
    assert reds[0] == pytest.approx(0.0, abs=1e-3)
    assert any(tint[2] == pytest.approx(0.5029, abs=0.01) for tint in tints)  # sRGB 188 of 255 is half of the light


def test_a_material_of_ours(tmp_path: Path) -> None:
    own = made(entry(bales(tmp_path / "bales.stl"), label="bench", material="turf_dry"))
    [material] = own.materials.values()
    assert (material.label, material.texture, own.textures) == (Label.BENCH, "turf_dry", {})
    side = np.ptp(own.mesh.uv, axis=0)
    assert side.max() == pytest.approx(3.6 / 0.5, abs=1e-5)  # a repeat of half a metre
    assert "unknown material 'turfdry'; did you mean 'turf_dry'?" in refusal(tmp_path / "bales.stl", material="turfdry")


def gltf(folder: Path, **values: Any) -> Path:
    """A glTF file of text with a buffer and an image beside it."""
    barrel(folder / "drum.gltf")
    document = json.loads((folder / "drum.gltf").read_text())
    for key, value in values.items():
        document[key] = value
    (folder / "drum.gltf").write_text(json.dumps(document))
    return folder / "drum.gltf"


def test_files_that_a_file_names_are_found(tmp_path: Path) -> None:
    path = gltf(tmp_path)
    assert {each.name for each in with_named(path)} == {each.name for each in tmp_path.iterdir()}
    assert len(with_named(path)) > 1
    assert volume(made(entry(path)).mesh) > 0


@pytest.mark.parametrize("uri", ["../secret.bin", "/etc/passwd", "https://example.org/a.bin", "sub/../../secret.bin"])
def test_what_lies_outside_the_folder_is_refused(tmp_path: Path, uri: str) -> None:
    (tmp_path / "secret.bin").write_bytes(b"")
    folder = tmp_path / "in"
    folder.mkdir()
    text = refusal(gltf(folder, buffers=[{"uri": uri, "byteLength": 4}]))
    assert f"names {uri!r}, which must be a file in its folder or below" in text


@pytest.mark.parametrize(
    "files",
    [
        {"a.obj": "mtllib a.mtl\n", "a.mtl": "newmtl m\nmap_kd ../secret.png\n"},
        {"a.obj": "mtllib a.mtl\n", "a.mtl": "newmtl m\n  MAP_KD\t../secret.png\n"},
        {"a.obj": "mtllib\ta.mtl\n", "a.mtl": "newmtl m\nmap_Kd ../secret.png\n"},
        {"a.obj": "mtllib \\\na.mtl\r\n", "a.mtl": "newmtl m\nmap_Kd ../secret.png\n"},
        {"a.obj": "mtllib ../secret.png\n".encode("utf-16")},
        {"a.ply": "ply\nformat ascii 1.0\ncomment my texturefile ../secret.png\nend_header\n"},
        {"a.ply": "ply\nformat ascii 1.0\ncomment no_end_header\nobj_info TextureFile\t../secret.png\nend_header\n"},
        {"a.gltf": '{"images": [{"uri": "data:/../../secret.png"}]}'},
        {"a.gltf": '{"images": [{"uri": "%2E%2E/secret.png"}]}'},
    ],
)  # fmt: skip
def test_what_lies_outside_the_folder_is_found_as_trimesh_finds_it(tmp_path: Path, files: dict[str, Any]) -> None:
    Image.new("RGB", (2, 2)).save(tmp_path / "secret.png")
    folder = tmp_path / "in"
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    assert "secret.png', which must be a file in its folder or below" in refusal(folder / next(iter(files)))


_SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n"


def square(folder: Path, texture: str) -> Path:
    """An OBJ file of a square with a texture."""
    (folder / "a.obj").write_text("mtllib a.mtl\n" + _SQUARE)
    (folder / "a.mtl").write_text(f"newmtl m\nmap_Kd {texture}\n")
    return folder / "a.obj"


@pytest.mark.filterwarnings("ignore:.*the mesh is open")
def test_a_texture_of_obj_has_no_options(tmp_path: Path) -> None:
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "t.png")
    text = refusal(square(tmp_path, "-s 1 1 1 t.png"))
    assert "map_Kd must be the name of an image without options, got '-s 1 1 1 t.png'" in text
    own = make_object(entry(square(tmp_path, "t.png"), collider="none"), "layout.objects[0]")
    assert [image[0, 0].tolist() for image in own.textures.values()] == [[255, 0, 0]]


@pytest.mark.filterwarnings("ignore:.*the mesh is open")
@pytest.mark.parametrize("content", [b"no image", b"\x89PNG\r\n\x1a\n", b""])
def test_a_damaged_texture_is_one_line(tmp_path: Path, content: bytes) -> None:
    path = square(tmp_path, "t.png")
    (tmp_path / "t.png").write_bytes(content)
    assert "a.obj: 't.png', which it names, is no image; or choose a material of ours" in refusal(path)
    assert make_object(entry(path, material="turf_dry", collider="none"), "layout.objects[0]").textures == {}


def test_half_a_texture_and_one_that_is_too_large_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = square(tmp_path, "t.png")
    rows = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    Image.fromarray(rows).save(tmp_path / "t.png")
    whole = (tmp_path / "t.png").read_bytes()
    (tmp_path / "t.png").write_bytes(whole[: len(whole) // 2])
    assert "a.obj: the texture of m cannot be read" in refusal(path)
    (tmp_path / "t.png").write_bytes(whole)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1000)
    assert "'t.png', which it names, is no image" in refusal(path)


def test_a_file_is_scanned_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scanned: list[Path] = []
    named = files._named

    def seen(path: Path) -> Iterator[str]:
        scanned.append(path)
        yield from named(path)

    monkeypatch.setattr(files, "_named", seen)
    path = barrel(tmp_path / "barrel.glb")
    made(entry(path))
    assert scanned == [path]


def test_a_name_with_a_percent_sign_is_a_name_but_in_gltf(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib a%20b.mtl\n" + _SQUARE)
    for name in ("a%20b.mtl", "a b.mtl"):
        (tmp_path / name).write_text("newmtl m\nKd 1 0 0\n")
    assert [each.name for each in with_named(tmp_path / "a.obj")] == ["a.obj", "a%20b.mtl"]
    (tmp_path / "a.gltf").write_text('{"buffers": [{"uri": "a%20b.mtl"}]}')
    assert [each.name for each in with_named(tmp_path / "a.gltf")] == ["a.gltf", "a b.mtl"]


def test_a_missing_texture_is_named(tmp_path: Path) -> None:
    barrel(tmp_path / "drum.obj")
    [image] = tmp_path.glob("*.png")
    image.unlink()
    assert f"{image.name!r}, which it names, is missing" in refusal(tmp_path / "drum.obj")
    assert len(made(entry(tmp_path / "drum.obj", material="turf_dry")).mesh.faces) == 4 * SIDES
    assert "no such file" in refusal(tmp_path / "other.obj")


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("a.glb", b"glTF\x02\0\0\0", "cannot be read as glTF"),
        ("a.gltf", b"[1, 2]", "it is not a JSON object"),
        ("a.gltf", b'{"extensionsRequired": ["KHR_draco_mesh_compression"]}', "export it without compression"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                  b"end_header\n1 2 3\n", "must have triangles, got none"),
        ("a.gltf", b'{"buffers": {"uri": "a.bin"}}', "buffers is not a list of JSON objects"),
        ("a.gltf", b'{"images": ["a.png"]}', "images is not a list of JSON objects"),
        ("a.gltf", b'{"extensionsRequired": null}', "extensionsRequired is not a list of names"),
        ("a.gltf", b"[" * 100_000, "cannot be read as glTF"),
        ("a.stl", b"no mesh", "must have triangles, got none"),
        ("a.ply", b"ply\nformat ascii 1.0\ncomment TextureFile \nelement face 0\nend_header\n", "must have triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "must have a triangle with an area"),
    ],
)  # fmt: skip
def test_files_that_are_no_meshes(tmp_path: Path, name: str, content: bytes, text: str) -> None:
    (tmp_path / name).write_bytes(content)
    assert text in refusal(tmp_path / name)


@pytest.mark.parametrize("stray", ["nan nan nan", "1e7 0 0", "inf 0 0"])
def test_vertices_without_a_triangle_do_not_count(tmp_path: Path, stray: str) -> None:
    """A far one makes the distance below which vertices are one point larger than the box."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    rows = [f"v {stray}", *(f"v {x} {y} {z}" for x, y, z in box.vertices[:, [1, 2, 0]].tolist())]
    rows += [f"f {a} {b} {c}" for a, b, c in (box.faces + 2).tolist()]
    (tmp_path / "a.obj").write_text("\n".join(rows) + "\n")
    own = made(entry(tmp_path / "a.obj"))
    assert volume(own.mesh) == pytest.approx(6.0, rel=1e-6)
    assert np.ptp(own.mesh.vertices, axis=0) == pytest.approx([1.0, 2.0, 3.0], abs=1e-6)


def test_too_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bales(tmp_path / "bales.stl")
    monkeypatch.setattr(files, "MOST_TRIANGLES", 71)
    assert "must have at most 71 triangles, got 72; simplify it" in refusal(path)
    assert files.MOST_BYTES == 1 << 30


def test_a_flat_object_has_no_hull(tmp_path: Path) -> None:
    (tmp_path / "sign.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    with pytest.warns(FieldtruthWarning, match="open"):
        assert "is flat and has no convex hull; choose collider: mesh or none" in refusal(tmp_path / "sign.obj")
    with pytest.warns(FieldtruthWarning, match="open: 4 edges"):
        own = make_object(entry(tmp_path / "sign.obj", collider="mesh"), "layout.objects[0]")
    assert len(own.mesh.colliders) == 2


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"pose": None}, "a place is required"),
        ({"scatter": {"count": 2}}, "and scatter alone"),
        ({"pose": None, "scatter": {}}, "either count or per_hectare is required"),
        ({"file": "a.fbx"}, "must end in .glb, .gltf"),
        ({"file": "Fass groß.obj"}, "other characters"),
        ({"pose": [[1.0]]}, "pose"),
    ],
)
def test_entries_that_are_not_allowed(values: dict[str, Any], text: str) -> None:
    given = {"file": "a.obj", "label": "bench", "pose": [0, 0]} | values
    with pytest.raises(ValidationError, match=text):
        ObjectConfig.model_validate({key: value for key, value in given.items() if value is not None})


def test_usd_says_its_unit_and_axis(tmp_path: Path) -> None:
    usd = pytest.importorskip("pxr.Usd")
    from pxr import Gf, UsdGeom

    stage = usd.Stage.CreateNew(str(tmp_path / "crate.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    box = trimesh.creation.box((100.0, 300.0, 200.0))  # y up: 3 m high
    mesh = UsdGeom.Mesh.Define(stage, "/crate")
    mesh.CreatePointsAttr([Gf.Vec3f(*p) for p in box.vertices.tolist()])
    mesh.CreateFaceVertexCountsAttr([3] * 12)
    mesh.CreateFaceVertexIndicesAttr(box.faces.ravel().tolist())
    mesh.CreateDisplayColorAttr([Gf.Vec3f(0.2, 0.4, 0.1)])
    mesh.AddTranslateOp().Set(Gf.Vec3d(70, 0, 0))
    stage.GetRootLayer().Save()
    own = made(entry(tmp_path / "crate.usda"))
    np.testing.assert_allclose(own.mesh.vertices.min(axis=0), (-1.0, -0.5, 0.0), atol=1e-6)
    np.testing.assert_allclose(own.mesh.vertices.max(axis=0), (1.0, 0.5, 3.0), atol=1e-6)
    assert volume(own.mesh) == pytest.approx(6.0, rel=1e-6)
    [material] = own.materials.values()
    assert material.tint == pytest.approx((0.2, 0.4, 0.1), abs=1e-6)


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ("", "must have triangles, got none"),
        ("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nint[] faceVertexCounts = [3]", "got none"),
        ("int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]", "got none"),
        ("point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\nint[] faceVertexCounts = [3]\n"
         "int[] faceVertexIndices = [0, 1, -1]", "got none"),
    ],
)  # fmt: skip
def test_a_usd_mesh_without_triangles_is_left_out(tmp_path: Path, content: str, text: str) -> None:
    pytest.importorskip("pxr.Usd")
    (tmp_path / "a.usda").write_text(f'#usda 1.0\ndef Mesh "a" {{\n{content}\n}}\n')
    assert text in refusal(tmp_path / "a.usda")


@pytest.mark.parametrize(("interpolation", "u"), [("vertex", [0, 2, 1, 1, 2, 3]), ("faceVarying", [0, 1, 2, 3, 4, 5])])
def test_uv_of_usd_go_by_their_interpolation(tmp_path: Path, interpolation: str, u: list[int]) -> None:
    """Points 0, 2, 1 and 1, 2, 3 are the corners of two triangles; two points more make six, as many as corners."""
    pytest.importorskip("pxr.Usd")
    (tmp_path / "a.usda").write_text(
        '#usda 1.0\ndef Mesh "a" {\npoint3f[] points = [(0,0,0),(1,0,0),(0,1,0),(1,1,0),(9,9,9),(9,9,9)]\n'
        "int[] faceVertexCounts = [3, 3]\nint[] faceVertexIndices = [0, 2, 1, 1, 2, 3]\n"
        "texCoord2f[] primvars:st = [(0,0),(1,0),(2,0),(3,0),(4,0),(5,0)] "
        f'(interpolation = "{interpolation}")\n}}\n'
    )
    [part] = read_file(tmp_path / "a.usda").parts
    assert part.uv is not None
    assert part.uv[part.faces].reshape(-1, 2)[:, 0].tolist() == u


def test_a_repair_of_a_broken_usd_file_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("pxr.Usd")
    (tmp_path / "a.usda").write_text("#usda 1.0\ndef Mesh {")
    assert "cannot be read as USD" in refusal(tmp_path / "a.usda")
    assert issubclass(ConfigurationError, FieldtruthError)


@pytest.mark.parametrize("label", [*(each for each in Label if each not in NOT_OF_WORLDS), 32, 255])
def test_a_surface_of_each_class_reflects(label: int) -> None:
    """Also where no table has its material; a class of the user's own as what is not known."""
    material = Material(name="mine", label=label, texture="mine")
    unknown = reflectance_of(replace(material, label=Label.VOID))
    assert 0 < reflectance_of(material).value < 1 or label == Label.SKY
    assert (reflectance_of(material) == unknown) == (label > 31 or label == Label.VOID)
