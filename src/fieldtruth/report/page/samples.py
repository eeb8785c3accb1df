# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A few stereo pairs along a run with their tags (paper, Figures 17 to 20), as small as a page wants them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import image, labels
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.png import encode_png
from fieldtruth.report.drawing.aerial import halved
from fieldtruth.report.page.bag_pass import FOREIGN, reason, usable

PAIRS: Final = 6
PHOTO_BYTES: Final = 330_000
TAG_BYTES: Final = 130_000
THUMB_BYTES: Final = 16_000
_WIDEST: Final = 1280  # [pixel]
_THUMB: Final = 200  # [pixel]
_TOGETHER: Final = 20_000_000  # [ns]; images farther apart are no pair
_QUALITIES: Final = (90, 80, 70, 60, 50, 40, 30, 20)

U1 = NDArray[np.uint8]


@dataclass
class View:
    """What one camera saw: JPEG of the photograph, PNG of the tags with the palette of the classes; either may lack."""

    photo: bytes | None = None
    tag: bytes | None = None
    classes: frozenset[int] = frozenset()
    """Class ids in the tags."""
    width: int = 0
    height: int = 0
    """Size [pixel] in the bag."""


@dataclass
class Pair:
    """Views of one instant, by side, and a small picture of the first of them."""

    stamp_ns: int
    views: dict[str, View] = field(default_factory=dict)
    thumb: bytes = b""


@dataclass
class Samples:
    """Pairs in time order, and why topics of images are not shown."""

    pairs: list[Pair] = field(default_factory=list)
    unreadable: dict[str, str] = field(default_factory=dict)


def take_samples(run: Run) -> Samples:
    """Take pairs in the middle of each sixth of the images; no other image is unpacked.

    Raises:
        BagError: the bag is damaged.
    """
    topics, _ = usable(run)
    wanted = [t for t in (*map(table.photograph, table.SIDES), *map(table.tag, table.SIDES)) if t in topics]
    found = Samples()
    if not wanted:
        return found
    with open_bag(run.bag) as bag:
        decode, places = decoder(bag), {topic: bag.places(topic) for topic in wanted}

        def nearest(topic: str, stamp: int) -> Any:
            if topic not in places:
                return None
            stamps_ns, chunk, offset = places[topic]
            row = int(np.abs(stamps_ns - stamp).argmin())
            together = abs(int(stamps_ns[row]) - stamp) <= _TOGETHER
            return decode(bag.message(bag.chunk(int(chunk[row])), int(offset[row]))) if together else None

        stamps = places[wanted[0]].stamps_ns
        count = min(PAIRS, len(stamps))
        for k in range(count):
            stamp = int(stamps[(2 * k + 1) * len(stamps) // (2 * count)])
            pair = Pair(stamp)
            for side in table.SIDES:
                view = _view(side, nearest, found.unreadable, pair)
                if view.photo or view.tag:
                    pair.views[side] = view
            if pair.views:
                found.pairs.append(pair)
    return found


def _view(side: str, nearest: Callable[[str, int], Any], unreadable: dict[str, str], pair: Pair) -> View:
    view = View()
    for topic, put in ((table.photograph(side), _put_photo), (table.tag(side), _put_tag)):
        message = nearest(topic, pair.stamp_ns)
        if message is None:
            continue
        try:
            colours = image(message)
            put(view, message, colours)
        except FOREIGN as error:
            unreadable[topic] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            pair.thumb = pair.thumb or jpeg_below(_small(colours, _THUMB), THUMB_BYTES)
    return view


def _put_photo(view: View, message: Any, colours: U1) -> None:
    stored = bytes(message.data)
    fits = len(stored) <= PHOTO_BYTES and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_small(colours, _WIDEST), PHOTO_BYTES)


def _put_tag(view: View, message: Any, colours: U1) -> None:
    ids = labels(colours)
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=PALETTE)) > TAG_BYTES or ids.shape[1] > _WIDEST:
        ids = np.ascontiguousarray(ids[::2, ::2])
    view.tag = png


def _small(colours: U1, widest: int) -> U1:
    """Means over squares of pixels, until the image is no wider than that."""
    by = -(-colours.shape[1] // widest)
    return halved(colours, by) if by > 1 and colours.shape[0] >= by else colours


def jpeg_below(colours: U1, limit: int) -> bytes:
    """JPEG as good as the limit [byte] allows."""
    while True:
        for quality in _QUALITIES:
            data = simplejpeg.encode_jpeg(np.ascontiguousarray(colours), quality, "RGB", "420")
            if len(data) <= limit:
                return bytes(data)
        colours = halved(colours)
