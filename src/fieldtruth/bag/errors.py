# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Files that are no bags, or no longer: whatever the layers below say of them becomes one clear line."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rosbags.rosbag1 import ReaderError
from rosbags.typesys import TypesysError

from fieldtruth.core.errors import FieldtruthError

_DAMAGE: Final = (ReaderError, OSError, EOFError, RuntimeError, ValueError, KeyError, struct.error, TypesysError)
"""What the layers below raise about bytes that are not what they should be."""
_BAG: Final = b"#ROSBAG V2.0"
_KINDS: Final = {
    b"PK\x03\x04": "it is a Zip file; unpack it and name the bag in it",
    b"\x89MCAP": "it is an MCAP file of ROS 2; needed is a ROS 1 bag",
    b"SQLite": "it is a database of ROS 2; needed is a ROS 1 bag",
    b"#ROSBAG": "it is a bag of another version; needed is v2.0",
}
"""What users take for a bag, by its first bytes."""
_LONGEST: Final = 200
"""Characters of a message from below, which may quote what it read."""


class BagError(FieldtruthError):
    """A file that is no readable bag, or that lacks what is needed of it."""


@contextmanager
def read_errors(path: Path) -> Iterator[None]:
    """Turn whatever goes wrong while a bag is read into one clear line.

    Raises:
        BagError: the path and what is wrong there.
    """
    try:
        yield
    except FieldtruthError:
        raise
    except _DAMAGE as error:
        raise BagError(f"cannot read {path}: {_other_kind(path) or _in_words(error)}") from error


def _other_kind(path: Path) -> str:
    """What a file is that is no bag at all."""
    try:
        with path.open("rb") as file:
            start = file.read(len(_BAG))
    except OSError:
        return ""
    if start.startswith(_BAG):
        return ""
    kinds = [words for magic, words in _KINDS.items() if start.startswith(magic)] if start else ["it is empty"]
    return kinds[0] if kinds else f"it is no ROS 1 bag, which begins with {_BAG.decode()}"


def _in_words(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if isinstance(error, KeyError):
        return f"a record lacks its field {error}"
    text = str(error)
    if "not indexed" in text:
        return "it has no index, as when a recording was cut off; `rosbag reindex` may mend it"
    if text.startswith("Bag index looks damaged"):
        return "its index is damaged, as when a file was cut off"
    return " ".join(text.split())[:_LONGEST] or type(error).__name__
