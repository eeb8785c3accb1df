# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI folders read by semantic-kitti-api and pykitti, against the bag and its images."""

import filecmp
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import paper_topics
import pytest
import yaml
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import KDTree
from semantickitti_reader import (
    F8,
    LIDAR_ONLY,
    lidar_poses,
    read_calib,
    read_poses,
    read_scan,
    rewritten,
    true_lidar_poses,
)

from fieldtruth.bag.decode import depth, labels, points, read_bag, stamp_ns
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.exporters import export

RELLIS = [0, 3, 4, 4, 19, 34, 3, 1, 5, 9, 9, 9, 5, 9, 6, 7]


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("semantickitti")


@pytest.fixture(scope="module")
def clouds(bag: Path) -> list[Any]:
    return [reading.message for reading in read_bag(bag, [paper_topics.POINTS])]


@pytest.fixture(scope="module")
def description(made: Path) -> dict[str, Any]:
    return read_description(made)


def read_description(folder: Path) -> dict[str, Any]:
    value: dict[str, Any] = yaml.safe_load((folder / "fieldtruth.yaml").read_text(encoding="utf-8"))
    return value


# ---------------------------------------------------------------------------------------------------------------------
# Clouds and labels


def test_points_classes_and_instances_match_the_bag(made: Path, clouds: list[Any]) -> None:
    folder = made / "sequences/00"
    assert sorted(p.name for p in (folder / "velodyne").iterdir()) == [f"{i:06d}.bin" for i in range(len(clouds))]
    assert sorted(p.name for p in (folder / "labels").iterdir()) == [f"{i:06d}.label" for i in range(len(clouds))]
    for number, cloud in enumerate(clouds):
        scan, label = read_scan(folder, number)
        rows = points(cloud)
        for column, axis in enumerate("xyz"):
            assert np.array_equal(scan[:, column], rows[axis])
        assert not scan[:, 3].any()
        assert np.array_equal(label & 0xFFFF, rows["label"])
        assert np.array_equal(label >> 16, rows["instance"])
    assert len(np.unique(label & 0xFFFF)) > 5
    assert (label >> 16).max() > 15


