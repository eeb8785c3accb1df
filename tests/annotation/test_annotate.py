# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Annotating a run without its images and clouds reproduces them: every photograph, label and point, bit by bit."""

import json
import shutil
import struct
import subprocess
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from annotate_bags import (
    ODOMETRY,
    STATES,
    STATIC,
    Kind,
    Message,
    in_file,
    sensed,
    standard,
    stored,
    ties_reversed,
    write,
)
from rosbags.rosbag1 import Writer

from fieldtruth import annotation, cli
from fieldtruth.bag import decode as read
from fieldtruth.bag.decode import image, read_bag, static_transforms
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.experiment.files import load_experiment
from fieldtruth.experiment.rig import Rig, paper_rig
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.sensing import Camera
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.sensors.lidar.config import LidarConfig

END = 320_000_000  # [ns]; 8 images of either camera, 3 clouds
WALL = 1_600_000_000 * 10**9  # [ns]
LEFT_TAG = "/stereo/camera/left/tag/img_raw"
pytestmark = pytest.mark.usefixtures("in_park")


Annotate = Callable[..., Path]


@pytest.fixture(scope="module")
def annotate(park: SensorWorld) -> Annotate:
    """Annotate in the scene that the tests share."""
    return partial(annotation.annotate, scene=park.scene)


@pytest.fixture(scope="module")
def original(small_run: Path) -> list[Message]:
    return [message for message in stored(open_run(small_run).bag) if message.stamp <= END]


@pytest.fixture(scope="module")
def rig(small_run: Path) -> Rig:
    experiment = open_run(small_run).experiment
    assert experiment is not None
    return experiment.rig


@pytest.fixture(scope="module")
def cameras(rig: Rig) -> Rig:
    """The rig without its LiDAR."""
    return rig.with_sensors(LidarConfig, enabled=False)


