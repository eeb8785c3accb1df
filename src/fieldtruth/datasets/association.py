# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which messages belong together: the stamps of topics, read from a bag's index, and how they are matched."""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import BagError, BagReader, Places
from fieldtruth.core.arrays import Mask
from fieldtruth.datasets.items import I8, Sensor
from fieldtruth.datasets.storage import Storage


class Stream(NamedTuple):
    """The messages of a topic, a row each, by rising stamp: stamp [ns] of the header, and where it is stored."""

    topic: str
    stamps_ns: I8
    chunk: I8
    offset: I8

    def rows(self, chosen: I8) -> "Stream":
        """Return the chosen rows, in that order."""
        return Stream(self.topic, self.stamps_ns[chosen], self.chunk[chosen], self.offset[chosen])


def read_streams(bag: BagReader, storage: Storage, topics: Sequence[str]) -> dict[str, Stream]:
    """Find the messages of topics by the bag's index, which holds the bag's own stamps.

    Where the first and the last message of a topic bear the bag's stamp in their header, or have no header, these
    stamps hold for all. Else, as in a bag that was recorded while messages were under way, every header is read.

    Raises:
        BagError: the bag is damaged.
    """
    streams: dict[str, Stream] = {}
    for topic, places in bag.places_of(topics).items():
        stamps = places.stamps_ns
        if not len(stamps):
            raise BagError(f"cannot read {bag.path}: its index knows no place of {topic}")
        ends = np.array([0, -1])
        if (_header_stamps(storage, topic, places, ends) != stamps[ends]).any():
            stamps = _header_stamps(storage, topic, places, np.arange(len(stamps)))
        stream = Stream(topic, stamps, places.chunk, places.offset)
        streams[topic] = stream.rows(np.argsort(stamps, kind="stable"))
    return streams


def matched(streams: Sequence[Stream]) -> list[Stream]:
    """Keep of each stream the rows whose stamps all streams have; of rows with the same stamp the first."""
    common = reduce(np.intersect1d, [stream.stamps_ns for stream in streams])
    return [stream.rows(np.searchsorted(stream.stamps_ns, common)) for stream in streams]


def nearest(stamps_ns: I8, others_ns: I8) -> I8:
    """Row of the nearest of the others (rising, at least one) for each stamp; the earlier one of two equally near."""
    after = np.clip(np.searchsorted(others_ns, stamps_ns), 0, len(others_ns) - 1)
    before = np.maximum(after - 1, 0)
    closer = np.abs(others_ns[before] - stamps_ns) <= np.abs(others_ns[after] - stamps_ns)
    rows: I8 = np.where(closer, before, after)
    return rows


def associate(
    streams: Mapping[Sensor, Sequence[Stream]], anchor: Sensor, tolerance_ns: int, covered: Callable[[I8], Mask]
) -> dict[Sensor, list[Stream]]:
    """Choose the rows of each stream that make the frames, so that row i of every stream is frame i.

    Args:
        streams: by sensor; those of one sensor belong together where their stamps are equal.
        anchor: the sensor whose stamps are the frames.
        tolerance_ns: largest difference [ns] between the anchor's stamp and that of another sensor.
        covered: tells at which stamps there is all else that a frame needs.
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


def why_none(streams: Mapping[Sensor, Sequence[Stream]], anchor: Sensor) -> str:
    """Say why no frame came of ``associate``."""
    stamps = {sensor: matched(group)[0].stamps_ns for sensor, group in streams.items()}
    for sensor, own in stamps.items():
        if not len(own):
            return f"no stamp is in all of {', '.join(stream.topic for stream in streams[sensor])}"
    for other in stamps.values():
        least = int(np.abs(other[nearest(stamps[anchor], other)] - stamps[anchor]).min())
        if least:
            return f"camera and LiDAR are never nearer than {least / 1e9:.6f} s to each other; see tolerance_s"
    return "there is no true pose at their stamps"


def _header_stamps(storage: Storage, topic: str, places: Places, rows: I8) -> I8:
    stamps = places.stamps_ns[rows].copy()
    for k, row in enumerate(rows):
        message = storage.message(topic, int(places.chunk[row]), int(places.offset[row]))
        if not hasattr(message, "header"):
            break
        stamps[k] = stamp_ns(message.header)
    return stamps
