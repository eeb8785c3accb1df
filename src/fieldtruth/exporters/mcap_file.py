# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Write MCAP files for ROS 2 (https://mcap.dev/spec): chunks are made on any thread and appended in order.

The writers at hand, of the mcap and of the rosbags library, compress on the thread that writes.
"""

import struct
import sys
import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import BinaryIO, Final, NamedTuple

import yaml

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_MAGIC: Final = b"\x89MCAP0\r\n"
_COMPRESSION: Final = "zstd"
_LEVEL: Final = 1
"""Against LZ4, a second of a run with depth and object ids: 158 to 194 MB, at 0.8 to 0.7 s; level 3: 157 MB, 1.2 s."""

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(1, 9)
_STATISTICS, _METADATA, _METADATA_INDEX, _SUMMARY_OFFSET, _DATA_END = range(11, 16)

_FOREVER: Final = {"sec": 9223372036, "nsec": 854775807}


class Message(NamedTuple):
    """A message to write: id of its channel, stamp [ns], bytes in CDR."""

    channel: int
    stamp_ns: int
    data: bytes | memoryview


class Chunk(NamedTuple):
    """Messages, packed."""

    start_ns: int
    end_ns: int
    size: int
    """Bytes before they were packed."""
    crc: int
    packed: bytes
    entries: Mapping[int, bytes]
    """Rows of stamp [ns] and offset, 16 bytes each, by channel."""


class Channel(NamedTuple):
    """A topic as rosbag2 describes it."""

    topic: str
    msgtype: str
    digest: str
    qos: str


def pack(messages: Iterable[Message]) -> Chunk:
    """Make a chunk of messages in time order; there must be one at least."""
    parts: list[bytes | memoryview] = []
    entries: defaultdict[int, bytearray] = defaultdict(bytearray)
    stamps: list[int] = []
    at = 0
    for channel, stamp, data in messages:
        entries[channel] += struct.pack("<QQ", stamp, at)
        stamps.append(stamp)
        parts += struct.pack("<BQHIQQ", _MESSAGE, 22 + len(data), channel, 0, stamp, stamp), data
        at += 31 + len(data)
    records = b"".join(parts)
    rows = {channel: bytes(entries[channel]) for channel in sorted(entries)}
    return Chunk(min(stamps), max(stamps), at, zlib.crc32(records), zstd.compress(records, _LEVEL), rows)


class McapWriter:
    """A file that grows: first all channels, then chunks, then ``finish``. Nothing but indices is kept in memory."""

    def __init__(self, stream: BinaryIO, library: str) -> None:
        self._stream = stream
        self._schemas: dict[str, bytes] = {}
        self._channels: list[Channel] = []
        self._channel_records: list[bytes] = []
        self._chunks: list[bytes] = []
        self._counts: defaultdict[int, int] = defaultdict(int)
        self._start_ns, self._end_ns = 2**64 - 1, 0
        stream.write(_MAGIC + _record(_HEADER, _text("ros2"), _text(library)))

    def add_channel(self, topic: str, msgtype: str, definition: str, digest: str, *, latched: bool) -> int:
        """Add a topic and return its id. ``definition`` is the text of the type (ros2msg), ``digest`` ROS 2's hash."""
        if msgtype not in self._schemas:
            number = struct.pack("<H", len(self._schemas) + 1)
            schema = _record(_SCHEMA, number, _text(msgtype), _text("ros2msg"), _text(definition))
            self._schemas[msgtype] = schema
            self._stream.write(schema)
        channel = Channel(topic, msgtype, digest, _qos(latched=latched))
        self._channels.append(channel)
        numbers = struct.pack("<HH", len(self._channels), list(self._schemas).index(msgtype) + 1)
        metadata = _texts({"offered_qos_profiles": channel.qos, "topic_type_hash": digest})
        record = _record(_CHANNEL, numbers, _text(topic), _text("cdr"), metadata)
        self._channel_records.append(record)
        self._stream.write(record)
        return len(self._channels)

    def append(self, chunk: Chunk) -> None:
        """Add a chunk."""
        position = self._stream.tell()
        span = struct.pack("<QQ", chunk.start_ns, chunk.end_ns)
        sizes = struct.pack("<QI", chunk.size, chunk.crc)
        packed_size = struct.pack("<Q", len(chunk.packed))
        self._stream.write(_record(_CHUNK, span, sizes, _text(_COMPRESSION), packed_size, chunk.packed))
        end = self._stream.tell()
        offsets = b""
        for channel, rows in chunk.entries.items():
            offsets += struct.pack("<HQ", channel, self._stream.tell())
            self._counts[channel] += len(rows) // 16
            self._stream.write(_record(_MESSAGE_INDEX, struct.pack("<HI", channel, len(rows)), rows))
        places = struct.pack("<QQ", position, end - position)
        index = struct.pack("<I", len(offsets)), offsets, struct.pack("<Q", self._stream.tell() - end)
        tail = _text(_COMPRESSION), packed_size, struct.pack("<Q", chunk.size)
        self._chunks.append(_record(_CHUNK_INDEX, span, places, *index, *tail))
        self._start_ns, self._end_ns = min(self._start_ns, chunk.start_ns), max(self._end_ns, chunk.end_ns)

    def finish(self, name: str) -> None:
        """Write what rosbag2 knows of a bag, under the file's ``name``, and the summary."""
        position = self._stream.tell()
        metadata = _record(_METADATA, _text("rosbag2"), _texts({"serialized_metadata": self._rosbag2(name)}))
        self._stream.write(metadata)
        self._stream.write(_record(_DATA_END, bytes(4)))
        place = struct.pack("<QQ", position, len(metadata))
        groups = {
            _SCHEMA: b"".join(self._schemas.values()),
            _CHANNEL: b"".join(self._channel_records),
            _STATISTICS: self._statistics(),
            _CHUNK_INDEX: b"".join(self._chunks),
            _METADATA_INDEX: _record(_METADATA_INDEX, place, _text("rosbag2")),
        }
        start = at = self._stream.tell()
        offsets = b""
        for group, records in groups.items():
            offsets += _record(_SUMMARY_OFFSET, struct.pack("<BQQ", group, at, len(records)))
            at += len(records)
        footer = struct.pack("<BQQQ", _FOOTER, 20, start, at)
        summary = b"".join(groups.values()) + offsets
        self._stream.write(summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + _MAGIC)

    def _statistics(self) -> bytes:
        numbers = struct.pack("<QHIIII", sum(self._counts.values()), len(self._schemas), len(self._channels), 0, 1,
                              len(self._chunks))  # fmt: skip
        counts = b"".join(struct.pack("<HQ", channel, self._counts[channel]) for channel in sorted(self._counts))
        span = struct.pack("<QQ", self._start_ns, self._end_ns)
        return _record(_STATISTICS, numbers, span, struct.pack("<I", len(counts)), counts)

    def _rosbag2(self, name: str) -> str:
        """rosbag2's description of a bag in version 8, the last whose QoS settings Humble understands, too."""
        start = {"nanoseconds_since_epoch": self._start_ns}
        span = {"starting_time": start, "duration": {"nanoseconds": self._end_ns - self._start_ns}}
        total = {"message_count": sum(self._counts.values())}
        topics = [
            {
                "topic_metadata": {
                    "name": channel.topic,
                    "type": channel.msgtype,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": channel.qos,
                    "type_description_hash": channel.digest,
                },
                "message_count": self._counts[number],
            }
            for number, channel in enumerate(self._channels, start=1)
        ]
        whole = {
            "version": 8,
            "storage_identifier": "mcap",
            **span,
            **total,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [name],
            "files": [{"path": name, **span, **total}],
            "custom_data": {},
            "ros_distro": "humble",
        }
        return _yaml(whole)


def _record(opcode: int, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack("<BQ", opcode, len(content)) + content


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def _texts(texts: Mapping[str, str]) -> bytes:
    data = b"".join(_text(key) + _text(value) for key, value in texts.items())
    return struct.pack("<I", len(data)) + data


def _qos(*, latched: bool) -> str:
    """Quality of service as rosbag2 writes it, in the numbers that every release reads.

    1 is reliable; 1 is transient local (a late subscriber gets the last message), 2 volatile; 1 is automatic.
    """
    profile = {
        "history": 3,
        "depth": 0,
        "reliability": 1,
        "durability": 1 if latched else 2,
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": 1,
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return _yaml([profile])


class _Plain(yaml.SafeDumper):
    """YAML without anchors."""

    def ignore_aliases(self, data: object) -> bool:
        """Write what occurs twice twice."""
        return True


def _yaml(value: object) -> str:
    text: str = yaml.dump(value, Dumper=_Plain, sort_keys=False)
    return text.strip()
