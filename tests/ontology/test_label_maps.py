# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Label maps against rows of the ontologies' own files and against docs/labels.md."""

import re
from pathlib import Path

import numpy as np
import pytest

from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.ontology import LABEL_MAPS, label_map_of

DOCUMENT = (Path(__file__).parents[2] / "docs/labels.md").read_text(encoding="utf-8")
NAMES = ("rellis", "rugd", "goose", "goose9", "ganav6", "ycor", "offroad", "semantickitti")

# RUGD_annotation-colormap.txt
RUGD = """\
0 void 0 0 0
3 grass 0 102 0
4 tree 0 255 0
5 pole 0 153 153
6 water 0 128 255
7 sky 0 0 255
8 vehicle 255 255 0
9 container/generic-object 255 0 127
11 gravel 255 128 0
12 building 255 0 0
17 person 204 153 255
18 fence 102 0 204
19 bush 255 153 204
21 rock 153 204 255
24 picnic-table 114 85 47"""

# challenge_label_mapping.csv: class_name,label_key,has_instance,hex,challege_category_id,challenge_category_name; the
# categories of car, person and animal are assumed
GOOSE = """\
undefined,0,0,#000000,0,other
obstacle,4,0,#ff4a46,4,obstacle
street_light,6,1,#006fa6,4,obstacle
ego_vehicle,8,0,#ffdbe5,0,other
car,12,1,#b79762,5,vehicle
person,14,1,#8fb0ff,7,human
animal,33,1,#000035,0,other
bush,17,0,#809693,6,vegetation
gravel,24,0,#61615a,3,natural_ground
tree_crown,27,0,#00c2a0,6,vegetation
tree_trunk,28,1,#ffaa92,6,vegetation
building,38,0,#013349,1,artificial_structures
rock,40,1,#372101,4,obstacle
fence,41,0,#ffb500,4,obstacle
pole,45,1,#c0b9b2,4,obstacle
low_grass,50,0,#0cbd66,3,natural_ground
high_grass,51,0,#eec3ff,6,vegetation
sky,53,0,#b77b68,8,sky
water,54,0,#7a87a1,3,natural_ground
wire,55,0,#ff8c00,4,obstacle
outlier,56,0,#788d66,0,other
container,58,1,#ff8a9a,4,obstacle"""

# rellis.yaml: labels and color_map (which it calls bgr; the values are RUGD's red, green, blue).
RELLIS_NAMES = {0: "void", 1: "dirt", 3: "grass", 4: "tree", 5: "pole", 6: "water", 7: "sky", 8: "vehicle", 9: "object",
                10: "asphalt", 12: "building", 15: "log", 17: "person", 18: "fence", 19: "bush", 23: "concrete",
                27: "barrier", 31: "puddle", 33: "mud", 34: "rubble"}  # fmt: skip
RELLIS_COLOURS = {1: (108, 64, 20), 27: (41, 121, 255), 31: (134, 255, 239), 33: (99, 66, 34), 34: (110, 22, 138)}

# GANav's tools/convert_datasets/rugd_relabel6.py: the group of RUGD's classes 1 to 24; void is background.
GANAV_GROUPS = [2, 2, 2, 5, 5, 4, 0, 5, 5, 1, 2, 5, 2, 3, 5, 5, 5, 5, 5, 0, 3, 5, 1, 5]
GANAV_PALETTE = [(0, 0, 0), (0, 128, 0), (255, 255, 0), (255, 128, 0), (255, 0, 0), (0, 0, 128)]

# semantic-kitti-all.yaml: ids, names, and color_map in blue, green, red, of the classes that ours are mapped to
SEMANTIC_KITTI = """\
0 unlabeled 0 0 0
1 outlier 0 0 255
20 other-vehicle 255 0 0
30 person 30 30 255
49 other-ground 75 0 175
50 building 0 200 255
51 fence 50 120 255
70 vegetation 0 175 0
71 trunk 0 60 135
72 terrain 80 240 150
80 pole 150 240 255
99 other-object 255 255 50"""

# The palette of YCOR's labels.png, with the names of its paper
YCOR = """\
0 background 255 255 255
1 smooth trail 178 176 153
2 traversable grass 128 255 0
3 rough trail 156 76 30
4 puddle 255 0 128
5 obstacle 255 0 0
6 non-traversable low vegetation 0 160 0
7 high vegetation 40 80 0
8 sky 1 88 255"""


def hexadecimal(text: str) -> tuple[int, ...]:
    return tuple(int(text[i : i + 2], 16) for i in (1, 3, 5))


def test_names_are_those_of_the_command_line() -> None:
    assert list(LABEL_MAPS) == sorted(NAMES)
    with pytest.raises(
        UnknownNameError, match=r"unknown label map 'rellis3d'; did you mean 'rellis'\? Available: ganav6, "
    ):
        label_map_of("rellis3d")


@pytest.mark.parametrize("name", NAMES)
def test_every_class_is_mapped_and_only_void_to_void(name: str) -> None:
    labels = label_map_of(name)
    assert labels.ids.shape == (len(CLASSES),)
    assert set(labels.ids.tolist()) <= set(labels.classes)
    assert labels.ids[Label.VOID] == 0
    also_void = {label for label in Label if labels.ids[label] == 0} - {Label.VOID}
    own = set() if name in ("goose", "semantickitti") else {Label.ROBOT, Label.PARTICLE, Label.AERIAL_VEHICLE}
    own |= {Label.ANIMAL} if name in ("rellis", "rugd", "goose9", "ganav6") else set()
    unseen = {"ganav6": {Label.SKY}, "semantickitti": {Label.SKY, Label.WATER}}
    assert also_void == own | unseen.get(name, set())


