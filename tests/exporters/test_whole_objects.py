# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Boxes of whole objects, against closed forms, and in COCO's and KITTI's files as other code reads them."""

import json
import shutil
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from export_bags import copied, without
from numpy.typing import NDArray
from sense_worlds import at, box, limbed_tree, make_world

from fieldtruth.bag.decode import points, read_bag, stamp_ns
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.errors import OutputError
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.exporters import export
from fieldtruth.exporters.amodal import WholeObjects
from fieldtruth.exporters.kitti_object import kitti_box
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.wind import leaning_of
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.boxes import object_box
from fieldtruth.world.model import World

F8 = NDArray[np.float64]
HALF: Final = np.array([1.0, 0.5, 0.75])
EYE: Final = transforms.pose((0.0, 0.0, 1.0)) @ OPTICAL
CORNERS: Final = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
LENSES: Final[dict[str, dict[str, Any]]] = {
    "pinhole": {},
    "plumb_bob": {"lens": {"model": "plumb_bob", "coefficients": [-0.1, 0.02, 0.0, 0.0, 0.0]}},
    "fisheye": {
        "lens": {"model": "equidistant", "coefficients": [0.0, 0.0, 0.0, 0.0]},
        "horizontal_fov_deg": 180.0,
        "vertical_fov_deg": 120.0,
    },
}


def camera_of(lens: str = "pinhole") -> CameraConfig:
    given = {"name": "eye", "mount": {"xyz": (0.0, 0.0, 0.0)}, "width": 160, "height": 96, "far": 300.0}
    return CameraConfig.model_validate(given | LENSES[lens])


def world_with(*poses: F8) -> World:
    return make_world([(box(f"block_{k}", HALF.tolist()), pose) for k, pose in enumerate(poses)], height=-900.0)


def projected(config: CameraConfig, pose: F8, scale: float = 1.0) -> F8:
    """Corners (8, 2) [pixel] of the block at a pose, with the pinhole's formula written out."""
    world = (pose[:3, :3] @ (CORNERS * HALF * scale).T).T + pose[:3, 3]
    right, down, ahead = -world[:, 1], 1.0 - world[:, 2], world[:, 0]
    lens = config.projection
    return np.stack([lens.cx + lens.fx * right / ahead, lens.cy + lens.fy * down / ahead], axis=1)


def test_the_box_of_an_object_is_turned_and_scaled_with_it() -> None:
    pose = transforms.pose((3.0, -2.0, 0.5), (10.0, 20.0, 70.0))
    scaled = pose.copy()
    scaled[:3, :3] *= 1.5
    world = world_with(scaled)
    found = object_box(world, world.instances[0])
    assert found.centre == pytest.approx([3.0, -2.0, 0.5])
    assert found.size == pytest.approx(3.0 * HALF)
    assert found.rotation == pytest.approx(pose[:3, :3])
    surface = transforms.transform(pose, CORNERS * HALF * 1.5)
    assert found.contains(surface, 1e-6).all()
    assert not found.contains(surface * 1.0 + 0.01 * (surface - found.centre)).any()
    moved = found.in_frame(transforms.inverse(pose))
    assert moved.centre == pytest.approx(np.zeros(3), abs=1e-9)
    assert moved.rotation == pytest.approx(np.eye(3), abs=1e-9)


def test_bounds_are_those_of_the_corners_whether_inside_the_image_or_not() -> None:
    config = camera_of()
    for xyz in ((8.0, 0.0, 1.0), (6.0, 4.0, 0.2), (5.0, -9.0, 3.0)):
        pose = transforms.pose(xyz, (5.0, -10.0, 35.0))
        bounds = WholeObjects(world_with(pose), config).bounds(2, EYE)
        corners = projected(config, pose)
        assert bounds == pytest.approx([*corners.min(axis=0), *corners.max(axis=0)], abs=1e-3)
    whole = WholeObjects(world_with(at(0.2, 0.0, 0.0), at(-5.0, 0.0, 0.0)), config)
    across, lens = whole.bounds(2, EYE), config.projection
    assert across is not None  # from 5 cm ahead of the camera, 0.25 m below which its upper side is
    assert across[1] == pytest.approx(lens.cy + lens.fy * 0.25 / 1.2, abs=1e-3)
    assert across[3] == pytest.approx(lens.cy + lens.fy * 1.75 / 0.05, rel=1e-4)
    assert whole.bounds(3, EYE) is None


