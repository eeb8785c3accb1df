# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""PCD files as pypcd4 and Open3D read them, against the bytes of the bag's clouds."""

import filecmp
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_bags import copied, longer, peak_memory, without
from numpy.typing import NDArray
from pypcd4.pypcd4 import PointCloud
from rosbags.rosbag1 import Reader
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointCloud2 as PointCloud2
from rosbags.typesys.stores.ros1_noetic import sensor_msgs__msg__PointField as PointField
from scipy.spatial.transform import Rotation

from fieldtruth.bag import messages as ros
from fieldtruth.bag import reader
from fieldtruth.bag.file import BagError
from fieldtruth.bag.messages import STORE
from fieldtruth.core.errors import OutputError, UnknownNameError
from fieldtruth.exporters import export

POINTS = "/os1_cloud_node/points"
ODOMETRY = "/ground_truth/odom"
IN_BAG = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "column", "label", "instance"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<u2", "<u2", "<u2"],
    }
)
COLOURS = {1: 0x00FF00, 2: 0xFF00FF, 3: 0xFFFF00, 4: 0x0000FF, 5: 0xFF0000, 6: 0x617F38, 7: 0x4C3930, 8: 0xCC6114}
COLOURS |= {9: 0x660066, 10: 0x000000, 11: 0xFFFFFF, 12: 0x3D3B70, 13: 0xFF9999}
"""Colours of the paper's Table 3."""
RELLIS = {1: (3, 0x006600), 2: (4, 0x00FF00), 3: (4, 0x00FF00), 4: (19, 0xFF99CC), 6: (3, 0x006600), 7: (1, 0x6C4014)}
"""Id and colour in RELLIS-3D of the classes of a park, from the data set's own table."""


def messages(bag: Path, topic: str) -> dict[int, Any]:
    """Messages by stamp in the bag [ns]."""
    with Reader(bag) as reader:
        connections = [c for c in reader.connections if c.topic == topic]
        return {ns: STORE.deserialize_ros1(raw, c.msgtype) for c, ns, raw in reader.messages(connections)}


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("pcd")


@pytest.fixture(scope="module")
def clouds(bag: Path) -> dict[int, NDArray[np.void]]:
    return {stamp: cloud.data.view(IN_BAG) for stamp, cloud in messages(bag, POINTS).items()}


def test_files_are_named_by_stamp(made: Path) -> None:
    names = {f"{k * 100_000_000}.pcd" for k in range(1, 13)}
    assert {path.name for path in made.iterdir()} == names | {"README.md"}


def test_pypcd4_reads_clouds_bit_for_bit(made: Path, clouds: dict[int, NDArray[np.void]]) -> None:
    for stamp, cloud in clouds.items():
        file = PointCloud.from_path(made / f"{stamp}.pcd")
        assert file.metadata.points == file.metadata.width == len(cloud) > 20_000
        assert file.fields == ("x", "y", "z", "rgb", "label", "intensity", "ring", "column", "instance")
        for name in IN_BAG.names or ():
            there, here = file.pc_data[name], cloud[name]
            if name == "label":
                there = there.astype("<u2")
            assert there.tobytes() == here.tobytes(), name
        colours = np.vectorize(COLOURS.get)(cloud["label"])
        np.testing.assert_array_equal(file.pc_data["rgb"].view("<u4"), colours)
        np.testing.assert_array_equal(PointCloud.decode_rgb(file.pc_data["rgb"])[:, 0], colours >> 16)


def test_field_types_match_pcl(made: Path) -> None:
    data = PointCloud.from_path(made / "100000000.pcd").metadata
    kinds = dict(zip(data.fields, zip(data.type, data.size, data.count, strict=True), strict=True))
    assert {name: kinds[name] for name in ("x", "y", "z", "rgb", "intensity")} == dict.fromkeys(
        ("x", "y", "z", "rgb", "intensity"), ("F", 4, 1)
    )
    assert kinds["label"] == ("U", 4, 1)  # pcl::PointXYZRGBL
    assert kinds["ring"] == ("U", 2, 1)


