# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bags with the topics, types and fields of the paper's data set are read as far as their topics go.

Made from the small run. ``table5`` has the names of the paper's Table 5, and the speeds of two wheels exchanged;
``files`` the names and encodings that the files have. Neither has /tf_static, CameraInfo, odometry or /clock; the
headers of images have the stamp 0, points only x, y, z and intensity.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import html5lib
import numpy as np
import paper_topics
import pytest
from rosbags.rosbag1 import Reader, Writer

import fieldtruth as ft
from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import image, points
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.reader import open_bag
from fieldtruth.cli import main
from fieldtruth.report.page import map as page_map
from fieldtruth.validation.runner import validate

KINDS: Final = ("table5", "files")
WHEELS: Final = [f"/gazebo_client/{wheel}_speed" for wheel in ("front_left", "front_right", "rear_left", "rear_right")]
IMAGES: Final = [name(side) for name in (paper_topics.photograph, paper_topics.tag) for side in paper_topics.SIDES]
KEPT: Final = {table.MODEL_STATES, paper_topics.IMU, paper_topics.NAVSAT, paper_topics.POINTS, *WHEELS, *IMAGES}
NAMES: Final = {
    "table5": {WHEELS[0]: WHEELS[3], WHEELS[3]: WHEELS[0]},
    "files": {
        paper_topics.POINTS: "/os0_cloud_node/points",
        WHEELS[2]: "/gazebo_client/back_left_speed",
        WHEELS[3]: "/gazebo_client/back_right_speed",
        **{paper_topics.photograph(side): paper_topics.photograph(side)[1:] for side in paper_topics.SIDES},
        **{paper_topics.tag(side): f"/stereo/camera/{side}/tag/image_raw" for side in paper_topics.SIDES},
    },
}
SKIPPED: Final = {
    "checksums", "experiment", "clock", "frames", "calibration", "poses", "drive", "rays", "depth", "object classes",
    "lidar and cameras", "world", "retraced clouds", "retraced images", "photographs", "independent rays",
    "wheel odometry", "commands",
}  # fmt: skip


def as_published(message: Any, kind: str) -> None:
    """Change an image or a cloud in place."""
    if hasattr(message, "fields"):
        rows = points(message)
        few = np.zeros(len(rows), [(name, "<f4") for name in ("x", "y", "z", "intensity")])
        for name in few.dtype.names or ():
            few[name] = rows[name]
        message.fields, message.data = message.fields[:4], few.view(np.uint8)
        message.point_step, message.row_step = 16, 16 * len(few)
        message.header.frame_id = "os1_lidar" if kind == "table5" else "os0_lidar"
        return
    message.header.stamp.sec = message.header.stamp.nanosec = 0
    message.header.frame_id = ""
    if kind == "files" and hasattr(message, "encoding"):
        message.encoding, message.data = "8UC3", message.data.reshape(-1, 3)[:, ::-1].reshape(-1).copy()


def make_bag(run: Path, target: Path, kind: str) -> Path:
    writer = Writer(target)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    with Reader(run / "park_1.bag") as source, writer:
        kept = [connection for connection in source.connections if connection.topic in KEPT]
        to = {
            c.id: writer.add_connection(
                NAMES[kind].get(c.topic, c.topic), c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest
            )
            for c in kept
        }
        for connection, stamp, data in source.messages(kept):
            if connection.topic in (paper_topics.POINTS, *IMAGES):
                message = STORE.deserialize_ros1(data, connection.msgtype)
                as_published(message, kind)
                data = bytes(STORE.serialize_ros1(message, connection.msgtype))
            writer.write(to[connection.id], stamp, data)
    return target


