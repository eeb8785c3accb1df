# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ontologies of off-road data sets, and the class of each that ours are mapped to.

Sources, reasons and losses are documented in docs/labels.md; a test compares its tables with these.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fieldtruth.core.classes import Label


class OntologyClass(NamedTuple):
    """Name and colour of a class of another ontology."""

    name: str
    rgb: tuple[int, int, int]


class Ontology(NamedTuple):
    """All classes of an ontology by id, and the id that each of our classes is mapped to."""

    classes: Mapping[int, OntologyClass]
    ids: Mapping[Label, int]


_RUGD: Final = {
    0: OntologyClass("void", (0, 0, 0)),
    1: OntologyClass("dirt", (108, 64, 20)),
    2: OntologyClass("sand", (255, 229, 204)),
    3: OntologyClass("grass", (0, 102, 0)),
    4: OntologyClass("tree", (0, 255, 0)),
    5: OntologyClass("pole", (0, 153, 153)),
    6: OntologyClass("water", (0, 128, 255)),
    7: OntologyClass("sky", (0, 0, 255)),
    8: OntologyClass("vehicle", (255, 255, 0)),
    9: OntologyClass("container/generic-object", (255, 0, 127)),
    10: OntologyClass("asphalt", (64, 64, 64)),
    11: OntologyClass("gravel", (255, 128, 0)),
    12: OntologyClass("building", (255, 0, 0)),
    13: OntologyClass("mulch", (153, 76, 0)),
    14: OntologyClass("rock-bed", (102, 102, 0)),
    15: OntologyClass("log", (102, 0, 0)),
    16: OntologyClass("bicycle", (0, 255, 128)),
    17: OntologyClass("person", (204, 153, 255)),
    18: OntologyClass("fence", (102, 0, 204)),
    19: OntologyClass("bush", (255, 153, 204)),
    20: OntologyClass("sign", (0, 102, 102)),
    21: OntologyClass("rock", (153, 204, 255)),
    22: OntologyClass("bridge", (102, 255, 255)),
    23: OntologyClass("concrete", (101, 101, 11)),
    24: OntologyClass("picnic-table", (114, 85, 47)),
}

_RELLIS: Final = {
    0: OntologyClass("void", (0, 0, 0)),
    1: OntologyClass("dirt", (108, 64, 20)),
    3: OntologyClass("grass", (0, 102, 0)),
    4: OntologyClass("tree", (0, 255, 0)),
    5: OntologyClass("pole", (0, 153, 153)),
    6: OntologyClass("water", (0, 128, 255)),
    7: OntologyClass("sky", (0, 0, 255)),
    8: OntologyClass("vehicle", (255, 255, 0)),
    9: OntologyClass("object", (255, 0, 127)),
    10: OntologyClass("asphalt", (64, 64, 64)),
    12: OntologyClass("building", (255, 0, 0)),
    15: OntologyClass("log", (102, 0, 0)),
    17: OntologyClass("person", (204, 153, 255)),
    18: OntologyClass("fence", (102, 0, 204)),
    19: OntologyClass("bush", (255, 153, 204)),
    23: OntologyClass("concrete", (170, 170, 170)),
    27: OntologyClass("barrier", (41, 121, 255)),
    31: OntologyClass("puddle", (134, 255, 239)),
    33: OntologyClass("mud", (99, 66, 34)),
    34: OntologyClass("rubble", (110, 22, 138)),
}

_GOOSE: Final = {
    0: OntologyClass("undefined", (0, 0, 0)),
    1: OntologyClass("traffic_cone", (255, 255, 0)),
    2: OntologyClass("snow", (209, 87, 160)),
    3: OntologyClass("cobble", (255, 52, 255)),
    4: OntologyClass("obstacle", (255, 74, 70)),
    5: OntologyClass("leaves", (0, 137, 65)),
    6: OntologyClass("street_light", (0, 111, 166)),
    7: OntologyClass("bikeway", (163, 0, 89)),
    8: OntologyClass("ego_vehicle", (255, 219, 229)),
    9: OntologyClass("pedestrian_crossing", (122, 73, 0)),
    10: OntologyClass("road_block", (0, 0, 166)),
    11: OntologyClass("road_marking", (99, 255, 172)),
    12: OntologyClass("car", (183, 151, 98)),
    13: OntologyClass("bicycle", (0, 77, 67)),
    14: OntologyClass("person", (143, 176, 255)),
    15: OntologyClass("bus", (153, 125, 135)),
    16: OntologyClass("forest", (90, 0, 7)),
    17: OntologyClass("bush", (128, 150, 147)),
    18: OntologyClass("moss", (180, 168, 189)),
    19: OntologyClass("traffic_light", (27, 68, 0)),
    20: OntologyClass("motorcycle", (79, 198, 1)),
    21: OntologyClass("sidewalk", (59, 93, 255)),
    22: OntologyClass("curb", (74, 59, 83)),
    23: OntologyClass("asphalt", (255, 47, 128)),
    24: OntologyClass("gravel", (97, 97, 90)),
    25: OntologyClass("boom_barrier", (52, 54, 45)),
    26: OntologyClass("rail_track", (107, 121, 0)),
    27: OntologyClass("tree_crown", (0, 194, 160)),
    28: OntologyClass("tree_trunk", (255, 170, 146)),
    29: OntologyClass("debris", (136, 111, 76)),
    30: OntologyClass("crops", (0, 134, 237)),
    31: OntologyClass("soil", (209, 97, 0)),
    32: OntologyClass("rider", (221, 239, 255)),
    33: OntologyClass("animal", (0, 0, 53)),
    34: OntologyClass("truck", (123, 79, 75)),
    35: OntologyClass("on_rails", (161, 194, 153)),
    36: OntologyClass("caravan", (48, 0, 24)),
    37: OntologyClass("trailer", (10, 166, 216)),
    38: OntologyClass("building", (1, 51, 73)),
    39: OntologyClass("wall", (0, 132, 111)),
    40: OntologyClass("rock", (55, 33, 1)),
    41: OntologyClass("fence", (255, 181, 0)),
    42: OntologyClass("guard_rail", (194, 255, 237)),
    43: OntologyClass("bridge", (160, 121, 191)),
    44: OntologyClass("tunnel", (204, 7, 68)),
    45: OntologyClass("pole", (192, 185, 178)),
    46: OntologyClass("traffic_sign", (194, 255, 153)),
    47: OntologyClass("misc_sign", (0, 30, 9)),
    48: OntologyClass("barrier_tape", (190, 196, 89)),
    49: OntologyClass("kick_scooter", (111, 0, 98)),
    50: OntologyClass("low_grass", (12, 189, 102)),
    51: OntologyClass("high_grass", (238, 195, 255)),
    52: OntologyClass("scenery_vegetation", (69, 109, 117)),
    53: OntologyClass("sky", (183, 123, 104)),
    54: OntologyClass("water", (122, 135, 161)),
    55: OntologyClass("wire", (255, 140, 0)),
    56: OntologyClass("outlier", (120, 141, 102)),
    57: OntologyClass("heavy_machinery", (250, 208, 159)),
    58: OntologyClass("container", (255, 138, 154)),
    59: OntologyClass("hedge", (232, 211, 23)),
    60: OntologyClass("barrel", (208, 208, 0)),
    61: OntologyClass("pipe", (221, 0, 0)),
    62: OntologyClass("tree_root", (196, 164, 132)),
    63: OntologyClass("military_vehicle", (64, 64, 64)),
}

