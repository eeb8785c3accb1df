# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Messages of a bag in any order, from any process and thread; no file stays open between two reads."""

import os
from collections import OrderedDict
from collections.abc import Callable, Collection
from pathlib import Path
from threading import Lock
from typing import Any, Final

from fieldtruth.bag.errors import BagError, read_errors
from fieldtruth.bag.reader import (
    BagReader,
    RawMessage,
    decoder_of,
    message_at,
    types_of,
)

BUDGET: Final = 64 * 2**20  # [byte]; the chunks of two frames of 1280 x 720 with all items

Key = tuple[Path, tuple[int, int], int]


class Storage:
    """The messages of one bag by position. It holds no file and no message, so it can be pickled and forked."""

    def __init__(self, bag: BagReader, clocked: Collection[str] = ()) -> None:
        self.path = bag.path.resolve()
        self.clocked = frozenset(clocked)
        """Topics whose headers have a sensor's own time."""
        self._version = _version(self.path)
        self._layout = bag.layout
        self._definitions = {c.msgtype: c.msgdef.data for c in bag.connections}
        self._kinds = {c.id: (c.topic, c.msgtype) for c in bag.connections}

    def message(self, topic: str, chunk: int, offset: int) -> Any:
        """Return the message of a topic at an offset in the chunk at a position in the file, with ROS's field names.

        Raises:
            BagError: the bag is missing, has changed since it was opened, or is damaged.
        """
        unpacked = _RECENT.get((self.path, self._version, chunk), lambda: self._unpack(chunk))
        with read_errors(self.path):
            stamp, number, data = message_at(self._layout, unpacked, offset)
            data = self._layout.ros1(number, data)
        found, msgtype = self._kinds.get(number, ("no topic", ""))
        if found != topic:
            raise BagError(f"cannot read {self.path}: its index has {topic} at the position of a message of {found}")
        return decoder_of(types_of(self._definitions), self.path)(RawMessage(stamp, topic, msgtype, data))

    def _unpack(self, chunk: int) -> bytes:
        if _version(self.path) != self._version:
            raise BagError(f"{self.path} has changed since the data set was opened; open it again")
        with read_errors(self.path):
            return self._layout.unpack(self.path, chunk)


class ChunkCache:
    """The most recently used chunks, decompressed: a single one, or several within a budget [byte]."""

    def __init__(self, budget: int) -> None:
        self.budget = budget
        self.forget()

    def forget(self) -> None:
        """Clear the cache and replace its lock, which may be held in a forked process."""
        self._chunks: OrderedDict[Key, bytes] = OrderedDict()
        self._lock = Lock()

    @property
    def size(self) -> int:
        """Bytes in the cache."""
        return sum(map(len, self._chunks.values()))

    def get(self, key: Key, unpack: Callable[[], bytes]) -> bytes:
        """Return the chunk of a key; ``unpack`` is called if it is not cached."""
        with self._lock:
            if key in self._chunks:
                self._chunks.move_to_end(key)
                return self._chunks[key]
        chunk = unpack()
        with self._lock:
            self._chunks[key] = chunk
            while len(self._chunks) > 1 and self.size > self.budget:
                self._chunks.popitem(last=False)
        return chunk


_RECENT: Final = ChunkCache(BUDGET)
"""Shared by all data sets of a process, so that 100 runs need no more memory than one."""
if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_RECENT.forget)


def _version(path: Path) -> tuple[int, int]:
    """Return modification time [ns] and size [byte], which identify the version of a file."""
    with read_errors(path):
        stat = path.stat()
    return stat.st_mtime_ns, stat.st_size
