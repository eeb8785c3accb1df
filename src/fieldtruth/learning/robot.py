# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot of an episode: driven for a step of control, with what happened to it in that time."""

import math
from collections.abc import Collection, Sequence
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.controller import Hazards
from fieldtruth.drive.physics import Command
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.soil import SoilContact
from fieldtruth.experiment.rig import Rig
from fieldtruth.learning.task_world import NOWHERE
from fieldtruth.world.model import World

HIT: Final = "hit an obstacle"
STUCK: Final = "stuck"
HIT_ROBOT: Final = "hit another robot"
HIT_ENERGY: Final = 5.0
"""[J] of a hit that ends an episode: 0.45 m/s head-on for a robot of 50 kg."""
STUCK_SECONDS: Final = 10.0
STUCK_METRES: Final = 0.3
"""A robot that has moved no farther in ``STUCK_SECONDS`` is stuck, whatever its commands were."""
_APART_S: Final = 0.5  # between two touches of an object, without one, for them to count as two
_CREEP: Final = 0.05  # [m/s] of the tread below which there is no slip


class Now(NamedTuple):
    """State of the robot after a step of control."""

    world_from_base: Array  # (4, 4)
    heading: float  # [rad]
    roll: float  # [rad]
    pitch: float  # [rad], positive with the nose down
    velocity: Array  # (3,) [m/s] of base_link's origin, in base_link
    turn_rate: float  # [rad/s]
    wheel_speeds: Array  # (n,) [rad/s]
    slip: float  # -1 to 1: share of the treads' mean speed by which the robot is slower

    @property
    def xy(self) -> Array:
        """Position (2,) [m]."""
        return self.world_from_base[:2, 3]

    @property
    def tilt_deg(self) -> float:
        """Angle [deg] between the robot's vertical axis and the world's."""
        return math.degrees(math.acos(min(max(float(self.world_from_base[2, 2]), -1.0), 1.0)))


class Happened(NamedTuple):
    """What a step of control has done: work [J] of the motors, energy [J] of hits, new touches, and why it ended."""

    work: float
    hit: float
    touches: int
    cause: str


class _Watch:
    """What a ``SimulatedRobot`` reports to."""

    def __init__(self, world: World, mass: float, others: Collection[str]) -> None:
        self._hazards, self._mass, self._others = Hazards(world), mass, others
        self.begin()

    def begin(self) -> None:
        """Forget what was."""
        self.cause, self.hit, self.touches = "", 0.0, 0
        self._touched_s = -math.inf

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        """Note what is fatal about a pose."""
        self.cause = self.cause or self._hazards.at(position, quaternion_wxyz)

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """Note a touch; the energy of a hit is that of the whole robot at the speed across the surface."""
        energy = 0.5 * self._mass * speed**2
        self.hit = max(self.hit, energy)
        self.touches += time_s - self._touched_s > _APART_S
        self._touched_s = time_s
        if energy > HIT_ENERGY:
            self.cause = self.cause or (HIT_ROBOT if name in self._others else HIT)


class EpisodeRobot:
    """The robot of a rig in a world, which is put down anew for every episode.

    Args:
        world: to drive in.
        rig: supplies the robot.
        step_ns: step of the physics [ns].
        steps: of the physics in a step of control.
        others: names of equal robots that it meets, where ``meet`` of its ``physics`` puts them.
    """

    def __init__(self, world: World, rig: Rig, step_ns: int, steps: int, others: Sequence[str] = ()) -> None:
        self._rig, self._steps, self._nowhere = rig, steps, dict.fromkeys(others, NOWHERE)
        self._watch = _Watch(world, rig.robot.mass, others)
        soil = SoilContact(world, rig.wheels, {}, step_ns / 1e9)
        self.physics = SimulatedRobot(world, rig, self._watch, soil, step_ns, dict.fromkeys(others, rig))
        self.now: Now

    def put_down(self, xy: Array, heading: float) -> str:
        """Let the robot come to rest at a point (2,) [m]; return why it cannot drive from there, empty if it can."""
        self._watch.begin()
        if self._nowhere:
            self.physics.meet(self._nowhere)
        self.physics.spawn(xy, xy + np.array([math.cos(heading), math.sin(heading)]))
        cause = self._watch.cause
        self._watch.begin()
        self._at, self._moved_s = np.array(xy, np.float64), 0.0
        self.now = self._read()
        return cause

    @property
    def seconds(self) -> float:
        """Simulated time [s] of the episode."""
        return self.physics.seconds

    def drive(self, command: Command) -> Happened:
        """Drive towards a command for a step of control."""
        self.head_for(command)
        self.physics.drive(self._steps)
        return self.happened()

    def head_for(self, command: Command) -> None:
        """Begin a step of control, which ``drive`` of its ``physics`` makes in parts."""
        self._watch.hit, self._before = 0.0, (self._watch.touches, self.physics.work)
        self.physics.head_for(command)

    def happened(self) -> Happened:
        """End a step of control."""
        watch, (touches, work) = self._watch, self._before
        watch.check(self.seconds, *self.physics.pose)
        now = self._read()
        if np.isfinite(now.world_from_base).all():
            self.now = now
        if math.dist(self.now.xy, self._at) > STUCK_METRES:
            self._at, self._moved_s = self.now.xy.copy(), self.seconds
        elif self.seconds - self._moved_s >= STUCK_SECONDS - 1e-9:
            watch.cause = watch.cause or STUCK
        return Happened(self.physics.work - work, watch.hit, watch.touches - touches, watch.cause)

    def _read(self) -> Now:
        pose, wheels = self.physics.world_from_base, self.physics.wheel_speeds
        velocity, turn_rate = self.physics.velocity
        own = pose[:3, :3].T @ velocity
        tread = float(wheels.mean()) * self._rig.wheels.radius
        slip = 1.0 - float(own[0]) / tread if abs(tread) > _CREEP else 0.0
        return Now(
            world_from_base=pose,
            heading=math.atan2(pose[1, 0], pose[0, 0]),
            roll=math.atan2(pose[2, 1], pose[2, 2]),
            pitch=math.asin(min(max(-float(pose[2, 0]), -1.0), 1.0)),
            velocity=own,
            turn_rate=float(turn_rate[2]),
            wheel_speeds=wheels,
            slip=min(max(slip, -1.0), 1.0),
        )
