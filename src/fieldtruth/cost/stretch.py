# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drives of the simulated robot straight over spots, and what they cost: a metre with each spot in its middle.

The robot is put down behind a spot, comes to rest, and gains its speed on a run-up before the metre that is measured.
A sweep goes on from there over the next spots of a line. A steering follower holds heading and line.
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
_PERIOD_S: Final = _PERIOD * STEP_NS / 1e9
_SETTLE_S: Final = 0.5
_SPARE: Final = 0.25  # [m] of the run-up at full speed
_PATIENCE: Final = 2.0
"""Times the undisturbed time of the way after which the robot is too slow."""
_FALL_S: Final = 0.1
_FALL_SPEED: Final = 0.3
"""A fall: this long [s] no load on the wheels of an axle or side, of a robot that sinks faster than this [m/s]."""
_DAMPING: Final = 0.7
"""Of the follower's return to the line, which its heading's gain and speed give a natural frequency."""
_MOST_TURN: Final = 0.3
"""Greatest angle [rad] between the heading and the one that is held, to return to the line."""
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


Outcome = tuple[Cause, Passage]


class _StopError(Exception):
    """End of a drive, by ``cause``."""

    def __init__(self, cause: Cause) -> None:
        super().__init__(CAUSE_TEXTS[cause])
        self.cause = cause