@pytest.fixture(scope="module")
def stripped(original: list[Message], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run without images and clouds, uncompressed, ties in the opposite order, with foreign topics added."""
    odd = Kind("/odd", "my_msgs/msg/Odd", "int32 a  # a comment\n", "0123456789abcdef" * 2, "/a", None)
    others = [
        *(Message(30_000_000 + k, odd._replace(callerid=f"/node_{k % 2}"), struct.pack("<i", k)) for k in range(9)),
        Message(40_000_000, standard("/late", "std_msgs/msg/Float32", "/late", 1), struct.pack("<f", 0.5)),
        Message(1_500_000_000, odd._replace(topic="/after"), struct.pack("<i", 7)),
    ]
    messages = [message for message in original if not sensed(message.kind.topic)] + others
    messages.sort(key=lambda message: message.stamp)
    return write(tmp_path_factory.mktemp("stripped") / "stripped.bag", ties_reversed(messages))


@pytest.fixture(scope="module")
def annotated(annotate: Annotate, stripped: Path, rig: Rig) -> Path:
    return annotate(stripped, "park", rig=rig, workers=2)


def seen(messages: list[Message]) -> list[tuple[int, str, bytes]]:
    return [(stamp, kind.topic, data) for stamp, kind, data in messages if sensed(kind.topic)]


def test_annotation_reproduces_every_image_and_cloud_bit_for_bit(annotated: Path, original: list[Message]) -> None:
    expected = seen(original)
    assert len(expected) == 8 * 10 + 3
    assert seen(stored(annotated)) == expected


def test_all_other_messages_are_copied_unchanged(annotated: Path, stripped: Path) -> None:
    carried = [message for message in stored(annotated) if not sensed(message.kind.topic)]
    assert carried == stored(stripped)
    assert len({kind for _, kind, _ in carried if kind.topic == "/odd"}) == 2


def test_the_bag_is_written_in_the_order_of_time(annotated: Path, stripped: Path, small_run: Path) -> None:
    rows = in_file(annotated)
    # at equal stamps the original messages come first, in their own order; then the new ones, in that of a run
    assert rows == sorted(rows, key=lambda row: (row[0], sensed(row[1])))
    assert [row for row in rows if not sensed(row[1])] == in_file(stripped)
    run = [row for row in in_file(open_run(small_run).bag) if row[0] <= END]
    assert [row for row in rows if sensed(row[1])] == [row for row in run if sensed(row[1])]


def test_the_input_is_only_read_and_no_other_files_remain(
    annotate: Annotate, stripped: Path, cameras: Rig, tmp_path: Path
) -> None:
    bag = Path(shutil.copy(stripped, tmp_path / "x.bag"))
    bag.chmod(0o444)
    before = sha256(bag.read_bytes()).digest(), bag.stat().st_mtime_ns
    annotate(bag, "park", rig=cameras)
    assert (sha256(bag.read_bytes()).digest(), bag.stat().st_mtime_ns) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.bag", "x_annotated.bag"]


@pytest.mark.slow
def test_same_bytes_for_any_number_of_workers_and_after_an_interruption(
    annotate: Annotate, annotated: Path, stripped: Path, rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    def again(rig: Rig) -> Path:
        return annotate(stripped, "park", rig=rig, workers=1, out=tmp_path / "new" / "y.bag")

    with monkeypatch.context() as patch:
        patch.setattr(annotation, "merge_bags", stop)
        for each in (rig.with_sensors(StereoConfig, jpeg_quality=10), rig):
            with pytest.raises(KeyboardInterrupt):
                again(each)
    assert not (tmp_path / "new" / "y.bag").exists()
    slices = sorted((tmp_path / "new").rglob("*.bag"))
    assert [path.name for path in slices] == ["000000.bag", "000001.bag", "000002.bag"]  # none of the other rig
    slices[0].unlink()
    renders = Counting(monkeypatch)
    assert again(rig).read_bytes() == annotated.read_bytes()
    assert renders.count == 2 * 3  # the missing slice has three of the five stamps
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["y.bag"]


class Counting:
    """Counts the calls of Camera.render."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.count = 0
        render = Camera.render

        def counted(camera: Camera, pose: Any, robot: Any = None, stamp_ns: int = 0) -> Any:
            self.count += 1
            return render(camera, pose, robot, stamp_ns)

        patch.setattr(Camera, "render", counted)


@pytest.mark.parametrize("source", [ODOMETRY, STATES])
@pytest.mark.parametrize(
    "packed", [Writer.CompressionFormat.BZ2, pytest.param(Writer.CompressionFormat.LZ4, marks=pytest.mark.slow)]
)
def test_either_source_of_poses_and_any_compression_is_read(
    annotate: Annotate, source: str, packed: Writer.CompressionFormat, original: list[Message], rig: Rig, tmp_path: Path
) -> None:
    messages = [message for message in original if message.kind.topic == source and message.stamp <= 120_000_000]
    bag = annotate(write(tmp_path / "x.bag", messages, packed), "park", rig=rig, out=tmp_path / "y.bag")
    assert seen(stored(bag)) == seen([message for message in original if message.stamp <= 120_000_000])


def test_a_scan_that_ends_after_the_last_pose_is_left_out(
    annotate: Annotate, original: list[Message], rig: Rig, tmp_path: Path
) -> None:
    messages = [m for m in original if m.kind.topic == ODOMETRY and m.stamp < 300_000_000]
    sweeping = rig.lidar.model_copy(update={"spinning": True, "columns": 16})
    clouds = paper_rig(cameras=StereoConfig(enabled=False), lidar=sweeping)
    bag = annotate(write(tmp_path / "x.bag", messages), "park", rig=clouds)
    assert [stamp for stamp, *_ in seen(stored(bag))] == [100_000_000]  # the scan at 0.2 s would end at 0.3 s


@pytest.mark.slow
def test_stamps_of_a_wall_clock(annotate: Annotate, original: list[Message], cameras: Rig, tmp_path: Path) -> None:
    # 3 ms off the grid of the cameras: images are at multiples of 40 ms, and there is a pose every millisecond
    shift = WALL + 3_000_000
    messages = [m._replace(stamp=m.stamp + shift) for m in original if m.kind.topic == STATES and m.stamp < 10**8]
    bag = annotate(write(tmp_path / "x.bag", messages), "park", rig=cameras)
    tags = list(read_bag(bag, [LEFT_TAG]))
    assert [tag.stamp_ns - WALL for tag in tags] == [40_000_000, 80_000_000]
    assert [read.stamp_ns(tag.message.header) for tag in tags] == [tag.stamp_ns for tag in tags]
    moved = {at: annotate_at(annotate, original, at, cameras, tmp_path) for at in (37, 77)}
    assert all((image(tag.message) == moved[at]).all() for tag, at in zip(tags, (37, 77), strict=True))


def annotate_at(annotate: Annotate, original: list[Message], milliseconds: int, rig: Rig, folder: Path) -> Any:
    """Tag image at a time of the original between its images: its poses there, shifted to a camera's stamp."""
    row = [m for m in original if m.kind.topic == STATES and abs(m.stamp - milliseconds * 10**6) <= 10**6]
    path = write(folder / f"{milliseconds}.bag", (m._replace(stamp=m.stamp + (80 - milliseconds) * 10**6) for m in row))
    [tag] = read_bag(annotate(path, "park", rig=rig), [LEFT_TAG])
    return image(tag.message)


def test_wall_time_in_the_bag_and_simulated_time_in_headers(
    annotate: Annotate, original: list[Message], cameras: Rig, tmp_path: Path
) -> None:
    # each message was recorded 2 ms after it was sent, by another clock
    start = [m for m in original if m.stamp <= 130_000_000]
    there = [m._replace(stamp=m.stamp + WALL + 2_000_000) for m in start if m.kind.topic == ODOMETRY]
    bag = annotate(write(tmp_path / "x.bag", there), "park", rig=cameras)
    images = [row for row in seen(start) if row[1] != "/os1_cloud_node/points"]
    assert seen(stored(bag)) == [(stamp + WALL + 2_000_000, topic, data) for stamp, topic, data in images]


def test_images_that_the_bag_has_already_are_kept_with_a_prefix(
    annotate: Annotate, original: list[Message], cameras: Rig, tmp_path: Path
) -> None:
    start = [m for m in original if m.stamp <= 50_000_000 and (m.kind.topic == ODOMETRY or "/stereo" in m.kind.topic)]
    bag = write(tmp_path / "x.bag", start)
    with pytest.warns(FieldtruthWarning, match=rf"own messages of .*{LEFT_TAG}.* have the prefix /recorded"):
        made = stored(annotate(bag, "park", rig=cameras))
    own = seen(start)
    assert len(own) == 10
    assert seen(made) == own
    kept = [(stamp, kind.topic, data) for stamp, kind, data in made if kind.topic.startswith("/recorded")]
    assert kept == [(stamp, f"/recorded{topic}", data) for stamp, topic, data in own]


def test_missing_frames_of_the_added_sensors_are_added(
    annotate: Annotate, original: list[Message], cameras: Rig, tmp_path: Path
) -> None:
    messages = [m for m in original if m.kind.topic == ODOMETRY and m.stamp <= 60_000_000]
    bag = annotate(write(tmp_path / "x.bag", messages), "park", rig=cameras)
    expected = {key for message in original if message.kind.topic == STATIC for key in static_transforms_in(message)}
    frames = {(parent, child) for parent, child in expected if "camera" in child}
    assert static_transforms(bag).keys() == frames
    [(stamp, kind, _)] = [message for message in stored(bag) if message.kind.topic == STATIC]
    assert (stamp, kind.latching) == (20_000_000, 1)


def static_transforms_in(message: Message) -> list[tuple[str, str]]:
    from fieldtruth.bag.messages import STORE

    content: Any = STORE.deserialize_ros1(message.data, "tf2_msgs/msg/TFMessage")
    return [(each.header.frame_id, each.child_frame_id) for each in content.transforms]


def test_other_commands_read_the_bag_as_a_run(annotated: Path, original: list[Message]) -> None:
    run = open_run(annotated)
    assert run.experiment is None
    assert run.counts[LEFT_TAG] == 8
    assert run.end_ns == 1_500_000_000
    if shutil.which("rosbag") is not None:
        info = subprocess.run(["rosbag", "info", str(annotated)], capture_output=True, text=True, check=True).stdout
        assert f"{len(stored(annotated))}" in info
        assert "my_msgs/Odd" in info
        assert "(2 connections)" in info


def test_the_command_line_uses_rig_and_seed_of_an_experiment(
    stripped: Path, annotated: Path, small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, experiment = tmp_path / "y.bag", small_run / "experiment.yaml"
    words = ["annotate", stripped, "--environment", "park", "--experiment", experiment, "--lidar", "--out", out]
    assert cli.main([str(word) for word in words]) == 0
    assert capsys.readouterr().out == f"{out}: {out.stat().st_size / 1e6:.1f} MB\n"
    assert out.read_bytes() == annotated.read_bytes()
    assert cli.main([str(word) for word in words]) == 2
    assert capsys.readouterr().err == f"error: {out} already exists; remove it, or choose another --out\n"
    words[3] = "lake"
    assert cli.main([str(word) for word in words]) == 2
    assert (
        capsys.readouterr().err == f"error: --environment must be 'park', the environment of {experiment}, got 'lake'\n"
    )
    assert json.dumps(load_experiment(experiment).seed) == "0"
