# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Read a bag as a stream, or its messages in any order.

A stream has the list of chunks in memory and one chunk at a time, however long the bag is. ``Storage`` reads messages
by position from any process and thread; no file stays open between two reads. A bag is a file of ROS 1, an MCAP file,
or one of ROS 2 (.db3, or a folder with metadata.yaml); messages of ROS 2 are handed out as ROS 1 serialises them.
"""

import os
from collections import OrderedDict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from threading import Lock
from typing import Any, Final, NamedTuple

import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag1 import ReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from fieldtruth.bag.file import MCAP, BagError, Layout, Ros1File, StoredFile, first_bytes, is_database, read_errors
from fieldtruth.bag.ros2 import DatabaseFile
from fieldtruth.bag.topics import ODOMETRY, namespace_of, standard_name
from fieldtruth.core.arrays import Counts
from fieldtruth.core.errors import UnknownNameError


class RawMessage(NamedTuple):
    """A serialised message: stamp in the bag [ns], topic, type (``sensor_msgs/msg/Imu``) and bytes."""

    stamp_ns: int
    topic: str
    msgtype: str
    data: bytes
    connection: int = -1
    """Number of its connection in the bag; a topic has one per publisher."""


class MessageIndex(NamedTuple):
    """Index of a topic's messages, a row each, in time order: stamp [ns], position of the chunk, offset in it."""

    stamps_ns: Counts
    chunk: Counts
    offset: Counts


class BagReader:
    """An open bag, from ``open_bag``; one thread at a time may read it."""

    def __init__(self, path: Path, file: StoredFile, *, own_names: bool) -> None:
        self.path, self._file, self.layout = path, file, file.layout
        topics = {connection.topic for connection in file.connections}
        namespace = None if own_names else namespace_of(topics)
        own_names = own_names or ODOMETRY in topics  # the paper's data set has none, ours always
        name = {topic: topic if own_names else _name(topic, topics) for topic in topics}
        if namespace is not None:
            name = {topic: topic.removeprefix(f"/{namespace}") for topic in topics}
        self._by_id = {c.id: c._replace(topic=name[c.topic]) for c in file.connections}
        counts: dict[str, int] = {}
        for connection in self._by_id.values():
            counts[connection.topic] = counts.get(connection.topic, 0) + connection.msgcount
        self.counts: Mapping[str, int] = counts
        """Messages by topic."""
        self.msgtypes: Mapping[str, str] = {c.topic: c.msgtype for c in self._by_id.values()}
        """Message type by topic."""
        self.start_ns: int = file.start_ns
        self.end_ns: int = file.end_ns
        """Stamp [ns] of the last message."""

    @property
    def connections(self) -> list[Connection]:
        """Topics with types, definitions and publishers."""
        return list(self._by_id.values())

    def types(self) -> Typestore:
        """Return the message types as the bag defines them."""
        with read_errors(self.path):
            return types_of({c.msgtype: c.msgdef.data for c in self.connections})

    def messages(self, topics: Sequence[str] = ()) -> Iterator[RawMessage]:
        """Yield the messages of some topics, or of all, in time order; ties in the order in which they were written.

        Raises:
            UnknownNameError: the bag has no such topic.
            BagError: the bag is damaged.
        """
        wanted = self._chosen(topics)
        infos = [info for info in self._file.chunks if not wanted.isdisjoint(info.counts)]
        infos.sort(key=lambda info: (info.start_ns, info.pos))
        waiting: list[tuple[int, int, int, int, bytes]] = []  # of chunks that overlap in time
        for order, info in enumerate(infos):
            if waiting:
                waiting.sort()
                ready = next((i for i, row in enumerate(waiting) if row[0] >= info.start_ns), len(waiting))
                yield from map(self._raw, waiting[:ready])
                del waiting[:ready]
            data = self.chunk(info.pos)
            with read_errors(self.path):
                waiting += [
                    (stamp, order, at, number, data[at : at + size])
                    for stamp, number, at, size in self.layout.rows(data)
                    if number in wanted
                ]
        waiting.sort()
        yield from map(self._raw, waiting)

    def index(self, topics: Sequence[str]) -> dict[str, MessageIndex]:
        """Return the index of each topic, for reading messages in any order; one pass for all topics."""
        topic_of = {number: self._by_id[number].topic for number in self._chosen(topics)} if topics else {}
        rows: dict[str, list[tuple[int, int, int]]] = {topic: [] for topic in topics}
        for info in self._file.chunks:
            if topic_of.keys().isdisjoint(info.counts):
                continue
            with read_errors(self.path):
                for number, stamp, offset in self._file.index(info):
                    if number in topic_of:
                        rows[topic_of[number]].append((stamp, info.pos, offset))
        tables = {topic: np.array(sorted(found), np.int64).reshape(-1, 3) for topic, found in rows.items()}
        return {topic: MessageIndex(*np.ascontiguousarray(table.T)) for topic, table in tables.items()}

    def message(self, chunk: bytes, offset: int) -> RawMessage:
        """Return the message at an offset in a decompressed chunk."""
        with read_errors(self.path):
            stamp, number, data = message_at(self.layout, chunk, offset)
        return self._raw((stamp, 0, 0, number, data))

    def chunk(self, position: int) -> bytes:
        """Read and decompress the chunk at a position in the file."""
        with read_errors(self.path):
            return self.layout.unpack(self.path, position)

    def _chosen(self, topics: Sequence[str]) -> set[int]:
        for topic in topics:
            if topic not in self.counts:
                raise UnknownNameError("topic", topic, self.counts)
        return {number for number, c in self._by_id.items() if not topics or c.topic in topics}

    def _raw(self, row: tuple[int, int, int, int, bytes]) -> RawMessage:
        stamp, _, _, number, data = row
        connection = self._by_id[number]
        with read_errors(self.path):
            data = self.layout.ros1(number, data)
        return RawMessage(stamp, connection.topic, connection.msgtype, data, number)