@pytest.mark.parametrize("name", NAMES)
def test_colours_and_names_are_unique(name: str) -> None:
    labels = label_map_of(name)
    twice = 2 if name == "semantickitti" else 0  # on-rails and other-vehicle, outlier and traffic-sign
    assert len({other.rgb for other in labels.classes.values()}) == len(labels.classes) - twice
    assert len({other.name for other in labels.classes.values()}) == len(labels.classes)
    colours = labels.colours()
    for number, other in labels.classes.items():
        assert tuple(colours[number]) == other.rgb
    assert not colours[[i for i in range(256) if i not in labels.classes]].any()


def test_rugd_matches_its_colour_map() -> None:
    labels = label_map_of("rugd")
    rows = {int(row[0]): (row[1], tuple(map(int, row[2:]))) for row in map(str.split, RUGD.splitlines())}
    assert set(labels.ids.tolist()) == set(rows)
    assert all(labels.classes[number] == row for number, row in rows.items())
    assert sorted(labels.classes) == list(range(25))


def test_semantickitti_matches_its_configuration() -> None:
    labels = label_map_of("semantickitti")
    rows = {int(row[0]): (row[1], tuple(map(int, row[:1:-1]))) for row in map(str.split, SEMANTIC_KITTI.splitlines())}
    assert set(labels.ids.tolist()) == set(rows)
    assert all(labels.classes[number] == row for number, row in rows.items())
    assert len(labels.classes) == 26


def test_rellis_matches_its_configuration_and_shares_ids_and_colours_with_rugd() -> None:
    rellis, rugd = label_map_of("rellis").classes, label_map_of("rugd").classes
    assert {number: other.name for number, other in rellis.items()} == RELLIS_NAMES
    assert all(rellis[number].rgb == rgb for number, rgb in RELLIS_COLOURS.items())
    shared = [number for number in rellis if number < 23]
    assert len(shared) == 15
    assert all(rellis[number].rgb == rugd[number].rgb for number in shared)


def test_goose_and_its_challenge_match_their_mapping() -> None:
    goose, challenge = label_map_of("goose"), label_map_of("goose9")
    rows = [line.split(",") for line in GOOSE.splitlines()]
    assert set(goose.ids.tolist()) == {int(row[1]) for row in rows}
    for name, key, _, colour, category, category_name in rows:
        assert goose.classes[int(key)] == (name, hexadecimal(colour))
        assert challenge.classes[int(category)].name == category_name
    category_of = {int(row[1]): int(row[4]) for row in rows}
    assert [category_of[number] for number in goose.ids.tolist()] == challenge.ids.tolist()
    assert (sorted(goose.classes), sorted(challenge.classes)) == (list(range(64)), list(range(9)))


def test_ganav6_matches_the_grouping_of_rugd_by_ganav() -> None:
    groups = np.array([0, *GANAV_GROUPS])
    assert label_map_of("ganav6").ids.tolist() == groups[label_map_of("rugd").ids].tolist()
    assert [other.rgb for _, other in sorted(label_map_of("ganav6").classes.items())] == GANAV_PALETTE


def test_ycor_matches_the_palette_of_its_files() -> None:
    rows = [re.fullmatch(r"(\d) (.*?) (\d+) (\d+) (\d+)", line) for line in YCOR.splitlines()]
    palette = {int(row[1]): (row[2], tuple(map(int, row.groups()[2:]))) for row in rows if row}
    assert label_map_of("ycor").classes == palette
    assert len(palette) == 9


def test_offroad_merges_and_never_splits_classes_of_ycor() -> None:
    coarse, ycor = label_map_of("offroad"), label_map_of("ycor")
    pairs = {
        (ycor.classes[a].name, coarse.classes[b].name)
        for a, b in zip(ycor.ids.tolist(), coarse.ids.tolist(), strict=True)
    }
    assert pairs == {
        ("background", "void"),
        ("traversable grass", "ground"),
        ("rough trail", "trail"),
        ("puddle", "water"),
        ("obstacle", "obstacle"),
        ("non-traversable low vegetation", "vegetation"),
        ("high vegetation", "vegetation"),
        ("sky", "sky"),
    }


def table(heading: str) -> list[list[str]]:
    """Cells of the rows of the table below a heading of the document, without its header."""
    section = DOCUMENT.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line[:1] == "|"]
    return rows[2:]


def test_document_has_the_mapping_of_every_class() -> None:
    rows = table("What each class becomes")
    assert [int(row[0]) for row in rows] == [c.label for c in CLASSES]
    for (number, name, *others, lost), own in zip(rows, CLASSES, strict=True):
        assert (int(number), name) == (own.label, own.name)
        assert lost
        expected = [label_map_of(each) for each in NAMES]
        assert others == [f"{m.ids[own.label]} {m.classes[int(m.ids[own.label])].name}" for m in expected], name


def test_document_has_the_colours() -> None:
    described = {
        (row[0].strip("`"), int(row[1])): (row[2], tuple(map(int, row[3].split()))) for row in table("Colours")
    }
    true = {
        (name, number): label_map_of(name).classes[number]
        for name in NAMES
        for number in sorted(set(label_map_of(name).ids.tolist()))
    }
    assert described == true


def test_document_columns_are_the_ontologies() -> None:
    head = next(line for line in DOCUMENT.splitlines() if line.startswith("| id | class |"))
    assert tuple(re.findall(r"`(\w+)`", head)) == NAMES
