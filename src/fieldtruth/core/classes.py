# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The semantic classes: one table of id, name and flat colour (paper, Table 3), used by every sensor and format.

Ids 1 to 13 are the paper's reflectivities. Water, sky and void are ours: neither returns a laser pulse,
so the paper gives them no reflectivity. Table is (0, 0, 0); void has no colour, because no pixel is ever void.
Robot and particle (rain, snow, fog, dust in the air) occur only in runs whose experiment asks for them, building and
fence only in worlds that are made from maps or from a user's objects, person, animal, vehicle and aerial vehicle only
in runs with actors, or in worlds with such objects of a user.
"""

from collections.abc import Iterable, Iterator, Mapping
from enum import IntEnum
from functools import cached_property
from itertools import combinations
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray


class Label(IntEnum):
    """Class id of a point or pixel; the LiDAR's intensity (reflectivity) is the same number."""

    VOID = 0
    GROUND = 1
    TRUNK = 2
    TREETOP = 3
    BUSH = 4
    ROCK = 5
    HIGH_GRASS = 6
    TRAIL = 7
    LAMP_POST = 8
    TRASH_BIN = 9
    TABLE = 10
    BENCH = 11
    POST = 12
    CABLE = 13
    WATER = 14
    SKY = 15
    ROBOT = 16
    PARTICLE = 17
    BUILDING = 18
    FENCE = 19
    PERSON = 20
    ANIMAL = 21
    VEHICLE = 22
    AERIAL_VEHICLE = 23


class PlantPart(IntEnum):
    """Part of a plant that a point or pixel is on."""

    NONE = 0
    """Of no plant, or of one that is drawn as a whole."""
    STEM = 1
    """Trunk, or stalk: what grows from the ground, its roots included."""
    BRANCH = 2
    LEAF = 3
    """Leaf or needle that grows on a stem or branch."""
    FLOWER = 4
    """Flower, fruit, ear or plume."""
    BLADE = 5
    """Blade or leaf that grows from the ground, as grass does."""


def as_key(name: str) -> str:
    """Return a name of a class in small letters, with underscores for spaces and hyphens."""
    return name.strip().lower().replace(" ", "_").replace("-", "_")


class SemanticClass(NamedTuple):
    """One row of the table: the id, its name for people, and its flat colour (None for void)."""

    label: int
    name: str
    rgb: tuple[int, int, int] | None

    @property
    def key(self) -> str:
        """Name as one word: ``trunk`` of trunk and branch."""
        name = self.label.name if isinstance(self.label, Label) else self.name
        return as_key(name)


class ClassTable(tuple[SemanticClass, ...]):
    """Classes by id. An id that no class has is a row of the name ``void`` without a colour."""

    others: Mapping[int, Mapping[str, str]]
    """Classes of other ontologies by class id and name of the label map, where the label map does not have it."""

    def __new__(cls, rows: Iterable[SemanticClass], others: Mapping[int, Mapping[str, str]] | None = None) -> Self:
        """Make a table of the rows of ids 0, 1, 2 and so on."""
        table = super().__new__(cls, rows)
        table.others = {} if others is None else others
        return table

    @cached_property
    def palette(self) -> NDArray[np.uint8]:
        """(ids, 3) flat colour per class id; black for rows without one."""
        table = np.array([row.rgb or (0, 0, 0) for row in self], np.uint8)
        table.setflags(write=False)
        return table

    @property
    def coloured(self) -> Iterator[SemanticClass]:
        """Rows that points and pixels can have."""
        return (row for row in self if row.rgb is not None)

    @property
    def of_objects(self) -> dict[str, int]:
        """Ids by name and key of the classes that objects of a world may have."""
        never = {*NOT_OF_WORLDS, Label.VOID, Label.SKY}
        rows = [row for row in self.coloured if row.label not in never]
        return {name: row.label for row in rows for name in (as_key(row.name), row.key)}

    def joined(self, other: "ClassTable") -> "ClassTable":
        """Return a table with the classes of both.

        Raises:
            ValueError: an id, a name or a colour is of different classes, or one class is different ones elsewhere.
        """
        same = "runs of one data set must have the same classes"
        both = {*self.coloured, *other.coloured}
        for one, two in combinations(sorted(both), 2):
            if any(a == b for a, b in zip(one, two, strict=True)):
                a, b = (f"class {row.label} is {row.name} with the colour {list(row.rgb or ())}" for row in (one, two))
                raise ValueError(f"{a} in one run, and {b} in another: {same}")
        others = {label: dict(maps) for label, maps in self.others.items()}
        for label, maps in other.others.items():
            mine = others.setdefault(label, {})
            for name in (name for name in maps if mine.setdefault(name, maps[name]) != maps[name]):
                text = f"class {label}, {other[label].name}, is {mine[name]} of {name} in one run, and {maps[name]}"
                raise ValueError(f"{text} in another: {same}")
        rows = {row.label: row for row in both}
        void = [SemanticClass(label, "void", None) for label in range(max(rows) + 1)]
        return ClassTable([rows.get(row.label, row) for row in void], others)

    def without(self, *labels: int) -> "ClassTable":
        """Return the table without some classes; other ids stay."""
        rows = [SemanticClass(row.label, "void", None) if row.label in labels else row for row in self]
        while rows[-1].rgb is None:
            rows.pop()
        return ClassTable(rows, self.others)