@pytest.mark.parametrize("lens", LENSES)
def test_a_silhouette_is_that_of_the_object_alone(lens: str) -> None:
    config, hidden = camera_of(lens), transforms.pose((9.0, 0.6, 1.0), (0.0, 0.0, 30.0))
    poses = (hidden, at(5.0, 0.0, 0.6), at(0.3, 0.4, 0.0), at(7.0, -5.2, 1.0))
    whole = WholeObjects(world_with(*poses), config)
    together = LabelCamera(config, Scene(world_with(*poses))).label(EYE).instance
    for number, pose in enumerate(poses):
        v, u = np.nonzero(LabelCamera(config, Scene(world_with(pose))).label(EYE).instance == 2)
        found = whole.silhouette(number + 2, EYE)
        assert found.pixels == len(u)
        assert found.bbox == [u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1]
    assert 0 < (together == 2).sum() < 0.8 * whole.silhouette(2, EYE).pixels
    assert whole.silhouette(2, transforms.pose((0.0, 0.0, 1.0), (0.0, 0.0, 180.0)) @ OPTICAL).pixels == 0


def test_a_silhouette_of_a_tree_in_wind_has_its_limbs_where_they_are() -> None:
    world, config, stamp = make_world([(limbed_tree(), at(8.0, 0.0, -1.0))], height=-900.0), camera_of(), 3_050_000_000
    leaning = leaning_of(WindConfig(speed_m_s=20.0, gusts=0.5), world, 1)
    seen = LabelCamera(config, Scene(world, Moving(leaning=leaning))).label(EYE, stamp_ns=stamp).instance == 2
    v, u = np.nonzero(seen)
    blown, still = WholeObjects(world, config, Moving(leaning=leaning)), WholeObjects(world, config)
    found = blown.silhouette(2, EYE, stamp_ns=stamp)
    assert found.pixels == len(u)
    assert found.bbox == [u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1]
    assert found != still.silhouette(2, EYE, stamp_ns=stamp)
    assert len(blown.parts(2, stamp)) == 3


def test_a_silhouette_of_a_class_is_that_of_its_faces() -> None:
    block = box("tree", HALF.tolist(), ["bark"] * 6 + ["leaf"] * 6)
    world, config = make_world([(block, at(6.0, 0.0, 1.0))], height=-900.0), camera_of()
    whole, image = WholeObjects(world, config), LabelCamera(config, Scene(world)).label(EYE)
    labels = {int(material.label) for name, material in world.materials.items() if name in ("bark", "leaf")}
    parts = [whole.silhouette(2, EYE, frozenset({label})).pixels for label in labels]
    assert all((image.label == label).sum() <= part for label, part in zip(labels, parts, strict=True))
    assert sum(parts) > whole.silhouette(2, EYE).pixels > max(parts) - 1


@pytest.mark.parametrize("yaw", [0.0, 30.0, -100.0])
def test_kittis_box_of_an_upright_block(yaw: float) -> None:
    world = world_with(transforms.pose((8.0, 2.0, 1.2), (0.0, 0.0, yaw)))
    found = kitti_box(WholeObjects(world, camera_of()), 2, EYE)
    assert [found.length, found.width, found.height] == pytest.approx(2 * HALF)
    assert found.location == pytest.approx([-2.0, -0.2 + 0.75, 8.0], abs=1e-6)  # right, down to its bottom, ahead
    turn = np.radians(yaw + 90.0) + found.rotation_y  # KITTI counts from the camera's x axis, about y, downwards
    assert np.sin(turn / 2.0) == pytest.approx(0.0, abs=1e-6)


