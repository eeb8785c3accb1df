# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What COCO calls things, stuff and crowds, in this package's classes and objects.

Things can be counted, and each object has a segment of its own. Stuff cannot: it has one segment per class. So has what
belongs to things that cannot be told apart: a crowd, as swarms are (far trees, pebbles), and woods on the far land.
"""

import re
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.reader import BagError
from fieldtruth.core.classes import CLASSES, Label
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
}
STUFF: Final = frozenset({Label.GROUND, Label.TRAIL, Label.HIGH_GRASS, Label.WATER, Label.SKY})
"""Classes that cannot be counted. A class of another ontology is a thing if all of ours that it holds are."""

_SINGLE: Final = re.compile(r"_\d+$")
"""Objects are numbered by kind (``bench_3``); a swarm of things, and the ground, have a name without a number."""


class Category(NamedTuple):
    """A row of COCO's categories."""

    id: int
    name: str
    supercategory: str
    isthing: bool
    color: tuple[int, int, int]

    def row(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        return self._asdict() | {"isthing": int(self.isthing)}


def categories_of(label_map: LabelMap | None) -> list[Category]:
    """Categories that pixels can have, by id: our classes, or those of another ontology that stand for any of ours."""
    ids = np.arange(len(CLASSES)) if label_map is None else label_map.ids
    result: list[Category] = []
    for number in sorted({int(ids[label]) for label in _SUPERCATEGORIES} - {int(ids[Label.VOID])}):
        ours = [label for label in _SUPERCATEGORIES if ids[label] == number]
        if label_map is None:
            name, rgb = CLASSES[number].name, CLASSES[number].rgb or (0, 0, 0)
        else:
            name, rgb = label_map.classes[number]
        above = {_SUPERCATEGORIES[label] for label in ours}
        thing = STUFF.isdisjoint(ours)
        result.append(Category(number, name, above.pop() if len(above) == 1 else name, thing, rgb))
    return result


class Numbering:
    """Numbers of segments: 65536 times the category, plus the object's id where the segment is one object.

    So a number means the same in all pictures of a run. 0 is void: only other ontologies leave pixels without a class.
    """

    def __init__(self, categories: Sequence[Category], label_map: LabelMap | None, names: Sequence[str]) -> None:
        ids = np.arange(len(CLASSES)) if label_map is None else label_map.ids.astype(np.int64)
        known = {category.id: category for category in categories}
        things = [int(number) in known and known[int(number)].isthing for number in ids]
        self._base = np.array([number << 16 if int(number) in known else 0 for number in ids], np.uint32)
        self._mask = np.where(things, 0xFFFF, 0).astype(np.uint32)
        single = [number if _SINGLE.search(name) else 0 for number, name in enumerate(names)]
        self._single = np.array(single, np.uint32)

    def number(self, label: NDArray[np.uint8], instance: NDArray[np.uint16]) -> NDArray[np.uint32]:
        """Return the number of each pixel's segment (h, w).

        Raises:
            BagError: classes and objects differ in shape, or an object is no row of /gazebo/model_states.
        """
        if label.shape != instance.shape:
            raise BagError(f"tags of {label.shape[::-1]} and objects of {instance.shape[::-1]} pixels do not fit")
        if (largest := int(instance.max(initial=0))) >= len(self._single):
            raise BagError(f"object {largest} is none of the {len(self._single)} in /gazebo/model_states")
        objects = np.take(self._mask, label) & np.take(self._single, instance)
        numbers: NDArray[np.uint32] = np.take(self._base, label) | objects
        return numbers
