# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes of a layout's own: a bale of id 32, with its name and colour in all that reads its run or its world."""

import json
import re
import runpy
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from openpyxl import load_workbook
from PIL import Image

import fieldtruth as ft
from fieldtruth.bag.decode import points
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.classes import CLASSES, OF_ACTORS, Label
from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.datasets import RunDataset, Runs
from fieldtruth.exporters import export
from fieldtruth.exporters.occupancy import Lattice, voxels_of
from fieldtruth.interchange.inventory import COLUMNS, inventory
from fieldtruth.ontology import label_map_of
from fieldtruth.report.shares import ClassShares, shares_table
from fieldtruth.validation.world import allowed_by_name, names_of_objects
from fieldtruth.world.build import check_layout
from fieldtruth.world.classes import CLASSES_FILE, FIRST, as_layout, classes_of, with_own

pytestmark = pytest.mark.usefixtures("small_sky", "small_ground_images")

NAME, COLOUR, ID = "hay_bale", (200, 180, 60), 32
OWN = {NAME: {"colour": list(COLOUR), "label_maps": {"rellis": "vehicle"}}, "crate": {"id": 77}}
VEHICLE = 8  # in RELLIS-3D
LOW = (4.0, 0.7, 0.0)  # corner of the bale
BOX = """\
v -0.5 0 -0.5
v 0.5 0 -0.5
v 0.5 0 0.5
v -0.5 0 0.5
v -0.5 1 -0.5
v 0.5 1 -0.5
v 0.5 1 0.5
v -0.5 1 0.5
f 1 2 3 4
f 8 7 6 5
f 1 5 6 2
f 2 6 7 3
f 3 7 8 4
f 4 8 5 1
"""
RIG = {
    "sensors": [
        {"kind": "lidar", "name": "lidar", "columns": 256, "rings": 16, "rate_hz": 5, "mount": {"xyz": [0, 0, 0.9]}},
        {
            "kind": "stereo", "name": "stereo", "width": 96, "height": 64, "rate_hz": 5, "baseline": 0.1,
            "depth": True, "instances": True, "mount": {"xyz": [0.3, 0, 0.6], "rpy_deg": [0, 90, 0]},
        },
    ]
}  # fmt: skip
MAPPED = ({"rellis": "bush"}, {"rellis": "bush", "rugd": "sign"}, {"rellis": "tree"})
ROUTE = {"metres": {"start": [0, 0], "waypoints": [[3, 0]]}}


