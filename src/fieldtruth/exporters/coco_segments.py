# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""COCO's categories, and the segments of an image: id, area, box and mask.

A segment of a countable class (COCO's ``isthing``) is one object. All other classes have one segment per image. So have
the objects of a countable class that have no ids of their own: a crowd, like the trees of the backdrop, or pebbles.
"""

import re
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as coco_mask

from fieldtruth.bag.file import BagError
from fieldtruth.core.classes import CLASSES, NOT_OF_WORLDS, Label
from fieldtruth.ontology.label_map import LabelMap

_SUPERCATEGORIES: Final = {
    Label.GROUND: "terrain",
    Label.TRAIL: "terrain",
    Label.ROCK: "terrain",
    Label.TRUNK: "vegetation",
    Label.TREETOP: "vegetation",
    Label.BUSH: "vegetation",
    Label.HIGH_GRASS: "vegetation",
    Label.LAMP_POST: "structure",
    Label.TRASH_BIN: "structure",
    Label.TABLE: "structure",
    Label.BENCH: "structure",
    Label.POST: "structure",
    Label.CABLE: "structure",
    Label.WATER: "water",
    Label.SKY: "sky",
    Label.ROBOT: "robot",
    Label.PARTICLE: "air",
}
STUFF: Final = frozenset({Label.GROUND, Label.TRAIL, Label.HIGH_GRASS, Label.WATER, Label.SKY}) | NOT_OF_WORLDS
"""Classes that are not countable. A class of another ontology is countable if all of ours that it holds are."""

_BITS: Final = 24
"""Bits of a segment id in a panoptic image."""
_SINGLE: Final = re.compile(r"_\d+$")
"""Names of single objects end in a number (``bench_3``); those of the ground and of countable swarms do not."""


class Category(NamedTuple):
    """A row of COCO's categories."""

    id: int
    name: str
    supercategory: str
    isthing: bool
    color: tuple[int, int, int]

    def row(self) -> dict[str, Any]:
        """Return it as JSON."""
        return self._asdict() | {"isthing": int(self.isthing)}


class Segment(NamedTuple):
    """All pixels with one id."""

    id: int
    area: int
    """Pixels."""
    bbox: list[int]
    """x, y of the upper left pixel, width, height."""
    counts: str
    """Run lengths down the columns, in COCO's compressed encoding."""


def categories_of(label_map: LabelMap | None) -> list[Category]:
    """Categories that pixels can have, by id: our classes, or those of another ontology to which ours are mapped."""
    ids = np.arange(len(CLASSES)) if label_map is None else label_map.ids
    result: list[Category] = []
    for number in sorted({int(ids[label]) for label in _SUPERCATEGORIES} - {int(ids[Label.VOID])}):
        ours = [label for label in _SUPERCATEGORIES if ids[label] == number]
        if label_map is None:
            name, rgb = CLASSES[number].name, CLASSES[number].rgb or (0, 0, 0)
        else:
            name, rgb = label_map.classes[number]
        above = {_SUPERCATEGORIES[label] for label in ours}
        countable = STUFF.isdisjoint(ours)
        result.append(Category(number, name, above.pop() if len(above) == 1 else name, countable, rgb))
    return result


def object_bits(names: Sequence[str]) -> int:
    """Bits of a segment id that hold the object; the higher ones hold the category."""
    return max(16, (len(names) - 1).bit_length())


class Numbering:
    """Segment ids: 65536 times the category, plus the instance id where the segment is a single object.

    An id has the same meaning in all images of a run. 0 is void: pixels without a class, in some ontologies only. Ids
    have 24 bits. With more than 65,536 objects the factor is a higher power of two, if the categories leave its bits.

    Raises:
        BagError: 24 bits do not hold categories and objects.
    """

    def __init__(self, categories: Sequence[Category], label_map: LabelMap | None, names: Sequence[str]) -> None:
        ids = np.arange(len(CLASSES)) if label_map is None else label_map.ids.astype(np.int64)
        known = {category.id: category for category in categories}
        countable = [int(number) in known and known[int(number)].isthing for number in ids]
        bits = object_bits(names)
        if (most := _BITS - max(known, default=0).bit_length()) < bits:
            raise BagError(
                f"COCO's panoptic images hold at most {1 << most} objects with these classes, got {len(names)}"
            )
        self._base = np.array([int(number) << bits if int(number) in known else 0 for number in ids], np.uint32)
        self._mask = np.where(countable, (1 << bits) - 1, 0).astype(np.uint32)
        single = [number if _SINGLE.search(name) else 0 for number, name in enumerate(names)]
        self._single = np.array(single, np.uint32)

    def number(self, label: NDArray[np.uint8], instance: NDArray[np.uint16] | NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return the segment id of each pixel (h, w).

        Raises:
            BagError: labels and instance ids differ in shape, or an instance id is that of no object.
        """
        if label.shape != instance.shape:
            raise BagError(f"the tag image has {_size(label)} pixels, but the instance image {_size(instance)}")
        if (largest := int(instance.max(initial=0))) >= len(self._single):
            raise BagError(f"instance id {largest} must be below {len(self._single)}, the number of objects")
        objects = np.take(self._mask, label) & np.take(self._single, instance)
        numbers: NDArray[np.uint32] = np.take(self._base, label) | objects
        return numbers


def segments_of(ids: NDArray[np.uint32]) -> list[Segment]:
    """Segments of an image (h, w) of segment ids, by ascending id; 0 is not a segment.

    The run lengths of all segments are found in one pass. Encoding mask by mask takes five times as long.
    """
    flat = np.ascontiguousarray(ids.T).reshape(-1)
    starts = np.append(0, np.flatnonzero(flat[1:] != flat[:-1]) + 1)
    owners = flat[starts]
    order = np.argsort(owners, kind="stable")
    runs = np.stack([starts, np.append(starts[1:], flat.size)], axis=1)[order]
    numbers, sizes = np.unique(owners, return_counts=True)
    masks = [{"size": ids.shape, "counts": _counts(own, flat.size)} for own in np.split(runs, np.cumsum(sizes)[:-1])]
    encoded = coco_mask.frPyObjects(masks, *ids.shape)
    areas, boxes = coco_mask.area(encoded).tolist(), coco_mask.toBbox(encoded).astype(int).tolist()
    rows = zip(numbers.tolist(), areas, boxes, encoded, strict=True)
    return [Segment(number, area, box, rle["counts"].decode()) for number, area, box, rle in rows if number]


def _counts(runs: NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Alternating lengths outside and inside of runs (n, 2) of start and end; nothing after a run at the end."""
    counts = np.diff(runs.reshape(-1), prepend=0, append=size)
    return counts if counts[-1] else counts[:-1]


def _size(image: NDArray[Any]) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"
