# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reading bags as streams: the messages that rosbags finds, for any compression, and one-line errors for damage."""

import struct
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag.decode import read_bag
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import FieldtruthError, UnknownNameError

CLOCK = "rosgraph_msgs/msg/Clock"


def clock(stamp_ns: int) -> bytes:
    return struct.pack("<LL", *divmod(stamp_ns, 10**9))


def write_bag(path: Path, rows: Iterable[tuple[str, int]], compression: str | None = None, chunk: int = 300) -> Path:
    """Write clock messages, topic and stamp each, in the given order; a chunk is full after some bytes."""
    writer = Writer(path)
    if compression is not None:
        writer.set_compression(Writer.CompressionFormat[compression])
    writer.chunk_threshold = chunk
    with writer:
        connections = {t: writer.add_connection(t, CLOCK, msgdef="time clock", md5sum="0" * 32) for t in "ab"}
        for topic, stamp in rows:
            writer.write(connections[topic], stamp, clock(stamp))
    return path


def shuffled_rows(rng: np.random.Generator) -> list[tuple[str, int]]:
    """Stamps that sometimes decrease, so that chunks overlap in time; with ties."""
    stamps = np.arange(1, 301) * 10**8 + rng.integers(-5, 6, 300) * 10**8
    return [("ab"[k % 2], int(max(stamp, 1))) for k, stamp in enumerate(stamps)]


@pytest.mark.parametrize("odometry", [True, False])
def test_topics_of_the_data_set_get_our_names_only_in_bags_of_the_data_set(tmp_path: Path, odometry: bool) -> None:
    """A LiDAR of a rig of ours may have the topic of the paper's data set, which has no odometry."""
    with Writer(tmp_path / "a.bag") as writer:
        for topic in ["/os0_cloud_node/points", *["/ground_truth/odom"] * odometry]:
            writer.write(writer.add_connection(topic, CLOCK, msgdef="time clock", md5sum="0" * 32), 5, clock(5))
    with open_bag(tmp_path / "a.bag") as bag:
        assert ("/os0_cloud_node/points" in bag.counts) == odometry
        assert ("/os1_cloud_node/points" in bag.counts) != odometry


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
def test_messages_are_in_time_order_although_chunks_overlap(tmp_path: Path, compression: str | None) -> None:
    rows = shuffled_rows(np.random.default_rng(0))
    path = write_bag(tmp_path / "o.bag", rows, compression)
    with open_bag(path) as bag:
        found = [(raw.topic, raw.stamp_ns) for raw in bag.messages()]
        only_b = [(raw.topic, raw.stamp_ns) for raw in bag.messages(["b"])]
        assert len(bag._file.chunks) > 20
        assert (bag.start_ns, bag.end_ns) == (min(s for _, s in rows), max(s for _, s in rows))
        assert bag.counts == {"a": 150, "b": 150}
    assert found == sorted(rows, key=lambda row: row[1])  # stable: ties as they were written
    assert only_b == [row for row in found if row[0] == "b"]
    with Reader(path) as reader:
        assert sorted((c.topic, stamp) for c, stamp, _ in reader.messages()) == sorted(found)


def test_messages_are_found_by_their_index(small_run: Path) -> None:
    topic = "/stereo/camera/left/tag/img_raw"
    with open_bag(small_run / "park_1.bag") as bag:
        expected = list(bag.messages([topic]))
        index = bag.index([topic])[topic]
        assert index.stamps_ns.tolist() == [raw.stamp_ns for raw in expected]
        for k in np.random.default_rng(1).permutation(len(expected)):
            chunk = bag.chunk(int(index.chunk[k]))
            assert bag.message(chunk, int(index.offset[k])) == expected[k]


def test_every_message_equals_what_another_reader_reads(small_run: Path) -> None:
    bag = small_run / "park_1.bag"
    with Reader(bag) as reader, open_bag(bag) as stored:
        theirs = {(c.topic, stamp): bytes(data) for c, stamp, data in reader.messages()}
        ours = {(raw.topic, raw.stamp_ns): raw.data for raw in stored.messages()}
    assert ours == theirs


