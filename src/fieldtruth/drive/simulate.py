# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drive of an experiment's route: physics at 1 kHz, the follower at the IMU's rate, the whole motion recorded.

GNSS receiver and IMU run before the recording begins, so the follower has a fix and a heading at time 0, when the robot
starts to move. The drive ends half a second after the fix that reaches the last waypoint, with the robot at rest.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Fix, Inertial
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.controller import (
    DriveMonitor,
    FollowerState,
    Nearing,
    WaypointFollower,
    antenna_geodetic,
    heading,
    horizontal_from_geodetic,
)
from fieldtruth.drive.physics import STOP, Command, Other, ramp, resting_pose, wheel_speeds
from fieldtruth.drive.soil import SoilContact
from fieldtruth.drive.stems import StemContact, open_world
from fieldtruth.drive.surroundings import EVERY, Following, FollowingState, Surroundings, WheelSoil
from fieldtruth.drive.track import (
    STEP_NS,
    STEP_S,
    Base,
    Commands,
    Motion,
    Track,
    WheelMotion,
    due_step,
    steps_at_rate,
    sweep_steps,
)
from fieldtruth.experiment.config import Experiment, RouteConfig, geodetic_route
from fieldtruth.experiment.rig import Rig
from fieldtruth.kernels.ruts import RutTable
from fieldtruth.kernels.stepping import Record, motor_work
from fieldtruth.world.model import World

STOP_SECONDS: Final = 0.5
"""From the fix that reaches the last waypoint to the end of the drive; braking from 0.3 m/s takes 0.1 s of it."""
SETTLE_SECONDS: Final = 2.0
YIELD_GAP: Final = 1.5
"""Gap [m] to what is in its way at which a robot that yields stands, at most half of ``control.yield_to``."""
YIELD_SECONDS: Final = 120.0
"""Time for which it waits before the drive ends."""
_WAITING: Final = 0.05
"""Share of its speed below which it waits."""
"""The robot rests this long before time 0, so that the contacts are settled at the first reading."""

_MERGED: Final = 1000
"""Blocks of states that become one array for a track: a few large ones are handled faster than many small ones."""

# A state is one row: base_link's position, quaternion, velocity in the world, turn rate in base_link; wheel speeds and
# angles.
_POSITION, _QUATERNION, _VELOCITY, _TURN_RATE = np.split(np.arange(13), [3, 7, 10])
_WHEELS: Final = 13


def drive(world: World, experiment: Experiment, *, progress: Callable[[float], None] | None = None) -> Track:
    """Drive the experiment's route through ``world`` to its last waypoint, or for ``experiment.seconds``.

    Equal input gives equal bytes, and a shorter drive equals the start of a longer one.

    Args:
        world: the world to drive in.
        experiment: supplies route, control, rig and duration.
        progress: called after every simulated second with the simulated time [s].

    Raises:
        DriveError: the robot gets stuck, tips over, touches an obstacle, drives into water or leaves the world.
        RouteError: a random route that was not planned.
    """
    route = geodetic_route(experiment.route, world.origin)
    return Drive(world, experiment, route, progress).finish(experiment.seconds)


class RobotState(NamedTuple):
    """State of a ``SimulatedRobot``, from which it goes on."""

    steps: int
    ramp: tuple[Command, Command, int]
    command: Command
    xy: Array
    work: float
    surroundings: FollowingState
    stems: Any = None


class Checkpoint(NamedTuple):
    """State of a drive, from which ``Drive.restore`` goes on."""

    robot: RobotState
    follower: FollowerState
    nearing: Nearing
    state: Array
    blocks: int
    commands: int
    periods: int
    fixes: int
    end: float
    arrived: bool
    yielding: tuple[bool, int]


