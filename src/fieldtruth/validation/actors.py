# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of where the actors of a run go, and of their joints."""

import math
from typing import Any, Final

import numpy as np

from fieldtruth.actors.cast import figures_of
from fieldtruth.actors.figure import Figure
from fieldtruth.bag import topics as table
from fieldtruth.bag.file import BagError
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import wxyz_from_xyzw
from fieldtruth.drive.controller import heading
from fieldtruth.drive.traversability import Outline, distance_to, gap_to, obstacle_outlines
from fieldtruth.experiment.actor_config import actor_names
from fieldtruth.sense.moving import KNOT_NS
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at

GROUND: Final = Rule("actors that do not fly are on the ground", 0.35, "m")
SOLID: Final = Rule("actors are outside of solid objects", 0.02, "m deep")
ROBOT: Final = Rule("actors are beside the robot", 0.02, "m deep")
SPEEDS: Final = Rule("joints move by speed times time step", 1e-6, "rad or m")
ACTORS: Final[Spec] = Spec("actors", (GROUND, SOLID, ROBOT, SPEEDS), "poses", "the world is not built")

_LOW: Final = 1.0
"""Height [m] up to which objects are in the way of actors."""
_LOOK_NS: Final = 10 * KNOT_NS
"""Time [ns] between two looks at what is around actors."""
_CIRCLE: Final = np.stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)], axis=1)


class ActorMotion(Checker):
    """Checks the motion of actors in /gazebo/model_states, and that nothing solid is in their way."""

    topics = (table.MODEL_STATES, table.ACTOR_JOINTS)

    def __init__(self, context: Context) -> None:
        self._context, self._reader = context, ModelStatesReader()
        self._tally = context.tally(ACTORS)
        self.tallies = [self._tally]
        self._names = context.actors
        self._joints: tuple[int, Array] | None = None
        self._figures: dict[str, Figure] = {}
        given = {} if context.experiment is None else context.experiment.actors
        self._sitting = {name for name, key in actor_names(given) if given[key].chosen_behaviour == "sit"}
        self._outlines, self._circles = list[Outline](), np.zeros((0, 3))
        if self._names and context.rebuilt is not None and context.experiment is not None:
            self._figures = figures_of(context.experiment)
            self._outlines = obstacle_outlines(context.rebuilt.world, _LOW)
            self._circles = np.array([outline.circle for outline in self._outlines]).reshape(-1, 3)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message."""
        if not self._names:
            return
        if raw.topic == table.ACTOR_JOINTS:
            self._see_joints(raw, message)
            return
        if raw.stamp_ns % _LOOK_NS == 0 and self._figures:
            poses = self._reader.poses(raw.data)
            rows = [self._reader.row(raw.data, name) for name in self._names]
            self._check_place(raw, poses[rows], poses[self._reader.row(raw.data)])

    def _check_place(self, raw: RawMessage, poses: Array, robot: Array) -> None:
        """Check that actors are on the ground, and inside of nothing, at a knot."""
        assert self._context.rebuilt is not None
        world, rig = self._context.rebuilt.world, self._context.rig
        pose = np.array([[robot[0], robot[1], heading(wxyz_from_xyzw(robot[3:7]))]])
        for k, name in enumerate(self._names):
            figure = self._figures[name]
            if figure.flies:
                continue
            middle = poses[k : k + 1, :2]
            ground = world.terrain.field.height_at(middle[:, 0], middle[:, 1])
            where = f"{at(raw)}: {name!r}"
            self._tally[GROUND].measure(float(poses[k, 2] - ground[0]), where)
            if name in self._sitting:  # on a bench
                continue
            near = self._near(middle[0], figure.radius)
            gap = min((float(distance_to(outline, middle)[0]) for outline in near), default=math.inf)
            self._tally[SOLID].measure(max(0.0, figure.radius - gap), where)
            circle = Outline(name, middle + figure.radius * _CIRCLE)
            self._tally[ROBOT].measure(max(0.0, -float(gap_to(circle, pose, rig.robot)[0])), where)

    def _near(self, middle: Array, radius: float) -> list[Outline]:
        """Return the outlines whose circles touch that of an actor."""
        near = np.hypot(*(self._circles[:, :2] - middle).T) < self._circles[:, 2] + radius
        return [self._outlines[k] for k in np.flatnonzero(near)]

    def _see_joints(self, raw: RawMessage, message: Any) -> None:
        values, speeds = np.asarray(message.position), np.asarray(message.velocity)
        if len(speeds) != len(values) or (self._joints is not None and len(self._joints[1]) != len(values)):
            raise BagError(f"{len(values)} joints with {len(speeds)} speeds, other than in the message before")
        if self._joints is not None and raw.stamp_ns - self._joints[0] == KNOT_NS:
            error = np.abs(values - self._joints[1] - KNOT_NS / 1e9 * speeds)
            self._tally[SPEEDS].measure_all(error, lambda k: f"{at(raw)}: {message.name[k]!r}")
        self._joints = raw.stamp_ns, values
