# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stereo pairs from a run with their tag images (paper, Figures 17 to 20), compressed to bounded sizes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.decode import image, labels
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.png import encode_png
from fieldtruth.report.drawing.images import downscaled, jpeg_below
from fieldtruth.report.page.bag_pass import UNEXPECTED, reason, usable_topics

PAIRS: Final = 6
PHOTO_BYTES: Final = 330_000
TAG_BYTES: Final = 130_000
THUMBNAIL_BYTES: Final = 16_000
_WIDEST: Final = 1280  # [pixel]
_THUMBNAIL: Final = 200  # [pixel]
_SIMULTANEOUS: Final = 20_000_000  # [ns]; images farther apart are not a pair


@dataclass
class View:
    """Images of one camera: photograph as JPEG and tag image as PNG, each empty if missing; size in the bag [pixel]."""

    photo: bytes = b""
    tag: bytes = b""
    classes: frozenset[int] = frozenset()
    """Class ids in the tag image."""
    width: int = 0
    height: int = 0


@dataclass
class Pair:
    """Simultaneous views by side, and a thumbnail (JPEG) of the first."""

    stamp_ns: int
    views: dict[str, View] = field(default_factory=dict)
    thumbnail: bytes = b""


def read_pairs(run: Run) -> tuple[list[Pair], dict[str, str]]:
    """Read a pair from the middle of each sixth of the images, and by topic why its images cannot be shown.

    Raises:
        BagError: the bag is damaged.
    """
    topics, _ = usable_topics(run)
    wanted = [t for t in (*map(table.photograph, table.SIDES), *map(table.tag, table.SIDES)) if t in topics]
    pairs: list[Pair] = []
    unreadable: dict[str, str] = {}
    if not wanted:
        return pairs, unreadable
    with open_bag(run.bag) as bag:
        decode, index = decoder(bag), bag.index(wanted)

        def nearest(topic: str, stamp: int) -> Any:
            if topic not in index:
                return None
            stamps_ns, chunk, offset = index[topic]
            row = int(np.abs(stamps_ns - stamp).argmin())
            if abs(int(stamps_ns[row]) - stamp) > _SIMULTANEOUS:
                return None
            return decode(bag.message(bag.chunk(int(chunk[row])), int(offset[row])))

        stamps = index[wanted[0]].stamps_ns
        count = min(PAIRS, len(stamps))
        for k in range(count):
            pair = Pair(int(stamps[(2 * k + 1) * len(stamps) // (2 * count)]))
            for side in table.SIDES:
                view = _view(side, nearest, unreadable, pair)
                if view.photo or view.tag:
                    pair.views[side] = view
            if pair.views:
                pairs.append(pair)
    return pairs, unreadable


def _view(side: str, nearest: Callable[[str, int], Any], unreadable: dict[str, str], pair: Pair) -> View:
    view = View()
    for topic, add in ((table.photograph(side), _add_photo), (table.tag(side), _add_tag)):
        message = nearest(topic, pair.stamp_ns)
        if message is None:
            continue
        try:
            colours = image(message)
            add(view, message, colours)
        except UNEXPECTED as error:
            unreadable[topic] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            pair.thumbnail = pair.thumbnail or jpeg_below(_narrowed(colours, _THUMBNAIL), THUMBNAIL_BYTES)
    return view


def _add_photo(view: View, message: Any, colours: NDArray[np.uint8]) -> None:
    stored = bytes(message.data)
    fits = len(stored) <= PHOTO_BYTES and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_narrowed(colours, _WIDEST), PHOTO_BYTES)


def _add_tag(view: View, _: Any, colours: NDArray[np.uint8]) -> None:
    ids = labels(colours)
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=PALETTE)) > TAG_BYTES or ids.shape[1] > _WIDEST:
        ids = np.ascontiguousarray(ids[::2, ::2])
    view.tag = png


def _narrowed(colours: NDArray[np.uint8], widest: int) -> NDArray[np.uint8]:
    factor = -(-colours.shape[1] // widest)
    return downscaled(colours, factor) if factor > 1 and colours.shape[0] >= factor else colours