def test_only_a_few_chunks_are_in_memory(small_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[int] = []
    with open_bag(small_run / "park_1.bag") as bag:
        unpack = bag.chunk

        def noted(position: int) -> bytes:
            opened.append(position)
            return unpack(position)

        monkeypatch.setattr(bag, "chunk", noted)
        messages = bag.messages(["/imu/data"])
        for _ in range(3):
            next(messages)
        assert len(opened) <= 3
        assert len(bag._file.chunks) > 10


def damaged(small_run: Path, tmp_path: Path, change: str) -> Path:
    data = bytearray((small_run / "park_1.bag").read_bytes())
    path = tmp_path / f"{change}.bag"
    if change == "middle":
        data = data[: len(data) // 2]
    elif change == "end":
        data = data[:-7]
    elif change == "start":
        data = data[:3000]
    elif change == "magic":
        data = data[:13]
    elif change == "empty":
        data = bytearray()
    elif change == "foreign":
        data = bytearray(b"PK\x03\x04" + bytes(range(256)) * 64)
    elif change == "unindexed":
        at = data.index(b"index_pos=") + len(b"index_pos=")
        data[at : at + 8] = bytes(8)
    elif change == "flip":
        data[len(data) // 2] ^= 0x10
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("change", ["middle", "end", "start", "magic", "empty", "foreign", "unindexed", "flip"])
def test_damage_is_one_line_with_the_path(small_run: Path, tmp_path: Path, change: str) -> None:
    path = damaged(small_run, tmp_path, change)
    with pytest.raises(BagError) as caught:
        for _ in read_bag(path):
            pass
    assert str(caught.value).startswith(f"cannot read {path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", range(20))
def test_any_changed_byte_gives_at_most_a_clear_error(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = write_bag(tmp_path / "x.bag", [("ab"[k % 2], (k + 1) * 10**8) for k in range(60)])
    data = np.frombuffer(path.read_bytes(), np.uint8).copy()
    for _ in range(25):
        broken = data.copy()
        places = rng.integers(13, len(data), 3)
        broken[places] = rng.integers(0, 256, 3)
        path.write_bytes(broken.tobytes())
        lines: list[str] = []
        try:
            for _ in read_bag(path):
                pass
        except FieldtruthError as error:
            lines = str(error).splitlines()
        assert len(lines) <= 1


def test_a_missing_file_and_an_unknown_topic_are_named(small_run: Path, tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"none\.bag"), open_bag(tmp_path / "none.bag"):
        pass
    with pytest.raises(UnknownNameError, match=r"unknown topic '/imu'; did you mean '/imu/data'\? Available: /clock, "):
        list(read_bag(small_run / "park_1.bag", ["/imu"]))


def test_a_damaged_message_is_named_with_its_topic(tmp_path: Path) -> None:
    path = tmp_path / "short.bag"
    with Writer(path) as writer:
        connection = writer.add_connection("/a", "std_msgs/msg/String", msgdef="string data", md5sum="0" * 32)
        writer.write(connection, 5, struct.pack("<L", 1000) + b"abc")
    with open_bag(path) as bag:
        decode = decoder(bag)
        with pytest.raises(BagError, match="the message of /a at 5 ns is damaged"):
            [decode(raw) for raw in bag.messages()]


@pytest.mark.parametrize(
    ("content", "line"),
    [
        (b"", "it is empty"),
        (b"name,x,y\n", "it is not an MCAP file, a database of ROS 2 or a ROS 1 bag, which begins with #ROSBAG V2.0"),
        (b"#ROSBAG V1.2\n" + bytes(99), "its bag version is not 2.0"),
        (b"\x89MCAP9\r\n" + bytes(99), "it is an MCAP file of another version"),
    ],
)
def test_files_of_other_formats_are_named(tmp_path: Path, content: bytes, line: str) -> None:
    path = tmp_path / "x.bag"
    path.write_bytes(content)
    with pytest.raises(BagError) as caught:
        list(read_bag(path))
    assert str(caught.value) == f"cannot read {path}: {line}"


def test_a_hostile_zip_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "in" / "park_1.zip"
    path.parent.mkdir()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("../park_1.bag", b"#ROSBAG V2.0\n")
    with pytest.raises(BagError, match="it is a Zip file; unpack it and use the bag in it"):
        open_run(path)
    assert [p.name for p in tmp_path.rglob("*")] == ["in", "park_1.zip"]
