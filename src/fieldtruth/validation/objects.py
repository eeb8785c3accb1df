# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Which classes an object can have: those of its materials where the world is at hand, else those its name tells.

A lamp post is lamp post from foot to lamp; a tree is trunk and treetop, the ground is ground and trail. So a class that
an object cannot have is found by this law alone. One that it can have, at the wrong place, is found by a retrace only.
"""

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.classes import CLASSES, Label
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import Subject
from fieldtruth.world.model import GROUND_ID, World

N_CLASSES: Final = len(CLASSES)
_TREE: Final = (Label.TRUNK, Label.TREETOP)

_WORDS: Final[dict[tuple[Label, ...], str]] = {
    (Label.GROUND, Label.TRAIL, Label.TREETOP): "ground",  # woods on far land are treetop
    (Label.GROUND,): "edges edging",
    (Label.TRUNK,): "trunk trunks snag snags stump stumps log logs",
    _TREE: "tree trees avenues woods spruce beech pine birch oak",
    (Label.BUSH,): "bush bushes shrub shrubs juniper gorse heather",
    (Label.ROCK,): "rock rocks boulder boulders slab slabs crag crags stone stones pebbles",
    (Label.HIGH_GRASS,): "grass grasses fern ferns nettle nettles herb herbs islands daisy yarrow buttercup flower",
    (Label.LAMP_POST,): "lamp",
    (Label.TRASH_BIN,): "bin bins",
    (Label.TABLE,): "table tables",
    (Label.BENCH,): "bench benches",
    (Label.POST,): "pole poles post posts",
    (Label.CABLE,): "cable cables wire wires",
    (Label.WATER,): "lake water pond",
}
_BY_WORD: Final = {word: labels for labels, words in _WORDS.items() for word in words.split()}


class ObjectLaw:
    """Counts pairs of object and class, and holds them against what is allowed."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._counts = np.zeros((1 << 16, N_CLASSES), np.int64)
        self._first: dict[tuple[int, int], str] = {}
        self._range = subject.law("object ids are rows of /gazebo/model_states")
        self._class = subject.law("an object has the classes of its materials")
        self._sky = subject.law("object 0 is the sky, and the sky is object 0")

    def add(self, counts: NDArray[np.int64], first: dict[tuple[int, int], str]) -> None:
        """Add pairs: counts (objects, classes), and where each pair was met first."""
        self._counts[: len(counts)] += counts
        for pair, where in first.items():
            self._first.setdefault(pair, where)

    def result(self) -> Check:
        """Objects."""
        names, world = self._subject.names, None if self._subject.place is None else self._subject.place.world
        allowed, known = (allowed_by_name(names), None) if world is None else (allowed_by_world(world), True)
        judged = 0
        for (thing, label), where in sorted(self._first.items()):
            count, name = int(self._counts[thing, label]), _class_name(label)
            if (thing == 0) != (label == Label.SKY):
                self._sky.count(count, count, f"{where}: object {thing} is {name}")
                continue
            self._sky.count(count, 0, "")
            if names and not self._range.see(thing < len(names), f"{where}: object {thing} of {len(names)}"):
                continue
            if thing == 0 or thing >= len(allowed) or not (known or allowed[thing].any()):
                continue
            judged += count
            wrong = 0 if allowed[thing, label] else count
            what = names[thing] if thing < len(names) else str(thing)
            self._class.count(count, wrong, f"{where}: {what!r} is {name}")
        by = "by their names" if world is None else "by the world's materials"
        seen = len({thing for thing, _ in self._first})
        return check_of(
            "objects",
            [self._sky, self._range, self._class],
            f"{judged:,} points and pixels of {seen} objects have classes that these can have, {by}",
            "no points or pixels with object ids",
        )


def allowed_by_world(world: World) -> NDArray[np.bool_]:
    """(objects, classes) whether an object of a world can have a class."""
    labels = {name: int(material.label) for name, material in world.materials.items()}
    of_mesh = {name: [labels[m] for m in mesh.materials] for name, mesh in world.meshes.items()}
    allowed = np.zeros((len(world.object_names), N_CLASSES), np.bool_)
    allowed[GROUND_ID, [Label.GROUND, Label.TRAIL]] = True
    if world.backdrop is not None:
        allowed[GROUND_ID, [labels[m] for m in world.backdrop.materials]] = True
    for instance in world.instances:
        allowed[instance.object_id, of_mesh[instance.mesh]] = True
    for swarm in world.swarms:
        for mesh in swarm.meshes:
            allowed[swarm.object_id, of_mesh[mesh]] = True
    return allowed


def allowed_by_name(names: tuple[str, ...]) -> NDArray[np.bool_]:
    """(objects, classes) whether an object can have a class, by the last word of its name that tells one; else none."""
    allowed = np.zeros((len(names), N_CLASSES), np.bool_)
    for row, name in enumerate(names):
        told = [_BY_WORD[word] for word in re.split(r"[_\W\d]+", name.lower()) if word in _BY_WORD]
        if re.search(r"lamp_?post", name.lower()):
            told = [(Label.LAMP_POST,)]
        if told and row > 0:
            allowed[row, list(told[-1])] = True
    return allowed


def _class_name(label: int) -> str:
    return f"of class {CLASSES[label].name!r}" if label < N_CLASSES else f"of class {label}"
