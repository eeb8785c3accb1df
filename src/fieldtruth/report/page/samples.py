# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images of all cameras from a run with their tag images (paper, Figures 17 to 20), compressed to bounded sizes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.file import BagError
from fieldtruth.bag.readings import Readings, image_of
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import Source
from fieldtruth.core.classes import PALETTE
from fieldtruth.core.png import encode_png
from fieldtruth.core.readings import Image
from fieldtruth.report.drawing.images import downscaled, jpeg_below
from fieldtruth.report.page.bag_pass import UNEXPECTED, reason, usable_topics

SAMPLES: Final = 6
PARTS_SHOWN: Final = ("photo", "label")
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


def read_samples(run: Run) -> tuple[list[Sample], dict[str, str]]:
    """Read a sample from the middle of each sixth of the images, and by topic why its images cannot be shown.

    Of a camera with stamps of its own, a sample has the image that is nearest in time.

    Raises:
        BagError: the bag is damaged.
    """
    usable, views = usable_topics(run)[0], run.of(Image, recorded=False)
    unreadable: dict[str, str] = {}
    images: dict[tuple[str, str], Readings] = {}
    for part in PARTS_SHOWN:
        for view in views:
            if view.topics[part] in usable:
                try:
                    images[view.name, part] = run.readings(view.name, [part])
                except BagError as error:
                    unreadable[view.topics[part]] = reason(error)
    samples: list[Sample] = []
    stamps = next((each.stamps_ns for each in images.values()), np.empty(0, np.int64))
    count = min(SAMPLES, len(stamps))
    share = min(1.0, 2.0 / max(len(views), 1))
    for k in range(count):
        sample = Sample(int(stamps[(2 * k + 1) * len(stamps) // (2 * count)]))
        for source in views:
            found = _view(source, images, unreadable, sample, share)
            if found.photo or found.tag:
                sample.views[source.label] = found
        if sample.views:
            samples.append(sample)
    return samples, unreadable


def _view(
    source: Source, images: Mapping[tuple[str, str], Readings], unreadable: dict[str, str], sample: Sample, share: float
) -> View:
    view, near_ns = View(), max(_SIMULTANEOUS, round(0.5e9 / source.config.rate_hz))
    for part, add, most in (("photo", _add_photo, PHOTO_BYTES), ("label", _add_tag, TAG_BYTES)):
        readings = images.get((source.name, part))
        if readings is None or not len(readings):
            continue
        row = int(np.abs(readings.stamps_ns - sample.stamp_ns).argmin())
        later_ns = int(readings.stamps_ns[row]) - sample.stamp_ns
        if abs(later_ns) > near_ns:
            continue
        message = readings.message(row)
        try:
            colours = add(view, image_of({part: message}), int(share * most))
        except UNEXPECTED as error:
            unreadable[source.topics[part]] = reason(error)
        else:
            view.height, view.width = colours.shape[:2]
            view.later_ms = round(later_ns / 1e6) if abs(later_ns) > _SIMULTANEOUS else 0
            sample.thumbnail = sample.thumbnail or jpeg_below(_narrowed(colours, _THUMBNAIL), THUMBNAIL_BYTES)
    return view


def _add_photo(view: View, image: Any, most: int) -> NDArray[np.uint8]:
    colours: NDArray[np.uint8] = image.photo
    stored = image.jpeg or b""
    fits = stored and len(stored) <= most and colours.shape[1] <= _WIDEST
    view.photo = stored if fits else jpeg_below(_narrowed(colours, _WIDEST), most)
    return colours


def _add_tag(view: View, image: Any, most: int) -> NDArray[np.uint8]:
    ids: NDArray[np.uint8] = image.label
    colours = PALETTE[ids]
    view.classes = frozenset(np.unique(ids).tolist())
    while len(png := encode_png(ids, palette=PALETTE)) > most or ids.shape[1] > _WIDEST:
        ids = np.ascontiguousarray(ids[::2, ::2])
    view.tag = png
    return colours


def _narrowed(colours: NDArray[np.uint8], widest: int) -> NDArray[np.uint8]:
    factor = -(-colours.shape[1] // widest)
    return downscaled(colours, factor) if factor > 1 and colours.shape[0] >= factor else colours
