# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A bag as the paper publishes it: packed without loss, with a text file that holds its SHA-256.

The bag is read once. Its blocks are hashed in order and packed side by side; packed blocks follow one another as one
Deflate stream, so that the file is the same however many threads worked. Deflate finds little in a bag, whose chunks
are LZ4 already. Measured on 4 s of park_1 with all images (776 MB), processor time of one core:

=============  =====  =============================
packer         ratio  speed
=============  =====  =============================
none           1.000  as fast as the disk
ISA-L level 1  1.195  550 MB/s (level 3: 396, 1.198)
zlib level 1   1.232  47 MB/s (level 6: 28, 1.236)
=============  =====  =============================

ISA-L saves a sixth of the file and costs little more than the checksum (SHA-256 of the same bag: 1,370 MB/s).
"""

import hashlib
import os
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

from isal import isal_zlib

from fieldtruth.bag.checksums import CHECKSUMS, read_checksums
from fieldtruth.bag.damage import BagError, damage
from fieldtruth.bag.run import CARD, EXPERIMENT, Run
from fieldtruth.core.parallel import in_order
from fieldtruth.exporters import Options

_BLOCK: Final = 2**20  # [byte]
_BESIDE: Final = (EXPERIMENT, CARD, CHECKSUMS, "README.md", "README.txt", "README")

_LOCAL: Final = struct.Struct("<4s5H3L2H")
_CENTRAL: Final = struct.Struct("<4s6H3L5H2L")
_END_64: Final = struct.Struct("<4sQ2H2L4Q")
_LOCATOR_64: Final = struct.Struct("<4sLQL")
_END: Final = struct.Struct("<4s4H2LH")
_VERSION: Final = 45  # of the format: the first with ZIP64
_UNIX: Final = 3 << 8
_UTF8: Final = 1 << 11
_DEFLATE: Final = 8
_TIME, _DATE = 0, 1 << 5 | 1  # 1 January 1980, the first of the format
_MODE: Final = 0o100644 << 16
_IN_EXTRA: Final = 0xFFFFFFFF  # the true number is in the ZIP64 field
_LAST: Final = b"\x03\x00"  # an empty block that ends a Deflate stream


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write ``NAME.bag``, ``NAME.sha256`` and what belongs to the bag in its folder.

    Raises:
        BagError: the bag cannot be read, or is not the one that its SHA256SUMS tells of.
    """
    (run,) = runs
    stated = read_checksums(run.folder).get(run.bag.name)
    digest = hashlib.sha256()
    with target.open("wb") as file:
        archive = _Archive(file, options.workers)
        with options.progress.stage("pack the bag", run.duration_s) as advance:
            archive.add(f"{run.name}.bag", _read(run, digest.update, advance))
        if stated not in (None, digest.hexdigest()):
            raise BagError(f"{run.bag} has changed since {CHECKSUMS} beside it was written: its SHA-256 is another")
        archive.add(f"{run.name}.sha256", [f"{digest.hexdigest()}  {run.name}.bag\n".encode()])
        for path in _beside(run):
            archive.add(path.name, [path.read_bytes()])
        archive.close()


def _beside(run: Run) -> list[Path]:
    """Files that tell of this bag: those of a folder with no other bag in it."""
    if list(run.folder.glob("*.bag")) != [run.bag]:
        return []
    paths = [run.folder / name for name in _BESIDE if name != EXPERIMENT or run.experiment is not None]
    return [path for path in paths if path.is_file()]


def _read(run: Run, update: Callable[[bytes], None], advance: Callable[[float], None]) -> Iterator[bytes]:
    with damage(run.bag), run.bag.open("rb") as source:
        size = os.fstat(source.fileno()).st_size
        while block := source.read(_BLOCK):
            update(block)
            advance(run.duration_s * len(block) / size)
            yield block


def _pack(block: bytes) -> bytes:
    packer = isal_zlib.compressobj(1, isal_zlib.DEFLATED, -15)
    packed: bytes = packer.compress(block) + packer.flush(isal_zlib.Z_SYNC_FLUSH)
    return packed


class _Archive:
    """A Zip that grows. Each entry is ZIP64, so that a small bag goes the way of one above 4 GB."""

    def __init__(self, file: BinaryIO, workers: int) -> None:
        self._file = file
        self._workers = workers
        self._directory: list[bytes] = []

    def add(self, name: str, blocks: Iterable[bytes]) -> None:
        """Pack the blocks as one file; they are taken one after the other, a few ahead."""
        encoded, at = os.fsencode(name), self._file.tell()
        size = crc = 0

        def counted() -> Iterator[bytes]:
            nonlocal size, crc
            for block in blocks:
                size, crc = size + len(block), isal_zlib.crc32(block, crc)
                yield block

        self._local(encoded, 0, 0, 0)
        start = self._file.tell()
        for packed in in_order(counted(), _pack, self._workers):
            self._file.write(packed)
        self._file.write(_LAST)
        end = self._file.tell()
        self._file.seek(at)
        self._local(encoded, crc, size, end - start)
        self._file.seek(end)
        kind = (_VERSION, _UTF8, _DEFLATE, _TIME, _DATE, crc, _IN_EXTRA, _IN_EXTRA, len(encoded))
        fixed = _CENTRAL.pack(b"PK\x01\x02", _UNIX | _VERSION, *kind, 28, 0, 0, 0, _MODE, _IN_EXTRA)
        self._directory.append(fixed + encoded + struct.pack("<2H3Q", 1, 24, size, end - start, at))

    def close(self) -> None:
        """Write the directory."""
        at, directory, count = self._file.tell(), b"".join(self._directory), len(self._directory)
        end = at + len(directory)
        sizes = (count, count, len(directory), at)
        self._file.write(directory)
        self._file.write(_END_64.pack(b"PK\x06\x06", _END_64.size - 12, _UNIX | _VERSION, _VERSION, 0, 0, *sizes))
        self._file.write(_LOCATOR_64.pack(b"PK\x06\x07", 0, end, 1))
        self._file.write(_END.pack(b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, _IN_EXTRA, _IN_EXTRA, 0))

    def _local(self, name: bytes, crc: int, size: int, packed: int) -> None:
        kind = (_VERSION, _UTF8, _DEFLATE, _TIME, _DATE, crc, _IN_EXTRA, _IN_EXTRA, len(name), 20)
        self._file.write(_LOCAL.pack(b"PK\x03\x04", *kind) + name + struct.pack("<2H2Q", 1, 16, size, packed))