def box(low: tuple[float, float, float], side: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Vertices and triangles of a cube by its lowest corner."""
    corners = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * side + low
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([(a, b, c) for q in quads for a, b, c in (q[:3], (q[0], q[2], q[3]))])


@pytest.fixture(scope="module")
def world() -> ft.World:
    """Level ground with a bale of 1 m, left of the way, and a crate on the right."""
    parts = [ft.MeshPart(box(LOW, 1.0), "hay bale", NAME + "_1"), ft.MeshPart(box((4.0, -1.9, 0.0), 0.7), "crate")]
    return ft.World.from_meshes(parts, ground=0.0, classes=OWN)


@pytest.fixture(scope="module")
def folder(world: ft.World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with a short run past them."""
    values = {"name": "own", "environment": "meshes", "seconds": 0.5, "route": ROUTE, "rig": RIG}
    out = tmp_path_factory.mktemp("own")
    return ft.generate(ft.Experiment.model_validate(values), out, world=world, workers=2).parent


@pytest.fixture(scope="module")
def run(folder: Path) -> Run:
    """The run; the world is not at hand."""
    return open_run(folder)


@pytest.fixture(scope="module")
def masks(run: Run) -> list[Any]:
    """Class ids of the left images."""
    found = [image.label for image in run["stereo/left"]]
    assert {ID, 77} <= set(np.unique(found))
    return found


def test_points_of_the_class_are_on_the_box(run: Run) -> None:
    assert run.classes[ID] == (ID, NAME, COLOUR)
    for number, cloud in enumerate(run["lidar"]):
        seen = cloud.xyz[cloud.label == ID]
        pose = run.poses.world_from_base(cloud.stamp_ns) @ run.calibration.base_from("lidar")
        points = seen @ pose[:3, :3].T + pose[:3, 3] - LOW
        assert len(points) > 20, number
        assert (points > -1e-3).all()
        assert (points < 1.0 + 1e-3).all()
        assert np.abs(points - np.rint(points)).min(axis=1).max() < 1e-3  # on one of its sides
        assert {*np.unique(cloud.instance[cloud.label == ID])} == {2}


def test_pixels_have_the_colour_of_the_class(run: Run, masks: list[Any]) -> None:
    topic = run.sensors["stereo/left"].topics["label"]
    for mask, reading in zip(masks, run.messages(topic), strict=True):
        tags = reading.value.data.reshape(*mask.shape, 3)
        assert ((tags == COLOUR).all(axis=2) == (mask == ID)).all()


def test_files_have_name_and_colour(folder: Path, run: Run, masks: list[Any], tmp_path: Path) -> None:
    made = export(folder, "files", out=tmp_path / "files", label_map="rellis")
    text = (made / "README.txt").read_text()
    assert re.search(rf"^ 32  {NAME} +200 180 60$", text, re.M)
    assert re.search(rf"^ 32  {NAME} +8 vehicle, colour 255 255 0$", text, re.M)
    assert re.search(r"^ 77  crate +0 void, colour 0 0 0$", text, re.M)
    for image, mask in zip(run["stereo/left"], masks, strict=True):
        tag, ids = (np.asarray(Image.open(made / f"img_left_{n}/{image.stamp_ns}.png")) for n in ("tag", "label_id"))
        assert ((tag == COLOUR).all(axis=2) == (mask == ID)).all()
        assert ((ids == VEHICLE) == (mask == ID)).all()
    sheet = load_workbook(made / "data_proportion.xlsx")["class shares"]
    (row,) = (row for row in sheet.iter_rows() if row[0].value == ID)
    assert row[1].value == NAME
    assert row[2].fill.start_color.rgb == "FFC8B43C"
    assert row[3].value == sum(np.count_nonzero(mask == ID) for mask in masks)


def test_semantickitti_describes_it(folder: Path, run: Run, tmp_path: Path) -> None:
    made = export(folder, "semantickitti", out=tmp_path / "kitti")
    about = yaml.safe_load((made / "fieldtruth.yaml").read_text())
    assert (about["labels"][ID], about["color_map"][ID]) == (NAME, [60, 180, 200])  # blue first
    assert [*about["learning_map"].values()] == [*range(len(about["labels"]))]
    assert not about["learning_ignore"][about["learning_map"][ID]]
    for number, cloud in enumerate(run["lidar"]):
        label = np.fromfile(made / f"sequences/00/labels/{number:06d}.label", "<u4")
        assert ((label & 0xFFFF) == cloud.label).all()


def test_coco_has_it_as_a_countable_category(folder: Path, masks: list[Any], tmp_path: Path) -> None:
    made = export(folder, "coco", out=tmp_path / "coco")
    data = json.loads((made / "panoptic.json").read_text())
    (row,) = (row for row in data["categories"] if row["id"] == ID)
    assert row == {"id": ID, "name": NAME, "supercategory": "object", "isthing": 1, "color": list(COLOUR)}
    found = [s for a in data["annotations"] if "/left/" in f"/{a['file_name']}" for s in a["segments_info"]]
    areas = [segment["area"] for segment in found if segment["category_id"] == ID]
    assert areas == [np.count_nonzero(mask == ID) for mask in masks]
    assert {segment["object_id"] for segment in found if segment["category_id"] == ID} == {2}


def test_train_ids_have_no_gaps(folder: Path, masks: list[Any], run: Run, tmp_path: Path) -> None:
    made = export(folder, "mmseg", out=tmp_path / "mmseg")
    about = runpy.run_path(str(made / "dataset.py"))["metainfo"]
    train = about["classes"].index(NAME)
    assert about["palette"][train] == list(COLOUR)
    assert len(about["classes"]) == len(CLASSES) - 1 + 2
    for image, mask in zip(run["stereo/left"], masks, strict=True):
        ids = np.asarray(Image.open(made / f"ann_dir/train/own_left_{image.stamp_ns:019d}.png"))
        assert ((ids == train) == (mask == ID)).all()


def test_other_exports_list_it(folder: Path, run: Run, tmp_path: Path) -> None:
    pcd = export(folder, "pcd", out=tmp_path / "pcd")
    assert f"| 32 | {NAME} | 200 180 60 |" in (pcd / "README.md").read_text()
    web = export(folder, "webdataset", out=tmp_path / "web")
    rows = json.loads((web / "dataset.json").read_text())["classes"]
    assert {"id": ID, "name": NAME, "rgb": list(COLOUR)} in rows
    assert f"| 32 | {NAME} | 200 180 60 |" in (folder / "DATASET.md").read_text()


def test_voxels_have_it(world: ft.World) -> None:
    lattice = Lattice(np.array([3.0, -3.0, -0.5]), 0.25, (12, 24, 12))
    found = [part for _, part in voxels_of(world, lattice)]
    cells = np.concatenate([part.coords[part.label == ID] for part in found]) * 0.25 + lattice.origin
    assert len(cells)
    assert (cells >= np.array(LOW) - 0.25 - 1e-9).all()
    assert (cells <= np.array(LOW) + 1.0 + 1e-9).all()


def test_data_sets_name_it(folder: Path, masks: list[Any]) -> None:
    own = RunDataset(folder, items=("mask",), camera="left")
    assert own.classes[ID] == NAME
    assert len(CLASSES) not in own.classes
    assert all((own[k]["mask"] == mask).all() for k, mask in enumerate(masks))
    there = RunDataset(folder, items=("mask",), camera="left", label_map="rellis")
    assert all(((there[k]["mask"] == VEHICLE) == (mask == ID)).all() for k, mask in enumerate(masks))
    assert Runs([own, own]).classes == own.classes


def test_the_report_counts_it(folder: Path, masks: list[Any], tmp_path: Path) -> None:
    page = ft.write_report(folder, out=tmp_path / "page.html").read_text()
    assert page.count("#c8b43c") >= 2  # in the class shares and in the legend of the cloud
    assert re.search(rf"<span>{NAME}</span><small>\d+</small>", page)


def test_the_bag_passes_its_checks(folder: Path, run: Run) -> None:
    checks = ft.validate(folder, quick=True)
    assert all(check.passed is not False for check in checks), checks
    by_name = allowed_by_name(("bench_1", "hay_bale_1"))
    assert by_name[:, ID].all()
    assert not by_name[0, Label.ROCK]
    assert not allowed_by_name(("log_cabin_1",))[0, Label.BUILDING]
    cabin = {"file": "log_cabin.glb", "label": "building", "pose": [1, 2]}
    assert [*names_of_objects({"objects": [cabin, {**cabin, "name": "hut"}, {"file": 3}]})] == ["log_cabin", "hut"]
    by_file = allowed_by_name(("log_cabin_1", "log_1"), {"log_cabin"})
    assert by_file[0].all()
    assert not by_file[1, Label.BUILDING]


def test_a_bag_from_elsewhere_has_them_in_a_file_beside_it(run: Run, tmp_path: Path) -> None:
    bag = Path(shutil.copy(run.bag, tmp_path / "elsewhere.bag"))
    assert open_run(bag).classes == CLASSES
    bag.with_suffix(CLASSES_FILE).write_text(yaml.safe_dump({"classes": as_layout(run.classes)}))
    assert open_run(bag).classes == run.classes
    bag.with_suffix(CLASSES_FILE).write_text("classes: {hay_bale: {id: 3}}")
    with pytest.raises(ConfigurationError, match=r"elsewhere.classes.yaml: classes.hay_bale.id must be an integer"):
        _ = open_run(bag).classes


def test_an_annotated_bag_has_them(run: Run, world: ft.World, tmp_path: Path) -> None:
    lidar = ft.Rig.model_validate({"sensors": RIG["sensors"][:1]})
    made = ft.annotate(run.bag, ft.WorldConfig("park"), rig=lidar, scene=ft.Scene(world), out=tmp_path / "a.bag")
    found = open_run(made)
    assert found.classes[ID] == (ID, NAME, COLOUR)
    topic = next(each.topic for each in run.of(ft.Cloud))
    assert all(ID in points(reading.value)["label"] for reading in found.messages(topic))


def test_scenes_have_it(world: ft.World, tmp_path: Path) -> None:
    glb = ft.write_scene(world, tmp_path / "own.glb", to="gltf").read_bytes()
    text = json.loads(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])
    (material,) = (m for m in text["materials"] if m["extras"]["class_id"] == ID)
    assert material["extras"]["class_name"] == NAME
    obj = ft.write_scene(world, tmp_path / "own_obj", to="obj")
    listed = json.loads((obj / "objects.json").read_text())["materials"].values()
    assert {"class_id": ID, "class_name": NAME} in listed
    (bale,) = (dict(zip(COLUMNS, row, strict=True)) for row in inventory(world) if row[1] == f"{NAME}_1")
    assert bale["classes"] == NAME


