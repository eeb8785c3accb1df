# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A drive of the simulated robot straight over a spot, and what it costs: a metre with the spot in its middle.

The robot is put down behind the spot, comes to rest, and gains its speed on a run-up before the metre that is measured.
A steering follower holds the heading, as that of a drive does on the way to a waypoint far ahead.
"""

import math
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.controller import IN_WATER, OUTSIDE, STUCK_SHARE, TIPPED, Hazards, heading, turn_rate
from fieldtruth.drive.physics import Command
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.soil import SoilContact
from fieldtruth.experiment.config import ControlConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import World

LENGTH: Final = 1.0
"""[m] that are measured, along the heading in plan view."""
STEP_NS: Final = 5_000_000
"""Step of the physics [ns]; docs/learning.md says what it changes against 1 ms."""
_PERIOD: Final = 10
"""Steps of the physics from one command to the next."""
_SETTLE_S: Final = 0.5
_SPARE: Final = 0.25  # [m] of the run-up at full speed
_PATIENCE: Final = 2.0
"""Times the undisturbed time of the way after which the robot is too slow."""
_FALL_S: Final = 0.1
_FALL_SPEED: Final = 0.3
"""A fall: this long [s] no load on the wheels of an axle or side, of a robot that sinks faster than this [m/s]."""
_PAIRS: Final = {4: ((0, 1), (2, 3), (0, 2), (1, 3)), 2: ((0, 1),)}
"""Wheels of axles and sides by the number of wheels. On a diagonal the robot stands, as its middle is on it."""


class Cause(IntEnum):
    """Reason why the robot does not pass."""

    PASSES = 0
    OUTSIDE = 1
    WATER = 2
    HULL = 3
    TIPS = 4
    DROPS = 5
    STUCK = 6
    SLIPS = 7


CAUSE_TEXTS: Final = {
    Cause.PASSES: "passes",
    Cause.OUTSIDE: "leaves the world",
    Cause.WATER: "is in water",
    Cause.HULL: "touches an object with hull or mast",
    Cause.TIPS: "tips over",
    Cause.DROPS: "drops",
    Cause.STUCK: "is stuck",
    Cause.SLIPS: "slips",
}
_FATAL: Final = {OUTSIDE: Cause.OUTSIDE, IN_WATER: Cause.WATER, TIPPED: Cause.TIPS}


class Passage(NamedTuple):
    """Costs of the measured metre; NaN where the robot does not pass."""

    slip: float = math.nan  # share of the treads' way by which the robot's is shorter; negative: longer
    tilt: float = math.nan  # [rad], greatest
    peak: float = math.nan  # [m/s^2], greatest vertical acceleration of base_link, up or down
    rms: float = math.nan  # [m/s^2] of the vertical acceleration
    energy: float = math.nan  # [J/m], work of the motors
    time: float = math.nan  # [s/m]


class _Watch:
    """What a ``SimulatedRobot`` reports to: notes the first cause."""

    def __init__(self, world: World) -> None:
        self.hazards, self.cause = Hazards(world), Cause.PASSES

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        """Note what is fatal about a pose."""
        self.note(_FATAL.get(self.hazards.at(position, quaternion_wxyz), Cause.PASSES))

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """Note a touch, which ends any drive."""
        self.note(Cause.HULL)

    def note(self, cause: Cause) -> None:
        """Keep the first cause."""
        self.cause = self.cause or cause


def run_up(speed: float, robot: RobotConfig) -> float:
    """Way [m] from rest to the metre that is measured at a speed [m/s]."""
    return speed**2 / (2 * robot.max_acceleration) + _SPARE


class SpotRobot:
    """The robot of a rig in a world, which is put down anew for every spot.

    Equal spots give equal bits, whatever came before, in a world that is one part (``drive.ground.WHOLE``), in larger
    ones as long as no drive gets farther than 16 m from ``middle`` (2,) [m] along x or y.
    """

    def __init__(self, world: World, rig: Rig, middle: Array) -> None:
        self._robot, self._wheels, self._watch = rig.robot, len(rig.wheels.names), _Watch(world)
        self._pairs = np.array(_PAIRS[self._wheels])
        soil = SoilContact(world, rig.wheels, {}, STEP_NS / 1e9)
        self._physics = SimulatedRobot(world, rig, self._watch, soil, STEP_NS)
        self._physics.enter(middle)
        usual = ControlConfig()
        limit = min(usual.max_turn_rate, rig.robot.max_turn_rate)
        self._control = usual.model_copy(update={"max_turn_rate": limit})

    def over(self, xy: Array, heading_rad: float, speed: float) -> tuple[Cause, Passage]:
        """Drive over a spot (2,) [m] at a heading and speed [m/s]; return why it does not pass, and the costs."""
        watch, ahead = self._watch, np.array([math.cos(heading_rad), math.sin(heading_rad)])
        way = run_up(speed, self._robot)
        start, end = xy - (way + LENGTH / 2) * ahead, xy + LENGTH / 2 * ahead
        watch.cause = Cause.PASSES
        for point in (start, end):
            watch.check(0.0, point, np.array([1.0, 0.0, 0.0, 0.0]))
        if not watch.cause:
            self._physics.spawn(start, start + ahead, _SETTLE_S)
        if watch.cause:
            return watch.cause, Passage()
        states, work = self._drive(start, ahead, heading_rad, speed)
        if watch.cause:
            return watch.cause, Passage()
        return Cause.PASSES, self._measured((states[:, :2] - start) @ ahead, states, work, way)

    def _drive(self, start: Array, ahead: Array, heading_rad: float, speed: float) -> tuple[Array, Array]:
        """Drive until the metre is behind; states after all steps, and the work [J] after each period."""
        physics, watch, way = self._physics, self._watch, run_up(speed, self._robot) + LENGTH
        period_s = _PERIOD * STEP_NS / 1e9
        periods = math.ceil(_PATIENCE * (way / speed + speed / self._robot.max_acceleration) / period_s)
        states, work, along, falling = list[Array](), [0.0], [0.0], 0
        while along[-1] < way and not watch.cause:
            _, quaternion = physics.pose
            turn = turn_rate(math.remainder(heading_rad - heading(quaternion), math.tau), self._control)
            states.append(physics.advance(Command(speed, turn), _PERIOD))
            work.append(physics.work)
            along.append(float((states[-1][-1, :2] - start) @ ahead))
            loads = physics.surroundings.contacts.wheels.load
            hangs = bool((loads[self._pairs] <= 0.0).all(axis=1).any())
            falling = falling + 1 if hangs and states[-1][-1, 9] < -_FALL_SPEED else 0
            if falling * period_s >= _FALL_S - 1e-9:
                watch.note(Cause.DROPS)
            if not math.isfinite(along[-1]):
                watch.note(Cause.TIPS)
            if len(states) == periods and along[-1] < way:
                late = along[-1] - along[periods // 2]
                moves = late > STUCK_SHARE * speed * period_s * (periods - periods // 2)
                watch.note(Cause.SLIPS if moves else Cause.STUCK)
        return np.concatenate(states), np.array(work)

    def _measured(self, along: Array, states: Array, work: Array, way: float) -> Passage:
        """Return the costs between ``way`` and LENGTH farther; ``along`` (n,) [m] is the way of each state."""
        step_s, marks = STEP_NS / 1e9, np.array([way, way + LENGTH])
        along = np.maximum.accumulate(along)
        tread = states[:, -self._wheels :].mean(axis=1) * self._robot.wheels.radius
        path = np.cumsum(np.linalg.norm(states[:, 7:10], axis=1)) * step_s

        def between(values: Array, at: Array = along) -> float:
            return float(np.diff(np.interp(marks, at, values))[0])

        rows = slice(*np.searchsorted(along, marks))
        rising = np.diff(states[rows, 9]) / step_s
        up = 1 - 2 * (states[rows, 4] ** 2 + states[rows, 5] ** 2)
        return Passage(
            slip=1.0 - between(path) / between(tread),
            tilt=float(np.arccos(np.clip(up, -1.0, 1.0)).max()),
            peak=float(np.abs(rising).max()),
            rms=float(np.sqrt(np.mean(rising**2))),
            energy=between(work, np.concatenate([[0.0], along[_PERIOD - 1 :: _PERIOD]])) / LENGTH,
            time=between(np.asarray(np.arange(1, len(along) + 1) * step_s, np.float64)) / LENGTH,
        )