# ---------------------------------------------------------------------------------------------------------------------
# Files of a run


class Scans:
    """Clouds of a run: points (n, 3) [m] in the world and instance ids, by stamp [ns]."""

    def __init__(self, folder: Path) -> None:
        run = open_run(folder)
        self.trajectory = run.trajectory
        self.base_from_lidar = run.rig.lidar.mount.base_from_sensor
        self.at: dict[int, tuple[F8, NDArray[Any]]] = {}
        for reading in read_bag(run.bag, [run.rig.lidar.topic]):
            cloud, stamp = points(reading.message), stamp_ns(reading.message.header)
            xyz = np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float)
            world_from_lidar = self.trajectory.world_from_base(stamp) @ self.base_from_lidar
            self.at[stamp] = transforms.transform(world_from_lidar, xyz), cloud["instance"]


@pytest.fixture(scope="module")
def scans(small_run: Path) -> Scans:
    return Scans(small_run)


@pytest.mark.usefixtures("in_park")
def test_kitti_object_files_as_the_devkit_reads_them(brief_run: Path, scans: Scans, tmp_path: Path) -> None:
    made = export(brief_run, "kitti-object", out=tmp_path / "object", workers=2)
    names = (made / "ImageSets" / "train.txt").read_text().split()
    stamps = [int(line.split()[1]) for line in (made / "stamps.txt").read_text().splitlines()]
    assert len(names) == len(stamps) == 2
    counted = inside = 0
    for name, stamp in zip(names, stamps, strict=True):
        training = made / "training"
        rows = (line.split(": ") for line in (training / "calib" / f"{name}.txt").read_text().splitlines())
        calib = {key: np.array(values.split(), float) for key, values in rows}
        p2, velo = calib["P2"].reshape(3, 4), calib["Tr_velo_to_cam"].reshape(3, 4)
        assert calib["R0_rect"].reshape(3, 3).tolist() == np.eye(3).tolist()
        lidar = np.fromfile(training / "velodyne" / f"{name}.bin", np.float32).reshape(-1, 4)[:, :3]
        camera = lidar @ velo[:, :3].T + velo[:, 3]
        ids = scans.at[stamp][1]
        labels = [line.split() for line in (training / "label_2" / f"{name}.txt").read_text().splitlines()]
        shares = [line.split() for line in (training / "visibility" / f"{name}.txt").read_text().splitlines()]
        assert len(labels) == len(shares) > 10
        for label, (number, share, *_) in zip(labels, shares, strict=True):
            truncated, occluded, alpha, left, top, right, bottom, h, w, l, x, y, z, ry = map(float, label[1:])  # noqa: E741
            assert 0.0 <= truncated < 1.0
            assert 0.0 < float(share) <= 1.0
            assert occluded == (0 if float(share) >= 0.8 else 1 if float(share) >= 0.4 else 2)
            assert -0.51 <= left < right <= 159.51
            assert -0.51 <= top < bottom <= 91.51
            assert np.sin((alpha - ry + np.arctan2(x, z)) / 2.0) == pytest.approx(0.0, abs=1e-3)
            turn = np.array([[np.cos(ry), 0, np.sin(ry)], [0, 1, 0], [-np.sin(ry), 0, np.cos(ry)]])
            own = (camera[ids == int(number)] - [x, y, z]) @ turn
            low, high = np.array([-l / 2, -h, -w / 2]) - 0.01, np.array([l / 2, 0.0, w / 2]) + 0.01
            counted, inside = counted + len(own), inside + int(((own >= low) & (own <= high)).all(axis=1).sum())
            corners = np.array([[a * l / 2, b * h, c * w / 2] for a in (-1, 1) for b in (-1, 0) for c in (-1, 1)])
            image = (corners @ turn.T + [x, y, z]) @ p2[:, :3].T + p2[:, 3]
            if (image[:, 2] > 0.1).all():
                u, v = image[:, 0] / image[:, 2], image[:, 1] / image[:, 2]
                assert u.min() < left + 0.1 or left < -0.4  # the box encloses the object, so its corners the bbox
                assert u.max() > right - 0.1
                assert v.min() < top + 0.1
                assert v.max() > bottom - 0.1
    assert counted > 100
    assert inside == counted


