# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files read by rosbags and mcap: every message equals that of the bag, field by field."""

import shutil
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
import zstandard
from export_bags import peak_memory
from export_messages import HUMBLE, NOETIC, STATES, assert_same
from mcap.reader import SeekingReader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability, QosReliability

from fieldtruth.exporters import export

Row = tuple[str, int, str, bytes]


@pytest.fixture(scope="module")
def made(exported: Callable[[str], Path]) -> Path:
    return exported("mcap")


@pytest.fixture(scope="module")
def ros1(bag: Path) -> list[Row]:
    return list(rows(bag))


@pytest.fixture(scope="module")
def ros2(made: Path) -> list[Row]:
    return list(rows(made))


def rows(path: Path) -> Iterator[Row]:
    """Topic, stamp, type and bytes of each message, read by rosbags."""
    with AnyReader([path]) as reader:
        for connection, stamp, data in reader.messages():
            yield connection.topic, stamp, connection.msgtype, bytes(data)


def by_topic(messages: Iterable[Row]) -> dict[str, list[Row]]:
    """Messages of each topic in order; AnyReader sorts messages with equal stamps by topic."""
    result: dict[str, list[Row]] = {}
    for row in messages:
        result.setdefault(row[0], []).append(row)
    return result


def test_all_messages_match_the_bag_by_rosbags(ros1: list[Row], ros2: list[Row]) -> None:
    old, new = by_topic(ros1), by_topic(ros2)
    assert old.keys() == new.keys()
    for topic, messages in old.items():
        assert len(messages) == len(new[topic]), topic
        for (_, stamp, msgtype, data), (_, stamp2, msgtype2, cdr) in zip(messages, new[topic], strict=True):
            assert (stamp, msgtype) == (stamp2, msgtype2), topic
            if msgtype == STATES:  # 143 objects at 1000 Hz: compare the bytes, converted back to ROS 1
                assert HUMBLE.cdr_to_ros1(cdr, STATES) == data, f"{topic} at {stamp}"
            else:
                values = HUMBLE.deserialize_cdr(cdr, msgtype)
                assert_same(NOETIC.deserialize_ros1(data, msgtype), values, f"{topic} at {stamp}")


