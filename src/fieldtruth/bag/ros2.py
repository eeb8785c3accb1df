# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of ROS 2 (CDR) as ROS 1 serialises them, so that all who read bags see one set of types and field names.

ROS 1 has ``seq`` in headers, which becomes 0, and capital letters in CameraInfo. A type that both have is read as ROS 1
defines it, any other as the file does. Of the two formats of ROS 2, databases (.db3) and folders with metadata.yaml are
read here by rosbags, in chunks that are spans of time; ``mcap_file`` reads MCAP files.
"""

import sqlite3
import struct
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path, PurePath
from typing import Final, NamedTuple

import yaml
from rosbags.convert.converter import is_same_wireformat, migrate_bytes
from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag1,
    ConnectionExtRosbag2,
    MessageDefinition,
    MessageDefinitionFormat,
    QosDurability,
)
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fieldtruth.bag import messages as ros
from fieldtruth.bag.file import BagError, ChunkInfo, Row, StoredFile
from fieldtruth.core.errors import FieldtruthError, FieldtruthWarning

MODEL_STATES: Final = "gazebo_msgs/msg/ModelStates"
ROS1_GAP, ROS2_GAP = 4, 8
"""Bytes between poses and twists of that type."""
_LITTLE_ENDIAN: Final = b"\x00\x01"

_BUILTIN: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
"""Types that some definitions use without repeating them."""

Convert = Callable[[bytes], bytes]


class Ros2Type(NamedTuple):
    """A message type of ROS 2: its name, like ``sensor_msgs/msg/Imu``, and its definition, maybe empty."""

    name: str
    definition: str
    is_idl: bool = False


@lru_cache(maxsize=256)
def definition_of(kind: Ros2Type) -> tuple[str, str]:
    """Return the definition in ROS 1 of a type, with those it contains, and its MD5 sum.

    Raises:
        TypesysError, KeyError: the type is unknown, or its definition cannot be read.
    """
    return _stores(kind)[1].generate_msgdef(kind.name)


@lru_cache(maxsize=256)
def converter_of(kind: Ros2Type) -> Convert:
    """Return the function that makes a message of ROS 1 from one of ROS 2; it raises any error for damaged bytes."""
    ros2, ros1 = _stores(kind)
    same, defaults = is_same_wireformat(ros2, ros1, kind.name, kind.name), dict[str, object]()

    def convert(data: bytes) -> bytes:
        if same and data.startswith(_LITTLE_ENDIAN):
            return bytes(ros2.cdr_to_ros1(data, kind.name))
        types = ros2, ros1, kind.name, kind.name
        return bytes(migrate_bytes(*types, defaults, data, src_is2=True, dst_is2=False))

    return ModelStatesConverter(convert, (ROS2_GAP, ROS1_GAP)) if same and kind.name == MODEL_STATES else convert


@lru_cache(maxsize=256)
def _stores(kind: Ros2Type) -> tuple[Typestore, Typestore]:
    """Return the types of ROS 2 and of ROS 1 that a type consists of."""
    ros2 = get_typestore(Stores.ROS2_HUMBLE)
    if kind.definition:
        own = get_types_from_idl(kind.definition) if kind.is_idl else get_types_from_msg(kind.definition, kind.name)
        own = {name: ros2.fielddefs[name] for name in _BUILTIN} | own
        ros2 = get_typestore(Stores.EMPTY)
        ros2.register(own)
    if kind.name in ros.STORE.fielddefs:
        return ros2, ros.STORE
    if kind.name not in ros2.fielddefs:
        raise TypesysError(f"Type {kind.name!r} is unknown.")
    ros1 = get_typestore(Stores.ROS1_NOETIC)
    types = get_types_from_msg(ros2.generate_msgdef(kind.name)[0], kind.name)
    ros1.register({name: fields for name, fields in types.items() if name not in ros1.fielddefs})
    return ros2, ros1


class ModelStatesConverter:
    """Converts gazebo_msgs/ModelStates, which comes at 1000 Hz: poses and twists are copied as two arrays.

    Field by field it takes 1 ms for a message of hundreds of objects. The names are kept from one message to the next.

    Args:
        convert: converts any message of the type.
        gaps: bytes between poses and twists, in the messages that are given and in those that are returned: their
            number and, in ROS 2, padding, because doubles start at multiples of 8.
    """

    def __init__(self, convert: Convert, gaps: tuple[int, int]) -> None:
        self._convert, self._gaps = convert, gaps
        self._known = b"", b"", 0
        """The bytes before the poses, as given and as returned, and the number of poses; threads share it."""

    def __call__(self, data: bytes) -> bytes:
        """Return a converted message."""
        (head, names, count), (gap, new_gap) = self._known, self._gaps
        at, middle, number = len(head), len(head) + 56 * count, struct.pack("<L", count)
        fits = len(data) == at + 104 * count + gap and data[middle : middle + 4] == number
        if not (count and fits and data.startswith(head)):
            whole = bytes(self._convert(data))
            (count,) = struct.unpack_from("<L", whole if gap > new_gap else data)
            self._known = data[: len(data) - 104 * count - gap], whole[: len(whole) - 104 * count - new_gap], count
            return whole
        return b"".join((names, data[at:middle], number.ljust(new_gap, b"\0"), data[middle + gap :]))


class Ros2Types:
    """Types of ROS 1 as ROS 2 Humble defines them, and their messages as CDR; types that ROS 2 lacks are copied.

    For all types that fieldtruth writes, definitions and hashes are the same in every release from Dashing to Kilted.

    Args:
        ros1: has the types.
        msgtypes: their names.
        source: for messages of errors.

    Raises:
        BagError: a definition cannot be read, or contradicts the one of ROS 2 with the same name.
    """

    def __init__(self, ros1: Typestore, msgtypes: Iterable[str], source: str) -> None:
        self._ros1, self._source = ros1, source
        self.store = get_typestore(Stores.ROS2_HUMBLE)
        """The types of ROS 2."""
        self._same, self._defaults = dict[str, bool](), dict[str, object]()
        self._model_states = ModelStatesConverter(partial(self._same_fields, MODEL_STATES), (ROS1_GAP, ROS2_GAP))
        self.add(msgtypes)

    def add(self, msgtypes: Iterable[str]) -> None:
        """Add more types; raises as the class does."""
        for msgtype in sorted(msgtypes):
            try:
                self._copy_if_missing(msgtype)
                self._same[msgtype] = is_same_wireformat(self._ros1, self.store, msgtype, msgtype)
            except (TypesysError, KeyError) as error:
                raise BagError(f"{self._source}: cannot convert {msgtype} to ROS 2: {error}") from error

    def definition(self, msgtype: str) -> str:
        """Return the text of a type's definition with those it contains (``ros2msg``)."""
        return self.store.generate_msgdef(msgtype, ros_version=2)[0]

    def digest(self, msgtype: str) -> str:
        """Return the RIHS01 hash of a type (REP-2016)."""
        return self.store.hash_rihs01(msgtype)

    def cdr(self, msgtype: str, data: bytes) -> bytes | memoryview:
        """Return a message of ROS 1 as CDR; raises any error for a damaged one."""
        if not self._same[msgtype]:
            types = self._ros1, self.store, msgtype, msgtype
            return migrate_bytes(*types, self._defaults, data, src_is2=False, dst_is2=True)
        return self._model_states(data) if msgtype == MODEL_STATES else self._same_fields(msgtype, data)

    def _copy_if_missing(self, msgtype: str) -> None:
        """Define a type as ROS 1 does, unless ROS 2 has one with this name."""
        if msgtype in self.store.fielddefs:
            return
        text, _ = self._ros1.generate_msgdef(msgtype, ros_version=2)
        types = get_types_from_msg(text, msgtype)
        self.store.register({name: fields for name, fields in types.items() if name not in self.store.fielddefs})

    def _same_fields(self, msgtype: str, data: bytes) -> bytes:
        """Convert a message of a type with the same fields in the same order: only alignment and lengths differ."""
        return bytes(self.store.ros1_to_cdr(data, msgtype))