def test_viewpoint_is_the_true_lidar_pose(made: Path, bag: Path) -> None:
    truth = messages(bag, ODOMETRY)
    for k in range(1, 13):
        pose = truth[k * 100_000_000].pose.pose
        p, q = pose.position, pose.orientation
        world_from_base = Rotation.from_quat([q.x, q.y, q.z, q.w])
        lidar = np.array([p.x, p.y, p.z]) + world_from_base.apply([0.09, 0.0, 0.826])
        viewpoint = np.array(PointCloud.from_path(made / f"{k * 100_000_000}.pcd").metadata.viewpoint)
        np.testing.assert_allclose(viewpoint[:3], lidar, atol=1e-9)
        np.testing.assert_allclose(viewpoint[3:], np.array([q.w, q.x, q.y, q.z]) * np.sign(q.w), atol=1e-9)


def test_open3d_reads_points_colours_and_labels(made: Path, clouds: dict[int, NDArray[np.void]]) -> None:
    open3d = pytest.importorskip("open3d", reason="pip install open3d")
    stamp = 700_000_000
    cloud = clouds[stamp]
    file = open3d.t.io.read_point_cloud(str(made / f"{stamp}.pcd"))
    xyz = np.column_stack([cloud[axis] for axis in "xyz"])
    np.testing.assert_array_equal(file.point.positions.numpy(), xyz)
    for name in ("label", "intensity", "ring", "column", "instance"):
        np.testing.assert_array_equal(file.point[name].numpy().ravel(), cloud[name], name)
    old = open3d.io.read_point_cloud(str(made / f"{stamp}.pcd"))
    red, green, blue = (255.0 * np.asarray(old.colors)).round().astype(int).T
    np.testing.assert_array_equal(red << 16 | green << 8 | blue, np.vectorize(COLOURS.get)(cloud["label"]))


def test_label_map_changes_labels_and_colours(
    small_run: Path, clouds: dict[int, NDArray[np.void]], tmp_path: Path
) -> None:
    made = export(small_run, "pcd", out=tmp_path / "rellis", label_map="rellis", workers=1)
    file = PointCloud.from_path(made / "1200000000.pcd").pc_data
    cloud = clouds[1_200_000_000]
    seen = [label for label in RELLIS if label in cloud["label"]]
    assert len(seen) >= 4
    for label in seen:
        rows = file[cloud["label"] == label]
        assert set(rows["label"].tolist()) == {RELLIS[label][0]}
        assert set(rows["rgb"].view("<u4").tolist()) == {RELLIS[label][1]}
    assert file["intensity"].tobytes() == cloud["intensity"].tobytes()
    assert "| 4 | tree | 0 255 0 |" in (made / "README.md").read_text()


def test_bytes_do_not_depend_on_workers(small_run: Path, made: Path, tmp_path: Path) -> None:
    again = export(small_run, "pcd", out=tmp_path / "again", workers=1)
    names = sorted(path.name for path in made.iterdir())
    assert sorted(path.name for path in again.iterdir()) == names
    assert filecmp.cmpfiles(made, again, names, shallow=False) == (names, [], [])


@pytest.mark.slow
def test_memory_does_not_grow_with_duration(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader._RECENT, "budget", 0)  # the last chunk only, instead of 16 MB
    peaks = []
    for times in (3, 12):
        long = longer(bag, tmp_path / f"{times}.bag", times, (POINTS, ODOMETRY), ("/tf_static",))
        peaks.append(peak_memory(lambda bag=long: export(bag, "pcd", workers=2)))  # type: ignore[misc]
        assert len(list((tmp_path / f"{times}_pcd").glob("*.pcd"))) == 12 * times
    assert peaks[1] < 1.5 * peaks[0]  # four times as much if all were in memory


# ---------------------------------------------------------------------------------------------------------------------
# Foreign bags


