# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pair each cloud with the photographs of the same stamp.

At 10 and 25 Hz every second cloud has such photographs. With the nearest ones instead, every second pair would be 20 ms
apart, 9 pixels for a robot that turns at 0.5 rad/s. So clouds without photographs of their own stamp are left out,
unless a bag has (nearly) no others: then the nearest photographs are used.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import reading_stamp
from fieldtruth.bag.reader import BagReader, decoder

WINDOW_NS: Final = 500_000_000
"""Largest difference [ns] of the stamps of a frame's messages, in the bag and in their headers."""
_FIRST_CLOUDS: Final = 50
"""Clouds at the start that decide whether pairing is exact."""
_EXACT_SHARE: Final = 0.1
"""Pairing is exact if at least this share of them has photographs of its own stamp."""


class _Item(NamedTuple):
    bag_ns: int
    stamp_ns: int
    """Of the header."""
    message: Any


class Frame(NamedTuple):
    """A cloud and its photographs, as messages with ROS's field names."""

    cloud: Any
    left: Any
    right: Any
    stamp_ns: int
    """Stamp [ns] of the left photograph (cam0)."""
    apart_ns: int
    """Largest difference [ns] between the three stamps."""


def stereo_frames(bag: BagReader) -> Iterator[Frame]:
    """Yield the frames of a bag with clouds and photographs of both cameras, in time order; 1 s of it is in memory.

    Raises:
        BagError: the bag is damaged.
    """
    sides = {table.photograph(side): side for side in table.SIDES}
    pairing, decode = _Pairing(exact=_has_exact_pairs(bag)), decoder(bag)
    for raw in bag.messages([table.POINTS, *sides]):
        message = decode(raw)
        item = _Item(raw.stamp_ns, reading_stamp(raw.stamp_ns, message.header), message)
        yield from pairing.add(sides.get(raw.topic), item)
    yield from pairing.rest()


def _has_exact_pairs(bag: BagReader) -> bool:
    """Whether clouds at the start have photographs of their own stamp."""
    stamps: dict[str, set[int]] = {topic: set() for topic in (table.POINTS, *map(table.photograph, table.SIDES))}
    decode = decoder(bag)
    for raw in bag.messages(list(stamps)):
        stamps[raw.topic].add(reading_stamp(raw.stamp_ns, decode(raw).header))
        if len(stamps[table.POINTS]) > _FIRST_CLOUDS:
            break
    return len(set.intersection(*stamps.values())) >= _EXACT_SHARE * len(stamps[table.POINTS])


class _Pairing:
    """Clouds that are not paired yet, and the photographs of the last second."""

    def __init__(self, *, exact: bool) -> None:
        self._exact = exact
        self._clouds: deque[_Item] = deque()
        self._images: dict[str, deque[_Item]] = {side: deque() for side in table.SIDES}
        self._last_ns = -1  # left photograph of the previous frame

    def add(self, side: str | None, item: _Item) -> Iterator[Frame]:
        """Take the next message, a cloud (None) or a photograph of a side; yield the frames that are final."""
        while self._clouds and item.bag_ns - self._clouds[0].bag_ns > WINDOW_NS:
            yield from self._frame(self._clouds.popleft())
        for images in self._images.values():
            while images and item.bag_ns - images[0].bag_ns > 2 * WINDOW_NS:
                images.popleft()
        (self._clouds if side is None else self._images[side]).append(item)

    def rest(self) -> Iterator[Frame]:
        """Yield the frames of the remaining clouds at the end."""
        while self._clouds:
            yield from self._frame(self._clouds.popleft())

    def _frame(self, cloud: _Item) -> Iterator[Frame]:
        if not all(self._images.values()):
            return
        left = _nearest(self._images["left"], cloud.stamp_ns)
        right = _nearest(self._images["right"], left.stamp_ns)
        stamps = cloud.stamp_ns, left.stamp_ns, right.stamp_ns
        apart = max(stamps) - min(stamps)
        if apart <= (0 if self._exact else WINDOW_NS) and left.stamp_ns != self._last_ns:
            self._last_ns = left.stamp_ns
            yield Frame(cloud.message, left.message, right.message, left.stamp_ns, apart)


def _nearest(images: deque[_Item], stamp_ns: int) -> _Item:
    """Return the item with the nearest stamp; of two equally near the earlier."""
    return min(images, key=lambda image: abs(image.stamp_ns - stamp_ns))