def test_usd_has_it(world: ft.World, tmp_path: Path) -> None:
    pxr = pytest.importorskip("pxr.Usd")
    semantics = pytest.importorskip("pxr.UsdSemantics")
    made = ft.write_scene(world, tmp_path / "own_usd", to="usd")
    stage = pxr.Stage.Open(str(next(made.glob("*.usd*"))))
    labels = [semantics.LabelsAPI(prim, "class").GetLabelsAttr().Get() for prim in stage.TraverseAll()]
    assert [NAME] in [list(each) for each in labels if each]


def test_gazebo_has_its_colour_and_id(world: ft.World, tmp_path: Path) -> None:
    made = ft.write_gazebo(world, tmp_path / "gazebo")
    model = next(made.rglob(f"models/{NAME}_1/model.sdf")).read_text()
    assert f"<laser_retro>{ID}</laser_retro>" in model
    script = next(made.rglob("*.material")).read_text()
    emissive = re.search(r"/HAY_BALE\n.*?emissive (\S+) (\S+) (\S+)", script, re.S)
    assert emissive is not None
    np.testing.assert_allclose([float(each) for each in emissive.groups()], np.array(COLOUR) / 255, atol=1e-6)


def test_shares_name_it() -> None:
    table = with_own({"classes": OWN})
    counts = np.zeros((1, len(table)), np.int64)
    counts[0, [1, ID]] = 3, 1
    shares = ClassShares(pixels=counts, points=counts, classes=table)
    assert shares.as_dict()["pixels"] == {"ground": 3, NAME: 1}
    plain = ClassShares(pixels=np.full((1, len(CLASSES)), 2), points=np.zeros((1, len(CLASSES)), np.int64))
    assert [NAME, "25.00", "-"] in [line.split() for line in shares_table({"a": shares, "b": plain}).splitlines()]