class Encoding(NamedTuple):
    """Stored messages of a channel: their type of ROS 2, or None for those of ROS 1, whose bytes are as they are."""

    topic: str
    ros2: Ros2Type | None


@dataclass(frozen=True)
class Ros2Layout:
    """Conversion of the messages of a file."""

    encodings: Mapping[int, Encoding]
    """By connection."""

    def ros1(self, connection: int, data: bytes) -> bytes:
        """Return a message as ROS 1 serialises it."""
        topic, ros2 = self.encodings[connection]
        try:
            return data if ros2 is None else converter_of(ros2)(data)
        except Exception as error:  # generated code raises any exception on invalid bytes
            raise ValueError(f"a message of {topic} is damaged") from error


class StoredTopic(NamedTuple):
    """A topic in a file."""

    number: int
    topic: str
    messages: int
    """Their number."""
    latching: bool
    callerid: str | None
    described: Callable[[], tuple[Ros2Type, bool, str]]
    """Returns type, whether messages are those of ROS 2, and the MD5 sum of a type of ROS 1; raises TypesysError."""


def connections_of(path: Path, channels: Iterable[StoredTopic]) -> tuple[list[Connection], dict[int, Encoding]]:
    """Return the channels with messages of ROS, and how these are stored; others are left out with a warning.

    Raises:
        BagError: there are messages, but none of ROS.
    """
    connections, encodings, others = list[Connection](), dict[int, Encoding](), list[str]()
    for channel in (each for each in channels if each.messages):
        try:
            kind, is_ros2, digest = channel.described()
            definition, digest = definition_of(kind) if is_ros2 else (kind.definition, digest)
        except (TypesysError, KeyError, UnicodeDecodeError) as error:
            others.append(f"{channel.topic} ({error})")
            continue
        extra = ConnectionExtRosbag1(channel.callerid, int(channel.latching))
        msgdef = MessageDefinition(MessageDefinitionFormat.MSG, definition)
        row = channel.number, channel.topic, kind.name, msgdef, digest, channel.messages, extra, None
        connections.append(Connection(*row))
        encodings[channel.number] = Encoding(channel.topic, kind if is_ros2 else None)
    if others:
        text = f"{path} has messages that are not of ROS, or of unknown types: {', '.join(others)}"
        if not connections:
            raise BagError(text)
        warnings.warn(f"{text}; they are left out", FieldtruthWarning, stacklevel=2)
    return connections, encodings


