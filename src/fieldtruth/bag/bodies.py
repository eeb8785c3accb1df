# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What moves in a run beside its own robot, as bodies for ray tracers, which are where the bag has them."""

from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagFile
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import open_bag
from fieldtruth.core import transforms
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.experiment.config import Experiment
from fieldtruth.sense.moving import KNOT_NS, KnotPoses, MovingBody
from fieldtruth.sense.robots import robot_body, with_robots
from fieldtruth.world.model import World


def with_bodies(world: World, run: BagFile, experiment: Experiment) -> tuple[World, list[MovingBody]]:
    """Return the world of a run with the materials and ids of what moves, and the bodies.

    Raises:
        BagError: the bag is damaged, or lacks them.
    """
    if not experiment.robots:
        return world, []
    world = with_robots(world, experiment.robots)
    return world, other_robots(run, experiment, world)


def other_robots(run: BagFile, experiment: Experiment, world: World) -> list[MovingBody]:
    """Return the robots beside that of a run, where the bag has them at each knot of the motion.

    Raises:
        BagError: the bag is damaged, or lacks them.
    """
    run.require(table.MODEL_STATES)
    rigs = {name: experiment.of_robot(name).rig for name in experiment.robots if name != experiment.namespace}
    states, poses = ModelStatesReader(), {name: KnotPoses() for name in rigs}
    with open_bag(run.bag) as bag:
        for raw in bag.messages([table.MODEL_STATES]):
            for name, known in poses.items():
                if raw.stamp_ns >= len(known) * KNOT_NS:  # the first message is for the knot at time 0, too
                    pose = states.poses(raw.data)[states.row(raw.data, name)]
                    known.add(transforms.pose_from_quaternion_wxyz(pose[:3], wxyz_from_xyzw(pose[3:]))[None])
    return [robot_body(world, name, rig, poses[name]) for name, rig in rigs.items()]
