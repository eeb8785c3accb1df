# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which photographs belong to a cloud: those of its very instant.

At 10 and 25 Hz that is every second cloud. Were each cloud joined with its nearest photographs, every second pair would
be 20 ms apart: 9 pixels for a robot that turns at 0.5 rad/s. So clouds without photographs of their own stamp are left
out, unless a bag has (nearly) no others: then the nearest photographs are taken.
"""

from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import stamp_ns
from fieldtruth.bag.reader import BagReader, decoder

WINDOW_NS: Final = 500_000_000
"""How far [ns] the messages of a frame may lie apart, in the bag and by their headers."""
_LOOK: Final = 50
"""Clouds at the start by which a bag is judged."""
_SHARE: Final = 0.1
"""Of them so many must have photographs of their own stamp, or the nearest are taken."""


class _Item(NamedTuple):
    bag_ns: int
    stamp_ns: int
    """Of the header."""
    message: Any


class Frame(NamedTuple):
    """A cloud and the photographs with it: messages with ROS's field names."""

    cloud: Any
    left: Any
    right: Any
    stamp_ns: int
    """Of the left photograph, and so of cam0 [ns]."""
    apart_ns: int
    """The most that two of the three lie apart [ns]."""
    bag_ns: int
    """Stamp in the bag [ns] of the cloud."""


def stereo_frames(bag: BagReader) -> Iterator[Frame]:
    """Frames of a bag that has clouds and both cameras' photographs, in time order; a second of it is in memory.

    Raises:
        BagError: the bag is damaged.
    """
    sides = {table.photograph(side): side for side in table.SIDES}
    pairing, decode = _Pairing(exact=_in_step(bag)), decoder(bag)
    for raw in bag.messages([table.POINTS, *sides]):
        message = decode(raw)
        item = _Item(raw.stamp_ns, stamp_ns(message.header), message)
        yield from pairing.add(sides.get(raw.topic), item)
    yield from pairing.rest()


def _in_step(bag: BagReader) -> bool:
    """Whether clouds have photographs of their own stamp."""
    stamps: dict[str, set[int]] = {topic: set() for topic in (table.POINTS, *map(table.photograph, table.SIDES))}
    decode = decoder(bag)
    for raw in bag.messages(list(stamps)):
        stamps[raw.topic].add(stamp_ns(decode(raw).header))
        if len(stamps[table.POINTS]) > _LOOK:
            break
    return len(set.intersection(*stamps.values())) >= _SHARE * len(stamps[table.POINTS])


class _Pairing:
    """Clouds that wait for their photographs, and the photographs of the last second."""

    def __init__(self, *, exact: bool) -> None:
        self._exact = exact
        self._clouds: deque[_Item] = deque()
        self._images: dict[str, deque[_Item]] = {side: deque() for side in table.SIDES}
        self._last_ns = -1  # of the left photograph of the frame before

    def add(self, side: str | None, item: _Item) -> Iterator[Frame]:
        """Take the next message, a cloud (None) or a photograph of a side; yield the frames that nothing can change."""
        while self._clouds and item.bag_ns - self._clouds[0].bag_ns > WINDOW_NS:
            yield from self._frame(self._clouds.popleft())
        for images in self._images.values():
            while images and item.bag_ns - images[0].bag_ns > 2 * WINDOW_NS:
                images.popleft()
        (self._clouds if side is None else self._images[side]).append(item)

    def rest(self) -> Iterator[Frame]:
        """Yield what can be made of the clouds that are left at the end."""
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
            yield Frame(cloud.message, left.message, right.message, left.stamp_ns, apart, cloud.bag_ns)


def _nearest(images: deque[_Item], stamp_ns: int) -> _Item:
    """Nearest by its header; of two the earlier."""
    return min(images, key=lambda image: abs(image.stamp_ns - stamp_ns))