_STORED: Final = struct.Struct("<qII")
"""Before each message of a chunk of a database: stamp [ns], connection, size."""
_MESSAGES: Final = """
    SELECT topics.name, topics.type, messages.timestamp, messages.data
    FROM messages JOIN topics ON messages.topic_id = topics.id
    WHERE messages.timestamp >= ? AND messages.timestamp < ? ORDER BY messages.timestamp, messages.id
"""
_CHUNK: Final = 4 * 2**20
"""Bytes that a chunk of a database has on average."""


@dataclass(frozen=True)
class DatabaseLayout(Ros2Layout):
    """Chunks of a database: spans of time, whose position is their first stamp."""

    span_ns: int
    databases: tuple[str, ...] | None
    """Files of a folder that are read with SQL, because rosbags parses YAML of each topic at first; None for others."""

    def unpack(self, path: Path, position: int) -> bytes:
        """Read the messages of a span."""
        numbers = {(topic, kind.name): number for number, (topic, kind) in self.encodings.items() if kind}
        span, parts = (position, position + self.span_ns), list[bytes]()
        for topic, msgtype, stamp, data in _stored(path, self.databases, span):
            if (topic, msgtype) in numbers:
                parts += [_STORED.pack(stamp, numbers[topic, msgtype], len(data)), data]
        return b"".join(parts)

    def rows(self, chunk: bytes, at: int = 0) -> Iterator[Row]:
        """Yield the messages in a chunk, from an offset on, where one begins."""
        while at < len(chunk):
            stamp, number, size = _STORED.unpack_from(chunk, at)
            at += _STORED.size
            yield stamp, number, at, size
            at += size