def test_ids_follow_the_names_and_colours_are_far_apart() -> None:
    names = [f"class_{k:02}" for k in range(40)]
    table = with_own({"classes": {name: {} for name in names[:-1]} | {names[-1]: {"id": FIRST}}})
    assert [table[FIRST].name, *(row.name for row in table[FIRST + 1 :])] == [names[-1], *names[:-1]]
    assert table == with_own({"classes": {name: {} for name in names[:-1]} | {names[-1]: {"id": FIRST}}})
    colours = np.array([row.rgb for row in table.coloured], float)
    apart = np.linalg.norm(colours[:, None] - colours, axis=2) + np.diag(np.full(len(colours), np.inf))
    assert apart[18:].min() >= 51.0  # the spacing of the colours that are tried
    assert with_own({"classes": as_layout(table)}) == table


def test_label_maps_have_it_as_void_unless_it_says_more() -> None:
    table = with_own({"classes": OWN})
    rellis, rugd = (label_map_of(name).over(table) for name in ("rellis", "rugd"))
    assert (rellis.ids[ID], rellis.ids[77], rugd.ids[ID]) == (VEHICLE, 0, 0)
    assert rellis.ids[: len(CLASSES)].tolist() == label_map_of("rellis").ids.tolist()


def test_buildings_and_fences_are_only_where_they_can_be() -> None:
    of_park, of_site = classes_of("park", {}), classes_of("site", {})
    assert (len(of_park), [row.name for row in of_site[18:]]) == (18, ["building", "fence"])
    assert classes_of("park", {"objects": [{"file": "house.glb"}]}) == CLASSES
    assert of_park.joined(of_site) == of_site == CLASSES.without(*OF_ACTORS)
    assert classes_of("site", {}, actors=True) == CLASSES
    with pytest.raises(ValueError, match=r"32 is a with the .* in one run, and class 32 is b with the"):
        with_own({"classes": {"a": {}}}).joined(with_own({"classes": {"b": {}}}))
    with pytest.raises(ValueError, match=r"32 is a with the colour \[1, 2, 3\] in .* is a with the colour \[1, 2, 4\]"):
        with_own({"classes": {"a": {"colour": [1, 2, 3]}}}).joined(with_own({"classes": {"a": {"colour": [1, 2, 4]}}}))


