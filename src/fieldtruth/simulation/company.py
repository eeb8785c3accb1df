# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Several robots in one world: where each was at the knots of the simulated time, and how the others meet it there.

All robots drive together in blocks from one knot to the next. In a block a robot meets the others where they were when
the block began. Sensors see them as bodies that move, with their poses at all knots (``sense.moving``). After the end
of its drive a robot stays where it was at its last knot.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import Final

import numpy as np

from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.core.progress import Advance
from fieldtruth.core.transforms import pose_from_quaternion_wxyz
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import Drive, SimulatedRobot
from fieldtruth.drive.track import STEP_NS, Motion, Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.moving import KNOT_NS, KnotPoses, MovingBody
from fieldtruth.sense.robots import robot_body, with_robots
from fieldtruth.world.model import World

KNOT_STEPS: Final = KNOT_NS // STEP_NS
"""Steps of the physics from one knot to the next."""


class Company:
    """The robots of an experiment in its world.

    Args:
        experiment: with robots.
        make_world: returns the world, which does not know the robots; called when it is first needed.
    """

    def __init__(self, experiment: Experiment, make_world: Callable[[], World]) -> None:
        self.experiments: Mapping[str, Experiment] = {name: experiment.of_robot(name) for name in experiment.robots}
        """The experiment of each robot."""
        self.poses: Mapping[str, KnotPoses] = {name: KnotPoses() for name in self.experiments}
        """What is known of the motion of each."""
        self._make_world = make_world

    @cached_property
    def world(self) -> World:
        """The world, with the materials and instance ids of the robots."""
        return with_robots(self._make_world(), self.experiments)

    def others(self, name: str) -> dict[str, Rig]:
        """Return the rigs of the robots that a robot meets."""
        return {other: made.rig for other, made in self.experiments.items() if other != name}

    def bodies(self, name: str) -> list[MovingBody]:
        """Return the bodies that the sensors of a robot see."""
        return [robot_body(self.world, other, rig, self.poses[other]) for other, rig in self.others(name).items()]

    def add(self, name: str, motion: Motion) -> None:
        """Add the poses at the knots of a motion of a robot; before the next knot it may have rows of earlier ones."""
        rows = np.flatnonzero(motion.stamps_ns % KNOT_NS == 0)
        rows = rows[motion.stamps_ns[rows] >= len(self.poses[name]) * KNOT_NS]
        self.poses[name].add(pose_from_quaternion_wxyz(motion.position[rows], motion.quaternion_wxyz[rows]))

    def meet(self, name: str, robot: SimulatedRobot, stamp_ns: int) -> None:
        """Put the others of a robot where they are at a knot [ns]."""
        robot.meet({other: self.poses[other]([stamp_ns])[0] for other in self.experiments if other != name})

    def drive(self, advance: Advance | None = None) -> dict[str, Track]:
        """Plan all routes, and drive all robots to the ends of their drives; ``advance`` receives the time [s] driven.

        Raises:
            RouteError, DriveError: a robot, and why it cannot drive its route.
        """
        drives = {name: self._at_start(name) for name in self.experiments}
        left, stamp = list(drives), 0
        while left:
            for name in left:
                self.meet(name, drives[name].robot, stamp)
            stamp += KNOT_NS
            for name in left:
                with errors_of(name):
                    self.add(name, drives[name].go_on(stamp // STEP_NS))
            left = [name for name in left if not drives[name].ended]
            if advance is not None:
                advance(KNOT_NS / 1e9)
        return {name: each.finish() for name, each in drives.items()}

    def _at_start(self, name: str) -> Drive:
        made = self.experiments[name]
        with errors_of(name):
            route = plan_route(self.world, made)
            drive = Drive(self.world, made, route, others=self.others(name))
        drive.whole = KNOT_STEPS
        drive.limit(made.seconds)
        self.poses[name].restart(pose_from_quaternion_wxyz(*drive.robot.pose))
        return drive


@contextmanager
def errors_of(name: str) -> Iterator[None]:
    """Put the name of a robot before what is wrong with its route or drive."""
    try:
        yield
    except (RouteError, DriveError) as error:
        raise type(error)(f"{name}: {error}") from error
