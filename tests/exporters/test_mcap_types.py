# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion to ROS 2 of model states, of types in foreign bags, and of damaged messages."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from export_messages import HUMBLE, NOETIC, STATES, assert_same
from mcap.exceptions import InvalidMagic
from mcap.reader import SeekingReader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.stores.ros1_noetic import builtin_interfaces__msg__Time as Time
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Point as Point
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Pose as Pose
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Quaternion as Quaternion
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Twist as Twist
from rosbags.typesys.stores.ros1_noetic import geometry_msgs__msg__Vector3 as Vector3
from rosbags.typesys.stores.ros1_noetic import std_msgs__msg__Header as Header

from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.exporters import export
from fieldtruth.exporters.mcap import converted, types_of


def states(names: list[str], start: float) -> Any:
    def pose(i: int) -> Any:
        x = start + 13 * i
        return Pose(Point(x, x + 1, x + 2), Quaternion(x + 3, x + 4, x + 5, x + 6))

    def twist(i: int) -> Any:
        x = start + 13 * i + 7
        return Twist(Vector3(x, x + 1, x + 2), Vector3(x + 3, x + 4, x + 5))

    count = range(len(names))
    return NOETIC.types[STATES](names, [pose(i) for i in count], [twist(i) for i in count])


def test_model_states_match_rosbags_when_objects_change(bag: Path) -> None:
    """The fast conversion of ModelStates gives the bytes of rosbags' serialisation."""
    with open_bag(bag) as stored:
        types = types_of(stored)
    for names in (["a"], ["a"], ["bc", "d"], ["bc", "e"], ["ä", "0123456", "01234567"], [], ["bc", "e"], ["ebc"]):
        message = states(names, 100.0 * len(names))
        raw = RawMessage(5, "/gazebo/model_states", STATES, bytes(NOETIC.serialize_ros1(message, STATES)))
        made = bytes(converted(types, raw, bag))
        assert made == bytes(HUMBLE.serialize_cdr(message, STATES, little_endian=True)), names


CUSTOM = """
Header header
time when
duration span
uint8 kind
string[] words
geometry_msgs/Point[] points
float64 last
"""


def foreign_bag(path: Path, rows: Iterable[tuple[str, int, str, bytes]], definitions: dict[str, str]) -> Path:
    store = get_typestore(Stores.ROS1_NOETIC)
    for name, text in definitions.items():
        store.register(get_types_from_msg(text, name))
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for topic, stamp, msgtype, data in rows:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, msgtype, typestore=store)
            writer.write(connections[topic], stamp, data)
    return path


def test_types_missing_in_ros_2_are_copied(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(CUSTOM, "my_msgs/msg/Custom"))
    header = Header(77, Time(3, 4), "somewhere")
    span = store.types["builtin_interfaces/msg/Duration"](5, 6)
    points = [Point(1.0, 2.0, 3.0), Point(4.0, 5.0, 6.0)]
    message: Any = store.types["my_msgs/msg/Custom"](
        header, Time(1, 2), span, 9, ["one", "", "three"], points, 0.5  # type: ignore[arg-type]
    )  # fmt: skip
    data = bytes(store.serialize_ros1(message, "my_msgs/msg/Custom"))
    path = foreign_bag(tmp_path / "a.bag", [("/custom", 7, "my_msgs/msg/Custom", data)], {"my_msgs/msg/Custom": CUSTOM})
    with AnyReader([export(path, "mcap", workers=1)]) as reader:
        ((connection, stamp, cdr),) = reader.messages()
        assert stamp == 7
        assert_same(message, reader.deserialize(cdr, connection.msgtype), "/custom")


def test_types_changed_in_ros_2_keep_their_values(tmp_path: Path) -> None:
    """visualization_msgs/Marker has additional fields for textures in ROS 2, among the others."""
    rgba = NOETIC.types["std_msgs/msg/ColorRGBA"]
    duration = NOETIC.types["builtin_interfaces/msg/Duration"]
    pose = Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    values: tuple[Any, ...] = (
        Header(5, Time(1, 2), "map"), "ns", 3, 4, 0, pose, Vector3(1.0, 1.0, 2.0), rgba(0.25, 0.5, 0.75, 1.0),
        duration(8, 9), True, [Point(7.0, 8.0, 9.0)], [rgba(1.0, 0.0, 0.5, 1.0)], "words", "a.dae", True,
    )  # fmt: skip
    kind = "visualization_msgs/msg/Marker"
    message = NOETIC.types[kind](*values)
    path = foreign_bag(tmp_path / "b.bag", [("/m", 7, kind, bytes(NOETIC.serialize_ros1(message, kind)))], {})
    made = export(path, "mcap", workers=1)
    with AnyReader([made]) as reader:
        ((connection, _, cdr),) = reader.messages()
        assert reader.typestore.hash_rihs01(kind) == HUMBLE.hash_rihs01(kind)
        there = reader.deserialize(cdr, connection.msgtype)
    assert_same(message, there, "/m")
    with made.open("rb") as stream:
        schema, _, record = next(SeekingReader(stream).iter_messages())
        assert schema is not None
        decode = DecoderFactory().decoder_for("cdr", schema)
        assert decode is not None
        assert_same(message, decode(record.data), "/m")


def test_damage_is_reported_in_one_line(small_run: Path, bag: Path, tmp_path: Path) -> None:
    short = foreign_bag(tmp_path / "short.bag", [("/imu/data", 7, "sensor_msgs/msg/Imu", bytes(20))], {})
    with pytest.raises(BagError, match=r"the message of /imu/data at 7 ns is damaged$"):
        export(short, "mcap", workers=1)
    long = foreign_bag(tmp_path / "long.bag", [("/v", 8, "std_msgs/msg/Float32", bytes(5))], {})
    with pytest.raises(BagError, match=r"the message of /v at 8 ns is damaged$"):
        export(long, "mcap", workers=2)
    cut = tmp_path / "cut.bag"
    cut.write_bytes(bag.read_bytes()[:300_000])
    with pytest.raises(BagError, match=r"cannot read .*cut\.bag"):
        export(cut, "mcap", workers=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut.bag", "long.bag", "short.bag"]
    with pytest.raises(InvalidMagic), bag.open("rb") as stream:  # the reader detects files that are not MCAP
        SeekingReader(stream).get_summary()
