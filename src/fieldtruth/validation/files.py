# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files and checksums: SHA256SUMS, experiment.yaml, and the records and index of the bag.

The bag is read front to back with the record parser of rosbags. Every record must follow the one before it without a
gap, and the index must agree with the messages.
"""

import struct
from collections import Counter
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

import lz4.frame
from rosbags.interfaces import Connection
from rosbags.rosbag1 import ReaderError
from rosbags.rosbag1.reader import ChunkInfo, Header, RecordType, decompressors, read_bytes, read_uint32

from fieldtruth.bag.file import EXPERIMENT, MCAP, BagError, bag_files, read_errors
from fieldtruth.bag.provenance import CHECKSUMS, read_checksums, sha256_of
from fieldtruth.bag.reader import BagReader, RawMessage, open_bag
from fieldtruth.bag.run import Run, open_run
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.validation.check import Check, Rule, Spec, Tally

MAGIC: Final = b"#ROSBAG V2.0\n"
CHECKSUMS_SPEC: Final[Spec] = Spec("checksums", (Rule(f"the files have the SHA-256 sums of {CHECKSUMS}"),))
EXPERIMENT_SPEC: Final[Spec] = Spec("experiment", (Rule(f"{EXPERIMENT} can be read and belongs to this bag"),))
READABLE: Final = Rule("the file consists of records without a gap, and can be unpacked")
COUNTS: Final = Rule("header and index have the chunks, stamps and message counts of the file")
ENTRIES: Final = Rule("every message has its entry in the index behind its chunk, and every entry its message")
TOPICS: Final = Rule("chunks repeat the topic definitions of the index")
STRUCTURE: Final[Spec] = Spec("structure", (READABLE, COUNTS, ENTRIES, TOPICS), "messages", "the file was not read")


def check_checksums(bag: Path, progress: Progress) -> Check:
    """Compare the files beside a bag, and the bag, with SHA256SUMS."""
    name, folder = CHECKSUMS_SPEC.name, bag.parent
    try:
        sums = read_checksums(folder)
    except (FieldtruthError, OSError) as error:
        return Check(name, False, str(error))
    if bag.name not in sums:
        return Check(name, None, f"{CHECKSUMS} does not name the bag" if sums else f"no {CHECKSUMS} beside the bag")
    wrong, size = [], 0
    with progress.stage("checksums"):
        for file, expected in sums.items():
            try:
                found = sha256_of(folder / file)
                size += (folder / file).stat().st_size
            except OSError as error:
                missing = isinstance(error, FileNotFoundError)
                wrong.append(f"{file} is missing" if missing else f"cannot read {file}: {error.strerror}")
                continue
            if found != expected:
                wrong.append(f"{file} has changed: {found[:12]}..., {CHECKSUMS} has {expected[:12]}...")
    return Check(name, not wrong, "; ".join(wrong) or f"{len(sums)} files, {size / 1e6:.1f} MB")


def open_checked(bag: Path) -> tuple[Run, Check]:
    """Open a run; an experiment that cannot be read is a failed check, not an error.

    Raises:
        BagError: the bag cannot be opened.
    """
    name = EXPERIMENT_SPEC.name
    try:
        run = open_run(bag)
    except ConfigurationError as error:
        with open_bag(bag) as stored:
            counts = {topic: count for topic, count in stored.counts.items() if count}
            bare = Run(bag, None, counts, stored.msgtypes, stored.start_ns, stored.end_ns)
        return bare, Check(name, False, str(error))
    if run.experiment is not None:
        return run, Check(name, True, f"{run.experiment.name} made the bag")
    exists = (run.folder / EXPERIMENT).exists()
    return run, Check(name, None, f"{EXPERIMENT} belongs to another bag" if exists else f"no {EXPERIMENT}")


def was_bag(path: Path) -> bool:
    """Return whether an unreadable file is a damaged bag, by its magic number or by the files beside it."""
    try:
        with path.open("rb") as source:
            begins = source.read(len(MAGIC))
        named = path.name in read_checksums(path.parent) or (path.parent / EXPERIMENT).is_file()
        return begins.startswith((MAGIC, MCAP)) or named
    except (FieldtruthError, OSError):
        return False


class _Chunk(NamedTuple):
    """Messages of a chunk by offset: connection, stamp [ns] and data; and its index entries."""

    at: int
    messages: dict[int, tuple[int, int, bytes]]
    entries: list[tuple[int, int, int]]
    """Connection, stamp [ns], offset."""


class BagFile:
    """A bag file that is read once, front to back."""

    def __init__(self, path: Path, connections: Iterable[Connection]) -> None:
        self.path = path
        self.tally = Tally(STRUCTURE)
        self._topics = {c.id: (c.topic, c.msgtype) for c in connections}
        self._definitions: dict[int, tuple[Header, bytes]] = {}
        self._infos: dict[int, ChunkInfo] = {}
        self._size = 0

    @property
    def readable(self) -> bool:
        """True if everything could be read so far."""
        return self.tally[READABLE].wrong == 0

    def messages(self) -> Iterator[RawMessage]:
        """Messages in time order, ties in file order. Damage ends the stream and fails the check."""
        try:
            with read_errors(self.path), self.path.open("rb") as source:
                yield from self._in_time_order(self._chunks(source, self._read_index(source)))
        except BagError as error:
            self.tally[READABLE].see(False, str(error))

    def result(self) -> Check:
        """Return the check of the structure."""
        self.tally.note = f"{self._size / 1e6:.1f} MB, {len(self._infos):,} chunks"
        return self.tally.result()

    def _read_index(self, source: BinaryIO) -> int:
        """Read the header and the index at the end of the file; returns where the index begins."""
        self._size = source.seek(0, 2)
        source.seek(0)
        magic, header = source.read(len(MAGIC)), Header.read(source, RecordType.BAGHEADER)
        padding, first = read_bytes(source, read_uint32(source)), source.tell()
        self.tally[READABLE].see(magic == MAGIC, f"the file begins with {magic!r}")
        self.tally[READABLE].see(not padding.strip(b" "), "the padding of the header is not blank")
        index_at = header.get_uint64("index_pos")
        if not first <= index_at <= self._size:
            raise ReaderError(f"the header has the index at byte {index_at} of {self._size}")
        source.seek(index_at)
        while source.tell() < self._size:
            record, data = _record(source)
            if record.get_uint8("op") == RecordType.CONNECTION:
                self._definitions[record.get_uint32("conn")] = record, data
                continue
            if record.get_uint8("op") != RecordType.CHUNK_INFO or record.get_uint32("ver") != 1:
                raise ReaderError("the index holds another record than topics and chunks")
            counts = dict(struct.iter_unpack("<LL", data))
            start, end = record.get_time("start_time"), record.get_time("end_time")
            info = ChunkInfo(record.get_uint64("chunk_pos"), start, end, counts)
            self.tally[COUNTS].see(record.get_uint32("count") == len(counts), f"index of the chunk at byte {info.pos}")
            self._infos[info.pos] = info
        expected = header.get_uint32("conn_count"), header.get_uint32("chunk_count")
        found = len(self._definitions), len(self._infos)
        self.tally[COUNTS].see(expected == found, f"header: {expected} topics and chunks, index: {found}")
        source.seek(first)
        return index_at

    def _chunks(self, source: BinaryIO, index_at: int) -> Iterator[_Chunk]:
        while (start := source.tell()) < index_at:
            header = Header.read(source, RecordType.CHUNK)
            data = unpack(header.get_string("compression"), read_bytes(source, read_uint32(source)))
            if start not in self._infos or len(data) != header.get_uint32("size"):
                raise ReaderError(f"the chunk at byte {start} is not in the index, or of another size")
            entries: list[tuple[int, int, int]] = []
            for _ in self._infos[start].connection_counts:
                index = Header.read(source, RecordType.IDXDATA)
                rows = [*struct.iter_unpack("<LLL", read_bytes(source, read_uint32(source)))]
                if index.get_uint32("ver") != 1 or index.get_uint32("count") != len(rows):
                    raise ReaderError(f"the index behind the chunk at byte {start} has another length")
                number = index.get_uint32("conn")
                entries += [(number, seconds * 10**9 + nanoseconds, offset) for seconds, nanoseconds, offset in rows]
            yield _Chunk(start, self._messages_in(data), entries)
        self.tally[READABLE].see(source.tell() == index_at, "the last chunk reaches into the index")

    def _messages_in(self, data: bytes) -> dict[int, tuple[int, int, bytes]]:
        source, messages = BytesIO(data), {}
        while (offset := source.tell()) < len(data):
            record, body = _record(source)
            number = record.get_uint32("conn")
            if record.get_uint8("op") == RecordType.CONNECTION:
                self.tally[TOPICS].see(self._definitions.get(number) == (record, body), f"topic {number}")
            elif record.get_uint8("op") == RecordType.MSGDATA:
                messages[offset] = number, record.get_time("time"), body
            else:
                raise ReaderError("a chunk holds another record than messages and topics")
        return messages

    def _in_time_order(self, chunks: Iterator[_Chunk]) -> Iterator[RawMessage]:
        later = _earliest_after(self._infos)
        waiting: list[tuple[int, int, int, int, bytes]] = []
        read: set[int] = set()
        for chunk in chunks:
            read.add(chunk.at)
            self._compare(chunk)
            waiting += [(stamp, chunk.at, at, number, data) for at, (number, stamp, data) in chunk.messages.items()]
            waiting.sort()
            limit = later.get(chunk.at)
            ready = next((k for k, row in enumerate(waiting) if limit is not None and row[0] >= limit), len(waiting))
            yield from self._known(waiting[:ready])
            del waiting[:ready]
        yield from self._known(waiting)
        lost = sorted(set(self._infos) - read)
        self.tally[COUNTS].see(not lost, f"no chunk at {', '.join(f'byte {at}' for at in lost[:3])}")

    def _known(self, rows: list[tuple[int, int, int, int, bytes]]) -> Iterator[RawMessage]:
        for stamp, _, _, number, data in rows:
            if number in self._topics:
                yield RawMessage(stamp, *self._topics[number], data, number)

    def _compare(self, chunk: _Chunk) -> None:
        """Compare a chunk with the index behind it and the index at the end of the file."""
        where, info = f"chunk at byte {chunk.at}", self._infos[chunk.at]
        found = [(number, stamp, at) for at, (number, stamp, _) in chunk.messages.items()]
        wrong = sorted(set(found) ^ set(chunk.entries))
        extra = len(chunk.entries) - len(set(chunk.entries))
        first = f"{where}, topic {wrong[0][0]}" if wrong else f"{where}: an entry occurs twice"
        self.tally[ENTRIES].add(len(found), len(wrong) + extra, first)
        counts = Counter(number for number, _, _ in found)
        self.tally[TOPICS].see(counts.keys() <= self._topics.keys(), f"{where}: messages of unknown topics")
        self.tally[COUNTS].see(info.connection_counts == counts, f"{where}: other numbers of messages")
        stamps = [stamp for _, stamp, _ in found]
        right = not stamps or (info.start_time, info.end_time) == (min(stamps), max(stamps))
        self.tally[COUNTS].see(right, f"{where}: other first or last stamp")


class OtherFile(BagFile):
    """A bag of another format, such as MCAP: read once in time order; what must hold is that it can be read."""

    def __init__(self, stored: BagReader) -> None:
        super().__init__(stored.path, ())
        self._stored = stored

    def messages(self) -> Iterator[RawMessage]:
        """Messages in time order. Damage ends the stream and fails the check."""
        try:
            yield from self._stored.messages()
            self.tally[READABLE].see(True, "")
        except BagError as error:
            self.tally[READABLE].see(False, str(error))

    def result(self) -> Check:
        """Return the check of the structure."""
        self.tally.note = f"{sum(file.stat().st_size for file in bag_files(self.path)) / 1e6:.1f} MB"
        return self.tally.result()


def unpack(compression: str, packed: bytes) -> bytes:
    """Unpack a chunk.

    Raises:
        ReaderError: bytes follow the LZ4 frame, which the decompressor of rosbags ignores.
    """
    if compression != "lz4":
        return decompressors[compression](packed)
    data, used = lz4.frame.decompress(packed, return_bytes_read=True)
    if used != len(packed):
        raise ReaderError("a chunk holds bytes behind its LZ4 frame")
    return bytes(data)


def _record(source: BinaryIO) -> tuple[Header, bytes]:
    return Header.read(source), read_bytes(source, read_uint32(source))


def _earliest_after(infos: dict[int, ChunkInfo]) -> dict[int, int]:
    """Earliest stamp [ns] of all chunks behind each chunk, by its position."""
    earliest: dict[int, int] = {}
    limit: int | None = None
    for position in sorted(infos, reverse=True):
        if limit is not None:
            earliest[position] = limit
        info = infos[position]
        if info.connection_counts:
            limit = info.start_time if limit is None else min(limit, info.start_time)
    return earliest