def bare_cloud(stamp_ns: int, intensity: list[float]) -> PointCloud2:
    """A cloud as in the paper: x, y, z and the class as intensity; its second point is not a return."""
    rows = np.zeros(len(intensity), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("pad", "<u4"), ("intensity", "<f4")])
    rows["x"], rows["intensity"] = np.arange(len(rows)), intensity
    rows["y"][1] = np.nan
    fields = [PointField(name, at, 7, 1) for name, at in (("x", 0), ("y", 4), ("z", 8), ("intensity", 16))]
    head = ros.header(0, stamp_ns, "os1_lidar")
    return PointCloud2(head, 1, len(rows), fields, False, 20, 20 * len(rows), rows.view("u1"), False)


def with_clouds(bag: Path, path: Path, make: Any) -> Path:
    """Copy of a bag with replaced clouds."""

    def change(topic: str, stamp_ns: int, data: bytes) -> bytes:
        if topic != POINTS:
            return data
        return bytes(STORE.serialize_ros1(make(stamp_ns), "sensor_msgs/msg/PointCloud2"))

    return copied(bag, path, change)


def test_class_is_read_from_intensity(bag: Path, tmp_path: Path) -> None:
    paper = with_clouds(bag, tmp_path / "paper.bag", lambda stamp: bare_cloud(stamp, [1.0, 2.0, 3.0, 13.0]))
    file = PointCloud.from_path(export(paper, "pcd") / "500000000.pcd")
    assert file.fields == ("x", "y", "z", "rgb", "label", "intensity")
    assert file.pc_data["x"].tolist() == [0.0, 2.0, 3.0]
    assert file.pc_data["label"].tolist() == [1, 3, 13]
    assert file.pc_data["rgb"].view("<u4").tolist() == [0x00FF00, 0xFFFF00, 0xFF9999]


def test_empty_cloud_becomes_an_empty_file(bag: Path, tmp_path: Path) -> None:
    def nothing(stamp_ns: int) -> PointCloud2:
        fields = bare_cloud(stamp_ns, [1.0, 1.0]).fields
        return PointCloud2(ros.header(0, stamp_ns, "os1_lidar"), 1, 0, fields, False, 20, 0, np.zeros(0, "u1"), True)

    empty = with_clouds(bag, tmp_path / "empty.bag", nothing)
    file = PointCloud.from_path(export(empty, "pcd") / "500000000.pcd")
    assert file.metadata.points == file.metadata.width == 0


def test_errors_are_one_line(lean_run: Path, tmp_path: Path) -> None:
    bag = lean_run / "park_1.bag"
    cases = {
        "no_clouds": (
            without(bag, tmp_path / "no_clouds.bag", POINTS),
            r"has no /os1_cloud_node/points; available: /clock",
        ),
        "no_frames": (without(bag, tmp_path / "no_frames.bag", "/tf_static"), "has no /tf_static"),
        "no_poses": (
            without(bag, tmp_path / "no_poses.bag", ODOMETRY, "/gazebo/model_states"),
            "has no /ground_truth/odom",
        ),
        "other": (
            with_clouds(bag, tmp_path / "other.bag", lambda stamp: bare_cloud(stamp, [1.0, 1.0, 87.5])),
            r"other\.bag: /os1_cloud_node/points at \d+ ns: intensity of a point must be a class, .* 22, 23, got 87\.5",
        ),
        "twice": (
            with_clouds(bag, tmp_path / "twice.bag", lambda stamp: bare_cloud(500_000_000, [1.0, 1.0])),
            "two messages of /os1_cloud_node/points have the stamp 500000000 ns",
        ),
        "late": (
            with_clouds(bag, tmp_path / "late.bag", lambda stamp: bare_cloud(10**12 + stamp, [1.0, 1.0])),
            r"no true pose at 1000\d+ ns",
        ),
    }
    for name, (path, words) in cases.items():
        with pytest.raises(BagError, match=words) as caught:
            export(path, "pcd", workers=2)
        assert "\n" not in str(caught.value)
        assert not list(tmp_path.glob(f"*{name}_pcd*"))


def test_two_runs_and_unknown_label_maps_are_refused(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="takes one run, got 2"):
        export([small_run, small_run], "pcd", out=tmp_path / "a")
    with pytest.raises(UnknownNameError, match="unknown label map 'relis'; did you mean 'rellis'"):
        export(small_run, "pcd", out=tmp_path / "a", label_map="relis")
