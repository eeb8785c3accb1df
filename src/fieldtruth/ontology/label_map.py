# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The labels of other ontologies: which of their classes each of ours becomes."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.ontology.data_sets import ONTOLOGIES, Ontology, OntologyClass


class LabelMap(NamedTuple):
    """An ontology and the way there: ``ids[label]`` is the id there of our class ``label``."""

    name: str
    ids: NDArray[np.uint8]
    """(16,) ids there by our class id; row 0 is their void."""
    classes: Mapping[int, OntologyClass]
    """Every class there, by id; ``ids`` names some of them."""

    def colours(self) -> NDArray[np.uint8]:
        """(256, 3) RGB by id there; black where there is no class."""
        table = np.zeros((256, 3), np.uint8)
        for number, other in self.classes.items():
            table[number] = other.rgb
        return table


def _label_map(name: str, ontology: Ontology) -> LabelMap:
    ids = np.array([ontology.ids[label] for label in Label], np.uint8)
    ids.setflags(write=False)
    return LabelMap(name, ids, ontology.classes)


LABEL_MAPS: Final[dict[str, LabelMap]] = {name: _label_map(name, ontology) for name, ontology in ONTOLOGIES.items()}


def label_map_of(name: str) -> LabelMap:
    """Return an ontology by name.

    Raises:
        UnknownNameError: there is none of that name; lists those that there are.
    """
    if name not in LABEL_MAPS:
        raise UnknownNameError("label map", name, LABEL_MAPS)
    return LABEL_MAPS[name]


__all__ = ["LABEL_MAPS", "LabelMap", "OntologyClass", "label_map_of"]