CLASSES: Final = ClassTable(
    [
        SemanticClass(Label.VOID, "void", None),
        SemanticClass(Label.GROUND, "ground", (0, 255, 0)),
        SemanticClass(Label.TRUNK, "trunk and branch", (255, 0, 255)),
        SemanticClass(Label.TREETOP, "treetop", (255, 255, 0)),
        SemanticClass(Label.BUSH, "bush", (0, 0, 255)),
        SemanticClass(Label.ROCK, "rock", (255, 0, 0)),
        SemanticClass(Label.HIGH_GRASS, "high grass", (97, 127, 56)),
        SemanticClass(Label.TRAIL, "trail", (76, 57, 48)),
        SemanticClass(Label.LAMP_POST, "lamp post", (204, 97, 20)),
        SemanticClass(Label.TRASH_BIN, "trash bin", (102, 0, 102)),
        SemanticClass(Label.TABLE, "table", (0, 0, 0)),
        SemanticClass(Label.BENCH, "bench", (255, 255, 255)),
        SemanticClass(Label.POST, "post", (61, 59, 112)),
        SemanticClass(Label.CABLE, "cable", (255, 153, 153)),
        SemanticClass(Label.WATER, "water", (33, 112, 178)),
        SemanticClass(Label.SKY, "sky", (127, 127, 127)),
        SemanticClass(Label.ROBOT, "robot", (0, 255, 255)),
        SemanticClass(Label.PARTICLE, "particle", (178, 128, 255)),
        SemanticClass(Label.BUILDING, "building", (119, 255, 187)),
        SemanticClass(Label.FENCE, "fence", (128, 0, 255)),
        SemanticClass(Label.PERSON, "person", (255, 178, 51)),
        SemanticClass(Label.ANIMAL, "animal", (153, 51, 51)),
        SemanticClass(Label.VEHICLE, "vehicle", (0, 102, 102)),
        SemanticClass(Label.AERIAL_VEHICLE, "aerial vehicle", (170, 255, 0)),
    ]
)

PALETTE: Final = CLASSES.palette
"""(24, 3) flat colour per class id; row 0 (void) is never written."""

NO_RETURN: Final[frozenset[Label]] = frozenset({Label.WATER, Label.SKY})
"""Classes that return no laser pulse."""

NOT_OF_WORLDS: Final[frozenset[Label]] = frozenset({Label.ROBOT, Label.PARTICLE})
"""Classes that no object of a world has: the robot that carries the sensors, and what floats in the air."""

OF_MAPS: Final[frozenset[Label]] = frozenset({Label.BUILDING, Label.FENCE})
"""Classes that the paper's four environments do not have."""

OF_ACTORS: Final[frozenset[Label]] = frozenset({Label.PERSON, Label.ANIMAL, Label.VEHICLE, Label.AERIAL_VEHICLE})
"""Classes of actors."""

GROUND_ID: Final = 1
"""Instance id of the ground, in every world."""