class Drive:
    """A drive along waypoints, to which others may be added while it goes on, and which can go back to a checkpoint.

    Periods of control begin at the readings of the IMU: there the follower gives the robot a command, the ramp of the
    wheels' speeds begins anew, and the monitor looks. So the motion does not depend on how a drive is cut into steps.

    Args:
        world: the world to drive in.
        experiment: supplies control, soil and rig.
        route: start and first waypoints.
        progress: called after every simulated second with the simulated time [s].
        others: robots, and colliders of actors, by name that it meets; see ``SimulatedRobot``.
    """

    def __init__(
        self,
        world: World,
        experiment: Experiment,
        route: RouteConfig,
        progress: Callable[[float], None] | None = None,
        others: Mapping[str, Other] | None = None,
    ) -> None:
        self._rig, self._progress, self._origin = experiment.rig, progress, world.origin
        self._yield_to, self._slowed, self._waited = experiment.control.yield_to, False, 0
        self._follower = WaypointFollower(route.waypoints, experiment.control, world.origin)
        stems = StemContact(world, self._rig) if experiment.plants.yielding else None
        world = world if stems is None else open_world(world)
        self._monitor = DriveMonitor(world, self._follower, experiment.control, others or ())
        soil = SoilContact(world, self._rig.wheels, experiment.soil)
        self.robot = SimulatedRobot(world, self._rig, self._monitor, soil, others=others, stems=stems)
        self.end: float = math.inf
        """Physics step at which the drive ends: infinite until it is limited, or the last waypoint is reached."""
        self.endless = False
        """True: a robot that has reached the last waypoint stands there, and the drive does not end by it."""
        self.whole = 1
        """Steps of which the end is a multiple."""
        self._state = self.robot.spawn(
            horizontal_from_geodetic(route.start, world.origin), self._follower.waypoints_xy[0]
        )
        self._blocks, self._commands, self._periods, self._fixes = list[Array](), list[Command](), 0, 0
        self._sweep, self._arrived = sweep_steps(self._rig), False
        self._read_fix(self._state)

    def add(self, waypoint: tuple[float, float]) -> None:
        """Drive on to a waypoint, latitude and longitude [deg], after those that there are."""
        self._follower.add(waypoint)

    def reach_last(self) -> Checkpoint:
        """Drive until the last waypoint is reached.

        Raises:
            DriveError: it cannot be.
        """
        while not self._follower.finished:
            self._advance(math.inf)
        return self.save()

    def save(self) -> Checkpoint:
        """Return what ``restore`` needs to go on from here."""
        return Checkpoint(
            self.robot.save(),
            self._follower.save(),
            self._monitor.progress,
            self._state,
            len(self._blocks),
            len(self._commands),
            self._periods,
            self._fixes,
            self.end,
            self._arrived,
            (self._slowed, self._waited),
        )

    def restore(self, saved: Checkpoint) -> None:
        """Go on from where ``save`` was called, and forget what came after it."""
        self.robot.restore(saved.robot)
        self._follower.restore(saved.follower)
        self._monitor.progress = saved.nearing
        self._state, self._periods, self._fixes = saved.state, saved.periods, saved.fixes
        self.end, self._arrived, (self._slowed, self._waited) = saved.end, saved.arrived, saved.yielding
        del self._blocks[saved.blocks :], self._commands[saved.commands :]

    def limit(self, seconds: float | None) -> None:
        """End the drive after this time [s] at the latest."""
        if seconds is not None:
            self.end = self._whole(max(1, round(seconds / STEP_S)))

    @property
    def ended(self) -> bool:
        """Return whether the end is reached."""
        return self.robot.steps >= self.end

    def finish(self, seconds: float | None = None) -> Track:
        """Drive to the last waypoint and stop there, or for ``seconds``; return the whole track.

        Raises:
            DriveError: as ``drive``.
        """
        self.limit(seconds)
        while self._advance(math.inf):
            pass
        # The reading of the IMU at the end has the command that follows it.
        commands = [*self._commands, self._follow()]
        return _track(self._blocks, int(self.end), np.array(commands[1:]), self._rig)

    def drive_to(self, step: int, command: Command | None = None) -> tuple[Motion, WheelMotion]:
        """Drive to a physics step, at most to where the sweep after the end is complete; return the motion since then.

        Args:
            step: counted from time 0.
            command: of the robot from now on; None for those of the follower.

        Raises:
            DriveError: as ``drive``.
        """
        first = self.robot.steps + 1
        while self._advance(step, command):
            pass
        blocks = self._blocks or [np.empty((0, _WHEELS + 2 * len(self._rig.wheels.names)))]
        motion, wheels = _motion(blocks, first), _wheels(blocks)
        self._blocks, self._commands = [], []
        return motion, wheels

    def go_on(self, step: int) -> Motion:
        """Drive to a physics step, or where the drive ends before it to the end of the sweep; return the motion since.

        ``finish`` returns all of it. Raises as ``drive_to``.
        """
        first, known = self.robot.steps + 1, len(self._blocks)
        while self._advance(min(step, self.end)):
            pass
        while self.ended and self._advance(math.inf):
            pass
        return _motion(self._blocks[known:], first)

    def _whole(self, step: int) -> int:
        return -(-step // self.whole) * self.whole

    def _follow(self) -> Command:
        """Return the follower's command, slower if an actor or another robot is in the way and the robot yields."""
        command, begins = self._follower.command(heading(self._state[_QUATERNION])), self._yield_to
        if begins is None:
            return command
        gap, name = self.robot.surroundings.gap_ahead(self._rig.robot)
        stops = min(YIELD_GAP, begins / 2)
        share = min(max((gap - stops) / (begins - stops), 0.0), 1.0)
        self._slowed, self._waited = share < 1.0, self._waited + 1 if share < _WAITING else 0
        if self._waited > YIELD_SECONDS * self._rig.first(Inertial).rate_hz:
            what = f"waited {YIELD_SECONDS:.0f} s for {name} in its way"
            self._monitor.fail(what, self.robot.seconds, *self._state[_POSITION][:2])
        return Command(share * command.speed, share * command.turn_rate)

    def _advance(self, step: float, command: Command | None = None) -> bool:
        """Drive to the next period of control, at most to a step; return False at that step, or behind the end."""
        robot, began, rate = self.robot, self.robot.steps, self._rig.first(Inertial).rate_hz
        begins = began == due_step(rate, self._periods)
        if begins and self._follower.finished and not self._arrived and not self.endless:
            self._arrived, self.end = True, min(self.end, self._whole(began + round(STOP_SECONDS / STEP_S)))
        last = self.end + self._sweep
        if began >= min(step, last):
            return False
        if begins:
            self._commands.append(self._follow() if command is None else command)
            self._periods += 1
            robot.head_for(self._commands[-1])
        elif command is not None and command != robot.target:
            robot.head_for(command)
        due = due_step(rate, self._periods)
        block = robot.drive(int(min(due, step, last)) - began)
        self._blocks.append(block)
        self._state = block[-1]
        if robot.steps in {due, last}:
            free = command is None and not self._slowed
            self._monitor.check(robot.seconds, *robot.pose, is_following=free)
        while (fix := due_step(self._rig.first(Fix).rate_hz, self._fixes + 1)) <= robot.steps:
            self._read_fix(block[fix - began - 1])
            self._fixes += 1
        if self._progress is not None and int(robot.seconds) > int(began * STEP_S):
            self._progress(robot.seconds)
        return True

    def _read_fix(self, state: Array) -> None:
        mount = self._rig.first(Fix).mount
        latitude, longitude, _ = antenna_geodetic(state[_POSITION], state[_QUATERNION], mount, self._origin)
        self._follower.update_fix(float(latitude), float(longitude))


class Monitor(Protocol):
    """Watches a ``SimulatedRobot``; what it raises ends the drive."""

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        """Look at the pose of base_link, after every call of ``SimulatedRobot.advance``."""

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """Take note of a step of the physics in which the robot touches an object, which it hits at a speed [m/s]."""


class SimulatedRobot:
    """The robot of a rig in the physics simulation of a world.

    ``steps`` counts the physics steps since the recording began; it is negative while the robot settles.

    Args:
        world: the world to drive in.
        rig: supplies the robot.
        monitor: ends a drive that cannot go on.
        soil: what the ground does to the wheels; None for hard ground. Its steps are as long as those of the physics.
        step_ns: step of the physics [ns]. docs/learning.md says what longer ones change.
        others: robots, and colliders of actors, by name that it meets where ``meet`` puts them.
        stems: of plants that it pushes over; None if plants do not resist.
    """

    def __init__(
        self,
        world: World,
        rig: Rig,
        monitor: Monitor,
        soil: WheelSoil | None = None,
        step_ns: int = STEP_NS,
        others: Mapping[str, Other] | None = None,
        stems: StemContact | None = None,
    ) -> None:
        self.steps, self.stems, self._soil = 0, stems, soil
        self._step_ns, self._step_s = step_ns, step_ns / 1e9
        self._every = max(1, EVERY * STEP_NS // step_ns)
        self._following = Following(world, rig, soil, self._step_s, others)
        self._rig = rig
        self._monitor = monitor
        self._command = STOP
        self._ramp = STOP, STOP, 0
        self._xy = np.zeros(2)
        self.work = 0.0
        """Work [J] of the motors since the robot was put down; what a wheel gives back to its motor is lost."""

    @property
    def seconds(self) -> float:
        """Simulated time [s]; 0 while the robot settles."""
        return max(0, self.steps) * self._step_ns / 1e9

    @property
    def command(self) -> Command:
        """Forward speed [m/s] and turn rate [rad/s] that the wheels are driven with, which approaches ``target``."""
        return self._command

    @property
    def target(self) -> Command:
        """Command that the robot was given last."""
        return self._ramp[1]

    @property
    def pose(self) -> tuple[Array, Array]:
        """Position (3,) [m] and quaternion_wxyz (4,) of base_link in the world."""
        qpos = self.surroundings.data.qpos
        return qpos[:3].copy(), qpos[3:7].copy()

    @property
    def world_from_base(self) -> Array:
        """Pose (4, 4) of base_link in the world."""
        qpos, pose, rotation = self.surroundings.data.qpos, np.eye(4), np.empty(9)
        mujoco.mju_quat2Mat(rotation, qpos[3:7])
        pose[:3, :3], pose[:3, 3] = rotation.reshape(3, 3), qpos[:3]
        return pose

    @property
    def velocity(self) -> tuple[Array, Array]:
        """Velocity (3,) [m/s] of base_link's origin in the world, and turn rate (3,) [rad/s] in base_link."""
        qvel = self.surroundings.data.qvel
        return qvel[:3].copy(), qvel[3:6].copy()

    @property
    def twist(self) -> Array:
        """Velocity [m/s] of base_link's origin and turn rate [rad/s], both in the world, (6,)."""
        velocity, turn_rate = self.velocity
        return np.concatenate([velocity, self.world_from_base[:3, :3] @ turn_rate])

    @property
    def wheel_angles(self) -> Array:
        """Angles (wheels,) [rad], in the order of the rig's ``wheels.names``, since the robot was put down."""
        return np.array(self.surroundings.data.qpos[7:])

    @property
    def wheel_speeds(self) -> Array:
        """Angular speeds (wheels,) [rad/s], positive forwards."""
        return np.array(self.surroundings.data.qvel[6:])

    def save(self) -> RobotState:
        """Return what ``restore`` needs to go on from here."""
        stems = None if self.stems is None else self.stems.save()
        return RobotState(self.steps, self._ramp, self._command, self._xy, self.work, self._following.save(), stems)

    def restore(self, saved: RobotState) -> None:
        """Go on from where ``save`` was called."""
        self.steps, self._ramp, self._command, self._xy = saved.steps, saved.ramp, saved.command, saved.xy
        self.work = saved.work
        self._following.restore(saved.surroundings)
        if self.stems is not None:
            self.stems.restore(saved.stems)

    def enter(self, xy: Array) -> None:
        """Have the physics of the part of the world around a point (2,) [m] before the robot is put down."""
        self._following.at(xy)
        self._xy = xy

    def spawn(self, start_xy: Array, ahead_xy: Array, settle_s: float = SETTLE_SECONDS) -> Array:
        """Put the robot at ``start_xy`` [m], facing ``ahead_xy``, let it settle, and return the state at time 0."""
        north, west = ahead_xy - start_xy
        self._xy = start_xy
        here = self._following.at(start_xy)
        here.reset()
        if self.stems is not None:
            self.stems.reset()
        self._command, self._ramp = STOP, (STOP, STOP, 0)
        here.data.qpos[:3], here.data.qpos[3:7] = resting_pose(
            here.bearing, start_xy, math.atan2(west, north), self._rig
        )
        self.steps = -round(settle_s / self._step_s)
        settled: Array = self.advance(STOP, -self.steps)[-1]
        self.work = 0.0
        if self.stems is not None:
            self.stems.work = 0.0
        return settled

    @property
    def surroundings(self) -> Surroundings:
        """Physics of the part of the world around the robot."""
        return self._following.here

    def roll_in(self, ruts: RutTable) -> None:
        """Let the wheels meet ruts from now on."""
        if isinstance(self._soil, SoilContact):
            self._soil.ruts = ruts

    def meet(self, world_from_others: Mapping[str, Array], twists: Mapping[str, Array] | None = None) -> None:
        """Put the other robots where their base_link is, (4, 4) by name: obstacles that stand there from now on.

        A hit of one that moves has the speed at which both come nearer, if ``twists`` are given: as ``twist``, by name.
        """
        self.surroundings.place(world_from_others, twists or {})

    def advance(self, command: Command, count: int) -> Array:
        """Drive ``count`` physics steps towards ``command`` and return the state after each, (count, 13 + 2 wheels)."""
        self.head_for(command)
        states = self.drive(count)
        self._monitor.check(self.seconds, states[-1, _POSITION], states[-1, _QUATERNION])
        return states

    def head_for(self, command: Command) -> None:
        """Begin to accelerate towards a command, from what the wheels are driven with."""
        self._ramp = self._command, command, 0
        self._following.at(self._xy)

    def drive(self, count: int) -> Array:
        """Drive ``count`` physics steps towards the target and return the state after each, (count, 13 + 2 wheels)."""
        here, (begun, target, since) = self.surroundings, self._ramp
        data, first, done = here.data, self.steps, 0
        commands = ramp(begun, target, np.arange(since + 1, since + count + 1) * self._step_s, self._rig.robot)
        driven = wheel_speeds(commands, self._rig.wheels)
        states, efforts = np.empty((count, len(data.qpos) + len(data.qvel))), np.empty(driven.shape)
        record = Record(driven, states, efforts, data.ctrl, data.actuator_force)
        while done < count:
            if self.stems is None and here.is_compiled:
                done, touches = here.make_steps(record, first, self._every, done)
            else:
                done, touches = done + 1, self._make_step(record, done)
            self.steps = first + done
            if touches:
                self._monitor.touch(*here.touched(), self.seconds, states[done - 1, :3])
        if count:
            self.work += motor_work(efforts, states, _WHEELS, self._step_s)
            self._ramp, self._command, self._xy = (begun, target, since + count), Command(*commands[-1]), states[-1, :2]
        return states

    def _make_step(self, record: Record, row: int) -> bool:
        """Make the step of a row of a record from Python; return whether the robot touches more than the ground."""
        here = self.surroundings
        data, turning = here.data, _WHEELS + record.driven.shape[1]
        record.ctrl[:] = record.driven[row]
        if self.steps % self._every == 0:
            here.is_near_ground = here.hull.is_near_ground(data.qpos)
        here.contacts.update()
        if self.stems is not None:
            self.stems(data, self.steps * self._step_s, self._step_s)
        mujoco.mj_step(here.model, data)
        record.torques[row], state = record.actuator_force, record.states[row]
        state[:7], state[7:turning], state[turning:] = data.qpos[:7], data.qvel, data.qpos[7:]
        return here.contacts.read()


def _track(blocks: list[Array], count: int, commands: Array, rig: Rig) -> Track:
    """Return the track of the first ``count`` states; those behind are the sweep of the last scan.

    ``blocks`` are those of all states, (n, 13 + 2 wheels) each, and are emptied; each column is copied once, so that
    hours fit into memory.
    ``commands`` (n, 2) are those at all readings of the IMU, up to the end or later.
    """
    merged = []
    while blocks:
        merged.append(np.concatenate(blocks[:_MERGED]))
        del blocks[:_MERGED]
    swept, turned = _motion(merged, 1), _wheels(merged)
    motion = swept.first(count)
    wheels = WheelMotion(angle=turned.angle[:count], speed=turned.speed[:count])
    return Track(motion=motion, swept=swept, base=_base(motion, wheels, commands, rig))


def _columns(blocks: list[Array], which: NDArray[np.intp]) -> Array:
    return np.concatenate([block[:, which] for block in blocks])


def _motion(blocks: list[Array], first: int) -> Motion:
    """Motion of states, (n, 13 + 2 wheels) each block, from the physics step ``first`` on."""

    def turn_rate(block: Array) -> Array:
        rows = np.repeat(block, 2, axis=0) if len(block) == 1 else block  # one row alone is rounded otherwise
        rates = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(rows[:, _QUATERNION]), rows[:, _TURN_RATE])
        return np.asarray(rates)[: len(block)]

    return Motion(
        stamps_ns=np.arange(first, first + sum(map(len, blocks)), dtype=np.int64) * STEP_NS,
        position=_columns(blocks, _POSITION),
        quaternion_wxyz=_columns(blocks, _QUATERNION),
        linear_velocity=_columns(blocks, _VELOCITY),
        angular_velocity=np.concatenate([turn_rate(block) for block in blocks]),
    )


def _wheels(blocks: list[Array]) -> WheelMotion:
    speeds, angles = np.split(np.arange(_WHEELS, blocks[0].shape[1]), 2)
    return WheelMotion(angle=_columns(blocks, angles), speed=_columns(blocks, speeds))


def _base(motion: Motion, wheels: WheelMotion, commands: Array, rig: Rig) -> Base | None:
    if not rig.reports_wheels:
        return None
    stamps = motion.stamps_ns[steps_at_rate(rig.first(Inertial).rate_hz, int(motion.stamps_ns[-1])) - 1]
    return Base(wheels=wheels, commands=Commands(stamps_ns=stamps, command=commands[: len(stamps)].reshape(-1, 2)))