def _name(topic: str, topics: Collection[str]) -> str:
    """Return the standard name of a topic, unless the bag has another topic of that name."""
    name = standard_name(topic)
    return name if name not in topics else topic


@contextmanager
def open_bag(path: Path | str, *, own_names: bool = False) -> Iterator[BagReader]:
    """Open a bag for reading.

    Args:
        path: the file.
        own_names: keep the names of topics; otherwise those of the paper's data set are ours (``standard_name``), and
            those of one of several robots are without their namespace.

    Raises:
        BagError: no such file, not a bag, a truncated one, or one with a damaged index.
    """
    path = Path(path)
    file: StoredFile
    with read_errors(path):
        if is_database(path):
            file = DatabaseFile(path)
        else:
            file = _mcap_file(path) if first_bytes(path).startswith(MCAP) else Ros1File(path)
    try:
        with read_errors(path):
            bag = BagReader(path, file, own_names=own_names)
        yield bag
    finally:
        file.close()


def _mcap_file(path: Path) -> StoredFile:
    """Open an MCAP file, with a library that is an extra."""
    try:
        from fieldtruth.bag.mcap_file import McapFile
    except ImportError as error:
        needed = "the mcap library is not installed; run: pip install 'fieldtruth[mcap]'"
        raise BagError(f"cannot read {path}: {needed}") from error
    return McapFile(path)


def message_at(layout: Layout, chunk: bytes, offset: int) -> tuple[int, int, bytes]:
    """Return stamp [ns], connection and stored bytes of the message at an offset; call it in ``read_errors``."""
    found = next(layout.rows(chunk, offset), None)
    if found is None:
        raise ReaderError("its index points to a position without a message")
    stamp, number, at, size = found
    return stamp, number, chunk[at : at + size]


def types_of(definitions: Mapping[str, str]) -> Typestore:
    """Return the message types with these names and definitions (ROS's .msg text); they are shared, not to be changed.

    Their classes take 50 ms to make, and are needed for each of the sensors.
    """
    return _types(tuple(sorted(definitions.items())))


@lru_cache(maxsize=16)
def _types(definitions: tuple[tuple[str, str], ...]) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    for msgtype, definition in definitions:
        store.register(get_types_from_msg(definition, msgtype))
    return store


ORIGIN: Final = "_origin"
"""Attribute of a decoded message that says in errors which one it is."""
Decoder = Callable[[RawMessage], Any]