def test_messages_match_the_bag_by_mcap(made: Path, ros1: list[Row]) -> None:
    """This library is slow: only the first, the middle and the last message of each topic."""
    old = by_topic(ros1)
    seen: Counter[str] = Counter()
    checked: Counter[str] = Counter()
    with made.open("rb") as stream:
        factory = DecoderFactory()
        for schema, channel, message in SeekingReader(stream).iter_messages():
            topic, k = channel.topic, seen[channel.topic]
            seen[topic] += 1
            if k not in {0, len(old[topic]) // 2, len(old[topic]) - 1}:
                continue
            assert schema is not None
            decode = factory.decoder_for(channel.message_encoding, schema)
            assert decode is not None
            _, stamp, msgtype, data = old[topic][k]
            assert (message.log_time, message.publish_time, schema.name) == (stamp, stamp, msgtype)
            assert_same(NOETIC.deserialize_ros1(data, msgtype), decode(message.data), f"{topic} at {stamp}")
            checked[topic] += 1
    assert seen == Counter({topic: len(messages) for topic, messages in old.items()})
    assert min(checked.values()) == 1  # /tf_static
    assert sorted(checked.values())[1] >= 2  # /navsat/fix


def test_file_has_ros_2_profile_and_index(made: Path, ros1: list[Row]) -> None:
    with made.open("rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
    assert header.profile == "ros2"
    assert summary is not None
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    assert "seq" not in {line for schema in summary.schemas.values() for line in schema.data.decode().split()}
    statistics = summary.statistics
    assert statistics is not None
    counts = {summary.channels[i].topic: n for i, n in statistics.channel_message_counts.items()}
    assert counts == Counter(topic for topic, *_ in ros1)
    assert statistics.message_count == len(ros1)
    stamps = [stamp for _, stamp, *_ in ros1]
    assert (statistics.message_start_time, statistics.message_end_time) == (min(stamps), max(stamps))
    assert statistics.chunk_count == len(summary.chunk_indexes) > 5
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    assert all(a.message_end_time <= b.message_start_time for a, b in pairwise(summary.chunk_indexes))


def test_records_and_checksums_are_valid(made: Path) -> None:
    with made.open("rb") as stream:
        kinds = Counter(type(record).__name__ for record in StreamReader(stream, validate_crcs=True).records)
    assert kinds["Message"] == 3123
    assert kinds["Footer"] == kinds["DataEnd"] == kinds["Statistics"] == kinds["Metadata"] == 1
    whole = made.read_bytes()
    start, _, crc = struct.unpack("<QQI", whole[-28:-8])  # the footer, followed by the magic
    assert crc == zlib.crc32(whole[start:-12])


def test_message_indexes_point_to_messages(made: Path, ros1: list[Row]) -> None:
    """Foxglove reads these indexes, the libraries above do not."""
    found, chunk = 0, b""
    with made.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                chunk = decompressed(record)
            elif isinstance(record, MessageIndex):
                for stamp, offset in record.records:
                    opcode, _, channel, _, log_time = struct.unpack_from("<BQHIQ", chunk, offset)
                    assert (opcode, channel, log_time) == (5, record.channel_id, stamp)
                    found += 1
    assert found == len(ros1)


def decompressed(chunk: Chunk) -> bytes:
    data: bytes = zstandard.decompress(chunk.data, chunk.uncompressed_size)
    return data


def test_index_finds_messages_by_time(made: Path, ros1: list[Row]) -> None:
    topics, start, end = ["/imu/data", "/stereo/camera/left/depth", "/gazebo/model_states"], 300_000_000, 800_000_001
    with made.open("rb") as stream:
        messages = SeekingReader(stream).iter_messages(topics, starting_at=start, ending_before=end)
        found = [(channel.topic, message.log_time) for _, channel, message in messages]
    wanted = [(topic, stamp) for topic, stamp, *_ in ros1 if topic in topics and start <= stamp < end]
    assert sorted(found) == sorted(wanted)
    assert [stamp for _, stamp in found] == sorted(stamp for _, stamp in wanted)


def test_latched_topics_are_transient_local(made: Path) -> None:
    with AnyReader([made]) as reader:
        durability = {}
        for connection in reader.connections:
            assert isinstance(connection.ext, ConnectionExtRosbag2)
            (qos,) = connection.ext.offered_qos_profiles
            assert qos.reliability is QosReliability.RELIABLE
            durability[connection.topic] = qos.durability
    assert durability.pop("/tf_static") is QosDurability.TRANSIENT_LOCAL
    assert set(durability.values()) == {QosDurability.VOLATILE}


def test_rosbag2_metadata_describes_the_file(made: Path, ros1: list[Row], tmp_path: Path) -> None:
    with made.open("rb") as stream:
        (record,) = SeekingReader(stream).iter_metadata()
    assert record.name == "rosbag2"
    known = yaml.safe_load(record.metadata["serialized_metadata"])
    profiles = [yaml.safe_load(t["topic_metadata"]["offered_qos_profiles"]) for t in known["topics_with_message_count"]]
    for (profile,) in profiles:  # Humble reads only numbers, not the names of later releases
        assert {type(profile[key]) for key in ("history", "reliability", "durability", "liveliness")} == {int}
    folder = tmp_path / "run"
    folder.mkdir()
    shutil.copy(made, folder / known["relative_file_paths"][0])
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": known}))
    with AnyReader([folder]) as reader:
        assert reader.message_count == len(ros1)
        assert {topic: info.msgcount for topic, info in reader.topics.items()} == Counter(t for t, *_ in ros1)
        assert (reader.start_time, reader.end_time - 1) == (ros1[0][1], max(stamp for _, stamp, *_ in ros1))
        assert sum(1 for _ in reader.messages()) == len(ros1)


def test_frames_of_sensors_are_connected(ros2: list[Row]) -> None:
    parents: dict[str, str] = {}
    used = set()
    for topic, _, msgtype, cdr in ros2:
        if msgtype in (STATES, "rosgraph_msgs/msg/Clock", "std_msgs/msg/Float32", "geometry_msgs/msg/Twist"):
            continue
        message: Any = HUMBLE.deserialize_cdr(cdr, msgtype)
        if topic in ("/tf", "/tf_static"):
            parents |= {each.child_frame_id: each.header.frame_id for each in message.transforms}
        else:
            used.add(message.header.frame_id)
    for frame in used - {"odom"}:  # wheel odometry has a frame of its own: base_link has only one parent
        while frame in parents:
            frame = parents[frame]
        assert frame == "world"
    assert len(used) >= 5


def test_bytes_do_not_depend_on_workers(small_run: Path, made: Path, tmp_path: Path) -> None:
    alone = export(small_run, "mcap", out=tmp_path / "alone.mcap", workers=1)
    assert alone.read_bytes() == made.read_bytes()


@pytest.mark.slow
def test_memory_does_not_grow_with_duration(
    small_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ros1: list[Row]
) -> None:
    """With MCAP chunks of 128 kB; the reader holds a chunk of the bag, 4 MB or more."""
    monkeypatch.setattr("fieldtruth.exporters.mcap._CHUNK_SIZE", 2**17)
    peak = peak_memory(lambda: export(small_run, "mcap", out=tmp_path / "run.mcap", workers=1))
    whole = sum(len(data) for *_, data in ros1)
    assert peak < 0.5 * whole, f"{peak} of {whole}"
