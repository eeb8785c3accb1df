# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings for the viewer, read by its own reader, against the bag."""

import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth import cli
from fieldtruth.bag import decode as read
from fieldtruth.core.classes import CLASSES
from fieldtruth.core.errors import OutputError
from fieldtruth.report.viewer import entities, view

pytest.importorskip("rerun", reason="the viewer's package is not installed")

LIDAR = "/world/base_link/os1_lidar"
OPTICAL = "/world/base_link/left_camera/left_camera_optical"


@pytest.fixture(scope="module")
def file(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("view") / "park.rrd"
    view(small_run, save=path)
    return path


@pytest.fixture(scope="module")
def rows(file: Path) -> dict[str, list[dict[str, Any]]]:
    """Rows by entity; a row has components by name, and the stamp [ns] as ``time`` unless it is static."""
    from rerun.chunk import RrdReader

    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for chunk in RrdReader(str(file)).stream():
        batch = chunk.to_record_batch()
        columns = {name: batch.column(name) for name in batch.schema.names}
        for k in range(batch.num_rows):
            row = {name: column[k] for name, column in columns.items()}
            if "time" in row:
                row["time"] = row["time"].value
            found[chunk.entity_path].append(row)
    for listed in found.values():
        listed.sort(key=lambda row: row.get("time") or 0)
    return found


def values(row: dict[str, Any], component: str) -> NDArray[Any]:
    """Array of a component."""
    return np.array(row[component].as_py())


def messages(run: Path, topic: str) -> dict[int, Any]:
    return {r.stamp_ns: r.message for r in read.read_bag(run / "park_1.bag", [topic])}


@pytest.mark.slow
def test_rerun_verifies_the_file(file: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(file)], capture_output=True, text=True, check=True
    )
    assert "1 file verified without error" in done.stdout + done.stderr


def test_clouds_are_in_the_lidar_frame_with_classes(small_run: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    clouds = messages(small_run, "/os1_cloud_node/points")
    shown = rows[f"{LIDAR}/points"]
    assert [row["time"] for row in shown] == list(clouds)
    for row in shown[::5]:
        cloud = read.points(clouds[row["time"]])
        xyz = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=-1)
        assert np.array_equal(values(row, "Points3D:positions").astype(np.float32), xyz)
        assert np.array_equal(values(row, "Points3D:class_ids"), cloud["label"])


def test_robot_poses_match_odometry(small_run: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    odometry = messages(small_run, "/ground_truth/odom")
    shown = [row for row in rows["/world/base_link"] if "Transform3D:translation" in row]
    assert [row["time"] for row in shown] == list(odometry)
    for row in shown[::20]:
        pose = read.pose_matrix(odometry[row["time"]].pose.pose)
        assert np.allclose(values(row, "Transform3D:translation")[0], pose[:3, 3], atol=1e-5)
        columns = values(row, "Transform3D:mat3x3")[0].reshape(3, 3)  # column-major
        assert np.allclose(columns.T, pose[:3, :3], atol=1e-6)


def test_sensor_frames_match_tf_static(small_run: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    static = read.static_transforms(small_run / "park_1.bag")
    for (_, child), transform in static.items():
        [row] = [r for r in rows["/" + entities(static)[child]] if "Transform3D:translation" in r]
        assert np.allclose(values(row, "Transform3D:translation")[0], transform[:3, 3], atol=1e-6)
        assert np.allclose(values(row, "Transform3D:mat3x3")[0].reshape(3, 3).T, transform[:3, :3], atol=1e-6)
    assert entities(static)["left_camera_optical"] == OPTICAL[1:]


def test_images_and_tags_match_the_bag_at_5_hz(small_run: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    photographs = messages(small_run, "/stereo/camera/left/real/compressed")
    tags = messages(small_run, "/stereo/camera/left/tag/img_raw")
    shown = rows[f"{OPTICAL}/photograph"]
    assert [row["time"] for row in shown] == [40_000_000 + k * 200_000_000 for k in range(6)]
    for row in shown:
        blob = bytes(values(row, "EncodedImage:blob")[0].astype(np.uint8))
        assert blob == photographs[row["time"]].data.tobytes()
    row = rows[f"{OPTICAL}/tag"][-1]
    label = read.labels(read.image(tags[row["time"]]))
    assert np.array_equal(values(row, "SegmentationImage:buffer")[0].astype(np.uint8), label.ravel())


def test_pinhole_uses_pixel_corners(small_run: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    info = next(iter(messages(small_run, "/stereo/camera/left/camera_info").values()))
    [row] = [r for r in rows[OPTICAL] if "Pinhole:image_from_camera" in r]
    matrix = values(row, "Pinhole:image_from_camera")[0].reshape(3, 3).T
    true = info.K.reshape(3, 3)
    assert matrix[0, 0] == pytest.approx(true[0, 0], rel=1e-6)
    assert matrix[1, 1] == pytest.approx(true[1, 1], rel=1e-6)
    assert matrix[:2, 2] == pytest.approx([160 / 2, 92 / 2])  # the middle, measured from the corner
    assert values(row, "Pinhole:resolution")[0].tolist() == [160, 92]


def test_annotation_context_matches_the_class_table(rows: dict[str, list[dict[str, Any]]]) -> None:
    [row] = [r for r in rows["/"] if "AnnotationContext:context" in r]
    listed = {
        entry["class_id"]: (entry["class_description"]["info"]["label"], entry["class_description"]["info"]["color"])
        for entry in row["AnnotationContext:context"].as_py()[0]
    }
    for label, name, rgb in CLASSES[:18]:
        if rgb is not None:
            assert listed[int(label)] == (name, int.from_bytes(bytes([*rgb, 255]), "big"))
    assert len(listed) == 17


def test_errors_are_one_line_and_nothing_is_written(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = tmp_path / "taken.rrd"
    taken.write_bytes(b"mine")
    with pytest.raises(OutputError, match=r"taken\.rrd already exists"):
        view(small_run, save=taken)
    assert taken.read_bytes() == b"mine"
    with pytest.raises(OutputError, match=r"its name must end in \.rrd"):
        view(small_run, save=tmp_path / "x.bin")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert cli.main(["view", str(small_run)]) == 2
    assert capsys.readouterr().err.startswith("error: there is no display for the viewer; use --save FILE.rrd ")
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert cli.main(["view", str(small_run), "--save", str(tmp_path / "new.rrd")]) == 2
    assert capsys.readouterr().err == "error: the viewer is not installed; run: pip install 'fieldtruth[view]'\n"
    assert [path.name for path in tmp_path.iterdir()] == ["taken.rrd"]