def decoder(bag: BagReader) -> Decoder:
    """Return the function that deserialises raw messages of this bag, with ROS's field names."""
    return decoder_of(bag.types(), bag.path)


def decoder_of(store: Typestore, path: Path) -> Decoder:
    """Return the function that deserialises raw messages of the bag at ``path``."""

    def decode(raw: RawMessage) -> Any:
        try:
            message: Any = store.deserialize_ros1(raw.data, raw.msgtype)
        except Exception as error:  # generated code raises any exception on invalid bytes
            raise BagError(f"cannot read {path}: the message of {raw.topic} at {raw.stamp_ns} ns is damaged") from error
        setattr(message, ORIGIN, f"of {raw.topic} at {raw.stamp_ns} ns")
        return message

    return decode


BUDGET: Final = 16 * 2**20  # [byte]; the chunks of a view of 1280 x 720 with all items
Key = tuple[Path, tuple[int, int], int]


class Storage:
    """The messages of one bag by position. It holds no file and no message, so it can be pickled and forked."""

    def __init__(self, bag: BagReader, clocked: Collection[str] = ()) -> None:
        self.path = bag.path.resolve()
        self.clocked = frozenset(clocked)
        """Topics whose headers have a sensor's own time."""
        self._version = _version(self.path)
        self._layout = bag.layout
        self._definitions = {c.msgtype: c.msgdef.data for c in bag.connections}
        self._kinds = {c.id: (c.topic, c.msgtype) for c in bag.connections}

    def message(self, topic: str, chunk: int, offset: int) -> Any:
        """Return the message of a topic at an offset in the chunk at a position in the file, with ROS's field names.

        Raises:
            BagError: the bag is missing, has changed since it was opened, or is damaged.
        """
        return decoder_of(types_of(self._definitions), self.path)(self.raw(topic, chunk, offset))

    def raw(self, topic: str, chunk: int, offset: int) -> RawMessage:
        """Return a message as ROS 1 serialises it; raises as ``message``."""
        unpacked = _RECENT.get((self.path, self._version, chunk), lambda: self._unpack(chunk))
        with read_errors(self.path):
            stamp, number, data = message_at(self._layout, unpacked, offset)
            data = self._layout.ros1(number, data)
        found, msgtype = self._kinds.get(number, ("no topic", ""))
        if found != topic:
            raise BagError(f"cannot read {self.path}: its index has {topic} at the position of a message of {found}")
        return RawMessage(stamp, topic, msgtype, data)

    def _unpack(self, chunk: int) -> bytes:
        if _version(self.path) != self._version:
            raise BagError(f"{self.path} has changed since the data set was opened; open it again")
        with read_errors(self.path):
            return self._layout.unpack(self.path, chunk)


class ChunkCache:
    """The most recently used chunks, decompressed: a single one, or several within a budget [byte]."""

    def __init__(self, budget: int) -> None:
        self.budget = budget
        self.forget()

    def forget(self) -> None:
        """Clear the cache and replace its lock, which may be held in a forked process."""
        self._chunks: OrderedDict[Key, bytes] = OrderedDict()
        self._lock = Lock()

    @property
    def size(self) -> int:
        """Bytes in the cache."""
        return sum(map(len, self._chunks.values()))

    def get(self, key: Key, unpack: Callable[[], bytes]) -> bytes:
        """Return the chunk of a key; ``unpack`` is called if it is not cached."""
        with self._lock:
            if key in self._chunks:
                self._chunks.move_to_end(key)
                return self._chunks[key]
        chunk = unpack()
        with self._lock:
            self._chunks[key] = chunk
            while len(self._chunks) > 1 and self.size > self.budget:
                self._chunks.popitem(last=False)
        return chunk


_RECENT: Final = ChunkCache(BUDGET)
"""Shared by all data sets of a process, so that 100 runs need no more memory than one."""


if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_RECENT.forget)


def _version(path: Path) -> tuple[int, int]:
    """Return modification time [ns] and size [byte], which identify the version of a file."""
    with read_errors(path):
        stat = path.stat()
    return stat.st_mtime_ns, stat.st_size