def test_a_class_is_one_class_of_another_ontology() -> None:
    tables = [with_own({"classes": {"a": {"label_maps": each}}}) for each in MAPPED]
    assert tables[0].joined(tables[1]).others == {32: {"rellis": "bush", "rugd": "sign"}}
    with pytest.raises(ValueError, match=r"class 32, a, is bush of rellis in one run, and tree in another"):
        tables[0].joined(tables[2])


def test_ids_do_not_depend_on_the_order_of_a_mapping() -> None:
    """In which digests do not differ either."""
    tables = [with_own({"classes": {name: {} for name in names}}) for names in (("b", "a", "A c"), ("A c", "a", "b"))]
    assert tables[0] == tables[1]
    assert [row.name for row in tables[0] if row.label >= 32] == ["a", "A c", "b"]


@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({"Tree Top!": {}}, r"layout: classes.Tree Top! must be named by at most 64 letters, digits, "),
        ({"treetop": {}}, r"layout: classes.treetop is the name of another class"),
        ({"trunk": {}}, r"is the name of another class"),
        ({"a b": {}, "a_b": {}}, r"is the name of another class"),
        ({"a": {"id": 31}}, r"classes.a.id must be an integer between 32 and 255, got 31"),
        ({"a": {"id": 40}, "b": {"id": 40}}, r"classes.\w must have an id of its own from 32 to 255"),
        ({"a": {"colour": [0, 0, 0]}}, r"classes.a.colour must differ from that of table"),
        ({"a": {"colour": [0, 0, 256]}}, r"classes.a.colour.* must be .*, got 256"),
        ({"a": {"rgb": [0, 0, 255]}}, r"unknown key 'classes.a.rgb'; .*Available: id, colour, label_maps"),
        ({"a": 3}, r"classes.a must be a mapping with the keys id, colour, label_maps, got 3"),
    ],
)
def test_what_is_wrong_is_one_line(own: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as error:
        check_layout("park", {"classes": own})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("others", "words"),
    [
        ({"rellis": "car"}, r"layout: classes.a.label_maps.rellis: unknown class 'car'; "),
        ({"relis": "vehicle"}, r"unknown label map 'relis'; did you mean 'rellis'"),
    ],
)
def test_unknown_classes_of_others_are_named_before_a_run(others: dict[str, str], words: str) -> None:
    values = {"name": "own", "environment": "park", "layout": {"classes": {"a": {"label_maps": others}}}}
    with pytest.raises(UnknownNameError, match=words):
        ft.Simulation(ft.Experiment.model_validate(values | {"route": ROUTE}))


@pytest.mark.slow
def test_objects_from_files_have_it(tmp_path: Path) -> None:
    """A bale from a file in a small park: generated, exported, and validated in the world that is built again."""
    pytest.importorskip("trimesh")
    (tmp_path / "bale.obj").write_text(BOX, encoding="ascii")
    bale = {"file": str(tmp_path / "bale.obj"), "label": "hay bale", "pose": [4.5, 1.2]}
    layout = {"size": [24, 16], "bushes": 0, "classes": OWN, "objects": [bale]}
    values = {"name": "own", "environment": "park", "seconds": 0.5, "layout": layout, "route": ROUTE, "rig": RIG}
    bag = ft.generate(ft.Experiment.model_validate(values), tmp_path, workers=2)
    assert all(ID in cloud.label for cloud in open_run(bag)["lidar"])
    assert all(check.passed is not False for check in ft.validate(bag))
    with np.load(export(bag, "occupancy", out=tmp_path / "own.npz")) as grid:
        assert grid["names"][ID] == NAME
        assert ID in grid["label"]
    boxes = json.loads((export(bag, "coco", out=tmp_path / "coco", boxes=True) / "instances.json").read_text())
    assert any(row["category_id"] == ID and "box_3d" in row for row in boxes["annotations"])
