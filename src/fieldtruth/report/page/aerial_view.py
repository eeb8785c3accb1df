# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The place that a run was made in, from above: rebuilt, and taken only if it is the one that the bag tells of."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.model_states import ROBOT, ModelStatesReader
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import Run
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.aerial import Aerial, take_aerial
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

WIDTH: Final = 1800  # [pixel]
_APART: Final = 1e-3  # [m]; an object farther from where the bag has it is another


class Place(NamedTuple):
    """A world and its photograph from above."""

    world: World
    aerial: Aerial


def see_place(run: Run, progress: Progress) -> tuple[Place | None, str]:
    """Rebuild and photograph the place of a run, or say why not.

    Raises:
        BagError: the bag is damaged.
    """
    if run.experiment is None:
        return None, "No experiment.yaml lies beside the bag, so the place cannot be rebuilt."
    try:
        with progress.stage("build the world"):
            world = world_of(run.experiment)
    except FieldtruthError as error:
        return None, f"The place cannot be rebuilt: {error}."
    if not _same(run, world):
        return None, "This version of fieldtruth builds another place from experiment.yaml than the bag tells of."
    with progress.stage("look from above"):
        return Place(world, take_aerial(bake(Scene(world), run.experiment.light), WIDTH)), ""


def _same(run: Run, world: World) -> bool:
    """Whether the objects of the bag, if it names any, have the names and positions of the world's."""
    if run.msgtypes.get(table.MODEL_STATES) != "gazebo_msgs/msg/ModelStates" or table.MODEL_STATES not in run.counts:
        return True
    reader = ModelStatesReader()
    with open_bag(run.bag) as bag:
        poses = reader.poses(next(bag.messages([table.MODEL_STATES])).data)
    if reader.names != (ROBOT, *world.object_names[1:]):
        return False
    return all(
        bool(np.allclose(poses[each.object_id, :3], each.world_from_object[:3, 3], rtol=0.0, atol=_APART))
        for each in world.instances
    )
