# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The world of a run, built again from its experiment, and whether the bag's objects stand where it has them."""

from typing import Any, Final

import numpy as np

import fieldtruth
from fieldtruth.bag import topics as table
from fieldtruth.bag.model_states import ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.robot_messages import ModelStatesWriter
from fieldtruth.bag.run import EXPERIMENT, Run
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.experiment.files import VERSION_KEY
from fieldtruth.experiment.yaml_io import parse_mapping
from fieldtruth.render.bake import bake
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import Examiner, Place, Subject, place_of
from fieldtruth.world.build import world_of

PLACE_BOUND: Final = 1e-6
"""[m] and of a quaternion: worlds built on other processors differ in a last digit."""


def rebuilt(run: Run, *, quick: bool, progress: Progress) -> tuple[Place | None, str]:
    """Build the world of a run again; or say why not."""
    if run.experiment is None:
        return None, f"no {EXPERIMENT} beside the bag says what made it"
    if quick:
        return None, "the world is not built for a quick validation"
    version = _written_by(run)
    if version != fieldtruth.__version__:
        return None, f"made by fieldtruth {version}, this is {fieldtruth.__version__}, which may build another world"
    try:
        with progress.stage("build the world"):
            world = world_of(run.experiment)
            scene = Scene(world)
            filmed = any(table.photograph(side) in run.counts for side in table.SIDES)
            baked = bake(scene, run.experiment.light) if filmed else None
    except FieldtruthError as error:
        return None, f"the world cannot be built: {error}"
    return Place(world, scene, baked), ""


class Objects(Examiner):
    """Names and poses in /gazebo/model_states against the world."""

    topics = (table.MODEL_STATES,)

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._names = subject.law("objects have the names of the world's")
        self._poses = subject.law("objects stand where the world has them", PLACE_BOUND, "m or of a quaternion")
        self._seen = False

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message; the others are as the first."""
        if self._seen or self._subject.place is None:
            return
        self._seen = True
        real, told = ModelStatesReader(), ModelStatesReader()
        true = real.poses(ModelStatesWriter(self._subject.place.world).template)
        poses = told.poses(raw.data)
        if self._names.see(real.names == told.names, lambda: f"{place_of(raw)}: {_differing(real.names, told.names)}"):
            away = np.abs(poses[1:] - true[1:]).max(axis=1)
            self._poses.measure_all(away, lambda k: f"{place_of(raw)}: {told.names[1 + k]!r}")

    def results(self) -> list[Check]:
        """World."""
        why = self._subject.no_place or f"no {table.MODEL_STATES}"
        return [
            check_of(
                "world",
                [self._names, self._poses],
                f"{self._poses.seen} objects stand where the world built again has them: {self._poses.margin}",
                why,
            )
        ]


def _differing(real: tuple[str, ...], told: tuple[str, ...]) -> str:
    if len(real) != len(told):
        return f"{len(told)} objects, the world has {len(real)}"
    row = next(k for k, (a, b) in enumerate(zip(real, told, strict=True)) if a != b)
    return f"object {row} is {told[row]!r}, in the world it is {real[row]!r}"


def _written_by(run: Run) -> str:
    path = run.folder / EXPERIMENT
    return str(parse_mapping(path.read_text(encoding="utf-8"), str(path)).get(VERSION_KEY, "of unknown version"))
