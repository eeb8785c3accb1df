# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""KITTI odometry folders as pykitti and evo read them, against the bag and closed forms of the robot's geometry."""

import filecmp
import shutil
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evo.core import metrics
from evo.core.trajectory import PosePath3D
from evo.tools import file_interface
from export_bags import copied, longer, peak_memory, without
from numpy.typing import NDArray
from PIL import Image
from rosbags.rosbag1 import Reader
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from fieldtruth.bag import reader
from fieldtruth.bag.file import BagError
from fieldtruth.bag.messages import STORE
from fieldtruth.core.classes import PALETTE
from fieldtruth.exporters import export

F8 = NDArray[np.float64]
POINTS = "/os1_cloud_node/points"
ODOMETRY = "/ground_truth/odom"
PHOTOS = {side: f"/stereo/camera/{side}/real/compressed" for side in ("left", "right")}
INFOS = tuple(f"/stereo/camera/{side}/camera_info" for side in ("left", "right"))
STAMPS = [k * 200_000_000 for k in range(1, 7)]
"""Stamps [ns] common to 10 Hz and 25 Hz within 1.2 s."""
WIDTH, HEIGHT = 160, 92
BASE_FROM_CAM0 = np.array([[0, 0, 1, 0.15], [-1, 0, 0, 0.06], [0, -1, 0, 0.72], [0, 0, 0, 1.0]])
"""The paper's Table 2, and REP-103: x right, y down, z forward."""
IN_BAG = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")]
                  + [(name, "<u2") for name in ("ring", "column", "label", "instance")])  # fmt: skip


