# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI folders, read as semantic-kitti-api and pykitti read them, against the bag and against its images."""

import filecmp
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from PIL import Image
from rosbags.rosbag1 import Writer
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from fieldtruth.bag import topics as table
from fieldtruth.bag.calibration import StaticFrames, read_calibration
from fieldtruth.bag.decode import depth, labels, points, read_bag, stamp_ns, static_transforms
from fieldtruth.bag.reader import BagError, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.bag.types import STORE
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.exporters import export

F8 = NDArray[np.float64]
RELLIS = [0, 3, 4, 4, 19, 34, 3, 1, 5, 9, 9, 9, 5, 9, 6, 7]
LIDAR_ONLY = (table.POINTS, table.TF_STATIC, table.ODOMETRY)


@pytest.fixture(scope="module")
def bag(small_run: Path) -> Path:
    return small_run / "park_1.bag"


@pytest.fixture(scope="module")
def made(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(small_run, "semantickitti", out=tmp_path_factory.mktemp("semantickitti") / "made", workers=2)


@pytest.fixture(scope="module")
def clouds(bag: Path) -> list[Any]:
    return [reading.message for reading in read_bag(bag, [table.POINTS])]


@pytest.fixture(scope="module")
def description(made: Path) -> dict[str, Any]:
    return read_description(made)


def read_description(folder: Path) -> dict[str, Any]:
    value: dict[str, Any] = yaml.safe_load((folder / "fieldtruth.yaml").read_text(encoding="utf-8"))
    return value


def read_scan(folder: Path, number: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Points (n, 4) and labels (n,), as every reader of the format takes them from the files."""
    scan = np.fromfile(folder / "velodyne" / f"{number:06d}.bin", np.float32).reshape(-1, 4)
    return scan, np.fromfile(folder / "labels" / f"{number:06d}.label", np.uint32)


def read_calib(folder: Path) -> dict[str, F8]:
    """calib.txt as generate_sequential.py reads it: every line 12 numbers, completed to (4, 4)."""
    matrices = {}
    for line in (folder / "calib.txt").read_text().splitlines():
        key, content = line.strip().split(":")
        values = [float(v) for v in content.split()]
        assert len(values) == 12
        matrices[key] = np.vstack([np.reshape(values, (3, 4)), [0, 0, 0, 1]])
    return matrices


def read_poses(folder: Path) -> F8:
    """Poses (n, 4, 4) of cam0 in poses.txt."""
    rows = np.loadtxt(folder / "poses.txt", ndmin=2).reshape(-1, 3, 4)
    return np.concatenate([rows, np.broadcast_to([[[0.0, 0.0, 0.0, 1.0]]], (len(rows), 1, 4))], axis=1)


def lidar_poses(folder: Path) -> F8:
    """Poses of the LiDAR as semantic-kitti-api computes them: inv(Tr) @ pose @ Tr."""
    transform = read_calib(folder)["Tr"]
    return np.linalg.inv(transform) @ read_poses(folder) @ transform


def true_lidar_poses(bag: Path) -> F8:
    """world_from_lidar (n, 4, 4) at the clouds' stamps, by SciPy from the numbers in the bag's messages."""
    at = {}
    for reading in read_bag(bag, [table.ODOMETRY]):
        p, q = reading.message.pose.pose.position, reading.message.pose.pose.orientation
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        pose[:3, 3] = p.x, p.y, p.z
        at[stamp_ns(reading.message.header)] = pose
    base_from_lidar = static_transforms(bag)["base_link", "os1_lidar"]
    stamps = [stamp_ns(reading.message.header) for reading in read_bag(bag, [table.POINTS])]
    return np.array([at[stamp] @ base_from_lidar for stamp in stamps])


def rewritten(bag: Path, target: Path, topics: Collection[str], **changes: Callable[[Any], None]) -> Path:
    """Copy some topics of a bag; ``points`` and ``camera_info`` change the messages of those kinds."""
    with open_bag(bag) as stored, Writer(target) as writer:
        types = {topic: stored.msgtypes[topic] for topic in sorted(topics)}
        connections = {topic: writer.add_connection(topic, kind, typestore=STORE) for topic, kind in types.items()}
        for raw in stored.messages(sorted(topics)):
            data = raw.data
            change = changes.get(raw.topic.rpartition("/")[2])
            if change is not None:
                message = STORE.deserialize_ros1(data, raw.msgtype)
                change(message)
                data = bytes(STORE.serialize_ros1(message, raw.msgtype))
            writer.write(connections[raw.topic], raw.stamp_ns, data)
    return target


# ---------------------------------------------------------------------------------------------------------------------
# Clouds and labels


def test_points_classes_and_objects_are_the_bags_frame_by_frame(made: Path, clouds: list[Any]) -> None:
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


def test_the_apis_own_reader_takes_it(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    laserscan = pytest.importorskip("auxiliary.laserscan", reason="pip install --no-deps semantic-kitti-api")
    scan = laserscan.SemLaserScan(sem_color_dict=description["color_map"], project=True)
    scan.open_scan(str(made / "sequences/00/velodyne/000003.bin"))
    scan.open_label(str(made / "sequences/00/labels/000003.label"))
    scan.colorize()
    rows = points(clouds[3])
    assert np.array_equal(scan.points, np.stack([rows[axis] for axis in "xyz"], axis=1))
    assert np.array_equal(scan.sem_label, rows["label"])
    assert np.array_equal(scan.inst_label, rows["instance"])
    # The tool draws sem_label_color[..., ::-1]: that must be our flat colours.
    drawn = np.rint(255 * scan.sem_label_color[..., ::-1])
    assert np.array_equal(drawn, PALETTE[rows["label"]])


def test_the_apis_own_evaluation_finds_perfect_predictions_perfect(made: Path, description: dict[str, Any]) -> None:
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


def test_the_apis_lidar_poses_are_the_true_ones(made: Path, bag: Path, description: dict[str, Any]) -> None:
    true = true_lidar_poses(bag)
    assert np.allclose(read_poses(made / "sequences/00")[0], np.eye(4), atol=1e-12)
    assert np.linalg.norm(true[-1, :3, 3] - true[0, :3, 3]) > 0.3  # it drives: a wrong sign would show
    assert np.allclose(true[0] @ lidar_poses(made / "sequences/00"), true, atol=1e-9)
    first = np.reshape(description["sequences"][0]["world_from_first_cam0"], (3, 4))
    transform = read_calib(made / "sequences/00")["Tr"]
    assert np.allclose(np.vstack([first, [0, 0, 0, 1]]) @ transform, true[0], atol=1e-9)


def test_what_stands_still_stands_still_in_the_world(made: Path) -> None:
    """No truth of ours here: furniture in the first and in the last cloud lies at the same place."""
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


@pytest.mark.parametrize(("camera", "side"), [("P0", "left"), ("P1", "right"), ("P2", "left"), ("P3", "right")])
def test_clouds_fall_upon_their_classes_in_the_images(made: Path, bag: Path, camera: str, side: str) -> None:
    folder, calib = made / "sequences/00", read_calib(made / "sequences/00")
    images = {stamp_ns(r.message.header): r.message for r in read_bag(bag, [table.tag(side)])}
    depths = {stamp_ns(r.message.header): r.message for r in read_bag(bag, [table.depth(side)])}
    right, wrong, looked_at = 0, 0, 0
    for number, reading in enumerate(read_bag(bag, [table.POINTS])):
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
        # Not at silhouettes, and not what stands behind something for the camera, which sits elsewhere.
        plain = (maximum_filter(seen, 5) == minimum_filter(seen, 5))[v, u]
        judged = plain & (np.abs(far[v, u] - z) < 0.02 * z)
        right += int((seen[v, u] == own)[judged].sum())
        wrong += int((seen[v, u] != own)[judged].sum())
        looked_at += len(u)
    assert right > 0.45 * looked_at > 5000
    assert wrong < 0.001 * right  # twigs and blades below a pixel's width


def test_calibration_is_that_of_camera_info(made: Path, bag: Path) -> None:
    calib = read_calib(made / "sequences/00")
    for side, names in (("left", ("P0", "P2")), ("right", ("P1", "P3"))):
        info = next(read_bag(bag, [table.camera_info(side)])).message
        assert all(np.allclose(calib[name][:3].ravel(), info.P, rtol=1e-12, atol=0) for name in names)
    # x right, y down, z forward; the LiDAR stands 6 cm behind and 10.6 cm above the left camera, 6 cm to its right.
    assert np.allclose(
        calib["Tr"], np.array([[0, -1, 0, 0.06], [0, 0, -1, -0.106], [1, 0, 0, -0.06], [0, 0, 0, 1]]), atol=1e-9
    )


def test_times_are_the_stamps(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    lines = (made / "sequences/00/times.txt").read_text().split()
    first = description["sequences"][0]["first_stamp_ns"]
    assert [first + round(float(line) * 1e9) for line in lines] == [stamp_ns(cloud.header) for cloud in clouds]
    assert float(lines[0]) == 0.0


def test_pykitti_reads_it(made: Path, bag: Path, clouds: list[Any], tmp_path: Path) -> None:
    pykitti = pytest.importorskip("pykitti", reason="pip install pykitti opencv-python-headless", exc_type=ImportError)
    (tmp_path / "sequences").symlink_to(made / "sequences")
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses/00.txt").symlink_to(made / "sequences/00/poses.txt")  # where KITTI itself has them
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


def test_images_are_the_photographs_at_a_clouds_stamp(made: Path, bag: Path, clouds: list[Any]) -> None:
    stamps = [stamp_ns(cloud.header) for cloud in clouds]
    for side, name in (("left", "image_2"), ("right", "image_3")):
        jpeg = {stamp_ns(r.message.header): r.message.data for r in read_bag(bag, [table.photograph(side)])}
        numbers = [number for number, stamp in enumerate(stamps) if stamp in jpeg]
        assert len(numbers) == 6
        assert sorted(p.name for p in (made / "sequences/00" / name).iterdir()) == [f"{i:06d}.png" for i in numbers]
        for number in numbers:
            written = np.asarray(Image.open(made / "sequences/00" / name / f"{number:06d}.png"), int)
            true = np.asarray(Image.open(BytesIO(bytes(jpeg[stamps[number]]))), int)
            assert written.shape == true.shape == (184, 320, 3)
            assert np.abs(written - true).mean() < 1.0  # two decoders of the same JPEG


# ---------------------------------------------------------------------------------------------------------------------
# fieldtruth.yaml


def test_the_configuration_describes_our_classes(made: Path, clouds: list[Any], description: dict[str, Any]) -> None:
    assert description["labels"] == {c.label.value: c.name for c in CLASSES}
    assert description["color_map"][8] == [20, 97, 204]  # blue first
    counts = np.sum([np.bincount(points(cloud)["label"], minlength=16) for cloud in clouds], axis=0)
    assert description["content"] == {i: counts[i] / counts.sum() for i in range(16)}
    assert description["sequences"][0] | {"world_from_first_cam0": None} == {
        "run": "park_1",
        "clouds": len(clouds),
        "points": counts.sum(),
        "images": 12,
        "first_stamp_ns": stamp_ns(clouds[0].header),
        "world_from_first_cam0": None,
    }
    assert [number for number, ignored in description["learning_ignore"].items() if ignored] == [0, 14, 15]
    assert description["learning_map"] == {i: i for i in range(16)}
    assert description["split"] == {"train": [0], "valid": [], "test": []}


def test_another_ontology_changes_classes_and_nothing_else(bag: Path, made: Path, tmp_path: Path) -> None:
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


def test_several_runs_are_sequences_and_splits_take_them_whole(bag: Path, tmp_path: Path) -> None:
    short = [rewritten(bag, tmp_path / f"short_{k}.bag", LIDAR_ONLY) for k in range(4)]
    both = export(short[:2], "semantickitti", out=tmp_path / "two")
    assert sorted(p.name for p in (both / "sequences").iterdir()) == ["00", "01"]
    assert read_description(both)["split"] == {"train": [0], "valid": [1], "test": []}
    four = read_description(export(short, "semantickitti", out=tmp_path / "four"))
    assert four["split"] == {"train": [0, 1], "valid": [2], "test": [3]}
    assert four["content"] == read_description(both)["content"]


# ---------------------------------------------------------------------------------------------------------------------
# Other bags


def test_a_bag_without_cameras_has_the_optical_frame_of_the_lidar_as_cam0(bag: Path, tmp_path: Path) -> None:
    alone = rewritten(bag, tmp_path / "alone.bag", LIDAR_ONLY)
    folder = export(alone, "semantickitti") / "sequences/00"
    assert folder.parents[1] == tmp_path / "alone_semantickitti"
    assert sorted(p.name for p in folder.iterdir()) == ["calib.txt", "labels", "poses.txt", "times.txt", "velodyne"]
    calib = read_calib(folder)
    assert np.array_equal(calib["Tr"], [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    assert all(np.array_equal(calib[f"P{i}"], np.eye(4)) for i in range(4))
    true = true_lidar_poses(bag)
    assert np.allclose(true[0] @ lidar_poses(folder), true, atol=1e-9)
    assert read_poses(folder)[-1][2, 3] > 0.3  # forward is z


def test_the_papers_clouds_have_the_class_as_intensity_and_no_objects(bag: Path, made: Path, tmp_path: Path) -> None:
    def as_published(cloud: Any) -> None:
        rows = points(cloud)
        few = np.zeros(len(rows) + 1, [(name, "<f4") for name in ("x", "y", "z", "intensity")])
        for name in ("x", "y", "z", "intensity"):
            few[name][1:] = rows[name]
        few["z"][0] = np.nan  # a miss
        cloud.fields = cloud.fields[:4]
        cloud.width, cloud.point_step, cloud.row_step = len(few), 16, 16 * len(few)
        cloud.data = few.view(np.uint8)

    published = rewritten(bag, tmp_path / "published.bag", LIDAR_ONLY, points=as_published)
    folder = export(published, "semantickitti") / "sequences/00"
    for number in (0, 7):
        (scan, label), (true_scan, true_label) = read_scan(folder, number), read_scan(made / "sequences/00", number)
        assert np.array_equal(scan, true_scan)
        assert np.array_equal(label, true_label & 0xFFFF)


@pytest.mark.parametrize(
    ("dropped", "message"),
    [
        ((table.POINTS,), f"has no {table.POINTS}; available: "),
        ((table.TF_STATIC,), f"has no {table.TF_STATIC}; available: "),
        ((table.ODOMETRY, table.MODEL_STATES), f"has no {table.ODOMETRY}; available: "),
        ((table.camera_info("right"),), f"has no {table.camera_info('right')}; available: "),
    ],
)
def test_what_is_missing_is_named(bag: Path, tmp_path: Path, dropped: tuple[str, ...], message: str) -> None:
    kept = {*LIDAR_ONLY, *map(table.camera_info, table.SIDES)} - {*dropped}
    poor = rewritten(bag, tmp_path / "poor.bag", kept)
    with pytest.raises(BagError, match=message):
        export(poor, "semantickitti")
    assert [p.name for p in tmp_path.iterdir()] == ["poor.bag"]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        (
            "label",
            16,
            r"the cloud at 100000000 ns in .*odd\.bag: label must be a class from 0 to 15, got 16",
        ),
        ("x", None, r"must have x, y, z and label or intensity, got y, z, "),
    ],
)
def test_odd_clouds_are_told_apart(bag: Path, tmp_path: Path, field: str, value: int | None, message: str) -> None:
    def odd(cloud: Any) -> None:
        rows = points(cloud).copy()
        if value is None:
            cloud.fields = [each for each in cloud.fields if each.name != field]
        else:
            rows[field][7] = value
        cloud.data = rows.view(np.uint8)

    strange = rewritten(bag, tmp_path / "odd.bag", LIDAR_ONLY, points=odd)
    with pytest.raises(BagError, match=message):
        export(strange, "semantickitti")


def test_the_number_of_workers_does_not_matter(small_run: Path, made: Path, tmp_path: Path) -> None:
    other = export(small_run, "semantickitti", out=tmp_path / "other", workers=1)

    def files(folder: Path) -> Iterator[Path]:
        return (p.relative_to(folder) for p in sorted(folder.rglob("*")) if p.is_file())

    names = list(files(made))
    assert list(files(other)) == names
    assert all(filecmp.cmp(other / name, made / name, shallow=False) for name in names)


# ---------------------------------------------------------------------------------------------------------------------
# Calibration


def moved(x: float, yaw_deg: float = 0.0) -> F8:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw_deg, degrees=True).as_matrix()
    pose[0, 3] = x
    return pose


def test_frames_are_found_along_their_parents() -> None:
    static = StaticFrames(
        {
            "base_link": ("base_footprint", moved(10.0)),
            "mast": ("base_link", moved(1.0, 90.0)),
            "lidar": ("mast", moved(2.0)),
            "stray": ("nowhere", moved(0.0)),
        },
        "a.bag",
    )
    # The mast stands 1 m ahead and is turned to the left, so that the LiDAR, 2 m along it, is 2 m to the left.
    assert np.allclose(static.base_from("lidar")[:3, 3], [1.0, 2.0, 0.0])
    assert np.allclose(static.base_from("lidar")[:3, 0], [0.0, 1.0, 0.0])
    assert np.allclose(static.base_from("base_footprint")[:3, 3], [-10.0, 0.0, 0.0])
    assert np.array_equal(static.base_from("base_link"), np.eye(4))
    with pytest.raises(BagError, match=r"a\.bag has no frame 'velodyne'; available: base_footprint, base_link, "):
        static.base_from("velodyne")
    with pytest.raises(BagError, match="does not connect 'stray' with 'base_link'"):
        static.base_from("stray")
    circle = StaticFrames({"a": ("b", moved(1.0)), "b": ("a", moved(1.0)), "base_link": ("b", moved(1.0))}, "a.bag")
    with pytest.raises(BagError, match="has a cycle at "):
        circle.base_from("a")


def test_the_calibration_of_a_run_is_the_papers(small_run: Path) -> None:
    calibration = read_calibration(open_run(small_run))
    assert (calibration.width, calibration.height) == (320, 184)
    assert np.allclose(calibration.base_from_lidar[:3], np.c_[np.eye(3), [0.09, 0.0, 0.826]])
    axes = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # right, down, forward
    for side, y in (("left", 0.06), ("right", -0.06)):
        assert np.allclose(calibration.base_from_optical[side][:3], np.c_[axes, [0.15, y, 0.72]], atol=1e-12)
    assert calibration.projection["right"][0, 3] / calibration.projection["right"][0, 0] == pytest.approx(-0.12)
    assert np.allclose(calibration.base_from("GNSS_link")[:3, 3], [0.10, 0.0, 0.89])


def test_a_camera_without_a_projection_is_refused(bag: Path, tmp_path: Path) -> None:
    def blind(message: Any) -> None:
        message.P = np.zeros(12)

    kept = {*LIDAR_ONLY, *map(table.camera_info, table.SIDES)}
    strange = rewritten(bag, tmp_path / "blind.bag", kept, camera_info=blind)
    with pytest.raises(
        BagError, match=r"left/camera_info of .*blind.bag has an invalid projection: P has fx 0\.0, fy 0\.0"
    ):
        export(strange, "semantickitti")
