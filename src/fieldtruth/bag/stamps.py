# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stamps of the messages of a topic: which are taken, and that they rise (``rising_rows``), for all that reads bags."""

import warnings
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.file import BagError
from fieldtruth.bag.reader import BagReader, MessageIndex, Storage, decoder
from fieldtruth.core.arrays import Counts
from fieldtruth.core.errors import FieldtruthWarning

LARGEST_DISORDER: Final = 400_000_000
"""Largest time [ns] by which a stamp may be below an earlier one, as messages arrive in any order."""
_SAMPLES: Final = 4
_FEWEST: Final = 8
"""Messages from which on their order in the file shows a second pass."""


class Stream(NamedTuple):
    """The messages of a topic, a row each, by rising stamp."""

    topic: str
    stamps_ns: Counts
    """Of the readings [ns]: those of the headers; without, or of a sensor with a clock of its own, of the bag."""
    chunk: Counts
    offset: Counts
    """Position in the bag."""
    bag_ns: Counts
    """Stamp [ns] in the bag."""

    def rows(self, chosen: Counts) -> "Stream":
        """Return the chosen rows, in that order."""
        return Stream(self.topic, *(each[chosen] for each in self[1:]))


def read_streams(bag: BagReader, storage: Storage, topics: Sequence[str]) -> dict[str, Stream]:
    """Read the streams of topics from the bag's index, which holds the stamps in the bag.

    If some headers of a topic have the stamps in the bag, or there are no headers, these stamps are used for all, and
    ``checked_stamp`` holds when a message is read. Otherwise, as in bags recorded with transport delay, every header
    is read first. Topics of ``storage.clocked``, and those whose headers have no stamp, have the stamps of the bag.

    Raises:
        BagError: the bag is damaged, or the stamps of a topic do not rise.
    """
    found = bag.index(topics)
    delayed = [topic for topic, index in found.items() if not _trusted(bag, storage, topic, index)]
    headers = _header_stamps(bag, delayed)
    streams = {}
    for topic, index in found.items():
        stamps = given_stamps(headers.get(topic, index.stamps_ns), index.stamps_ns, topic, bag.path)
        rows = rising_rows(stamps, topic, bag.path, bag_ns=index.stamps_ns)
        refuse_second_pass(stamps, index, topic, bag.path)
        streams[topic] = Stream(topic, stamps, index.chunk, index.offset, index.stamps_ns).rows(rows)
    return streams


def given_stamps(stamps: Counts, bag_ns: Counts, topic: str, path: Path) -> Counts:
    """Return the stamps (n,) [ns] of a topic's headers or, with a warning, those in the bag if all headers have 0."""
    if stamps.any() or not bag_ns.any():
        return stamps
    text = f"{path}: the headers of {topic} have no stamp (0), so the stamps in the bag are used"
    warnings.warn(text, FieldtruthWarning, stacklevel=1)  # one position, so that it is said once
    return bag_ns


def rising_rows(
    stamps: Counts, topic: str, path: Path, *, bag_ns: Counts | None = None, coarse: bool = False
) -> Counts:
    """Return the rows of a topic's stamps (n,) [ns], in the order of arrival, that make them rise.

    Readings without a stamp (0) are left out: their clock had not started.

    Args:
        stamps: of the headers, or of the bag if the type has none.
        topic: for the error.
        path: of the bag, for the error.
        bag_ns: the stamps in the bag, for the error.
        coarse: leave out what has the stamp of the reading before it, as a clock with coarse ticks gives it.

    Raises:
        BagError: stamps go back by more than messages that arrive late, or repeat.
    """
    rows = np.flatnonzero(stamps) if stamps.any() else np.arange(len(stamps))
    if not len(rows):
        return rows
    given = stamps[rows]
    highest = np.maximum.accumulate(given)
    worst = int(np.argmax(highest - given > LARGEST_DISORDER))
    if highest[worst] - given[worst] > LARGEST_DISORDER:
        recorded_ns = None if bag_ns is None else bag_ns[rows][worst]
        raise _went_back(path, topic, int(highest[worst]), int(given[worst]), recorded_ns)
    if coarse:
        rows = rows[np.diff(given, prepend=-1) != 0]
    rows = rows[np.argsort(stamps[rows], kind="stable")]
    twice = np.flatnonzero(np.diff(stamps[rows]) == 0)
    if len(twice):
        stamp = int(stamps[rows[twice[0]]])
        raise BagError(
            f"{path}: two messages of {topic} have the stamp {stamp} ns, so one pass was recorded over another, or "
            "twice; cut the bag, so that each stamp is there once"
        )
    return rows


