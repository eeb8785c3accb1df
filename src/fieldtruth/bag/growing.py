# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag that grows by whole bags in its own file, and goes on after a crash with the same bytes.

Beside it is a journal with a line for each bag that was added: where its copy ends, the CRC-32 of the copy, and its
chunks, behind the CRC-32 of the line itself. A line is written after the copy is on the disk. Whatever follows the last
copy that agrees with its line is cut off when the file is opened again.
"""

import json
import zlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, NamedTuple, Self

from fieldtruth.bag.writer import COPY_SIZE, BagWriter, Chunk
from fieldtruth.core.files import sync, write_atomically
from fieldtruth.experiment.topic import Topic

JOURNAL: Final = ".journal"
"""What follows the file's name in that of the journal."""


class _Copy(NamedTuple):
    """A line of the journal: where the copy of a bag is, its CRC-32, and its chunks."""

    start: int
    end: int
    crc: int
    chunks: list[Chunk]


class GrowingBag(BagWriter):
    """Context manager that adds bags to a file; the index is written at the end, if there is no error.

    Args:
        path: the bag; without its index it is not complete, and whatever happens, it stays.
        topics: those of the bags that are added.
    """

    def __init__(self, path: Path, topics: Sequence[Topic]) -> None:
        self.path = path
        self.added = 0
        """Number of bags that are in the file, and safe there."""
        self._journal = path.with_name(path.name + JOURNAL)
        self._fresh = path.with_name(path.name + ".new")
        self._fresh.unlink(missing_ok=True)
        self._seal = None
        self._prepare(self._fresh, topics)

    def __enter__(self) -> Self:
        copies = list(_intact_copies(self.path, self._journal))
        super().__enter__()
        if copies:
            self._resume(copies)
        else:
            self._fresh.replace(self.path)
        write_atomically(self._journal, b"".join(map(_line, copies)))
        self.added = len(copies)
        return self

    def _resume(self, copies: Sequence[_Copy]) -> None:
        self._writer.abort()
        bio = self._writer.bio = self.path.open("r+b")
        bio.write(self._fresh.read_bytes())  # a former end may have written the header
        self._fresh.unlink()
        bio.truncate(copies[-1].end)
        bio.seek(copies[-1].end)
        self._enter([chunk for copy in copies for chunk in copy.chunks])

    def add(self, path: Path) -> None:
        """Add a bag; when this returns, its copy is on the disk."""
        bio = self._writer.bio
        assert bio is not None
        start = bio.tell()
        chunks = self.append(path)
        end = bio.tell()
        bio.flush()
        sync(self.path)
        with self.path.open("rb") as file, self._journal.open("ab") as journal:
            journal.write(_line(_Copy(start, end, _crc(file, start, end), chunks)))
        sync(self._journal)
        self.added += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._finish(self.path)
                sync(self.path)
        finally:
            with suppress(OSError):
                self._writer.abort()


def _line(copy: _Copy) -> bytes:
    text = json.dumps(copy).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _intact_copies(path: Path, journal: Path) -> Iterator[_Copy]:
    """Yield the copies in a file that agree with the journal, up to the first one that does not."""
    if not (path.exists() and journal.exists()):
        return
    with path.open("rb") as file, journal.open("rb") as lines:
        for line in lines:
            crc, _, text = line.rstrip(b"\n").partition(b" ")
            if crc != b"%08x" % zlib.crc32(text):
                return
            start, end, content, chunks = json.loads(text)
            if _crc(file, start, end) != content:
                return
            yield _Copy(start, end, content, [_chunk(*chunk) for chunk in chunks])


def _chunk(position: int, start_ns: int, end_ns: int, counts: dict[str, int]) -> Chunk:
    return Chunk(position, start_ns, end_ns, {int(number): count for number, count in counts.items()})


def _crc(file: BinaryIO, start: int, end: int) -> int:
    """CRC-32 of a part of a file, or of what there is of it."""
    file.seek(start)
    crc, left = 0, end - start
    while left > 0 and (block := file.read(min(left, COPY_SIZE))):
        crc = zlib.crc32(block, crc)
        left -= len(block)
    return crc
