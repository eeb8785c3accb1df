# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The rebuilt world of a run, and which classes its objects can have."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

import fieldtruth
from fieldtruth.bag import topics as table
from fieldtruth.bag.bodies import moving_in
from fieldtruth.bag.file import EXPERIMENT
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.messages import ModelStatesWriter
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.run import Run
from fieldtruth.core.arrays import Mask
from fieldtruth.core.classes import GROUND_ID, NOT_OF_WORLDS, ClassTable, Label
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.core.yaml_io import parse_mapping
from fieldtruth.experiment.files import VERSION_KEY
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.kind import SensorWorld
from fieldtruth.validation.check import Rule, Spec, Tally
from fieldtruth.validation.context import Checker, Context, at
from fieldtruth.world.build import world_of
from fieldtruth.world.model import ROBOT_ID, WIDE_IDS, World
from fieldtruth.world.objects.config import ObjectConfig

NAMES: Final = Rule("objects have the names of the world's objects")
# Worlds that are built on other processors differ in the last digit.
OBJECT_POSES: Final = Rule("objects have the poses of the world's objects", 1e-6, "m or of a quaternion")
WORLD: Final[Spec] = Spec("world", (NAMES, OBJECT_POSES), "objects", f"no {table.MODEL_STATES}")

CLASS_OF_OBJECT: Final = Rule("each instance id is 0 for sky and robot, or an object that can have this class")
_NO_IDS: Final = "no points or pixels with instance ids"
OBJECT_CLASSES: Final[Spec] = Spec("object classes", (CLASS_OF_OBJECT,), "points and pixels", _NO_IDS)

N_CLASSES: Final = 256
"""Class ids."""
_WORDS: Final[dict[tuple[Label, ...], str]] = {
    (Label.GROUND, Label.TRAIL, Label.TREETOP): "ground",  # woods of the backdrop are treetop
    (Label.GROUND, Label.TRAIL): "litter",
    (Label.GROUND,): "edges edging",
    (Label.TRUNK,): "trunk trunks snag snags stump stumps log logs",
    (Label.TRUNK, Label.TREETOP): "tree trees avenues woods spruce beech pine birch oak",
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
    (Label.BUILDING,): "building buildings",
    (Label.FENCE,): "fence fences",
}
_BY_WORD: Final = {word: labels for labels, words in _WORDS.items() for word in words.split()}


def rebuild(run: Run, *, quick: bool, progress: Progress) -> tuple[SensorWorld | None, str]:
    """Rebuild the world of a run, with its sensors in it; or return None and the reason."""
    experiment, path = run.experiment, run.folder / EXPERIMENT
    if experiment is None:
        return None, f"no {EXPERIMENT} beside the bag"
    if quick:
        return None, "the world is not built with --quick"
    version = parse_mapping(path.read_text(encoding="utf-8"), str(path)).get(VERSION_KEY, "of unknown version")
    if version != fieldtruth.__version__:
        return None, f"made by fieldtruth {version}, and {fieldtruth.__version__} may build another world"
    try:
        with progress.stage("build the world"):
            world, moving = moving_in(world_of(experiment), run, experiment)
            scene = Scene(world, moving)
    except FieldtruthError as error:
        return None, f"the world cannot be built: {error}"
    options: dict[str, Any] = {"scene": scene, "seed": experiment.noise_seed, "moving": moving}
    return SensorWorld(world, run.rig, experiment.light, experiment.weather, **options), ""


class WorldObjects(Checker):
    """Names and poses of the first message with all objects; the others are equal to it."""

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(WORLD)
        self._tally.skipped = context.no_world or WORLD.skipped
        self.tallies = [self._tally]
        self.topics = [table.objects_topic(context.run.counts)]

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if self._context.rebuilt is None or self._tally[NAMES].seen:
            return
        expected, found = ModelStatesReader(), ModelStatesReader()
        true = expected.poses(ModelStatesWriter(self._context.rebuilt.world).template)
        poses, names = found.poses(raw.data), found.names
        pairs = zip(expected.names, names, strict=False)
        other = next((f"{b!r} instead of {a!r}" for a, b in pairs if a != b), "all names agree")
        mismatch = f"{at(raw)}: {len(names)} objects instead of {len(expected.names)}, {other}"
        if self._tally[NAMES].see(expected.names == names, mismatch):
            still = [row for row, name in enumerate(names) if row and name not in self._context.moving]
            residuals = np.abs(poses[still] - true[still]).max(axis=1)
            self._tally[OBJECT_POSES].measure_all(residuals, lambda k: f"{at(raw)}: {names[still[k]]!r}")


