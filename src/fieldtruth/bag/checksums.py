# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""SHA-256 of the files of a run, in the format of ``sha256sum -c``."""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from fieldtruth.bag.reader import BagError

CHECKSUMS: Final = "SHA256SUMS"
"""The file in a run's folder."""

_BLOCK: Final = 8 * 2**20  # [byte]


def sha256_of(path: Path, advance: Callable[[float], None] | None = None) -> str:
    """Return the SHA-256 of a file in hexadecimal; ``advance`` is called with the fraction of the file just read."""
    digest, size = hashlib.sha256(), max(path.stat().st_size, 1)
    with path.open("rb") as source:
        while block := source.read(_BLOCK):
            digest.update(block)
            if advance is not None:
                advance(len(block) / size)
    return digest.hexdigest()


def checksum_lines(folder: Path, names: Iterable[str]) -> str:
    """Return the lines of ``sha256sum`` for files of a folder."""
    return "".join(f"{sha256_of(folder / name)}  {name}\n" for name in names)


def read_checksums(folder: Path) -> dict[str, str]:
    """Read the SHA-256 by file name of a run's folder; empty if it has no SHA256SUMS.

    Raises:
        BagError: the file is not in the format of ``sha256sum``, or names a file outside the folder.
    """
    path = folder / CHECKSUMS
    if not path.is_file():
        return {}
    found: dict[str, str] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        digest, mark, name = line[:64], line[64:66], line[66:]
        if len(digest) != 64 or not set(digest) <= set("0123456789abcdef") or mark not in ("  ", " *"):
            raise BagError(f"{path}, line {number}: must be 64 hexadecimal digits, two spaces and a file name")
        if not name or Path(name).name != name:
            raise BagError(f"{path}, line {number}: {name!r} is not a file name in this folder")
        found[name] = digest
    return found
