# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files are read wherever bags are: the same messages, items and files as from the bag that they were made of."""

import shutil
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.interfaces import ConnectionExtRosbag2
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode
from rosbags.rosbag2 import Reader as Ros2Reader
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fieldtruth.bag.decode import count_messages, read_bag
from fieldtruth.bag.file import BagError, find_bag
from fieldtruth.bag.reader import RawMessage, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning
from fieldtruth.datasets import RunDataset, open_runs
from fieldtruth.exporters import export
from fieldtruth.report.page import write_report
from fieldtruth.validation.runner import validate

pytest.importorskip("mcap")
from mcap.writer import CompressionType, IndexType, Writer

ROS2 = get_typestore(Stores.ROS2_HUMBLE)


@pytest.fixture(scope="module")
def made(lean_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the run as MCAP, and its experiment."""
    folder = tmp_path_factory.mktemp("mcap") / "park_1"
    folder.mkdir()
    shutil.copy(lean_run / "experiment.yaml", folder)
    return export(lean_run, "mcap", out=folder / "park_1.mcap").parent


def raw(path: Path) -> list[RawMessage]:
    with open_bag(path) as bag:
        return list(bag.messages())


def without_numbers(message: RawMessage) -> tuple[int, str, str, bytes]:
    """Return a message whose header has the sequence number 0; transforms have headers within."""
    data = message.data
    if message.topic in ("/tf", "/tf_static"):
        data = b""
    elif message.msgtype.split("/")[-1] not in ("Clock", "ModelStates", "Float32", "Twist"):
        data = bytes(4) + data[4:]
    return message.stamp_ns, message.topic, message.msgtype, data


def test_messages_are_those_of_the_bag_but_for_their_sequence_numbers(lean_run: Path, made: Path) -> None:
    ours, theirs = raw(find_bag(lean_run)), raw(find_bag(made))
    assert len(theirs) == len(ours) > 1000
    assert [*map(without_numbers, theirs)] == [*map(without_numbers, ours)]
    transforms = [
        [(t.header.frame_id, t.child_frame_id, t.header.stamp, t.transform) for t in r.message.transforms]
        for path in (lean_run, made)
        for r in read_bag(find_bag(path), ["/tf", "/tf_static"])
    ]
    assert transforms[: len(transforms) // 2] == transforms[len(transforms) // 2 :]


@pytest.fixture(scope="module", params=["folder", pytest.param("zstd", marks=pytest.mark.slow)])
def database(made: Path, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """The same messages as ``ros2 bag record`` stores them by default: a database and metadata.yaml."""
    folder = tmp_path_factory.mktemp(request.param) / "park_1"
    writer = Ros2Writer(folder, version=9)
    if request.param == "zstd":
        writer.set_compression(CompressionMode.MESSAGE, CompressionFormat.ZSTD)
    with Ros2Reader(find_bag(made)) as source, writer as target:
        known = {}
        for c in source.connections:
            qos = c.ext.offered_qos_profiles if isinstance(c.ext, ConnectionExtRosbag2) else ()
            text = c.msgdef.data
            known[c.id] = target.add_connection(
                c.topic, c.msgtype, msgdef=text, rihs01=c.digest or "RIHS01_unknown", offered_qos_profiles=qos
            )
        for c, stamp, data in source.messages(source.connections):
            target.write(known[c.id], stamp, data)
    return folder


def test_a_database_of_ros_2_has_what_the_bag_has(lean_run: Path, database: Path, made: Path) -> None:
    with open_bag(find_bag(made)) as ours, open_bag(find_bag(database)) as theirs:
        assert (theirs.counts, theirs.msgtypes) == (ours.counts, ours.msgtypes)
        assert (theirs.start_ns, theirs.end_ns) == (ours.start_ns, ours.end_ns)
        latched = [{c.topic for c in bag.connections if getattr(c.ext, "latching", 0)} for bag in (ours, theirs)]
        assert latched[0] == latched[1] != set()
    messages = [sorted(map(without_numbers, raw(find_bag(path)))) for path in (made, database)]
    assert messages[0] == messages[1]
    if database.parent.name.startswith("zstd"):
        return  # each read parses metadata.yaml
    items = ("mask", "cloud", "pose")
    expected, found = RunDataset(lean_run, items), RunDataset(database, items)
    assert len(expected) == len(found) > 1
    for i in (len(found) - 1, 0):  # in any order
        a, b = expected[i], found[i]
        for key in a.keys() - {"run"}:
            np.testing.assert_array_equal(b[key], a[key])


def test_counts_types_definitions_stamps_and_index_are_those_of_the_bag(lean_run: Path, made: Path) -> None:
    found = []
    for path in (find_bag(lean_run), find_bag(made)):
        with open_bag(path) as bag:
            stamps = {topic: index.stamps_ns.tolist() for topic, index in bag.index(list(bag.counts)).items()}
            types = {c.topic: (c.msgtype, c.msgdef.data, c.digest) for c in bag.connections}
            latched = {c.topic for c in bag.connections if getattr(c.ext, "latching", 0)}
            found.append((dict(bag.counts), dict(bag.msgtypes), types, stamps, bag.start_ns, bag.end_ns, latched))
    assert found[0] == found[1]
    assert count_messages(find_bag(made)) == found[0][0]


def test_field_names_are_those_of_ros_1(made: Path) -> None:
    info = next(read_bag(find_bag(made), ["/stereo/camera/left/camera_info"])).message
    assert info.K.reshape(3, 3)[0, 0] == info.P.reshape(3, 4)[0, 0] > 0.0
    assert (info.header.seq, len(info.D), len(info.R)) == (0, 5, 9)


def test_items_of_a_data_set_are_those_of_the_bag(lean_run: Path, made: Path) -> None:
    items = ("image", "mask", "depth", "instance_mask", "cloud", "labels", "pose", "calibration")
    ours, theirs = RunDataset(lean_run, items), RunDataset(made, items)
    assert theirs.run.experiment == ours.run.experiment is not None
    assert len(ours) == len(theirs) > 1
    for i in (len(ours) - 1, 0):  # in any order
        a, b = ours[i], theirs[i]
        assert a.keys() == b.keys()
        for key, value in a.items():
            np.testing.assert_array_equal(b[key], value)


def tree(path: Path) -> dict[str, bytes]:
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    return {file.relative_to(path).as_posix(): file.read_bytes() for file in files}


@pytest.mark.parametrize("form", ["tum", "semantickitti", "pcd"])
def test_exports_are_those_of_the_bag(form: str, lean_run: Path, made: Path, tmp_path: Path) -> None:
    for name, source in (("a", lean_run), ("b", made)):
        export(source, form, out=tmp_path / name, workers=1)
    assert tree(tmp_path / "a") == tree(tmp_path / "b")


def test_an_export_of_an_mcap_file_to_mcap_has_the_same_messages(made: Path, tmp_path: Path) -> None:
    again = export(made, "mcap", out=tmp_path / "again.mcap")
    assert raw(again) == raw(find_bag(made))


def test_checks_pass_as_of_the_bag(lean_run: Path, made: Path) -> None:
    ours, theirs = (validate(path, quick=True, workers=1) for path in (lean_run, made))
    assert [check.name for check in theirs if check.passed is False] == []
    passed = {check.name for check in ours if check.passed}
    assert passed - {check.name for check in theirs if check.passed} == {"checksums"}


@pytest.mark.usefixtures("in_park")
def test_a_report_and_a_folder_of_runs(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.report.page.map.WIDTH", 300)  # a large aerial view takes seconds
    write_report(made, out=tmp_path / "report.html")
    assert "park_1" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert open_runs(made.parent).names == ("park_1",)
    shutil.copytree(made, tmp_path / "both" / "park_1")
    shutil.copy(made / "park_1.mcap", tmp_path / "both" / "park_1" / "park_1.bag")  # an ending says nothing
    assert find_bag(tmp_path / "both" / "park_1").suffix == ".bag"
    assert open_runs(tmp_path / "both").names == ("park_1",)


# ---------------------------------------------------------------------------------------------------------------------
# Files of other writers


def copy_of(source: Path, target: Path, *, finish: bool = True, ros1: bool = False, **options: Any) -> Path:
    """Write the messages of a bag of ROS 1 with other options; ``ros1``: without conversion."""
    with open_bag(source) as bag, target.open("wb") as stream:
        writer = Writer(stream, **options)
        writer.start("ros1" if ros1 else "ros2", "other")
        ids, store = {}, bag.types()
        for c in bag.connections:
            text = c.msgdef.data if ros1 else ROS2.generate_msgdef(c.msgtype, ros_version=2)[0]
            name = c.msgtype.replace("/msg/", "/") if ros1 else c.msgtype
            schema = writer.register_schema(name, "ros1msg" if ros1 else "ros2msg", text.encode())
            extra = {"md5sum": c.digest, "callerid": "/node", "latching": "1"} if ros1 else {}
            ids[c.id] = writer.register_channel(c.topic, "ros1" if ros1 else "cdr", schema, extra)
        for message in bag.messages():
            data = message.data if ros1 else bytes(ROS2.ros1_to_cdr(message.data, message.msgtype))
            writer.add_message(ids[message.connection], message.stamp_ns, data, message.stamp_ns)
        del store
        if finish:
            writer.finish()  # type: ignore[no-untyped-call]
    return target


@pytest.fixture(scope="module")
def few(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of ROS 1 with some topics, whose types are known in Humble."""
    topics = ("/ground_truth/odom", "/imu/data", "/stereo/camera/left/camera_info", "/tf", "/os1_cloud_node/points")
    path = tmp_path_factory.mktemp("few") / "few.bag"
    with open_bag(find_bag(small_run)) as bag, Ros1Writer(path) as writer:
        kept = {
            c.id: writer.add_connection(c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest)
            for c in bag.connections
            if c.topic in topics
        }
        for message in bag.messages(topics):
            writer.write(kept[message.connection], message.stamp_ns, message.data)
    return path


WRITERS: dict[str, dict[str, Any]] = {
    "ROS 1": {"ros1": True},
    "LZ4": {"compression": CompressionType.LZ4},
    "small chunks, no compression": {"compression": CompressionType.NONE, "chunk_size": 5000},
    "no chunks": {"use_chunking": False},
    "no statistics": {"use_statistics": False},
    "no index of messages": {"index_types": IndexType.NONE},
    "no list of chunks": {"index_types": IndexType.MESSAGE},
    "no summary": {"use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False},
    "no checksums": {"enable_crcs": False},
    "not finished": {"finish": False, "chunk_size": 5000},
}


@pytest.mark.parametrize("options", WRITERS.values(), ids=WRITERS)
def test_files_of_other_writers_have_the_messages_of_the_bag(
    options: dict[str, Any], few: Path, tmp_path: Path
) -> None:
    path = copy_of(few, tmp_path / "x.mcap", **options)
    ours, theirs = raw(few), raw(path)
    if options.get("finish") is False:
        assert len(ours) > len(theirs) > 0.5 * len(ours)  # the last chunk was in memory
        ours = ours[: len(theirs)]
    assert [*map(without_numbers, theirs)] == [*map(without_numbers, ours)]
    with open_bag(path) as bag:
        assert sum(bag.counts.values()) == len(theirs)
        index = bag.index(["/imu/data"])["/imu/data"]
        imu = [message for message in theirs if message.topic == "/imu/data"]
        assert index.stamps_ns.tolist() == [message.stamp_ns for message in imu]
        last = bag.message(bag.chunk(int(index.chunk[-1])), int(index.offset[-1]))
        assert last.data == imu[-1].data
    if options.get("ros1"):
        assert theirs[0].data == ours[0].data  # with their numbers


def own_file(
    path: Path, msgtype: str, text: str, data: list[bytes], encoding: str = "cdr", schema: str = "ros2msg"
) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "other")
        channel = writer.register_channel("/own", encoding, writer.register_schema(msgtype, schema, text.encode()))
        for k, each in enumerate(data):
            writer.add_message(channel, 10 * k, each, 10 * k)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_types_of_other_packages_keep_their_fields(tmp_path: Path) -> None:
    text = "std_msgs/Header header\nfloat64 depth\nstring name\nuint8[] data\n" + "=" * 80 + "\nMSG: std_msgs/Header\n"
    text += "builtin_interfaces/Time stamp\nstring frame_id\n"
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(text, "my_msgs/msg/Sonar"))
    kind = store.types
    header: Any = kind["std_msgs/msg/Header"](kind["builtin_interfaces/msg/Time"](3, 4), "sonar")
    message: Any = kind["my_msgs/msg/Sonar"](header, 2.5, "ä", np.arange(3, dtype=np.uint8))
    for little in (True, False):
        data = bytes(store.serialize_cdr(message, "my_msgs/msg/Sonar", little_endian=little))
        (found,) = read_bag(own_file(tmp_path / f"{little}.mcap", "my_msgs/msg/Sonar", text, [data]))
        assert (found.message.depth, found.message.name, found.message.data.tolist()) == (2.5, "ä", [0, 1, 2])
        assert (found.message.header.stamp.sec, found.message.header.frame_id) == (3, "sonar")


