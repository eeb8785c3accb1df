# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Match messages by their stamps, which are read from the bag's index."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from fieldtruth.bag.decode import reading_stamp
from fieldtruth.bag.reader import BagError, BagReader, MessageIndex
from fieldtruth.core.arrays import Counts, Mask
from fieldtruth.datasets.items import Sensor
from fieldtruth.datasets.storage import Storage


class Stream(NamedTuple):
    """The messages of a topic, a row each, by rising stamp: stamp [ns] of the header, and position in the bag."""

    topic: str
    stamps_ns: Counts
    chunk: Counts
    offset: Counts

    def rows(self, chosen: Counts) -> "Stream":
        """Return the chosen rows, in that order."""
        return Stream(self.topic, self.stamps_ns[chosen], self.chunk[chosen], self.offset[chosen])


def read_streams(bag: BagReader, storage: Storage, topics: Sequence[str]) -> dict[str, Stream]:
    """Read the streams of topics from the bag's index, which holds the stamps in the bag.

    If the headers of a topic's first and last message have the stamps in the bag, or there are no headers, these stamps
    are used for all. Otherwise, as in bags recorded with transport delay, every header is read.

    Raises:
        BagError: the bag is damaged.
    """
    streams: dict[str, Stream] = {}
    for topic, index in bag.index(topics).items():
        stamps = index.stamps_ns
        if not len(stamps):
            raise BagError(f"cannot read {bag.path}: its index has no entry for {topic}")
        ends = np.array([0, -1])
        if (_header_stamps(storage, topic, index, ends) != stamps[ends]).any():
            stamps = _header_stamps(storage, topic, index, np.arange(len(stamps)))
        stream = Stream(topic, stamps, index.chunk, index.offset)
        streams[topic] = stream.rows(np.argsort(stamps, kind="stable"))
    return streams


def matched(streams: Sequence[Stream]) -> list[Stream]:
    """Select the rows whose stamps are in all streams; of rows with the same stamp the first."""
    common = reduce(np.intersect1d, [stream.stamps_ns for stream in streams])
    return [stream.rows(np.searchsorted(stream.stamps_ns, common)) for stream in streams]


def nearest(stamps_ns: Counts, others_ns: Counts) -> Counts:
    """Return for each stamp the row of the nearest of the others (rising, not empty); of two the earlier."""
    after = np.clip(np.searchsorted(others_ns, stamps_ns), 0, len(others_ns) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(others_ns[before] - stamps_ns) <= np.abs(others_ns[after] - stamps_ns)
    rows: Counts = np.where(closer, before, after)
    return rows


def associate(
    streams: Mapping[Sensor, Sequence[Stream]], anchor: Sensor, tolerance_ns: int, covered: Callable[[Counts], Mask]
) -> dict[Sensor, list[Stream]]:
    """Select rows of each stream so that row i of every stream belongs to frame i.

    Args:
        streams: by sensor; messages of one sensor belong together if their stamps are equal.
        anchor: the sensor whose stamps define the frames.
        tolerance_ns: largest difference [ns] between the anchor's stamp and that of another sensor.
        covered: returns for which stamps all other data of a frame exist.
    """
    groups = {sensor: matched(group) for sensor, group in streams.items()}
    stamps = {sensor: group[0].stamps_ns for sensor, group in groups.items()}
    if any(len(own) == 0 for own in stamps.values()):
        return {sensor: [stream.rows(np.empty(0, np.intp)) for stream in group] for sensor, group in groups.items()}
    rows = {sensor: nearest(stamps[anchor], own) for sensor, own in stamps.items()}
    keep = np.full(len(stamps[anchor]), True)
    for sensor, own in stamps.items():
        found = own[rows[sensor]]
        keep &= (np.abs(found - stamps[anchor]) <= tolerance_ns) & covered(found)
    return {sensor: [stream.rows(rows[sensor][keep]) for stream in group] for sensor, group in groups.items()}


def explain_no_frame(streams: Mapping[Sensor, Sequence[Stream]], anchor: Sensor) -> str:
    """Explain why ``associate`` found no frame."""
    stamps = {sensor: matched(group)[0].stamps_ns for sensor, group in streams.items()}
    for sensor, own in stamps.items():
        if not len(own):
            return f"no stamp is common to {', '.join(stream.topic for stream in streams[sensor])}"
    for other in stamps.values():
        least = int(np.abs(other[nearest(stamps[anchor], other)] - stamps[anchor]).min())
        if least:
            return f"stamps of camera and LiDAR differ by at least {least / 1e9:.6f} s; see tolerance_s"
    return "there is no true pose at their stamps"


def _header_stamps(storage: Storage, topic: str, index: MessageIndex, rows: Counts) -> Counts:
    stamps = index.stamps_ns[rows].copy()
    for k, row in enumerate(rows):
        message = storage.message(topic, int(index.chunk[row]), int(index.offset[row]))
        if not hasattr(message, "header"):
            break
        stamps[k] = reading_stamp(int(stamps[k]), message.header)
    return stamps
