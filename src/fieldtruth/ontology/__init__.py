# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Label maps from our classes to the ontologies of other data sets, as arrays.

A map is a file with ``classes``, name and rgb by id of the ontology, and ``ids`` by the name of our class. Those of the
package are in ``label_maps``: RELLIS-3D, RUGD, the 64 classes of GOOSE, the 9 of its challenge, the 6 groups of GANav,
YCOR, SemanticKITTI, and a few classes that the off-road ones share. A user's are in a folder ``label_maps`` of
FIELDTRUTH_PATH, or named by an entry point of the group ``fieldtruth.label_maps``; building and fence, which came
later, are void where they are missing. Sources, reasons and losses are documented in docs/labels.md; a test compares
its tables with the files.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import CLASSES, OF_ACTORS, OF_MAPS, ClassTable, SemanticClass
from fieldtruth.core.errors import ConfigurationError, UnknownNameError, suggestion
from fieldtruth.core.registry import Registry
from fieldtruth.core.yaml_io import read_data


class OntologyClass(NamedTuple):
    """Name and colour of a class of another ontology."""

    name: str
    rgb: tuple[int, int, int]


class LabelMap(NamedTuple):
    """An ontology and the map to it: ``ids[label]`` is its id for our class ``label``."""

    name: str
    ids: NDArray[np.uint8]
    """(20,) ids of the ontology by our class id; row 0 is its void class."""
    classes: Mapping[int, OntologyClass]
    """All classes of the ontology by id; ``ids`` uses some of them."""

    @property
    def is_own(self) -> bool:
        """True of our own classes."""
        return self.name == _OWN

    def over(self, classes: ClassTable) -> "LabelMap":
        """Return the map of the classes of a run. Own classes that do not say what they are there are void."""
        ids = dict.fromkeys(range(len(classes)), int(self.ids[0]))
        ids |= {row.label: int(self.ids[row.label]) for row in classes.coloured if row.label < len(self.ids)}
        said = {label: names[self.name] for label, names in classes.others.items() if self.name in names}
        ids |= {label: self.number_of(name, classes[label]) for label, name in said.items()}
        return self._replace(ids=np.array([*ids.values()], np.uint8))

    def number_of(self, name: str, own: SemanticClass) -> int:
        """Return the id of the class that an own class is said to be.

        Raises:
            UnknownNameError: the ontology has no class of this name.
        """
        by_name = {other.name: number for number, other in self.classes.items()}
        if name not in by_name:
            raise UnknownNameError("class", name, by_name, f"layout: classes.{own.name}.label_maps.{self.name}")
        return by_name[name]

    def colours(self) -> NDArray[np.uint8]:
        """(256, 3) RGB by id of the ontology; black where it has no class."""
        table = np.zeros((256, 3), np.uint8)
        for number, other in self.classes.items():
            table[number] = other.rgb
        return table


_OWN: Final = "fieldtruth"


def own_labels(classes: ClassTable = CLASSES) -> LabelMap:
    """Return our own classes, mapped to themselves."""
    known = {row.label: OntologyClass(row.name, row.rgb or (0, 0, 0)) for row in (classes[0], *classes.coloured)}
    return LabelMap(_OWN, np.arange(len(classes), dtype=np.uint8), {int(n): other for n, other in known.items()})


def _read(name: str, given: Any) -> LabelMap:
    """Read the map of a file, or of a mapping.

    Raises:
        ConfigurationError: a class of ours without id, an unknown class, or an id without a class.
    """
    if isinstance(given, LabelMap):
        return given
    data, source = read_data(name, given), str(given) if isinstance(given, str | Path) else name
    ours = [row.name for row in CLASSES]
    classes = {number: OntologyClass(row["name"], tuple(row["rgb"])) for number, row in data["classes"].items()}
    for own in data["ids"]:
        if own not in ours:
            raise ConfigurationError(f"{source}: ids: unknown class {own!r}; {suggestion(str(own), ours)}")
    rare = (CLASSES[label].name for label in sorted(OF_MAPS | OF_ACTORS))
    ids = dict.fromkeys(rare, data["ids"].get("void")) | data["ids"]
    for own in ours:
        number = ids.get(own)
        if number not in classes or not 0 <= number < 256:
            allowed = ", ".join(map(str, classes))
            raise ConfigurationError(f"{source}: ids: {own} must be one of the classes {allowed}; got {number}")
    by_label = np.array([ids[own] for own in ours], np.uint8)
    by_label.setflags(write=False)
    return LabelMap(name, by_label, classes)


LABEL_MAPS: Final[Registry[LabelMap]] = Registry(
    "label map", "label_maps", ".yaml", _read, Path(__file__).parent / "label_maps"
)


def check_others(classes: ClassTable) -> None:
    """Check what own classes are said to be in other ontologies.

    Raises:
        UnknownNameError: an unknown label map or class.
    """
    for label, names in classes.others.items():
        for map_name, name in names.items():
            label_map_of(map_name).number_of(name, classes[label])


def label_map_of(name: str) -> LabelMap:
    """Return a label map by name.

    Raises:
        UnknownNameError: unknown name.
    """
    return LABEL_MAPS.find(name)