class DatabaseFile(StoredFile):
    """A database of ROS 2, or a folder of databases or MCAP files with metadata.yaml; open only while it is read."""

    layout: DatabaseLayout

    def __init__(self, path: Path) -> None:
        self._path = path
        with _opened(path) as bag:
            self.connections, encodings = connections_of(path, map(_stored_topic, bag.connections))
            self.start_ns, self.end_ns = bag.start_time, bag.end_time - 1
            mode, description = bag.compression_mode, path / "metadata.yaml"
        files = [path]
        if path.is_dir():
            known = yaml.safe_load(description.read_text())["rosbag2_bagfile_information"]
            files = [path / PurePath(name).name for name in known["relative_file_paths"]]
        # Compressed files are unpacked as a whole.
        chunks = 1 if mode == "file" else sum(file.stat().st_size for file in files) // _CHUNK + 1
        span_ns = max(1, -((self.start_ns - self.end_ns - 1) // chunks))
        plain = not mode and all(file.suffix == ".db3" for file in files)
        names = tuple(file.name for file in files if file != path)
        self.layout = DatabaseLayout(encodings, span_ns, names if plain else None)
        counts = dict.fromkeys(encodings, 1)
        starts = range(self.start_ns, self.end_ns + 1, span_ns) if encodings else ()
        self.chunks = [ChunkInfo(start, start, start + span_ns - 1, counts) for start in starts]

    def index(self, chunk: ChunkInfo) -> Iterator[tuple[int, int, int]]:
        """Yield connection, stamp [ns] and offset in its chunk of each message."""
        rows = self.layout.rows(self.layout.unpack(self._path, chunk.pos))
        return ((number, stamp, at - _STORED.size) for stamp, number, at, _ in rows)

    def close(self) -> None:
        """Do nothing, as the file is not open."""


def _stored_topic(connection: Connection) -> StoredTopic:
    text, extra = connection.msgdef, connection.ext
    qos = extra.offered_qos_profiles if isinstance(extra, ConnectionExtRosbag2) else []
    latching = any(each.durability == QosDurability.TRANSIENT_LOCAL for each in qos)
    kind = Ros2Type(connection.msgtype, text.data, text.format == MessageDefinitionFormat.IDL)
    return StoredTopic(connection.id, connection.topic, connection.msgcount, latching, None, lambda: (kind, True, ""))


def _stored(
    path: Path, databases: tuple[str, ...] | None, span: tuple[int, int]
) -> Iterator[tuple[str, str, int, bytes]]:
    """Yield topic, type, stamp [ns] and bytes of the messages in a span of time."""
    if databases is None:
        with _opened(path) as bag:
            for each, stamp, data in bag.messages(bag.connections, *span):
                yield each.topic, each.msgtype, stamp, data
        return
    for file in [path / name for name in databases] or [path]:
        try:
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?immutable=1", uri=True)) as database:
                yield from database.execute(_MESSAGES, span)
        except sqlite3.Error as error:
            raise ValueError(str(error)) from error


@contextmanager
def _opened(path: Path) -> Iterator[Reader]:
    try:
        with Reader(path) as bag:
            yield bag
    except (FieldtruthError, OSError):
        raise
    except Exception as error:  # the library raises any exception on invalid bytes
        raise ValueError(str(error) or type(error).__name__) from error