def checked_stamp(stream: Stream, row: int, message: Any, path: Path, *, clocked: bool) -> int:
    """Return the stamp [ns] of a message's header, or that of the reading if it has none.

    Raises:
        BagError: the header has neither the stamp of the reading nor a sensor's own time.
    """
    stamp = int(stream.stamps_ns[row])
    if not hasattr(message, "header"):
        return stamp
    own = stamp_ns(message.header)
    if own not in (stamp, 0) and not clocked:
        raise _went_back(path, stream.topic, stamp, own, stream.bag_ns[row])
    return own or stamp


def matched(streams: Sequence[Stream]) -> list[Stream]:
    """Select the rows whose stamps are in all streams."""
    common = reduce(np.intersect1d, [stream.stamps_ns for stream in streams])
    return [stream.rows(np.searchsorted(stream.stamps_ns, common)) for stream in streams]


def nearest(stamps_ns: Counts, others_ns: Counts) -> Counts:
    """Return for each stamp the row of the nearest of the others (rising, not empty); of two the earlier."""
    after = np.clip(np.searchsorted(others_ns, stamps_ns), 0, len(others_ns) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(others_ns[before] - stamps_ns) <= np.abs(others_ns[after] - stamps_ns)
    rows: Counts = np.where(closer, before, after)
    return rows


def _trusted(bag: BagReader, storage: Storage, topic: str, index: MessageIndex) -> bool:
    """Return True if the stamps in the bag are those of the readings."""
    count = len(index.stamps_ns)
    if not count:
        raise BagError(f"cannot read {bag.path}: its index has no entry for {topic}")
    if topic in storage.clocked:
        return True
    for row in np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).round().astype(int)).tolist():
        message = storage.message(topic, int(index.chunk[row]), int(index.offset[row]))
        if not hasattr(message, "header"):
            return True
        if stamp_ns(message.header) != index.stamps_ns[row]:
            return False
    return True


def _header_stamps(bag: BagReader, topics: Sequence[str]) -> dict[str, Counts]:
    """Stamps [ns] of all headers of some topics, in the order of the bag."""
    if not topics:
        return {}
    stamps: dict[str, list[int]] = {topic: [] for topic in topics}
    decode = decoder(bag)
    for raw in bag.messages(topics):
        stamps[raw.topic].append(stamp_ns(decode(raw).header))
    return {topic: np.array(values, np.int64) for topic, values in stamps.items()}


def refuse_second_pass(stamps: Counts, index: MessageIndex, topic: str, path: Path) -> None:
    """Refuse stamps of the bag itself that go back once in the file, to a time that was recorded before."""
    written = stamps[np.lexsort((index.offset, index.chunk))]
    back = np.flatnonzero(np.diff(written) < 0)  # more of them: messages that were written in any order
    if len(written) < _FEWEST or len(back) > len(written) // _FEWEST:
        return
    for row in back.tolist():
        before, after = written[: row + 1], written[row + 1 :]
        if written[row] - after[0] > LARGEST_DISORDER and after.max() >= before.min():
            raise _went_back(path, topic, int(written[row]), int(after[0]), None)


def _went_back(path: Path, topic: str, before: int, after: int, bag_ns: Any) -> BagError:
    where = "" if bag_ns is None else f" (at {int(bag_ns)} ns in the bag)"
    return BagError(
        f"{path}: stamps of {topic} go back from {before} ns to {after} ns{where}: a simulation was reset, or a "
        "playback looped, while it was recorded; cut the bag there"
    )