@pytest.fixture(scope="module")
def bags(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("published")
    return {kind: make_bag(small_run, folder / f"{kind}.bag", kind) for kind in KINDS}


@pytest.mark.parametrize("kind", KINDS)
def test_validate_skips_what_needs_missing_topics_and_says_why(kind: str, bags: dict[str, Path]) -> None:
    checks = validate(bags[kind])
    assert {check.name for check in checks if check.passed is None} == SKIPPED
    assert all(check.passed is not False and check.text for check in checks), checks
    texts = {check.name: check.text for check in checks}
    assert texts["topics"] == "12 topics"
    assert texts["counts"].startswith("12 topics")
    assert texts["frames"] == "neither /tf_static nor /tf"
    assert "120 of 194 mismatch" in texts["stamps"]  # headers of images
    assert texts["tag colours"] == f"{60 * 92 * 160:,} pixels"
    assert texts["wheels"].startswith("12 readings of four wheels")


def sections_of(page: Path) -> dict[str, str]:
    """Text of each section of a report."""
    root = html5lib.parse(page.read_text("utf-8"), namespaceHTMLElements=False)
    return {str(section.get("id")): " ".join("".join(section.itertext()).split()) for section in root.iter("section")}


@pytest.mark.slow
@pytest.mark.usefixtures("in_park")
def test_the_report_shows_what_there_is(
    bags: dict[str, Path], small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page_map, "WIDTH", 300)  # a large aerial view takes seconds
    own, made = (
        sections_of(ft.write_report(run, out=tmp_path / f"{run.name}.html")) for run in (small_run, bags["files"])
    )
    assert made["classes"] == own["classes"]  # every pixel and point
    assert "Stereo pairs from the run with the class of every pixel" in made["images"]
    assert "blue line is the true path of base_link" in made["path"]
    assert "of the tachometers" in made["motion"]
    assert "The bag has no CameraInfo. The bag has no /tf_static" in made["calibration"]


EXPORTS: Final = {
    "zip": None,
    "tum": None,
    "mcap": None,
    "semantickitti": "has no /tf_static",
    "pcd": "has no /tf_static",
    "kitti": "has no /stereo/camera/left/camera_info, /stereo/camera/right/camera_info",
    "coco": "has no /stereo/camera/left/instances, /stereo/camera/right/instances",
}


@pytest.mark.parametrize("form", EXPORTS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_format_is_written_or_its_missing_topics_are_one_line(
    kind: str, form: str, bags: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if form == "mcap":
        pytest.importorskip("mcap")
    code, missing = main(["export", str(bags[kind]), "--to", form, "--out", str(tmp_path / "out")]), EXPORTS[form]
    assert (code == 0) == (missing is None)
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(error) == (missing is not None)
    assert missing is None or missing in error[0]
    assert (tmp_path / "out").exists() == (missing is None)


@pytest.mark.parametrize("kind", KINDS)
def test_files_have_the_stamps_of_the_bag(
    kind: str, bags: dict[str, Path], exported: Callable[[str], Path], tmp_path: Path
) -> None:
    made, own = ft.export(bags[kind], "files", out=tmp_path / "files"), exported("files")
    for folder in ("img_left", "img_right", "img_left_tag", "img_right_tag", "lidar"):
        names = sorted(path.name for path in (own / folder).iterdir())
        assert sorted(path.name for path in (made / folder).iterdir()) == names
        assert (made / folder / names[-1]).read_bytes() == (own / folder / names[-1]).read_bytes()
    for name in ("imu_data.txt", "GNSS_data.txt", "tacho_data/front_right.txt"):
        assert (made / name).read_bytes() == (own / name).read_bytes()
    assert len((made / "pose_ground_truth.txt").read_text().splitlines()) == 1200  # of model states
    other = "rear_right" if kind == "table5" else "front_left"
    assert (made / f"tacho_data/{other}.txt").read_bytes() == (own / "tacho_data/front_left.txt").read_bytes()


def test_frames_for_training_pair_images_by_the_stamps_of_the_bag(bags: dict[str, Path]) -> None:
    for bag in bags.values():
        frames = ft.RunDataset(bag, items=("image", "mask", "cloud", "labels"))
        assert [frame["stamp_ns"] for frame in frames] == [k * 200_000_000 for k in range(1, 7)]


def test_topics_have_our_names_or_their_own(bags: dict[str, Path]) -> None:
    assert set(ft.count_messages(bags["files"])) == {NAMES["files"].get(name, name) for name in KEPT}
    assert set(ft.open_run(bags["files"]).counts) == KEPT
    for topic in (paper_topics.tag("left"), "/stereo/camera/left/tag/image_raw"):
        first = next(iter(ft.read_bag(bags["files"], [topic])))
        assert first.topic == topic
        assert image(first.message).shape == (92, 160, 3)


def test_a_name_that_the_bag_uses_for_another_topic_stays(small_run: Path, tmp_path: Path) -> None:
    names = (WHEELS[2], "/gazebo_client/back_left_speed")
    with Writer(tmp_path / "both.bag") as target:
        for name in names:
            speed = target.add_connection(name, "std_msgs/msg/Float32", typestore=STORE)
            target.write(speed, 1, bytes(4))
    with open_bag(tmp_path / "both.bag") as bag:
        assert bag.counts == dict.fromkeys(names, 1)