_GOOSE9: Final = {
    0: OntologyClass("other", (169, 169, 169)),
    1: OntologyClass("artificial_structures", (222, 136, 222)),
    2: OntologyClass("artificial_ground", (235, 255, 59)),
    3: OntologyClass("natural_ground", (161, 136, 127)),
    4: OntologyClass("obstacle", (255, 193, 7)),
    5: OntologyClass("vehicle", (244, 67, 54)),
    6: OntologyClass("vegetation", (76, 175, 80)),
    7: OntologyClass("human", (143, 176, 255)),
    8: OntologyClass("sky", (183, 123, 104)),
}

_GANAV6: Final = {
    0: OntologyClass("background", (0, 0, 0)),
    1: OntologyClass("L1 (Smooth)", (0, 128, 0)),
    2: OntologyClass("L2 (Rough)", (255, 255, 0)),
    3: OntologyClass("L3 (Bumpy)", (255, 128, 0)),
    4: OntologyClass("non-Nav (Forbidden)", (255, 0, 0)),
    5: OntologyClass("obstacle", (0, 0, 128)),
}

_NAMES: Final[dict[Label, tuple[str, str, str, str, str]]] = {
    Label.VOID: ("void", "void", "undefined", "other", "background"),
    Label.GROUND: ("grass", "grass", "low_grass", "natural_ground", "L2 (Rough)"),
    Label.TRUNK: ("tree", "tree", "tree_trunk", "vegetation", "obstacle"),
    Label.TREETOP: ("tree", "tree", "tree_crown", "vegetation", "obstacle"),
    Label.BUSH: ("bush", "bush", "bush", "vegetation", "obstacle"),
    Label.ROCK: ("rubble", "rock", "rock", "obstacle", "L3 (Bumpy)"),
    Label.HIGH_GRASS: ("grass", "grass", "high_grass", "vegetation", "L2 (Rough)"),
    Label.TRAIL: ("dirt", "gravel", "gravel", "natural_ground", "L2 (Rough)"),
    Label.LAMP_POST: ("pole", "pole", "street_light", "obstacle", "obstacle"),
    Label.TRASH_BIN: ("object", "container/generic-object", "container", "obstacle", "obstacle"),
    Label.TABLE: ("object", "picnic-table", "obstacle", "obstacle", "obstacle"),
    Label.BENCH: ("object", "container/generic-object", "obstacle", "obstacle", "obstacle"),
    Label.POST: ("pole", "pole", "pole", "obstacle", "obstacle"),
    Label.CABLE: ("object", "container/generic-object", "wire", "obstacle", "obstacle"),
    Label.WATER: ("water", "water", "water", "natural_ground", "non-Nav (Forbidden)"),
    Label.SKY: ("sky", "sky", "sky", "sky", "background"),
    Label.ROBOT: ("void", "void", "ego_vehicle", "other", "background"),
    Label.PARTICLE: ("void", "void", "outlier", "other", "background"),
}
"""Class names in the order of ``_CLASSES``."""

_CLASSES: Final = {"rellis": _RELLIS, "rugd": _RUGD, "goose": _GOOSE, "goose9": _GOOSE9, "ganav6": _GANAV6}


def _ontology(column: int, classes: Mapping[int, OntologyClass]) -> Ontology:
    id_of = {other.name: number for number, other in classes.items()}
    return Ontology(classes, {label: id_of[names[column]] for label, names in _NAMES.items()})


ONTOLOGIES: Final[dict[str, Ontology]] = {
    name: _ontology(column, classes) for column, (name, classes) in enumerate(_CLASSES.items())
}
"""RELLIS-3D, RUGD, the 64 classes of GOOSE, the 9 of its challenge, and the 6 groups of GANav."""