class _Watch:
    """What a ``SimulatedRobot`` reports to: raises ``_StopError``."""

    def __init__(self, world: World) -> None:
        self._hazards = Hazards(world)

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        """Look whether a pose is fatal."""
        if found := self._hazards.at(position, quaternion_wxyz):
            raise _StopError(_FATAL[found])

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """End the drive by a touch."""
        raise _StopError(Cause.HULL)

    def beyond(self, start: Array, end: Array) -> Cause:
        """Return what is fatal about where a stretch starts or ends (2,) [m]."""
        found = (self._hazards.at(point, np.array([1.0, 0.0, 0.0, 0.0])) for point in (start, end))
        return next((_FATAL[each] for each in found if each), Cause.PASSES)


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

    def over(self, xy: Array, heading_rad: float, speed: float) -> Outcome:
        """Drive over a spot (2,) [m] at a heading and speed [m/s]; return why it does not pass, and the costs."""
        return self.sweep(xy, np.zeros(1), heading_rad, speed)[0]

    def sweep(self, xy: Array, spots: Array, heading_rad: float, speed: float) -> list[Outcome]:
        """Drive over spots of a line, and return the outcome of each.

        One drive goes over all of them as long as it passes. The spots whose stretch holds the point where it fails are
        driven singly, from rest, and the next sweep begins behind them.

        Args:
            xy: a point (2,) [m] of the line.
            spots: distances (n,) [m] of the spots from it along the heading, ascending.
            heading_rad: of the line.
            speed: [m/s].
        """
        found, failed = list[Outcome](), -math.inf
        before = run_up(speed, self._robot) + LENGTH / 2
        while len(found) < len(spots):
            left = spots[len(found) :]
            alone = left[0] - before <= failed
            outcomes, at = self._attempt(xy, left[:1] if alone else left, heading_rad, speed)
            found += outcomes
            failed = max(failed, at)
        return found

    def _attempt(self, xy: Array, spots: Array, heading_rad: float, speed: float) -> tuple[list[Outcome], float]:
        """Return the outcomes of the first spots, one at least, and the point [m] of the line where the drive fails."""
        ahead = np.array([math.cos(heading_rad), math.sin(heading_rad)])
        before = run_up(speed, self._robot) + LENGTH / 2
        begins, ends = spots - before, spots + LENGTH / 2
        causes = [self._watch.beyond(xy + a * ahead, xy + b * ahead) for a, b in zip(begins, ends, strict=True)]
        if causes[0]:
            return [(causes[0], Passage())], -math.inf
        ends = ends[: next((k for k, cause in enumerate(causes) if cause), len(spots))] - begins[0]
        start = xy + begins[0] * ahead
        try:
            self._physics.spawn(start, start + ahead, _SETTLE_S)
        except _StopError as failure:
            return [(failure.cause, Passage())], float(begins[0])
        cause, states, work, along = self._drive(start, heading_rad, speed, float(ends[-1]))
        ends, failed = ends[ends <= along.max()], float(begins[0] + along.max()) if cause else -math.inf
        if len(ends):  # what is behind the robot when it fails has passed
            return self._measured((states[:, :2] - start) @ ahead, states, work, ends), failed
        return [(cause, Passage())], failed

    def _drive(self, start: Array, heading_rad: float, speed: float, way: float) -> tuple[Cause, Array, Array, Array]:
        """Drive a way [m] from a point (2,) [m] on.

        Returns:
            Why it fails; states after all steps; the work [J] before and after all periods; and the way [m] then: all
            of them without the period in which it fails.
        """
        physics, ahead = self._physics, np.array([math.cos(heading_rad), math.sin(heading_rad)])
        states, work, along, falling, cause = [np.empty((0, 13 + 2 * self._wheels))], [0.0], [0.0], 0, Cause.PASSES
        while along[-1] < way:
            position, quaternion = physics.pose
            command = self._command(position[:2] - start, quaternion, heading_rad, speed)
            try:
                block = physics.advance(command, _PERIOD)
            except _StopError as failure:
                cause = failure.cause
                break
            reached = float((block[-1, :2] - start) @ ahead)
            falling = falling + 1 if block[-1, 9] < -_FALL_SPEED and self._hangs() else 0
            if falling * _PERIOD_S >= _FALL_S - 1e-9:
                cause = Cause.DROPS
            elif not math.isfinite(reached):
                cause = Cause.TIPS
            elif reached < way:
                cause = self._late(along, reached, speed)
            if cause:
                break
            states.append(block)
            work.append(physics.work)
            along.append(reached)
        return cause, np.concatenate(states), np.array(work), np.array(along)

    def _hangs(self) -> bool:
        """Return whether no wheel of an axle or side has a load."""
        loads = self._physics.surroundings.contacts.wheels.load
        return bool((loads[self._pairs] <= 0.0).all(axis=1).any())

    def _late(self, along: list[float], reached: float, speed: float) -> Cause:
        """Return why a robot is too slow over its last stretch, if it is; ``along`` are its ways [m] before."""
        stretch = run_up(speed, self._robot) + LENGTH
        periods = math.ceil(_PATIENCE * (stretch / speed + speed / self._robot.max_acceleration) / _PERIOD_S)
        first = len(along) - periods
        if first < 0 or reached >= along[first] + stretch:
            return Cause.PASSES
        is_stuck = reached - along[first + periods // 2] <= STUCK_SHARE * speed * _PERIOD_S * (periods - periods // 2)
        return Cause.STUCK if is_stuck else Cause.SLIPS

    def _command(self, off: Array, quaternion_wxyz: Array, heading_rad: float, speed: float) -> Command:
        """Return the command that holds a line; ``off`` (2,) [m] is the robot's position from a point on it."""
        left = float(off[1] * math.cos(heading_rad) - off[0] * math.sin(heading_rad))
        gain = self._control.heading_gain / (4 * _DAMPING**2 * speed)  # [rad/m]
        held = heading_rad - min(max(gain * left, -_MOST_TURN), _MOST_TURN)
        return Command(speed, turn_rate(held - heading(quaternion_wxyz), self._control))

    def _measured(self, along: Array, states: Array, work: Array, ends: Array) -> list[Outcome]:
        """Return the outcomes of the metres up to ``ends`` (m,) [m]; ``along`` (n,) [m] is the way of each state."""
        step_s, marks = STEP_NS / 1e9, np.stack([ends - LENGTH, ends], axis=-1)
        along = np.maximum.accumulate(along)
        tread = states[:, -self._wheels :].mean(axis=1) * self._robot.wheels.radius
        path = np.cumsum(np.linalg.norm(states[:, 7:10], axis=1)) * step_s
        rising = np.diff(states[:, 9]) / step_s
        up = 1 - 2 * (states[:, 4] ** 2 + states[:, 5] ** 2)
        tilt = np.arccos(np.clip(up, -1.0, 1.0))

        def between(values: Array, at: Array = along) -> Array:
            return np.asarray(np.diff(np.interp(marks, at, values), axis=-1)[:, 0], np.float64)

        slip = 1.0 - between(path) / between(tread)
        time = between(np.asarray(np.arange(1, len(along) + 1) * step_s, np.float64)) / LENGTH
        energy = between(work, np.concatenate([[0.0], along[_PERIOD - 1 :: _PERIOD]])) / LENGTH
        found = list[Outcome]()
        for k, (first, last) in enumerate(np.searchsorted(along, marks).tolist()):
            bumps = rising[first : last - 1]
            peak, rms = float(np.abs(bumps).max()), float(np.sqrt(np.mean(bumps**2)))
            costs = Passage(float(slip[k]), float(tilt[first:last].max()), peak, rms, float(energy[k]), float(time[k]))
            found.append((Cause.PASSES, costs))
        return found
