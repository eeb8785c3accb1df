# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files beside a bag that say where it comes from: what made its readings, and checksums.

made_by.json is a list of processors as they were used and of libraries, because the workers of a cluster, or the
processes that resumed a run, may differ. Where all entries are those of this process, it makes the same bytes again.
SHA256SUMS has the format of ``sha256sum -c``.
"""

import hashlib
import json
import sys
from collections.abc import Callable, Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from fieldtruth.bag.file import MADE_BY, BagError
from fieldtruth.core.files import write_atomically
from fieldtruth.sense.embree import processor

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


def fits_checksums(folder: Path, *names: str) -> bool:
    """Return whether the SHA256SUMS of a folder has these files as they are.

    Raises:
        BagError: as ``read_checksums``.
    """
    found = read_checksums(folder)
    return found.keys() >= {*names} and all(found[name] == sha256_of(folder / name) for name in names)


LIBRARIES: Final = ("numpy", "scipy", "numba", "embreex", "simplejpeg", "lz4", "rosbags")
"""Distributions whose version shapes the bytes of a bag."""
Maker = dict[str, str]
"""Processor, and versions of Python and libraries, by name; empty if they are unknown."""


@cache
def this_process() -> Maker:
    """Return processor and versions of this process."""
    python = ".".join(map(str, sys.version_info[:2]))
    return processor() | {"Python": python} | {name: version(name) for name in LIBRARIES}


def note(folder: Path, makers: Iterable[Maker]) -> None:
    """Add makers of slices to the folder of these slices."""
    for maker in makers:
        text = json.dumps(maker, indent=1)
        write_atomically(folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.maker", text)


def noted(folder: Path) -> str:
    """Return the text of made_by.json for the slices of a folder."""
    return json.dumps([json.loads(path.read_bytes()) for path in sorted(folder.glob("*.maker"))], indent=1) + "\n"


def makers_of(folder: Path) -> list[Maker]:
    """Read the makers of the run in a folder; one unknown maker if made_by.json is missing or cannot be read."""
    try:
        found: Any = json.loads((folder / MADE_BY).read_bytes())
        return [{str(name): str(value) for name, value in maker.items()} for maker in found] or [{}]
    except (OSError, ValueError, AttributeError, TypeError):
        return [{}]


def difference(makers: Iterable[Maker]) -> str:
    """Name the differences of makers from this process; empty if this process makes the same bytes."""
    here, names = this_process(), dict[str, None]()
    for maker in makers:
        if not maker:
            return f"no {MADE_BY} says what made it"
        names |= dict.fromkeys(name for name in here | maker if maker.get(name) != here.get(name))
    return f"made with other {', '.join(names)}" if names else ""
