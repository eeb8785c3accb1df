# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Variants of a bag: without some topics, with changed messages, or longer."""

import struct
import tracemalloc
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader, Writer

from fieldtruth.bag.messages import STORE

Message = tuple[str, int, Any]
"""Topic, stamp in the bag [ns] and message."""


def bag_of(path: Path, messages: Iterable[Message]) -> Path:
    """Write a bag of messages in the given order."""
    path.parent.mkdir(parents=True, exist_ok=True)
    connections: dict[str, Any] = {}
    with Writer(path) as writer:
        for topic, stamp_ns, message in messages:
            msgtype = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, msgtype, typestore=STORE)
            writer.write(connections[topic], stamp_ns, STORE.serialize_ros1(message, msgtype))
    return path


def without(bag: Path, path: Path, *topics: str) -> Path:
    """Copy a bag without some of its topics."""
    return copied(bag, path, lambda topic, stamp, data: None if topic in topics else data)


def copied(bag: Path, path: Path, change: Callable[[str, int, bytes], bytes | None]) -> Path:
    """Copy a bag; ``change`` gives the new bytes of a message, or None to drop it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    connections: dict[str, Any] = {}
    target = Writer(path)
    target.set_compression(Writer.CompressionFormat.LZ4)
    with Reader(bag) as reader, target as writer:
        for connection, stamp_ns, data in reader.messages():
            new = change(connection.topic, stamp_ns, bytes(data))
            if new is None:
                continue
            if connection.topic not in connections:
                connections[connection.topic] = writer.add_connection(
                    connection.topic, connection.msgtype, msgdef=connection.msgdef.data, md5sum=connection.digest
                )
            writer.write(connections[connection.topic], stamp_ns, new)
    return path


def longer(bag: Path, path: Path, times: int, topics: Collection[str], once: Collection[str]) -> Path:
    """Repeat the messages of some topics, which must have headers, with later stamps; copy other topics once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    made: dict[str, Any] = {}
    with Reader(bag) as reader, Writer(path) as writer:
        for number in range(times):
            wanted = {*topics} if number else {*topics, *once}
            for old, stamp_ns, data in reader.messages([c for c in reader.connections if c.topic in wanted]):
                later = stamp_ns + number * reader.duration
                moved = bytes(data[:4]) + struct.pack("<2L", *divmod(later, 10**9)) + bytes(data[12:])
                if old.topic not in made:
                    made[old.topic] = writer.add_connection(
                        old.topic, old.msgtype, msgdef=old.msgdef.data, md5sum=old.digest
                    )
                writer.write(made[old.topic], later, moved if old.topic in topics else bytes(data))
    return path


def peak_memory(work: Callable[[], object]) -> int:
    """Peak of the bytes that Python and NumPy allocate for some work."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
