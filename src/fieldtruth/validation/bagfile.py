# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a bag from its first byte to its last: every record must be where its neighbours and the index say.

A byte that belongs to no record, an index entry without a message and a message without an entry are all faults. What
the file's structure does not hold together twice (the blanks behind its header) is held against what writers put there.
"""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.parallel import in_order
from fieldtruth.validation import records
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.records import Record, StructureError

NAME: Final = "structure"


class _Told(NamedTuple):
    """What the index says of a chunk."""

    start_ns: int
    end_ns: int
    counts: dict[int, int]


class _Message(NamedTuple):
    """A message in an unpacked chunk."""

    stamp_ns: int
    connection: int
    at: int
    start: int
    end: int


class _Unpacked(NamedTuple):
    """A chunk with what stands behind it in the file."""

    at: int
    data: bytes
    messages: list[_Message]
    connections: list[tuple[int, Record, bytes]]
    entries: dict[int, list[tuple[int, int]]]


class BagFile:
    """A bag file that is read once, front to back."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.counts: dict[str, int] = {}
        """Messages by topic, as far as read."""
        self._chunks = Law("the index at the end fits each chunk")
        self._index = Law("each entry of the index behind a chunk has its message, and each message its entry")
        self._connections = Law("each chunk repeats the topics as the index has them")
        self._file = Law("the file is records without a gap, from its header to the last entry of its index")
        self._told: dict[int, _Told] = {}
        self._topics: dict[int, tuple[str, str]] = {}
        self._definitions: dict[int, tuple[dict[str, bytes], bytes]] = {}
        self._bytes = 0

    def messages(self, workers: int) -> Iterator[RawMessage]:
        """Messages in time order; ties in the order in which they stand in the file.

        What cannot be read ends it and shows in ``result``.
        """
        try:
            with self.path.open("rb") as source:
                first, index_at = self._read_frame(source)
                yield from self._in_time_order(self._chunks_of(source, first, index_at), workers)
        except StructureError as error:
            self._file.see(False, str(error))
        except OSError as error:
            self._file.see(False, f"cannot be read: {error.strerror}")

    @property
    def whole(self) -> bool:
        """Whether all of it could be read."""
        return self._file.broken == 0

    def result(self) -> Check:
        """Return the check of the structure."""
        figures = (
            f"{self._bytes / 1e6:.1f} MB: {len(self._told):,} chunks, {sum(self.counts.values()):,} messages, "
            f"{self._index.seen:,} index entries"
        )
        laws = [self._file, self._chunks, self._index, self._connections]
        return check_of(NAME, laws, figures, "the file was not read")

    def _read_frame(self, source: BinaryIO) -> tuple[int, int]:
        """Read the header and the index at the end; returns where chunks begin and end."""
        self._bytes = source.seek(0, 2)
        source.seek(0)
        if source.read(len(records.MAGIC)) != records.MAGIC:
            raise StructureError(f"it does not begin with {records.MAGIC.decode().strip()!r}")
        header = records.read_record(source)
        if header.kind != records.BAG_HEADER:
            raise StructureError("its first record is no bag header")
        self._file.see(not header.data.strip(b" "), "the padding behind the header holds other bytes than blanks")
        first, index_at = source.tell(), header.whole("index_pos")
        if not first <= index_at <= self._bytes:
            raise StructureError(f"its header places the index at byte {index_at} of {self._bytes}")
        source.seek(index_at)
        connections, chunks = header.whole("conn_count"), header.whole("chunk_count")
        while source.tell() < self._bytes:
            self._read_index_record(records.read_record(source))
        self._file.see(connections == len(self._topics), f"the header counts {connections} topics of "
                       f"{len(self._topics)}")  # fmt: skip
        self._file.see(chunks == len(self._told), f"the header counts {chunks} chunks of {len(self._told)}")
        return first, index_at

    def _read_index_record(self, record: Record) -> None:
        if record.kind == records.CONNECTION:
            number, topic = record.whole("conn"), record.word("topic")
            msgtype = records.fields_of(record.data, record.at).get("type", b"").decode("latin-1")
            self._topics[number] = (topic, msgtype.replace("/", "/msg/") if "/msg/" not in msgtype else msgtype)
            self._definitions[number] = (dict(record.fields), record.data)
        elif record.kind == records.CHUNK_INFO:
            pairs = list(struct.iter_unpack("<LL", record.data[: len(record.data) // 8 * 8]))
            told = _Told(record.time("start_time"), record.time("end_time"), dict(pairs))
            self._chunks.see(
                record.whole("ver") == 1 and len(record.data) == 8 * record.whole("count") == 8 * len(told.counts),
                lambda: f"the entry at byte {record.at} does not hold as many topics as it says",
            )
            self._told[record.whole("chunk_pos")] = told
        else:
            raise StructureError(f"the index holds a record of kind {record.kind} at byte {record.at}")

    def _chunks_of(self, source: BinaryIO, first: int, index_at: int) -> Iterator[tuple[Record, list[Record]]]:
        """Each chunk with the index records behind it."""
        source.seek(first)
        chunk, index = None, list[Record]()
        while source.tell() < index_at:
            record = records.read_record(source)
            if record.kind == records.CHUNK:
                if chunk is not None:
                    yield chunk, index
                chunk, index = record, []
            elif record.kind == records.INDEX and chunk is not None:
                index.append(record)
            else:
                raise StructureError(f"between chunks stands a record of kind {record.kind} at byte {record.at}")
        if chunk is not None:
            yield chunk, index
        self._file.see(source.tell() == index_at, f"the last record before the index ends at byte {source.tell()}, the "
                       f"index begins at byte {index_at}")  # fmt: skip

    def _in_time_order(self, chunks: Iterator[tuple[Record, list[Record]]], workers: int) -> Iterator[RawMessage]:
        later = _earliest_from(self._told)
        waiting: list[tuple[int, int, int, int, bytes]] = []
        met: set[int] = set()
        for order, chunk in enumerate(in_order(chunks, _unpack, workers)):
            self._compare(chunk)
            met.add(chunk.at)
            for m in chunk.messages:
                waiting.append((m.stamp_ns, order, m.at, m.connection, chunk.data[m.start : m.end]))
            waiting.sort()
            limit = later.get(chunk.at)
            ready = next((k for k, row in enumerate(waiting) if limit is not None and row[0] >= limit), len(waiting))
            yield from self._known(waiting[:ready])
            del waiting[:ready]
        yield from self._known(waiting)
        lost = sorted(set(self._told) - met)
        self._chunks.see(not lost, f"there is none at {', '.join(f'byte {at}' for at in lost[:3])}")

    def _known(self, rows: list[tuple[int, int, int, int, bytes]]) -> Iterator[RawMessage]:
        for stamp, _, _, number, data in rows:
            topic, msgtype = self._topics.get(number, ("", ""))
            if topic:
                self.counts[topic] = self.counts.get(topic, 0) + 1
                yield RawMessage(stamp, topic, msgtype, data)

    def _compare(self, chunk: _Unpacked) -> None:
        """Hold a chunk against the index behind it and the index at the file's end."""
        place = f"chunk at byte {chunk.at}"
        found: dict[int, list[tuple[int, int]]] = {}
        for m in chunk.messages:
            found.setdefault(m.connection, []).append((m.stamp_ns, m.at))
        entries = {(number, *entry) for number, rows in chunk.entries.items() for entry in rows}
        real = {(number, *entry) for number, rows in found.items() for entry in rows}
        wrong = sorted(entries ^ real)
        self._index.count(len(chunk.messages), len(wrong), f"{place}, topic {wrong[0][0]}" if wrong else "")
        count = sum(map(len, chunk.entries.values()))
        self._index.see(count == len(entries), lambda: f"{place}: an entry stands there twice")
        self._connections.see(set(found) <= set(self._topics), f"{place} holds messages of unknown topics")
        for number, record, data in chunk.connections:
            same = self._definitions.get(number) == (dict(record.fields), data)
            self._connections.see(same, lambda number=number: f"{place}, topic {number}")  # type: ignore[misc]
        told = self._told.get(chunk.at)
        if told is None:
            self._chunks.see(False, f"the {place} is not in the index")
            return
        counts = {number: len(rows) for number, rows in found.items()}
        self._chunks.see(told.counts == counts, f"the {place} holds other numbers of messages")
        stamps = [m.stamp_ns for m in chunk.messages]
        if stamps:
            self._chunks.see((told.start_ns, told.end_ns) == (min(stamps), max(stamps)),
                             f"the {place} has another first or last stamp")  # fmt: skip


def _earliest_from(told: dict[int, _Told]) -> dict[int, int]:
    """Earliest stamp [ns] in all chunks behind each chunk, by its place in the file."""
    earliest: dict[int, int] = {}
    soonest = None
    for at in sorted(told, reverse=True):
        if soonest is not None:
            earliest[at] = soonest
        if told[at].counts:
            soonest = told[at].start_ns if soonest is None else min(soonest, told[at].start_ns)
    return earliest


def _unpack(item: tuple[Record, list[Record]]) -> _Unpacked:
    chunk, index = item
    data = records.unpack(chunk)
    messages: list[_Message] = []
    connections: list[tuple[int, Record, bytes]] = []
    at = 0
    while at < len(data):
        record, end = records.record_at(data, at)
        start = at + 8 + int.from_bytes(data[at : at + 4], "little")
        if record.kind == records.MESSAGE:
            messages.append(_Message(record.time("time"), record.whole("conn"), at, start, end))
        elif record.kind == records.CONNECTION:
            connections.append((record.whole("conn"), record, data[start:end]))
        else:
            raise StructureError(f"the chunk at byte {chunk.at} holds a record of kind {record.kind}")
        at = end
    return _Unpacked(chunk.at, data, messages, connections, _entries(index))


def _entries(index: list[Record]) -> dict[int, list[tuple[int, int]]]:
    """Stamp [ns] and offset of each entry, by topic's number."""
    entries: dict[int, list[tuple[int, int]]] = {}
    for record in index:
        if record.whole("ver") != 1 or len(record.data) != 12 * record.whole("count"):
            raise StructureError(f"the index record at byte {record.at} does not hold as many entries as it says")
        rows = entries.setdefault(record.whole("conn"), [])
        rows += [(seconds * 10**9 + ns, offset) for seconds, ns, offset in struct.iter_unpack("<LLL", record.data)]
    return entries
