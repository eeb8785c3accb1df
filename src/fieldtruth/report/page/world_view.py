# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Aerial view of the world of a run, rebuilt from its experiment if that gives the world that the bag describes."""

from typing import Final

import numpy as np

from fieldtruth.bag.geometry import read_objects
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.progress import Progress
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.aerial import Aerial, render_aerial
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

WIDTH: Final = 1800
"""Width of the view [pixel]."""
_TOLERANCE: Final = 1e-3  # [m]


def view_world(run: Run, progress: Progress) -> tuple[Aerial | None, str]:
    """Render the world of a run from above, or explain why that is not possible.

    Raises:
        BagError: the bag is damaged.
    """
    if run.experiment is None:
        return None, "The world cannot be rebuilt, because there is no experiment.yaml beside the bag."
    try:
        with progress.stage("build the world"):
            world = world_of(run.experiment)
    except FieldtruthError as error:
        return None, f"The world cannot be rebuilt: {error}."
    if not _same_objects(run, world):
        return None, "This version of fieldtruth builds another world from experiment.yaml than the one in the bag."
    with progress.stage("render the aerial view"):
        return render_aerial(bake(Scene(world), run.experiment.light), WIDTH), ""


def _same_objects(run: Run, world: World) -> bool:
    """Whether the objects in the bag, if it has any, have the names and positions of the world's."""
    names, poses = read_objects(run)
    return not names or (
        names == (ROBOT, *world.object_names[1:])
        and all(
            np.allclose(poses[each.object_id, :3], each.world_from_object[:3, 3], rtol=0.0, atol=_TOLERANCE)
            for each in world.instances
        )
    )
