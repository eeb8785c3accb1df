# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pair each cloud of a LiDAR with the photographs of one or several cameras that have its stamp.

At 10 and 25 Hz every second cloud has such photographs. With the nearest ones instead, every second pair would be 20 ms
apart, 9 pixels for a robot that turns at 0.5 rad/s. So clouds without photographs of their own stamp are left out,
unless a bag has (nearly) no others: then the nearest photographs are used.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

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
    images: tuple[Any, ...]
    """A photograph of each camera, in the order of their topics."""
    stamp_ns: int
    """Stamp [ns] of the first photograph (cam0)."""
    apart_ns: int
    """Largest difference [ns] between the stamps."""


def paired_frames(bag: BagReader, cloud: str, images: Sequence[str]) -> Iterator[Frame]:
    """Yield the frames of a topic of clouds and topics of photographs, in time order; 1 s of them is in memory.

    Raises:
        BagError: the bag is damaged.
    """
    pairing, decode = _Pairing(images, exact=_has_exact_pairs(bag, cloud, images)), decoder(bag)
    for raw in bag.messages([cloud, *images]):
        message = decode(raw)
        item = _Item(raw.stamp_ns, reading_stamp(raw.stamp_ns, message.header), message)
        yield from pairing.add(None if raw.topic == cloud else raw.topic, item)
    yield from pairing.rest()


def _has_exact_pairs(bag: BagReader, cloud: str, images: Sequence[str]) -> bool:
    """Whether clouds at the start have photographs of their own stamp."""
    stamps: dict[str, set[int]] = {topic: set() for topic in (cloud, *images)}
    decode = decoder(bag)
    for raw in bag.messages(list(stamps)):
        stamps[raw.topic].add(reading_stamp(raw.stamp_ns, decode(raw).header))
        if len(stamps[cloud]) > _FIRST_CLOUDS:
            break
    return len(set.intersection(*stamps.values())) >= _EXACT_SHARE * len(stamps[cloud])


class _Pairing:
    """Clouds that are not paired yet, and the photographs of the last second."""

    def __init__(self, images: Sequence[str], *, exact: bool) -> None:
        self._exact = exact
        self._clouds: deque[_Item] = deque()
        self._images: dict[str, deque[_Item]] = {topic: deque() for topic in images}
        self._last_ns = -1  # first photograph of the previous frame

    def add(self, topic: str | None, item: _Item) -> Iterator[Frame]:
        """Take the next message, a cloud (None) or a photograph of a topic; yield the frames that are final."""
        while self._clouds and item.bag_ns - self._clouds[0].bag_ns > WINDOW_NS:
            yield from self._frame(self._clouds.popleft())
        for images in self._images.values():
            while images and item.bag_ns - images[0].bag_ns > 2 * WINDOW_NS:
                images.popleft()
        (self._clouds if topic is None else self._images[topic]).append(item)

    def rest(self) -> Iterator[Frame]:
        """Yield the frames of the remaining clouds at the end."""
        while self._clouds:
            yield from self._frame(self._clouds.popleft())

    def _frame(self, cloud: _Item) -> Iterator[Frame]:
        if not all(self._images.values()):
            return
        first, *rest = self._images.values()
        left = _nearest(first, cloud.stamp_ns)
        images = (left, *(_nearest(others, left.stamp_ns) for others in rest))
        stamps = [each.stamp_ns for each in (cloud, *images)]
        apart = max(stamps) - min(stamps)
        if apart <= (0 if self._exact else WINDOW_NS) and left.stamp_ns != self._last_ns:
            self._last_ns = left.stamp_ns
            yield Frame(cloud.message, tuple(image.message for image in images), left.stamp_ns, apart)


def _nearest(images: deque[_Item], stamp_ns: int) -> _Item:
    """Return the item with the nearest stamp; of two equally near the earlier."""
    return min(images, key=lambda image: abs(image.stamp_ns - stamp_ns))
