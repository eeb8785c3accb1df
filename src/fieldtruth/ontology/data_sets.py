# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ontologies of the field's own data sets, and what each of our classes is called there.

docs/labels.md names the sources, gives the reasons and says what is lost; a test holds it to these tables.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from fieldtruth.core.classes import Label


class OtherClass(NamedTuple):
    """A class of another ontology."""

    name: str
    rgb: tuple[int, int, int]


class Ontology(NamedTuple):
    """All classes there by id, and the id there of each of our classes."""

    classes: Mapping[int, OtherClass]
    ids: Mapping[Label, int]


_RUGD: Final = {
    0: OtherClass("void", (0, 0, 0)),
    1: OtherClass("dirt", (108, 64, 20)),
    2: OtherClass("sand", (255, 229, 204)),
    3: OtherClass("grass", (0, 102, 0)),
    4: OtherClass("tree", (0, 255, 0)),
    5: OtherClass("pole", (0, 153, 153)),
    6: OtherClass("water", (0, 128, 255)),
    7: OtherClass("sky", (0, 0, 255)),
    8: OtherClass("vehicle", (255, 255, 0)),
    9: OtherClass("container/generic-object", (255, 0, 127)),
    10: OtherClass("asphalt", (64, 64, 64)),
    11: OtherClass("gravel", (255, 128, 0)),
    12: OtherClass("building", (255, 0, 0)),
    13: OtherClass("mulch", (153, 76, 0)),
    14: OtherClass("rock-bed", (102, 102, 0)),
    15: OtherClass("log", (102, 0, 0)),
    16: OtherClass("bicycle", (0, 255, 128)),
    17: OtherClass("person", (204, 153, 255)),
    18: OtherClass("fence", (102, 0, 204)),
    19: OtherClass("bush", (255, 153, 204)),
    20: OtherClass("sign", (0, 102, 102)),
    21: OtherClass("rock", (153, 204, 255)),
    22: OtherClass("bridge", (102, 255, 255)),
    23: OtherClass("concrete", (101, 101, 11)),
    24: OtherClass("picnic-table", (114, 85, 47)),
}

_RELLIS: Final = {
    0: OtherClass("void", (0, 0, 0)),
    1: OtherClass("dirt", (108, 64, 20)),
    3: OtherClass("grass", (0, 102, 0)),
    4: OtherClass("tree", (0, 255, 0)),
    5: OtherClass("pole", (0, 153, 153)),
    6: OtherClass("water", (0, 128, 255)),
    7: OtherClass("sky", (0, 0, 255)),
    8: OtherClass("vehicle", (255, 255, 0)),
    9: OtherClass("object", (255, 0, 127)),
    10: OtherClass("asphalt", (64, 64, 64)),
    12: OtherClass("building", (255, 0, 0)),
    15: OtherClass("log", (102, 0, 0)),
    17: OtherClass("person", (204, 153, 255)),
    18: OtherClass("fence", (102, 0, 204)),
    19: OtherClass("bush", (255, 153, 204)),
    23: OtherClass("concrete", (170, 170, 170)),
    27: OtherClass("barrier", (41, 121, 255)),
    31: OtherClass("puddle", (134, 255, 239)),
    33: OtherClass("mud", (99, 66, 34)),
    34: OtherClass("rubble", (110, 22, 138)),
}

