# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Unreadable files: errors of the libraries below become one clear line."""

import stat
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rosbags.rosbag1 import ReaderError
from rosbags.typesys import TypesysError

from fieldtruth.core.errors import FieldtruthError

_DAMAGE: Final = (ReaderError, OSError, EOFError, RuntimeError, ValueError, KeyError, struct.error, TypesysError)
"""Errors that the libraries raise for invalid bytes."""
_BAG: Final = b"#ROSBAG V2.0"
MCAP: Final = b"\x89MCAP0\r\n"
"""First bytes of an MCAP file."""
_KINDS: Final = {
    b"PK\x03\x04": "it is a Zip file; unpack it and use the bag in it",
    b"\x89MCAP": "it is an MCAP file of another version",
    b"SQLite": "it is a database of ROS 2; `ros2 bag convert` makes an MCAP file of it",
    b"#ROSBAG": "its bag version is not 2.0",
}
"""Files that users confuse with bags, by their first bytes."""
_LONGEST: Final = 200
"""Characters of a library's message, which may quote what it read."""


class BagError(FieldtruthError):
    """A file that is not a readable bag, or a bag that lacks required topics or fields."""


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Turn any error while a bag is read into one clear line.

    Raises:
        BagError: the path and the reason.
    """
    try:
        yield
    except FieldtruthError:
        raise
    except _DAMAGE as error:
        raise BagError(f"cannot read {path}: {_other_kind(path) or _in_words(error)}") from error


def first_bytes(path: Path, size: int = len(_BAG)) -> bytes:
    """Return the first bytes of a file.

    Raises:
        BagError: it cannot be read, or is not a file: reading a named pipe would wait for a process that writes to it.
    """
    with read_errors(path):
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a named pipe", stat.S_IFSOCK: "a socket"}
            raise BagError(f"cannot read {path}: it is {kinds.get(stat.S_IFMT(mode), 'a device')}, not a file")
        with path.open("rb") as file:
            return file.read(size)


def is_ros1(path: Path) -> bool:
    """Whether a file begins as a bag of ROS 1; raises as ``first_bytes``."""
    return first_bytes(path) == _BAG


def _other_kind(path: Path) -> str:
    """Describe a file that is not a bag at all; empty for bags."""
    try:
        with path.open("rb") as file:
            start = file.read(len(_BAG))
    except OSError:
        return ""
    if start.startswith((_BAG, MCAP)):
        return ""
    kinds = [words for magic, words in _KINDS.items() if start.startswith(magic)] if start else ["it is empty"]
    return kinds[0] if kinds else f"it is neither an MCAP file nor a ROS 1 bag, which begins with {_BAG.decode()}"


def _in_words(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f"a record lacks its field {error}"
    text = str(error)
    if "not indexed" in text:
        return "it has no index, as after an aborted recording; `rosbag reindex` may repair it"
    if text.startswith("Bag index looks damaged"):
        return "its index is damaged, as in a truncated file"
    return " ".join(text.split())[:_LONGEST] or type(error).__name__