def test_api_reader_reads_clouds_and_labels(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    laserscan = pytest.importorskip("auxiliary.laserscan", reason="pip install --no-deps semantic-kitti-api")
    scan = laserscan.SemLaserScan(sem_color_dict=description["color_map"], project=True)
    scan.open_scan(str(made / "sequences/00/velodyne/000003.bin"))
    scan.open_label(str(made / "sequences/00/labels/000003.label"))
    scan.colorize()
    rows = points(clouds[3])
    assert np.array_equal(scan.points, np.stack([rows[axis] for axis in "xyz"], axis=1))
    assert np.array_equal(scan.sem_label, rows["label"])
    assert np.array_equal(scan.inst_label, rows["instance"])
    # The tool draws sem_label_color[..., ::-1], which must be the flat colours.
    drawn = np.rint(255 * scan.sem_label_color[..., ::-1])
    assert np.array_equal(drawn, PALETTE[rows["label"]])


def test_api_evaluation_scores_true_labels_as_perfect(made: Path, description: dict[str, Any]) -> None:
    evaluation = pytest.importorskip("auxiliary.np_ioueval", reason="pip install --no-deps semantic-kitti-api")
    remap = np.zeros(max(description["learning_map"]) + 100, np.int32)
    remap[list(description["learning_map"])] = list(description["learning_map"].values())
    ignore = [number for number, ignored in description["learning_ignore"].items() if ignored]
    evaluator = evaluation.iouEval(len(description["learning_map_inv"]), ignore)
    for number in range(3):
        label = remap[read_scan(made / "sequences/00", number)[1] & 0xFFFF]
        evaluator.addBatch(label, label)
    _, by_class = evaluator.getIoU()
    present = np.unique(label)
    assert np.allclose(by_class[present], 1.0)
    assert not set(ignore) & set(present.tolist())


# ---------------------------------------------------------------------------------------------------------------------
# Poses, calibration, times


def test_api_lidar_poses_match_the_true_poses(made: Path, bag: Path, description: dict[str, Any]) -> None:
    true = true_lidar_poses(bag)
    assert np.allclose(read_poses(made / "sequences/00")[0], np.eye(4), atol=1e-12)
    assert np.linalg.norm(true[-1, :3, 3] - true[0, :3, 3]) > 0.3  # it moves, so that a wrong sign is detected
    assert np.allclose(true[0] @ lidar_poses(made / "sequences/00"), true, atol=1e-9)
    first = np.reshape(description["sequences"][0]["world_from_first_cam0"], (3, 4))
    transform = read_calib(made / "sequences/00")["Tr"]
    assert np.allclose(np.vstack([first, [0, 0, 0, 1]]) @ transform, true[0], atol=1e-9)


def test_static_objects_align_in_the_world(made: Path) -> None:
    """Independent of the true poses: furniture in the first and the last cloud coincides."""
    folder, poses = made / "sequences/00", lidar_poses(made / "sequences/00")

    def furniture(number: int, pose: F8) -> F8:
        scan, label = read_scan(folder, number)
        still = scan[np.isin(label & 0xFFFF, (8, 11)), :3].astype(np.float64)
        return still @ pose[:3, :3].T + pose[:3, 3]

    last = len(poses) - 1
    first = KDTree(furniture(0, poses[0]))
    moved, unmoved = (np.median(first.query(furniture(last, pose))[0]) for pose in (poses[last], poses[0]))
    backwards = np.median(first.query(furniture(last, np.linalg.inv(poses[last])))[0])
    assert moved < 0.5 * unmoved < 0.5 * backwards


@pytest.fixture(scope="module")
def fine(fine_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export of a run whose images are as fine as the rings of its LiDAR."""
    return export(fine_run, "semantickitti", out=tmp_path_factory.mktemp("fine") / "out")


@pytest.mark.parametrize(("camera", "side"), [("P0", "left"), ("P1", "right"), ("P2", "left"), ("P3", "right")])
def test_clouds_project_onto_their_classes_in_the_images(fine: Path, fine_run: Path, camera: str, side: str) -> None:
    folder, calib, bag = fine / "sequences/00", read_calib(fine / "sequences/00"), fine_run / "park_1.bag"
    images = {stamp_ns(r.message.header): r.message for r in read_bag(bag, [paper_topics.tag(side)])}
    depths = {stamp_ns(r.message.header): r.message for r in read_bag(bag, [paper_topics.depth(side)])}
    right, wrong, projected_count = 0, 0, 0
    for number, reading in enumerate(read_bag(bag, [paper_topics.POINTS])):
        stamp = stamp_ns(reading.message.header)
        if stamp not in images:
            continue
        scan, label = read_scan(folder, number)
        seen = labels(np.asarray(images[stamp].data).reshape(images[stamp].height, -1, 3))
        far = depth(depths[stamp])
        projected = (calib[camera] @ calib["Tr"] @ np.c_[scan[:, :3], np.ones(len(scan))].T)[:3]
        ahead = projected[2] > 0.5
        u, v = np.rint(projected[:2, ahead] / projected[2, ahead]).astype(int)
        inside = (u >= 0) & (u < seen.shape[1]) & (v >= 0) & (v < seen.shape[0])
        u, v, z, own = u[inside], v[inside], projected[2, ahead][inside], (label & 0xFFFF)[ahead][inside]
        # Exclude silhouettes, and points that are hidden from the camera.
        plain = (maximum_filter(seen, 5) == minimum_filter(seen, 5))[v, u]
        judged = plain & (np.abs(far[v, u] - z) < 0.02 * z)
        right += int((seen[v, u] == own)[judged].sum())
        wrong += int((seen[v, u] != own)[judged].sum())
        projected_count += len(u)
    assert right > 0.45 * projected_count > 5000
    assert wrong < 0.001 * right  # twigs and blades thinner than a pixel


def test_calibration_matches_camera_info(made: Path, bag: Path) -> None:
    calib = read_calib(made / "sequences/00")
    for side, names in (("left", ("P0", "P2")), ("right", ("P1", "P3"))):
        info = next(read_bag(bag, [paper_topics.camera_info(side)])).message
        assert all(np.allclose(calib[name][:3].ravel(), info.P, rtol=1e-12, atol=0) for name in names)
    # x right, y down, z forward; the LiDAR is 6 cm behind, 10.6 cm above and 6 cm to the right of the left camera.
    assert np.allclose(
        calib["Tr"], np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.106], [1, 0, 0, -0.06], [0, 0, 0, 1]]), atol=1e-9
    )


def test_times_match_the_stamps(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    lines = (made / "sequences/00/times.txt").read_text().split()
    first = description["sequences"][0]["first_stamp_ns"]
    assert [first + round(float(line) * 1e9) for line in lines] == [stamp_ns(cloud.header) for cloud in clouds]
    assert float(lines[0]) == 0.0


def test_pykitti_reads_the_sequence(made: Path, bag: Path, clouds: list[Any], tmp_path: Path) -> None:
    pykitti = pytest.importorskip("pykitti", reason="pip install pykitti opencv-python-headless", exc_type=ImportError)
    (tmp_path / "sequences").symlink_to(made / "sequences")
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses/00.txt").symlink_to(made / "sequences/00/poses.txt")  # as in KITTI
    data = pykitti.odometry(str(tmp_path), "00")
    assert len(data) == len(data.velo_files) == len(data.poses) == len(clouds)
    assert np.array_equal(data.get_velo(2)[:, 0], points(clouds[2])["x"])
    assert data.calib.b_rgb == pytest.approx(0.12)
    assert data.timestamps[5].total_seconds() == pytest.approx(0.5)
    true = true_lidar_poses(bag)
    of_lidar = [np.linalg.inv(data.calib.T_cam0_velo) @ pose @ data.calib.T_cam0_velo for pose in data.poses]
    assert np.allclose(of_lidar, np.linalg.inv(true[0]) @ true, atol=1e-9)


# ---------------------------------------------------------------------------------------------------------------------
# Images


def test_images_are_photographs_with_the_stamp_of_a_cloud(made: Path, bag: Path, clouds: list[Any]) -> None:
    stamps = [stamp_ns(cloud.header) for cloud in clouds]
    for side, name in (("left", "image_2"), ("right", "image_3")):
        jpeg = {stamp_ns(r.message.header): r.message.data for r in read_bag(bag, [paper_topics.photograph(side)])}
        numbers = [number for number, stamp in enumerate(stamps) if stamp in jpeg]
        assert len(numbers) == 6
        assert sorted(p.name for p in (made / "sequences/00" / name).iterdir()) == [f"{i:06d}.png" for i in numbers]
        for number in numbers:
            written = np.asarray(Image.open(made / "sequences/00" / name / f"{number:06d}.png"), int)
            true = np.asarray(Image.open(BytesIO(bytes(jpeg[stamps[number]]))), int)
            assert written.shape == true.shape == (92, 160, 3)
            assert np.abs(written - true).mean() < 1.0  # two decoders of the same JPEG


# ---------------------------------------------------------------------------------------------------------------------
# fieldtruth.yaml


def test_configuration_describes_the_classes(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    assert description["labels"] == {int(c.label): c.name for c in CLASSES[:18]}
    assert description["color_map"][8] == [20, 97, 204]  # blue first
    counts = np.sum([np.bincount(points(cloud)["label"], minlength=18) for cloud in clouds], axis=0)
    assert description["content"] == {i: counts[i] / counts.sum() for i in range(18)}
    assert description["sequences"][0] | {"world_from_first_cam0": None} == {
        "run": "park_1",
        "clouds": len(clouds),
        "points": counts.sum(),
        "images": 12,
        "first_stamp_ns": stamp_ns(clouds[0].header),
        "world_from_first_cam0": None,
    }
    assert [number for number, ignored in description["learning_ignore"].items() if ignored] == [0, 14, 15, 16, 17]
    assert description["learning_map"] == {i: i for i in range(18)}
    assert description["split"] == {"train": [0], "valid": [], "test": []}


def test_label_map_changes_only_the_classes(bag: Path, made: Path, tmp_path: Path) -> None:
    other = export(bag, "semantickitti", out=tmp_path / "rellis", label_map="rellis")
    for name in ("poses.txt", "calib.txt", "times.txt", "velodyne/000004.bin", "image_2/000003.png"):
        assert filecmp.cmp(other / "sequences/00" / name, made / "sequences/00" / name, shallow=False)
    (_, ours), (_, theirs) = read_scan(made / "sequences/00", 4), read_scan(other / "sequences/00", 4)
    assert np.array_equal(theirs & 0xFFFF, np.array(RELLIS)[ours & 0xFFFF])
    assert np.array_equal(theirs >> 16, ours >> 16)
    description = read_description(other)
    assert description["labels"][34] == "rubble"
    assert description["color_map"][1] == [20, 64, 108]
    learning, inverse = description["learning_map"], description["learning_map_inv"]
    assert list(learning) == list(description["labels"])
    assert sorted(learning.values()) == list(range(20))  # a network's outputs have no gaps
    assert {inverse[train]: train for train in inverse} == learning
    learnt = {inverse[train] for train, ignored in description["learning_ignore"].items() if not ignored}
    assert learnt == {1, 3, 4, 5, 9, 19, 34}
    assert sum(description["content"].values()) == pytest.approx(1.0)
    assert description["content"][4] == pytest.approx(sum(read_description(made)["content"][i] for i in (2, 3)))


def test_splits_are_by_sequence(bag: Path, tmp_path: Path) -> None:
    short = [rewritten(bag, tmp_path / f"short_{k}.bag", LIDAR_ONLY) for k in range(4)]
    both = export(short[:2], "semantickitti", out=tmp_path / "two")
    assert sorted(p.name for p in (both / "sequences").iterdir()) == ["00", "01"]
    assert read_description(both)["split"] == {"train": [0], "valid": [1], "test": []}
    four = read_description(export(short, "semantickitti", out=tmp_path / "four"))
    assert four["split"] == {"train": [0, 1], "valid": [2], "test": [3]}
    assert four["content"] == read_description(both)["content"]