_GOOSE: Final = {
    0: OtherClass("undefined", (0, 0, 0)),
    1: OtherClass("traffic_cone", (255, 255, 0)),
    2: OtherClass("snow", (209, 87, 160)),
    3: OtherClass("cobble", (255, 52, 255)),
    4: OtherClass("obstacle", (255, 74, 70)),
    5: OtherClass("leaves", (0, 137, 65)),
    6: OtherClass("street_light", (0, 111, 166)),
    7: OtherClass("bikeway", (163, 0, 89)),
    8: OtherClass("ego_vehicle", (255, 219, 229)),
    9: OtherClass("pedestrian_crossing", (122, 73, 0)),
    10: OtherClass("road_block", (0, 0, 166)),
    11: OtherClass("road_marking", (99, 255, 172)),
    12: OtherClass("car", (183, 151, 98)),
    13: OtherClass("bicycle", (0, 77, 67)),
    14: OtherClass("person", (143, 176, 255)),
    15: OtherClass("bus", (153, 125, 135)),
    16: OtherClass("forest", (90, 0, 7)),
    17: OtherClass("bush", (128, 150, 147)),
    18: OtherClass("moss", (180, 168, 189)),
    19: OtherClass("traffic_light", (27, 68, 0)),
    20: OtherClass("motorcycle", (79, 198, 1)),
    21: OtherClass("sidewalk", (59, 93, 255)),
    22: OtherClass("curb", (74, 59, 83)),
    23: OtherClass("asphalt", (255, 47, 128)),
    24: OtherClass("gravel", (97, 97, 90)),
    25: OtherClass("boom_barrier", (52, 54, 45)),
    26: OtherClass("rail_track", (107, 121, 0)),
    27: OtherClass("tree_crown", (0, 194, 160)),
    28: OtherClass("tree_trunk", (255, 170, 146)),
    29: OtherClass("debris", (136, 111, 76)),
    30: OtherClass("crops", (0, 134, 237)),
    31: OtherClass("soil", (209, 97, 0)),
    32: OtherClass("rider", (221, 239, 255)),
    33: OtherClass("animal", (0, 0, 53)),
    34: OtherClass("truck", (123, 79, 75)),
    35: OtherClass("on_rails", (161, 194, 153)),
    36: OtherClass("caravan", (48, 0, 24)),
    37: OtherClass("trailer", (10, 166, 216)),
    38: OtherClass("building", (1, 51, 73)),
    39: OtherClass("wall", (0, 132, 111)),
    40: OtherClass("rock", (55, 33, 1)),
    41: OtherClass("fence", (255, 181, 0)),
    42: OtherClass("guard_rail", (194, 255, 237)),
    43: OtherClass("bridge", (160, 121, 191)),
    44: OtherClass("tunnel", (204, 7, 68)),
    45: OtherClass("pole", (192, 185, 178)),
    46: OtherClass("traffic_sign", (194, 255, 153)),
    47: OtherClass("misc_sign", (0, 30, 9)),
    48: OtherClass("barrier_tape", (190, 196, 89)),
    49: OtherClass("kick_scooter", (111, 0, 98)),
    50: OtherClass("low_grass", (12, 189, 102)),
    51: OtherClass("high_grass", (238, 195, 255)),
    52: OtherClass("scenery_vegetation", (69, 109, 117)),
    53: OtherClass("sky", (183, 123, 104)),
    54: OtherClass("water", (122, 135, 161)),
    55: OtherClass("wire", (255, 140, 0)),
    56: OtherClass("outlier", (120, 141, 102)),
    57: OtherClass("heavy_machinery", (250, 208, 159)),
    58: OtherClass("container", (255, 138, 154)),
    59: OtherClass("hedge", (232, 211, 23)),
    60: OtherClass("barrel", (208, 208, 0)),
    61: OtherClass("pipe", (221, 0, 0)),
    62: OtherClass("tree_root", (196, 164, 132)),
    63: OtherClass("military_vehicle", (64, 64, 64)),
}

_GOOSE9: Final = {
    0: OtherClass("other", (169, 169, 169)),
    1: OtherClass("artificial_structures", (222, 136, 222)),
    2: OtherClass("artificial_ground", (235, 255, 59)),
    3: OtherClass("natural_ground", (161, 136, 127)),
    4: OtherClass("obstacle", (255, 193, 7)),
    5: OtherClass("vehicle", (244, 67, 54)),
    6: OtherClass("vegetation", (76, 175, 80)),
    7: OtherClass("human", (143, 176, 255)),
    8: OtherClass("sky", (183, 123, 104)),
}

_GANAV6: Final = {
    0: OtherClass("background", (0, 0, 0)),
    1: OtherClass("L1 (Smooth)", (0, 128, 0)),
    2: OtherClass("L2 (Rough)", (255, 255, 0)),
    3: OtherClass("L3 (Bumpy)", (255, 128, 0)),
    4: OtherClass("non-Nav (Forbidden)", (255, 0, 0)),
    5: OtherClass("obstacle", (0, 0, 128)),
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
}
"""Names in the order of ``_CLASSES``."""

_CLASSES: Final = {"rellis": _RELLIS, "rugd": _RUGD, "goose": _GOOSE, "goose9": _GOOSE9, "ganav6": _GANAV6}


def _ontology(column: int, classes: Mapping[int, OtherClass]) -> Ontology:
    number = {other.name: number for number, other in classes.items()}
    return Ontology(classes, {label: number[names[column]] for label, names in _NAMES.items()})


ONTOLOGIES: Final[dict[str, Ontology]] = {
    name: _ontology(column, classes) for column, (name, classes) in enumerate(_CLASSES.items())
}
"""RELLIS-3D, RUGD, GOOSE's 64 classes, the 9 of its challenge, and the 6 groups of GANav."""
