# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Laws of every picture: its form, its colours, and that tag, depth and object ids of a moment fit pixel by pixel."""

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import decode as read
from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import BagError, RawMessage
from fieldtruth.validation.bundle import Bundler, Moment
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import Law, check_of
from fieldtruth.validation.objects import ObjectLaw
from fieldtruth.validation.subject import Examiner, Subject
from fieldtruth.validation.survey import NO_PIXEL, Survey, survey

PARTS: Final = ("photograph", "tag", "depth", "instances")
_DECODERS: Final[dict[str, Callable[[Any], NDArray[Any]]]] = {
    "photograph": read.image,
    "tag": read.image,
    "depth": read.depth,
    "instances": read.instances,
}
_ENCODINGS: Final = {"tag": "rgb8", "depth": "32FC1", "instances": "16UC1"}


class Laws(NamedTuple):
    """The laws of pictures."""

    form: Law
    whole: Law
    colour: Law
    depth: Law
    beyond: Law

    def another(self) -> "Laws":
        """Return the same laws with nothing seen."""
        return Laws(*(law.another() for law in self))


class Seen(NamedTuple):
    """What a thread found in a moment."""

    laws: Laws
    survey: Survey | None
    first: dict[tuple[int, int], str]


class Pictures(Examiner):
    """Form, colours, depth of every picture of both cameras."""

    def __init__(self, subject: Subject, objects: ObjectLaw) -> None:
        self._subject = subject
        self._objects = objects
        self._bundler = Bundler(PARTS, subject.run.counts, self._submit)
        self.topics = [*self._bundler.topics, *map(table.camera_info, table.SIDES)]
        self._sizes: dict[str, tuple[int, int]] = {}
        self._pixels = self._tags = self._depths = 0
        self._laws = Laws(
            form=subject.law("pictures have the encoding of their topic and the size of CameraInfo"),
            whole=subject.law("photographs are whole JPEG files"),
            colour=subject.law("every pixel of a tag image has the colour of a class"),
            depth=subject.law("depth is infinite on the sky and within the camera's reach elsewhere"),
            beyond=subject.law("object ids in images are rows of /gazebo/model_states"),
        )

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message."""
        for side in table.SIDES:
            if raw.topic == table.camera_info(side):
                self._sizes.setdefault(side, (message.width, message.height))
                return
        self._bundler.add(raw.topic, raw.stamp_ns, message)

    def finish(self) -> None:
        """See the end of the bag."""
        self._bundler.finish()

    def results(self) -> list[Check]:
        """Tags, depth, photographs."""
        laws, nothing = self._laws, "no camera's topics"
        return [
            check_of("pictures", [laws.form, laws.whole],
                     f"{laws.form.seen:,} images of {self._size()}; {laws.whole.seen:,} whole photographs", nothing),
            check_of("tag colours", [laws.colour],
                     f"{self._pixels:,} pixels of {self._tags:,} tag images have colours of classes", "no tag images"),
            check_of("depth and ids", [laws.depth, laws.beyond],
                     f"{self._depths:,} images with depth or object ids fit their tag images",
                     "no depth and no object ids: generate --extras depth,instances makes them"),
        ]  # fmt: skip

    def _size(self) -> str:
        return " and ".join(sorted({f"{width} x {height}" for width, height in self._sizes.values()})) or "unknown size"

    def _submit(self, moment: Moment) -> None:
        laws, size = self._laws.another(), self._sizes.get(moment.side)
        objects, far = len(self._subject.names) or 1 << 16, self._subject.rig.cameras.far
        self._subject.submit(lambda: _examine(moment, size, objects, far, laws), self._fold)

    def _fold(self, seen: Seen) -> None:
        for mine, theirs in zip(self._laws, seen.laws, strict=True):
            mine.merge(theirs)
        self._tags += seen.laws.colour.seen > 0
        self._pixels += seen.laws.colour.seen
        self._depths += (seen.laws.depth.seen > 0) + (seen.laws.beyond.seen > 0)
        if seen.survey is not None:
            self._objects.add(seen.survey.counts, seen.first)


def _examine(moment: Moment, size: tuple[int, int] | None, objects: int, far: float, laws: Laws) -> Seen:
    pictures = {part: _decoded(moment, part, size, laws) for part in moment.parts}
    rgb, depth, instance = (pictures.get(part) for part in ("tag", "depth", "instances"))
    if rgb is None:
        return Seen(laws, None, {})
    height, width, _ = rgb.shape
    depth, instance = (None if p is None or p.shape != (height, width) else p for p in (depth, instance))
    found = survey(rgb, instance, depth, objects, far)

    def pixel(part: str, k: int) -> str:
        return f"{moment.place(part)}, row {k // width}, column {k % width}"

    count, k = found.colours
    colour = " ".join(map(str, rgb.reshape(-1, 3)[k]))
    laws.colour.count(height * width, count, f"{pixel('tag', k)}: {colour}")
    if depth is not None:
        count, k = found.depths
        laws.depth.count(height * width, count, f"{pixel('depth', k)}: {depth.reshape(-1)[k]:g} m on "
                         f"{'sky' if _is_sky(rgb.reshape(-1, 3)[k]) else 'a thing'}")  # fmt: skip
    if instance is None:
        return Seen(laws, None, {})
    count, k = found.beyond
    laws.beyond.count(height * width, count, f"{pixel('instances', k)}: object {instance.reshape(-1)[k]} of {objects}")
    first = {(int(thing), int(label)): pixel("tag", int(found.first[thing, label]))
             for thing, label in np.argwhere(found.first != NO_PIXEL)}  # fmt: skip
    return Seen(laws, found, first)


def _decoded(moment: Moment, part: str, size: tuple[int, int] | None, laws: Laws) -> NDArray[Any] | None:
    """Pixels of a part; what is wrong with its form is counted."""
    message, place = moment.parts[part], moment.place(part)
    try:
        picture = _DECODERS[part](message)
    except (BagError, ValueError) as error:
        (laws.whole if part == "photograph" else laws.form).see(False, f"{place}: {error}")
        return None
    if part == "photograph":
        laws.whole.see(True, "")
    encoding = getattr(message, "encoding", None)
    shape = (picture.shape[1], picture.shape[0])
    if picture.size == 0:
        laws.form.see(False, f"{place} has no pixels")
        return None
    right = encoding == _ENCODINGS.get(part) and not getattr(message, "is_bigendian", 0) and size in (None, shape)
    laws.form.see(bool(right), f"{place}: {shape[0]} x {shape[1]} {encoding or 'photograph'}, CameraInfo says {size}")
    return picture


def _is_sky(colour: NDArray[np.uint8]) -> bool:
    return bool((colour == 127).all())
