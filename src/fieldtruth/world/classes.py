# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Classes of a user's own: the key ``classes`` of a layout, and the table of all classes of a world or a run.

The layout is the one place that has them: worlds keep theirs, and so does the experiment beside a bag.
"""

import re
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Annotated, Any, Final

import numpy as np
from pydantic import Field, field_validator

from fieldtruth.core.classes import CLASSES, OF_ACTORS, OF_MAPS, ClassTable, Label, SemanticClass, as_key
from fieldtruth.experiment.fields import Frozen, Integer, LocatedError, validated_as
from fieldtruth.world.environments import PAPER

CLASSES_KEY: Final = "classes"
CLASSES_FILE: Final = ".classes.yaml"
"""Ending, in place of its own, of the file with this key beside a bag without an experiment."""
FIRST: Final = 32
"""First id of an own class; smaller ones are for classes of ours that may come."""
LAST: Final = 255
_GRID: Final = np.array(list(product(range(0, 256, 51), repeat=3)), np.int64)
"""Colours (n, 3) from which those are chosen that a class does not say."""
_Byte = Annotated[Integer, Field(ge=0, le=255)]
_NAME: Final = re.compile("[A-Za-z][A-Za-z0-9 _-]{0,63}")


class OwnClass(Frozen):
    """A class that the package does not have."""

    id: Annotated[Integer, Field(ge=FIRST, le=LAST)] | None = None
    """By default the next free one, in the order of the names."""
    colour: Annotated[tuple[_Byte, _Byte, _Byte], Field(description="[red, green, blue], each 0 to 255")] | None = None
    """By default one that is far from those of all other classes."""
    label_maps: Mapping[str, str] = Field(
        default={}, description="a mapping of names of label maps to one of their classes"
    )
    """Class of another ontology by the name of the label map; void in those that are not listed. The names are checked
    before a world is built, in ``simulation``: worlds do not depend on label maps."""


class ClassesConfig(Frozen):
    """The part of a layout with a user's classes."""

    classes: Mapping[str, OwnClass] = Field(
        default={}, description="a mapping of names of classes to {colour: [red, green, blue], id: 32}"
    )

    @field_validator("classes")
    @classmethod
    def _different(cls, classes: Mapping[str, OwnClass]) -> Mapping[str, OwnClass]:
        class_table(classes)
        return classes


def class_table(own: Mapping[str, OwnClass], classes: ClassTable = CLASSES) -> ClassTable:
    """Return a table with a user's classes.

    Raises:
        LocatedError: a name, an id or a colour that another class has.
    """
    own = dict(sorted(own.items(), key=lambda item: as_key(item[0])))  # digests of layouts are of sorted keys
    names = [as_key(name) for name in own]
    for name, key in zip(own, names, strict=True):
        if not _NAME.fullmatch(name):
            raise LocatedError("must be named by at most 64 letters, digits, spaces, - and _", (name,))
        if names.count(key) > 1 or key in {known for row in CLASSES for known in (as_key(row.name), row.key)}:
            raise LocatedError("is the name of another class", (name,))
    given = [each.id for each in own.values() if each.id is not None]
    free = iter(number for number in range(FIRST, LAST + 1) if number not in given)
    rgb = {row.rgb: row.name for row in CLASSES}
    found: dict[int, SemanticClass] = {}
    for name, each in own.items():
        label = next(free, None) if each.id is None else each.id
        if label is None or label in found or given.count(label) > 1:
            raise LocatedError(f"must have an id of its own from {FIRST} to {LAST}", (name,))
        if each.colour in rgb and each.colour is not None:
            raise LocatedError(f"must differ from that of {rgb[each.colour]}", (name, "colour"))
        found[label] = SemanticClass(label, name, each.colour)
        rgb |= {each.colour: name} if each.colour else {}
    for label, row in sorted(found.items()):
        colour = row.rgb or _far_from([each for each in rgb if each])
        found[label], rgb[colour] = row._replace(rgb=colour), row.name
    rows = [*classes, *(SemanticClass(label, "void", None) for label in range(len(classes), max(found, default=0) + 1))]
    for label, row in found.items():
        rows[label] = row
    by_name = {row.name: label for label, row in found.items()}
    return ClassTable(rows, {by_name[name]: each.label_maps for name, each in own.items() if each.label_maps})


def _far_from(taken: list[tuple[int, int, int]]) -> tuple[int, int, int]:
    """Colour whose nearest other one is the farthest away."""
    distance = np.square(_GRID[:, None] - np.array(taken)).sum(axis=2).min(axis=1)
    red, green, blue = _GRID[distance.argmax()].tolist()
    return red, green, blue


def classes_of(environment: str, layout: Mapping[str, Any], *, actors: bool = False) -> ClassTable:
    """Return the classes that a world of an environment may have, with those of its layout, and of actors.

    Buildings and fences come to the paper's environments with objects, or in a world that is given: its classes are in
    the layout, even if it is empty. So do classes of actors to all environments.

    Raises:
        ConfigurationError: classes that are not allowed.
    """
    only_ours = not layout.get("objects") and CLASSES_KEY not in layout
    maps = OF_MAPS if only_ours and environment in PAPER else frozenset[Label]()
    return with_own(layout, CLASSES.without(*maps, *(OF_ACTORS if only_ours and not actors else ())))


def with_own(layout: Mapping[str, Any], classes: ClassTable = CLASSES, source: str = "layout") -> ClassTable:
    """Return a table with the classes of a layout; raises as ``classes_of``, with ``source`` in front."""
    own = layout.get(CLASSES_KEY)
    if not own:
        return classes
    return class_table(validated_as(ClassesConfig, {"classes": own}, source).classes, classes)


def as_layout(classes: ClassTable) -> dict[str, Any]:
    """Return the value of ``classes`` in a layout that gives the own classes of a table."""
    return {row.name: dict(_values(row, classes)) for row in classes.coloured if row.label >= FIRST}


def _values(row: SemanticClass, classes: ClassTable) -> Iterator[tuple[str, Any]]:
    yield "id", row.label
    yield "colour", list(row.rgb or ())
    if others := classes.others.get(row.label):
        yield "label_maps", dict(others)
