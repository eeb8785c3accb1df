# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Label maps as arrays: look up the id in another ontology for arrays of our class ids."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.ontology.data_sets import ONTOLOGIES, Ontology, OntologyClass


class LabelMap(NamedTuple):
    """An ontology and the map to it: ``ids[label]`` is its id for our class ``label``."""

    name: str
    ids: NDArray[np.uint8]
    """(18,) ids of the ontology by our class id; row 0 is its void class."""
    classes: Mapping[int, OntologyClass]
    """All classes of the ontology by id; ``ids`` uses some of them."""

    def colours(self) -> NDArray[np.uint8]:
        """(256, 3) RGB by id of the ontology; black where it has no class."""
        table = np.zeros((256, 3), np.uint8)
        for number, other in self.classes.items():
            table[number] = other.rgb
        return table


def _label_map(name: str, ontology: Ontology) -> LabelMap:
    ids = np.array([ontology.ids[label] for label in Label], np.uint8)
    ids.setflags(write=False)
    return LabelMap(name, ids, ontology.classes)


OWN: Final = LabelMap(
    "fieldtruth",
    np.arange(len(CLASSES), dtype=np.uint8),
    {int(row.label): OntologyClass(row.name, row.rgb or (0, 0, 0)) for row in CLASSES},
)
"""Our own classes, mapped to themselves."""

LABEL_MAPS: Final[dict[str, LabelMap]] = {name: _label_map(name, ontology) for name, ontology in ONTOLOGIES.items()}


def label_map_of(name: str) -> LabelMap:
    """Return a label map by name.

    Raises:
        UnknownNameError: unknown name.
    """
    if name not in LABEL_MAPS:
        raise UnknownNameError("label map", name, LABEL_MAPS)
    return LABEL_MAPS[name]


__all__ = ["LABEL_MAPS", "OWN", "LabelMap", "OntologyClass", "label_map_of"]
