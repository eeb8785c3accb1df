# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Format ``files``: bags that are incomplete, unusual or damaged."""

import struct
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from export_bags import bag_of, copied, longer, peak_memory
from files_reader import (
    IMU,
    MODELS,
    ODOMETRY,
    POINTS,
    camera,
    cloud_columns,
    header_ns,
    messages,
)

from fieldtruth.bag import messages as ros
from fieldtruth.bag import reader
from fieldtruth.bag.file import BagError
from fieldtruth.cli import main
from fieldtruth.core.errors import FieldtruthWarning, OutputError
from fieldtruth.exporters import export


def test_header_stamps_that_are_0_are_those_of_the_bag_and_equal_ones_are_refused(bag: Path, tmp_path: Path) -> None:
    topic = camera("left", "tag/img_raw")

    def stamped(path: Path, stamp_ns: int) -> Path:
        stamp = struct.pack("<2L", *divmod(stamp_ns, 10**9))
        return copied(bag, path, lambda t, _, data: data[:4] + stamp + data[12:] if t == topic else None)

    with pytest.warns(FieldtruthWarning, match=r"the headers of .*tag/img_raw have no stamp"):
        made = export(stamped(tmp_path / "zero.bag", 0), "files", out=tmp_path / "made")
    names = {int(path.stem) for path in (made / "img_left_tag").iterdir()}
    assert names == {stamp for stamp, _ in messages(bag, topic)}
    with pytest.raises(BagError, match=r"two messages of .*tag/img_raw have the stamp 5000000003 ns"):
        export(stamped(tmp_path / "same.bag", 5_000_000_003), "files", out=tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_points_that_are_not_finite_are_dropped(tmp_path: Path, bag: Path) -> None:
    message = deepcopy(messages(bag, POINTS)[0][1])
    data = message.data.copy().reshape(message.width, message.point_step)
    data[[0, 7], 4:8] = np.frombuffer(np.array([np.nan, -np.inf], "<f4").tobytes(), np.uint8).reshape(2, 4)
    message.data = data.reshape(-1)
    found = export(bag_of(tmp_path / "b.bag", [(POINTS, 5, message)]), "files")
    back = np.loadtxt(found / "lidar" / f"{header_ns(message)}.csv", delimiter=",", dtype=np.float32)
    assert back.tobytes() == np.delete(cloud_columns(message), [0, 7], axis=0).tobytes()


def test_empty_cloud_becomes_an_empty_file(tmp_path: Path, bag: Path) -> None:
    message = deepcopy(messages(bag, POINTS)[0][1])
    message.width, message.row_step, message.data = 0, 0, message.data[:0]
    found = export(bag_of(tmp_path / "b.bag", [(POINTS, 5, message)]), "files")
    assert (found / "lidar" / f"{header_ns(message)}.csv").read_bytes() == b""
    assert not (found / "data_proportion.xlsx").exists()


def bad_colour(data: bytes) -> bytes:
    return data[:-3] + bytes([1, 2, 3])


def cut_short(data: bytes) -> bytes:
    return data[:-100]


def no_jpeg(data: bytes) -> bytes:
    return data.replace(b"\xff\xd8\xff", b"\0\0\0", 1)


def bad_class(data: bytes) -> bytes:
    return data[:-5] + b"\x63\0" + data[-3:]  # the label of the last point; object and is_dense follow


@pytest.mark.parametrize(
    ("topic", "change", "words"),
    [
        (camera("right", "tag/img_raw"), bad_colour, "at 40000000 ns: tag image: pixel in row 91, column 159"),
        (camera("left", "tag/img_raw"), cut_short, "the message of .*/left/tag/img_raw at 40000000 ns is damaged"),
        (
            camera("left", "real/compressed"),
            no_jpeg,
            r"wrong.bag: the compressed image of \S+left/real/compressed at 40000000 ns .* cannot be read as JPEG",
        ),
        (
            POINTS,
            bad_class,
            "wrong.bag: .*points at 100000000 ns: label of a point must be a class, one of 0, 1, .*, 22, 23, got 99",
        ),
        (POINTS, cut_short, "the message of /os1_cloud_node/points at 100000000 ns is damaged"),
        (MODELS, cut_short, "a message of /gazebo/model_states is damaged"),
        (IMU, cut_short, "the message of /imu/data at 20000000 ns is damaged"),
    ],
)
def test_damage_is_reported_with_topic_and_stamp(
    bag: Path, tmp_path: Path, topic: str, change: Callable[[bytes], bytes], words: str
) -> None:
    def hand_on(name: str, _: int, data: bytes) -> bytes | None:
        return change(data) if name == topic else data if name == "/navsat/fix" else None

    with pytest.raises(BagError, match=words) as error:
        export(copied(bag, tmp_path / "wrong.bag", hand_on), "files", out=tmp_path / "none")
    assert str(error.value).count(topic) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.bag"]


def test_bag_without_sensor_topics_is_refused(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lean = copied(bag, tmp_path / "b.bag", lambda topic, _, data: data if topic in ("/clock", ODOMETRY) else None)
    assert main(["export", str(lean), "--to", "files", "--out", str(tmp_path / "none")]) == 2
    warning, error = capsys.readouterr().err.splitlines()
    assert "there is no experiment.yaml of this bag beside it" in warning
    assert "has no messages of sensors" in error
    assert "available: /clock, /ground_truth/odom" in error
    assert not (tmp_path / "none").exists()


def test_topic_of_another_type_is_refused(tmp_path: Path) -> None:
    number = ros.STORE.types["std_msgs/msg/Float32"](1.0)
    wrong = bag_of(tmp_path / "b.bag", [(IMU, 5, number)])
    with pytest.raises(BagError, match=r"/imu/data of .* must be sensor_msgs/msg/Imu, got std_msgs/msg/Float32"):
        export(wrong, "files")


def test_existing_output_is_kept(small_run: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep")
    with pytest.raises(OutputError, match=" already exists; remove it"):
        export(small_run, "files", out=tmp_path / "mine")
    assert [path.name for path in tmp_path.rglob("*")] == ["mine", "notes.txt"]


def test_memory_does_not_grow_with_duration(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader._RECENT, "budget", 0)  # the last chunk only, instead of 16 MB
    topics = (camera("left", "tag/img_raw"), IMU)
    bags = [longer(bag, tmp_path / f"{times}.bag", times, topics, ()) for times in (1, 4)]
    peaks = [peak_memory(lambda path=path: export(path, "files", workers=1)) for path in bags]  # type: ignore[misc]
    assert len(list((tmp_path / "4_files" / "img_left_tag").iterdir())) == 120
    assert peaks[1] < 1.2 * peaks[0] + 1e6
