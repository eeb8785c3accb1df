# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of all cameras from a run with their tag images (paper, Figures 17 to 20), compressed to bounded sizes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import image, labels
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.png import encode_png
from fieldtruth.report.drawing.images import downscaled, jpeg_below
from fieldtruth.report.page.bag_pass import UNEXPECTED, reason, usable_topics
from fieldtruth.sensors.camera.config import Imager

SAMPLES: Final = 6
STREAMS_SHOWN: Final = ("photograph", "tag")
PHOTO_BYTES: Final = 330_000
TAG_BYTES: Final = 130_000
"""Limits of two cameras; more share what these have."""
THUMBNAIL_BYTES: Final = 16_000
_WIDEST: Final = 1280  # [pixel]
_THUMBNAIL: Final = 200  # [pixel]
_SIMULTANEOUS: Final = 20_000_000  # [ns]; images farther apart are not simultaneous


@dataclass
class View:
    """Images of one view of a camera: photograph as JPEG and tag image as PNG, each empty if missing."""

    photo: bytes = b""
    tag: bytes = b""
    classes: frozenset[int] = frozenset()
    """Class ids in the tag image."""
    width: int = 0
    height: int = 0
    """Size in the bag [pixel]."""
    later_ms: int = 0
    """Time after that of the sample, if it is not simultaneous."""


@dataclass
class Sample:
    """Views of all cameras at one time, by name, and a thumbnail (JPEG) of the first."""

    stamp_ns: int
    views: dict[str, View] = field(default_factory=dict)
    thumbnail: bytes = b""


Nearest = Callable[[str, int], tuple[int, Any] | None]
"""Stamp [ns] and message of a topic that are nearest to a stamp; None if the topic has none near it."""


def read_samples(run: Run) -> tuple[list[Sample], dict[str, str]]:
    """Read a sample from the middle of each sixth of the images, and by topic why its images cannot be shown.

    Of a camera with stamps of its own, a sample has the image that is nearest in time.

    Raises:
        BagError: the bag is damaged.
    """
    usable, imagers = usable_topics(run)[0], run.rig.imagers
    wanted = [t for stream in STREAMS_SHOWN for t in (each.topic_of(stream) for each in imagers) if t in usable]
    samples: list[Sample] = []
    unreadable: dict[str, str] = {}
    if not wanted:
        return samples, unreadable
    near_ns = {t: _near_ns(each) for each in imagers for t in map(each.topic_of, STREAMS_SHOWN)}
    with open_bag(run.bag, true_stamps=run.clocked) as bag:
        decode, index = decoder(bag), bag.index(wanted)

        def nearest(topic: str, stamp: int) -> tuple[int, Any] | None:
            if topic not in index:
                return None
            stamps_ns, chunk, offset = index[topic]
            row = int(np.abs(stamps_ns - stamp).argmin())
            found = int(stamps_ns[row])
            if abs(found - stamp) > near_ns[topic]:
                return None
            return found, decode(bag.message(bag.chunk(int(chunk[row])), int(offset[row])))

        stamps = index[wanted[0]].stamps_ns
        count = min(SAMPLES, len(stamps))
        share = min(1.0, 2.0 / len(imagers))
        for k in range(count):
            sample = Sample(int(stamps[(2 * k + 1) * len(stamps) // (2 * count)]))
            for imager in imagers:
                view = _view(imager, nearest, unreadable, sample, share)
                if view.photo or view.tag:
                    sample.views[imager.name] = view
            if sample.views:
                samples.append(sample)
    return samples, unreadable


def _near_ns(imager: Imager) -> int:
    """Half the interval between images, at least what counts as simultaneous."""
    return max(_SIMULTANEOUS, round(0.5e9 / imager.config.rate_hz))


def _view(imager: Imager, nearest: Nearest, unreadable: dict[str, str], sample: Sample, share: float) -> View:
    view = View()
    for stream, add, most in (("photograph", _add_photo, PHOTO_BYTES), ("tag", _add_tag, TAG_BYTES)):
        found = nearest(imager.topic_of(stream), sample.stamp_ns)
        if found is None:
            continue
        stamp, message = found
        try:
            colours = image(message)
            add(view, message, colours, int(share * most))
        except UNEXPECTED as error:
            unreadable[imager.topic_of(stream)] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            later_ns = stamp - sample.stamp_ns
            view.later_ms = round(later_ns / 1e6) if abs(later_ns) > _SIMULTANEOUS else 0
            sample.thumbnail = sample.thumbnail or jpeg_below(_narrowed(colours, _THUMBNAIL), THUMBNAIL_BYTES)
    return view


def _add_photo(view: View, message: Any, colours: NDArray[np.uint8], most: int) -> None:
    stored = bytes(message.data)
    fits = len(stored) <= most and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_narrowed(colours, _WIDEST), most)


def _add_tag(view: View, _: Any, colours: NDArray[np.uint8], most: int) -> None:
    ids = labels(colours)
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=PALETTE)) > most or ids.shape[1] > _WIDEST:
        ids = np.ascontiguousarray(ids[::2, ::2])
    view.tag = png


def _narrowed(colours: NDArray[np.uint8], widest: int) -> NDArray[np.uint8]:
    factor = -(-colours.shape[1] // widest)
    return downscaled(colours, factor) if factor > 1 and colours.shape[0] >= factor else colours