@pytest.mark.usefixtures("in_park")
def test_coco_has_boxes_of_whole_objects_on_request(small_run: Path, scans: Scans, tmp_path: Path) -> None:
    few = copied(
        small_run / "park_1.bag", tmp_path / "few" / "park_1.bag", lambda _, t, data: data if t <= 130_000_000 else None
    )
    shutil.copy(small_run / "experiment.yaml", few.parent)
    made = export(few.parent, "coco", out=tmp_path / "coco", boxes=True, workers=2)
    document = json.loads((made / "instances.json").read_text())
    world_boxes = {each["id"]: each["box_3d"] for each in document["objects"] if "box_3d" in each}
    images = {each["id"]: each for each in document["images"]}
    single = [each for each in document["annotations"] if each["object_id"]]
    assert len(single) > 100
    for each in single:
        x, y, width, height = each["bbox"]
        ax, ay, aw, ah = each["amodal_bbox"]
        assert ax <= x
        assert ay <= y
        assert ax + aw >= x + width
        assert ay + ah >= y + height
        assert each["area"] <= each["amodal_area"] <= aw * ah
        assert each["visibility"] == pytest.approx(each["area"] / each["amodal_area"], abs=1e-6)
        fx, fy, fw, fh = each["amodal_bbox_full"]
        assert fx <= ax + 1.0
        assert fy <= ay + 1.0
        assert fx + fw >= ax + aw - 1.0
        assert fy + fh >= ay + ah - 1.0
        pose, box_3d = np.array(images[each["image_id"]]["world_from_camera"]), each["box_3d"]
        world = world_boxes[each["object_id"]]
        assert transforms.transform(pose, [box_3d["center"]])[0] == pytest.approx(world["center"], abs=1e-6)
        assert pose[:3, :3] @ np.array(box_3d["rotation"]) == pytest.approx(np.array(world["rotation"]), abs=1e-6)
    assert not any("amodal_bbox" in each for each in document["annotations"] if not each["object_id"])
    xyz, ids = next(iter(scans.at.values()))
    met = 0
    for number, world in world_boxes.items():
        own = (xyz[ids == number] - world["center"]) @ np.array(world["rotation"])
        assert (np.abs(own) <= np.array(world["size"]) / 2 + 0.01).all()
        met += len(own)
    assert met > 100


def test_boxes_are_of_coco_alone(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"format 'tum' has no boxes; formats that have: coco$"):
        export(small_run, "tum", out=tmp_path / "a.tum", boxes=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("to", "boxes"), [("coco", True), ("kitti-object", False), ("occupancy", False)])
def test_a_bag_whose_world_is_not_known_has_no_whole_objects(to: str, boxes: bool, short: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"a\.bag has no experiment\.yaml beside it, which says what its world is$"):
        export(short, to, out=tmp_path / "made", boxes=boxes, workers=1)
    assert not list(tmp_path.iterdir())


def test_boxes_need_instance_images(short: Path, tmp_path: Path) -> None:
    bag = without(short, tmp_path / "a.bag", *(f"/stereo/camera/{side}/instances" for side in ("left", "right")))
    for to, boxes in (("coco", True), ("kitti-object", False)):
        with pytest.raises(BagError, match=r"has no /stereo/camera/left/instances.*--extras instances"):
            export(bag, to, boxes=boxes, workers=1)
    assert [path.name for path in tmp_path.iterdir()] == ["a.bag"]


def test_coco_without_boxes_is_as_before(short: Path, tmp_path: Path) -> None:
    document = json.loads((export(short, "coco", out=tmp_path / "coco") / "instances.json").read_text())
    assert all("amodal_bbox" not in each for each in document["annotations"])
    assert all(each.keys() == {"id", "name"} for each in document["objects"])