def test_a_known_type_needs_no_definition(tmp_path: Path) -> None:
    data = bytes(ROS2.serialize_cdr(ROS2.types["std_msgs/msg/Float32"](0.5), "std_msgs/msg/Float32"))
    (found,) = read_bag(own_file(tmp_path / "x.mcap", "std_msgs/msg/Float32", "", [data], schema=""))
    assert found.message.data == 0.5


def test_model_states_whose_models_change(tmp_path: Path) -> None:
    text = "string[] name\ngeometry_msgs/Pose[] pose\ngeometry_msgs/Twist[] twist\n"
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(text, "gazebo_msgs/msg/ModelStates"))
    kind: dict[str, Any] = dict(store.types)

    def at(x: float) -> Any:
        return kind["geometry_msgs/msg/Pose"](
            kind["geometry_msgs/msg/Point"](x, 0.0, 0.0), kind["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        )

    zero = kind["geometry_msgs/msg/Vector3"](0.0, 0.0, 7.0)
    still = kind["geometry_msgs/msg/Twist"](zero, zero)
    names = [["a"], ["a"], ["a", "bcd"], [], ["longer"], ["longer"], ["x"]]
    rows = [
        kind["gazebo_msgs/msg/ModelStates"](each, [at(float(k)) for _ in each], [still] * len(each))
        for k, each in enumerate(names)
    ]
    whole = store.generate_msgdef("gazebo_msgs/msg/ModelStates", ros_version=2)[0]
    data = [bytes(store.serialize_cdr(row, "gazebo_msgs/msg/ModelStates")) for row in rows]
    path = own_file(tmp_path / "x.mcap", "gazebo_msgs/msg/ModelStates", whole, data)
    found = [reading.message for reading in read_bag(path)]
    assert [message.name for message in found] == names
    assert [[p.position.x for p in message.pose] for message in found] == [
        [float(k)] * len(each) for k, each in enumerate(names)
    ]
    assert all(t.angular.z == 7.0 for message in found for t in message.twist)


# ---------------------------------------------------------------------------------------------------------------------
# Files that cannot be read


def truncated(data: bytes) -> bytes:
    return data[: len(data) // 2]


def changed(data: bytes) -> bytes:
    """Change the middle of the file, which is in a compressed chunk."""
    return data[: len(data) // 2] + bytes(200) + data[len(data) // 2 + 200 :]


def test_a_truncated_file_is_read_as_far_as_it_is_whole(few: Path, tmp_path: Path) -> None:
    path = copy_of(few, tmp_path / "x.mcap", chunk_size=5000)
    path.write_bytes(truncated(path.read_bytes()))
    assert 0 < len(raw(path)) < len(raw(few))


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (changed, r"cannot read .*x\.mcap: "),
        (lambda data: data[:8], r"x\.mcap has no messages"),
        (lambda data: data[:30], r"x\.mcap has no messages"),
        (lambda data: b"\x89MCAP9\r\n" + data[8:], "it is an MCAP file of another version"),
        (lambda data: b"", "it is empty"),
    ],
)
def test_damage_is_one_line(change: Callable[[bytes], bytes], line: str, few: Path, tmp_path: Path) -> None:
    path = copy_of(few, tmp_path / "x.mcap")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(BagError, match=line) as error:
        raw(path) if open_run(path) else None
    assert "\n" not in str(error.value)


def test_any_change_of_bytes_is_one_line(few: Path, tmp_path: Path) -> None:
    whole = copy_of(few, tmp_path / "x.mcap", chunk_size=20000).read_bytes()
    rng, path = np.random.default_rng(0), tmp_path / "y.mcap"
    for _ in range(60):
        data = bytearray(whole)
        for at in rng.integers(len(data), size=3):
            data[at] = rng.integers(256)
        path.write_bytes(data)
        try:
            with open_bag(path) as bag:
                list(bag.messages())
                bag.index(list(bag.counts))
        except FieldtruthError as error:
            if "\n" in str(error):
                raise AssertionError(str(error)) from error


def test_other_encodings_are_refused_or_left_out_with_a_warning(tmp_path: Path) -> None:
    path = own_file(tmp_path / "x.mcap", "Json", "{}", [b"{}"], "json", "jsonschema")
    with pytest.raises(BagError, match=r"not of ROS, or of unknown types: /own \(messages are encoded as json\)"):
        open_run(path)
    path = own_file(tmp_path / "y.mcap", "my_msgs/msg/Odd", "", [bytes(8)], schema="")
    with pytest.raises(BagError, match=r"unknown types: /own \(Type 'my_msgs/msg/Odd' is unknown"):
        open_run(path)
    with (tmp_path / "z.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start("", "other")
        writer.add_message(writer.register_channel("/json", "json", 0), 1, b"{}", 1)
        schema = writer.register_schema("std_msgs/msg/Float32", "ros2msg", b"float32 data\n")
        writer.add_message(writer.register_channel("/number", "cdr", schema), 2, struct.pack("<If", 256, 0.5), 2)
        writer.finish()  # type: ignore[no-untyped-call]
    with pytest.warns(FieldtruthWarning, match=r"/json \(messages are encoded as json\); they are left out"):
        assert open_run(tmp_path / "z.mcap").counts == {"/number": 1}


def test_a_damaged_message_is_named(tmp_path: Path) -> None:
    path = own_file(tmp_path / "x.mcap", "std_msgs/msg/Float32", "float32 data\n", [b"\x00\x01\x00\x00\x01"])
    with pytest.raises(BagError, match=r"a message of /own is damaged"):
        list(read_bag(path))


def test_without_the_library_one_line_says_what_to_install(made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcap.reader", None)
    monkeypatch.delitem(sys.modules, "fieldtruth.bag.mcap_file", raising=False)
    with pytest.raises(BagError, match=r"mcap library is not installed; run: pip install 'fieldtruth\[mcap\]'"):
        open_run(made)