class ClassComparison(NamedTuple):
    """Compares classes and objects in a thread."""

    tally: Tally
    allowed: Mask
    """(ids, classes) whether an instance id can have a class; the last row is for all higher ids."""
    names: tuple[str, ...]
    classes: ClassTable

    @property
    def has_wide_ids(self) -> bool:
        """True if the objects of the bag have ids of more than 16 bits."""
        return len(self.names) > WIDE_IDS

    def see(self, instance: NDArray[Any], label: NDArray[Any], where: Callable[[int], str]) -> None:
        """Count points or pixels (n,); classes must exist."""
        known = np.minimum(instance.astype(np.int64), len(self.allowed) - 1)
        found = self.allowed.reshape(-1)[known * N_CLASSES + label]

        def mismatch(k: int) -> str:
            number, name = int(instance[k]), self.classes[label[k]].name
            if self.names and number >= len(self.names):
                return f"{where(k)}: object {number} of {len(self.names)}"
            known = f" ({self.names[number]!r})" if number and self.names else ""
            return f"{where(k)}: object {number}{known} has the class {name!r}"

        self.tally[CLASS_OF_OBJECT].see_all(np.asarray(found), mismatch)


class ObjectClasses(Checker):
    """Classes that an object can have: those of its materials in the rebuilt world, else those its name suggests.

    A lamp post is a lamp post from foot to lamp; a tree is trunk and treetop, the ground is ground and trail. A class
    that the object can have, at the wrong point, is found by retracing only.
    """

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(OBJECT_CLASSES)
        self._tally.note = "by their names" if context.rebuilt is None else "by the materials of the world"
        self.tallies = [self._tally]
        self._names: tuple[str, ...] | None = None
        self._allowed: Mask = np.zeros((0, N_CLASSES), np.bool_)

    def comparison(self) -> "ClassComparison":
        """Return the comparison for a thread, with the objects that are known by now."""
        names, rebuilt = self._context.names, self._context.rebuilt
        if names != self._names:
            experiment = self._context.run.experiment
            files = names_of_objects(experiment.layout) if experiment else ()
            own = allowed_by_name(names, {*files}) if rebuilt is None else allowed_by_world(rebuilt.world)
            allowed = np.full((len(own) + 2, N_CLASSES), not names)
            allowed[: len(own)] = own
            allowed[:, [Label.SKY, *NOT_OF_WORLDS]] = False
            allowed[ROBOT_ID] = np.arange(N_CLASSES) == Label.SKY
            allowed[ROBOT_ID, Label.ROBOT] = self._context.rig.visible
            allowed[ROBOT_ID, Label.PARTICLE] = self._context.has_weather
            for row in (row for row, name in enumerate(names) if name in self._context.moving):
                allowed[row] = np.isin(np.arange(N_CLASSES), self._context.moving[names[row]])
            allowed[:, Label.VOID] = True  # the checks of labels and colours report it
            self._names, self._allowed = names, allowed
        return ClassComparison(self._tally.part(), self._allowed, names, self._context.run.classes)


def names_of_objects(layout: Mapping[str, Any]) -> Iterator[str]:
    """Yield the names, without number, of the objects from files of a layout, which may not be valid."""
    given = layout.get("objects")
    for each in given if isinstance(given, list | tuple) else ():
        with suppress(ValidationError):
            yield ObjectConfig.model_validate(each).title


def allowed_by_world(world: World) -> Mask:
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


def allowed_by_name(names: tuple[str, ...], own: Collection[str] = ()) -> Mask:
    """(objects, classes) whether an object can have a class, by the last known word of its name; else all.

    ``own`` are the names, without number, of a user's objects, which say nothing of their class.
    """
    allowed = np.ones((len(names), N_CLASSES), np.bool_)
    for row, name in enumerate(names):
        if name.rpartition("_")[0] in own:
            continue
        known = [_BY_WORD[word] for word in re.split(r"[_\W\d]+", name.lower()) if word in _BY_WORD]
        if re.search(r"lamp_?post", name.lower()):
            known = [(Label.LAMP_POST,)]
        if known:
            allowed[row, : len(Label)] = False  # an own class may have any name
            allowed[row, list(known[-1])] = True
    return allowed