@pytest.fixture(scope="module")
def made(small_run: Path, bag: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kitti")
    twin = Path(shutil.copy(bag, folder / "twin.bag"))
    return export([small_run, twin], "kitti", out=folder / "made", workers=2)


@pytest.fixture(scope="module")
def sequence(made: Path) -> Any:
    pykitti = pytest.importorskip("pykitti", reason="pip install pykitti opencv-python-headless", exc_type=ImportError)
    return pykitti.odometry(str(made), "00")


def messages(bag: Path, topic: str) -> dict[int, Any]:
    """Messages by stamp in the bag [ns]."""
    with Reader(bag) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        return {ns: STORE.deserialize_ros1(raw, c.msgtype) for c, ns, raw in reader.messages(connections)}


def world_from_cam0(bag: Path, stamps_ns: list[int]) -> F8:
    """True poses (n, 4, 4) of the left camera at stamps of the odometry."""
    truth, poses = messages(bag, ODOMETRY), []
    for stamp in stamps_ns:
        p, q = truth[stamp].pose.pose.position, truth[stamp].pose.pose.orientation
        world_from_base = np.eye(4)
        world_from_base[:3, :3] = Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix()
        world_from_base[:3, 3] = p.x, p.y, p.z
        poses.append(world_from_base @ BASE_FROM_CAM0)
    return np.array(poses)


def cloud_xyz(bag: Path, stamp_ns: int) -> NDArray[np.float32]:
    cloud = messages(bag, POINTS)[stamp_ns]
    rows = cloud.data.reshape(-1, cloud.point_step)
    return np.ascontiguousarray(rows[:, :12]).view("<f4")


# ---------------------------------------------------------------------------------------------------------------------
# What other readers find


def test_pykitti_reads_clouds_with_common_stamps(sequence: Any, bag: Path) -> None:
    assert len(sequence) == len(sequence.velo_files) == len(sequence.cam2_files) == len(sequence.cam3_files) == 6
    assert [round(time.total_seconds() * 1e9) for time in sequence.timestamps] == [t - STAMPS[0] for t in STAMPS]
    for number, stamp in enumerate(STAMPS):
        assert Path(sequence.velo_files[number]).name == f"{number:06d}.bin"
        scan = sequence.get_velo(number)
        assert np.ascontiguousarray(scan[:, :3]).tobytes() == cloud_xyz(bag, stamp).tobytes()
        assert not scan[:, 3].any()  # the class must not be the reflectance


@pytest.mark.parametrize(("camera", "side"), [("cam2", "left"), ("cam3", "right")])
def test_images_have_the_stamps_of_the_clouds(sequence: Any, bag: Path, camera: str, side: str) -> None:
    photographs = messages(bag, PHOTOS[side])
    for seen, stamp in zip(getattr(sequence, camera), STAMPS, strict=True):
        there = np.asarray(Image.open(BytesIO(photographs[stamp].data.tobytes())))
        assert seen.size == (WIDTH, HEIGHT)
        np.testing.assert_array_equal(np.asarray(seen), there)


def test_poses_are_of_the_left_camera(sequence: Any, made: Path, bag: Path) -> None:
    world = world_from_cam0(bag, STAMPS)
    first = np.linalg.inv(world[0]) @ world
    np.testing.assert_allclose(np.array(sequence.poses), first, atol=1e-9)
    assert first[-1][2, 3] > 0.25  # it drives forward, along z
    from_file = file_interface.read_kitti_poses_file(made / "poses" / "00.txt")
    assert from_file.check()[0]
    error = metrics.APE(metrics.PoseRelation.full_transformation)
    error.process_data((PosePath3D(poses_se3=list(first)), from_file))
    assert error.get_statistic(metrics.StatisticsType.max) < 1e-8


def test_calibration_matches_closed_form(sequence: Any) -> None:
    calib = sequence.calib
    fx = WIDTH / 2 / np.tan(np.radians(69.0 / 2))
    fy = HEIGHT / 2 / np.tan(np.radians(42.0 / 2))
    pinhole = [[fx, 0, (WIDTH - 1) / 2], [0, fy, (HEIGHT - 1) / 2], [0, 0, 1]]
    for camera in range(4):
        np.testing.assert_allclose(getattr(calib, f"K_cam{camera}"), pinhole, rtol=1e-9)
    assert calib.b_rgb == pytest.approx(0.12, abs=1e-9)
    assert calib.b_gray == pytest.approx(0.12, abs=1e-9)
    lidar = np.array([[4.0, 1.0, -0.5, 1.0], [10.0, -3.0, 2.0, 1.0]])
    in_cam0 = (calib.T_cam0_velo @ lidar.T).T
    # The LiDAR is 6 cm behind, 10.6 cm above and 6 cm to the right of the left camera.
    np.testing.assert_allclose(in_cam0[:, :3], [[-0.94, 0.394, 3.94], [3.06, -2.106, 9.94]], atol=1e-9)
    np.testing.assert_allclose((calib.T_cam3_velo @ lidar.T).T - in_cam0, [[-0.12, 0, 0, 0]] * 2, atol=1e-9)


@pytest.mark.parametrize(("camera", "side"), [(2, "left"), (3, "right")])
def test_points_project_onto_pixels_of_their_class(sequence: Any, bag: Path, camera: int, side: str) -> None:
    tags = messages(bag, f"/stereo/camera/{side}/tag/img_raw")
    depths = messages(bag, f"/stereo/camera/{side}/depth")
    clouds = messages(bag, POINTS)
    agree, compared = [], 0
    for number, stamp in enumerate(STAMPS):
        label = clouds[stamp].data.view(IN_BAG)["label"]
        colours = tags[stamp].data.reshape(HEIGHT, WIDTH, 3)
        code = colours.astype(np.int64) @ [1, 256, 65536]
        inside = maximum_filter(code, 3) == minimum_filter(code, 3)
        depth = depths[stamp].data.view("<f4").reshape(HEIGHT, WIDTH)
        scan = np.column_stack([sequence.get_velo(number)[:, :3], np.ones(len(label))])
        projected = scan @ (_pinhole(sequence, camera) @ getattr(sequence.calib, f"T_cam{camera}_velo")[:3]).T
        z = projected[:, 2]
        u, v = np.rint(projected[:, :2] / np.where(z == 0.0, 1.0, z)[:, None]).astype(np.int64).T
        shown = (z > 0.5) & (u >= 0) & (u < WIDTH) & (v >= 0) & (v < HEIGHT)
        u, v, z, label = u[shown], v[shown], z[shown], label[shown]
        # Points behind the camera's foreground are not in the image.
        same_surface = inside[v, u] & (np.abs(depth[v, u] - z) < 0.02 * z)
        agree.append((PALETTE[label] == colours[v, u]).all(axis=1)[same_surface])
        compared += int(shown.sum())
    assert sum(map(len, agree)) > 0.3 * compared > 1000
    assert np.concatenate(agree).mean() > 0.995


def _pinhole(sequence: Any, camera: int) -> F8:
    matrix: F8 = getattr(sequence.calib, f"K_cam{camera}")
    return matrix


def test_several_runs_become_sequences(made: Path) -> None:
    files = sorted(
        str(path.relative_to(made / "sequences" / "00")) for path in (made / "sequences" / "00").rglob("*.*")
    )
    assert len(files) == 2 + 3 * 6
    same = filecmp.cmpfiles(made / "sequences" / "00", made / "sequences" / "01", files, shallow=False)
    assert same == (files, [], [])
    assert filecmp.cmp(made / "poses" / "00.txt", made / "poses" / "01.txt", shallow=False)
    readme = (made / "README.md").read_text()
    assert "| 00 | park_1 | 6 | 200000000 | 0 ms |" in readme
    assert "| 01 | twin | 6 | 200000000 | 0 ms |" in readme


def test_bytes_do_not_depend_on_workers(small_run: Path, made: Path, tmp_path: Path) -> None:
    again = export(small_run, "kitti", out=tmp_path / "again", workers=1)
    names = [str(path.relative_to(again)) for path in again.rglob("*.*") if path.name != "README.md"]
    assert len(names) == 1 + 2 + 3 * 6
    assert filecmp.cmpfiles(made, again, names, shallow=False) == (names, [], [])


@pytest.mark.slow
def test_memory_does_not_grow_with_duration(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader._RECENT, "budget", 0)  # the last chunk only, instead of 16 MB
    peaks = []
    for times in (2, 6):
        topics = (POINTS, ODOMETRY, *PHOTOS.values())
        long = longer(bag, tmp_path / f"{times}.bag", times, topics, ("/tf_static", *INFOS))
        peaks.append(peak_memory(lambda run=long: export(run, "kitti", workers=2)))  # type: ignore[misc]
        assert len(list((tmp_path / f"{times}_kitti").rglob("*.bin"))) > 5 * times
    assert peaks[1] < 1.5 * peaks[0]  # three times as much if all were in memory


# ---------------------------------------------------------------------------------------------------------------------
# Foreign bags


def test_nearest_photographs_are_used_without_common_stamps(bag: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp_ns: int, data: bytes) -> bytes | None:
        return None if topic == POINTS and stamp_ns in STAMPS else data

    made = export(copied(bag, tmp_path / "odd.bag", change), "kitti")
    images = [stamp - 120_000_000 for stamp in STAMPS]  # 20 ms before a cloud; others are 20 ms after it
    photographs = messages(bag, PHOTOS["right"])
    for number, stamp in enumerate(images):
        seen = Image.open(made / "sequences" / "00" / "image_3" / f"{number:06d}.png")
        there = Image.open(BytesIO(photographs[stamp].data.tobytes()))
        np.testing.assert_array_equal(np.asarray(seen), np.asarray(there))
        scan = np.fromfile(made / "sequences" / "00" / "velodyne" / f"{number:06d}.bin", "<f4").reshape(-1, 4)
        assert scan[:, :3].tobytes() == cloud_xyz(bag, stamp + 20_000_000).tobytes()
    world = world_from_cam0(bag, images)
    poses = np.loadtxt(made / "poses" / "00.txt").reshape(-1, 3, 4)
    np.testing.assert_allclose(poses, (np.linalg.inv(world[0]) @ world)[:, :3], atol=1e-9)
    assert "| 00 | odd | 6 | 80000000 | 20 ms |" in (made / "README.md").read_text()


def test_clouds_without_labels_are_exported(bag: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp_ns: int, data: bytes) -> bytes:
        if topic != POINTS:
            return data
        cloud: Any = STORE.deserialize_ros1(data, "sensor_msgs/msg/PointCloud2")
        bare = PointCloud2(
            cloud.header,
            cloud.height,
            cloud.width,
            cloud.fields[:3],
            cloud.is_bigendian,
            cloud.point_step,
            cloud.row_step,
            cloud.data,
            cloud.is_dense,
        )
        return bytes(STORE.serialize_ros1(bare, "sensor_msgs/msg/PointCloud2"))

    made = export(copied(bag, tmp_path / "bare.bag", change), "kitti")
    scan = np.fromfile(made / "sequences" / "00" / "velodyne" / "000000.bin", "<f4").reshape(-1, 4)
    assert scan[:, :3].tobytes() == cloud_xyz(bag, STAMPS[0]).tobytes()


@pytest.mark.parametrize(
    ("topics", "words"),
    [
        ([POINTS], f"has no {POINTS}; available: /clock"),
        ([PHOTOS["right"]], f"has no {PHOTOS['right']}; available: "),
        (["/tf_static"], "has no /tf_static; available: "),
        ([INFOS[0]], f"has no {INFOS[0]}; available: "),
        ([ODOMETRY, "/gazebo/model_states"], f"has no {ODOMETRY}, nor /gazebo/model_states in its place; available: "),
    ],
)
def test_missing_topics_are_reported_in_one_line(bag: Path, tmp_path: Path, topics: list[str], words: str) -> None:
    less = without(bag, tmp_path / "less.bag", *topics)
    with pytest.raises(BagError, match=words) as caught:
        export(less, "kitti")
    assert "\n" not in str(caught.value)
    assert [path.name for path in tmp_path.iterdir()] == ["less.bag"]


def test_photographs_far_from_clouds_are_refused(bag: Path, tmp_path: Path) -> None:
    def change(topic: str, stamp_ns: int, data: bytes) -> bytes:
        if topic not in PHOTOS.values():
            return data
        return data[:4] + struct.pack("<2L", *divmod(stamp_ns + 10**12, 10**9)) + data[12:]

    with pytest.raises(BagError, match=r"has no cloud with photographs of both cameras within 0\.5 s"):
        export(copied(bag, tmp_path / "apart.bag", change), "kitti")
