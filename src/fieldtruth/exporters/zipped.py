# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Export a bag as a ZIP archive, as the paper publishes it, with a text file that holds its SHA-256.

The bag is read once. Its chunks are LZ4 already, so Deflate gains little; measured on 4 s of park_1 with all images
(776 MB), processor time of one core:

=============  =====  =============================
Deflate        ratio  speed
=============  =====  =============================
none           1.000  as fast as the disk
ISA-L level 1  1.195  550 MB/s (level 3: 396, 1.198)
zlib level 1   1.232  47 MB/s (level 6: 28, 1.236)
=============  =====  =============================
"""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from isal import isal_zlib

from fieldtruth.bag.file import CARD, EXPERIMENT, MADE_BY, BagError, read_errors
from fieldtruth.bag.provenance import CHECKSUMS, read_checksums
from fieldtruth.bag.run import Run
from fieldtruth.exporters import Options

_BLOCK: Final = 2**20  # [byte]
_BESIDE: Final = (EXPERIMENT, CARD, MADE_BY, CHECKSUMS, "README.md", "README.txt", "README")


def write(runs: Sequence[Run], target: Path, options: Options) -> None:
    """Write the bag, ``NAME.sha256`` and the files of the bag's folder that describe it.

    Raises:
        BagError: the bag cannot be read, or differs from its checksum in SHA256SUMS.
    """
    (run,) = runs
    expected = read_checksums(run.folder).get(run.bag.name)
    digest = hashlib.sha256()
    with ZipFile(target, "w") as archive:
        with options.progress.stage("pack the bag", run.duration_s) as advance:
            add_member(archive, run.bag.name, _blocks(run, digest.update, advance))
        if expected not in (None, digest.hexdigest()):
            raise BagError(f"{run.bag} has changed since {CHECKSUMS} beside it was written: its SHA-256 differs")
        add_member(archive, f"{run.name}.sha256", [f"{digest.hexdigest()}  {run.bag.name}\n".encode()])
        for path in _beside(run):
            add_member(archive, path.name, [path.read_bytes()])


def _beside(run: Run) -> list[Path]:
    """Files that describe this bag; none if the folder has another bag."""
    if list(run.folder.glob(f"*{run.bag.suffix}")) != [run.bag]:
        return []
    paths = [run.folder / name for name in _BESIDE if name != EXPERIMENT or run.experiment is not None]
    return [path for path in paths if path.is_file()]


def _blocks(run: Run, update: Callable[[bytes], None], advance: Callable[[float], None]) -> Iterator[bytes]:
    with read_errors(run.bag), run.bag.open("rb") as source:
        size = os.fstat(source.fileno()).st_size
        while block := source.read(_BLOCK):
            update(block)
            advance(run.duration_s * len(block) / size)
            yield block


def add_member(archive: ZipFile, name: str, blocks: Iterable[bytes]) -> None:
    """Add a file. Sizes are ZIP64, as a bag may exceed 4 GB; it has no date, so that equal bags give equal archives."""
    info = ZipInfo(name)
    info.compress_type, info.create_system, info.external_attr = ZIP_DEFLATED, 3, 0o100644 << 16
    with archive.open(info, "w", force_zip64=True) as member:
        # zipfile has no option for another Deflate; ISA-L's is ten times as fast as zlib's
        member._compressor = isal_zlib.compressobj(1, isal_zlib.DEFLATED, -15)  # type: ignore[attr-defined]
        for block in blocks:
            member.write(block)
