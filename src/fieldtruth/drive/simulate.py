# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drive of an experiment's route: physics at 1 kHz, the follower at the IMU's rate, the whole motion recorded.

GNSS receiver and IMU run before the recording begins, so the follower has a fix and a heading at time 0, when the robot
starts to move. The drive ends half a second after the fix that reaches the last waypoint, with the robot at rest.
"""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.frames import rotation_from_quaternion_wxyz
from fieldtruth.drive.controller import WaypointFollower, horizontal_from_geodetic
from fieldtruth.drive.hull import EVERY
from fieldtruth.drive.monitor import DriveMonitor, Nearing
from fieldtruth.drive.physics import STEP_NS, STEP_S, resting_pose
from fieldtruth.drive.readings import sweep_steps
from fieldtruth.drive.robot import STOP, Command, ramp, wheel_speeds
from fieldtruth.drive.soil_contact import SoilContact
from fieldtruth.drive.steps import due_step, steps_at_rate
from fieldtruth.drive.surroundings import Following, FollowingState, Surroundings
from fieldtruth.drive.track import Base, Commands, Motion, Track, WheelMotion
from fieldtruth.drive.wheel_contacts import Soil
from fieldtruth.experiment.config import Experiment, RouteConfig
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.sensors.gnss.sensing import antenna_geodetic
from fieldtruth.sensors.imu.sensing import heading
from fieldtruth.world.model import World

STOP_SECONDS: Final = 0.5
"""From the fix that reaches the last waypoint to the end of the drive; braking from 0.3 m/s takes 0.1 s of it."""
SETTLE_SECONDS: Final = 2.0
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
    return Drive(world, experiment, geodetic_route(experiment.route), progress).finish(experiment.seconds)


class RobotState(NamedTuple):
    """What ``SimulatedRobot`` needs to go on from here."""

    step: int
    command: Command
    xy: Array
    surroundings: FollowingState


class Checkpoint(NamedTuple):
    """A drive at the moment at which the fix that reaches a waypoint has been read."""

    robot: RobotState
    progress: Nearing
    antenna_xy: Array
    state: Array
    blocks: int
    commands: int
    fixes: int


class Drive:
    """A drive along waypoints, to which others may be added while it goes on, and which can go back to a checkpoint.

    Args:
        world: the world to drive in.
        experiment: supplies control, soil and rig.
        route: start and first waypoints.
        progress: called after every simulated second with the simulated time [s].
    """

    def __init__(
        self,
        world: World,
        experiment: Experiment,
        route: RouteConfig,
        progress: Callable[[float], None] | None = None,
    ) -> None:
        self._rig, self._progress = experiment.rig, progress
        self._follower = WaypointFollower(route.waypoints, experiment.control)
        self._monitor = DriveMonitor(world, self._follower, experiment.control)
        soil = SoilContact(world, self._rig.wheels, experiment.soil)
        self._robot = SimulatedRobot(world, self._rig, self._monitor, soil)
        self._state = self._robot.spawn(horizontal_from_geodetic(route.start), self._follower.waypoints_xy[0])
        self._blocks, self._commands, self._fixes = list[Array](), list[Command](), 0
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
            self._advance()
        return Checkpoint(
            self._robot.save(),
            self._monitor.progress,
            self._follower.antenna_xy,
            self._state,
            len(self._blocks),
            len(self._commands),
            self._fixes,
        )

    def go_back(self, checkpoint: Checkpoint, waypoints: int) -> None:
        """Return to a checkpoint at the last of so many ``waypoints``, and forget the others."""
        self._robot.restore(checkpoint.robot)
        self._monitor.progress = checkpoint.progress
        self._follower.go_back(waypoints, checkpoint.antenna_xy)
        self._state, self._fixes = checkpoint.state, checkpoint.fixes
        del self._blocks[checkpoint.blocks :], self._commands[checkpoint.commands :]

    def finish(self, seconds: float | None = None) -> Track:
        """Drive to the last waypoint and stop there, or for ``seconds``; return the whole track.

        Raises:
            DriveError: as ``drive``.
        """
        end = math.inf if seconds is None else max(1, round(seconds / STEP_S))
        sweep, arrived = sweep_steps(self._rig), False
        while True:
            if self._follower.finished and not arrived:
                arrived, end = True, min(end, self._robot.step + round(STOP_SECONDS / STEP_S))
            if self._robot.step >= end + sweep:
                break
            self._advance(end + sweep)
        # The reading of the IMU at the end has the command that follows it.
        commands = [*self._commands, self._command()]
        return _track(self._blocks, int(end), np.array(commands[1:]), self._rig)

    def _command(self) -> Command:
        return self._follower.command(heading(self._state[_QUATERNION]))

    def _advance(self, end: float = math.inf) -> None:
        """Drive to the next reading of the IMU, or to the step ``end``."""
        robot, began = self._robot, self._robot.step
        self._commands.append(self._command())
        next_reading = due_step(self._rig.imu.rate_hz, len(self._commands))
        block = robot.advance(self._commands[-1], int(min(next_reading, end)) - began)
        self._blocks.append(block)
        self._state = block[-1]
        while (fix := due_step(self._rig.gnss.rate_hz, self._fixes + 1)) <= robot.step:
            self._read_fix(block[fix - began - 1])
            self._fixes += 1
        if self._progress is not None and int(robot.seconds) > int(began * STEP_S):
            self._progress(robot.seconds)

    def _read_fix(self, state: Array) -> None:
        latitude, longitude, _ = antenna_geodetic(state[_POSITION], state[_QUATERNION], self._rig.gnss.mount)
        self._follower.update_fix(float(latitude), float(longitude))


class SimulatedRobot:
    """The robot in the physics simulation. ``step`` counts the physics steps since the recording began."""

    def __init__(self, world: World, rig: Rig, monitor: DriveMonitor, soil: Soil | None = None) -> None:
        self.step = 0
        self._following = Following(world, rig, soil)
        self._rig = rig
        self._monitor = monitor
        self._command = STOP
        self._xy = np.zeros(2)

    @property
    def seconds(self) -> float:
        """Simulated time [s]; 0 while the robot settles."""
        return max(0, self.step) * STEP_NS / 1e9

    def save(self) -> RobotState:
        """Return what ``restore`` needs to go on from here."""
        return RobotState(self.step, self._command, self._xy, self._following.save())

    def restore(self, saved: RobotState) -> None:
        """Go on from where ``save`` was called."""
        self.step, self._command, self._xy = saved.step, saved.command, saved.xy
        self._following.restore(saved.surroundings)

    def spawn(self, start_xy: Array, ahead_xy: Array) -> Array:
        """Put the robot at ``start_xy`` [m], facing ``ahead_xy``, let it settle, and return the state at time 0."""
        north, west = ahead_xy - start_xy
        self._xy = start_xy
        here = self.surroundings
        here.data.qpos[:3], here.data.qpos[3:7] = resting_pose(
            here.bearing, start_xy, math.atan2(west, north), self._rig
        )
        self.step = -round(SETTLE_SECONDS / STEP_S)
        settled: Array = self.advance(STOP, -self.step)[-1]
        return settled

    @property
    def surroundings(self) -> Surroundings:
        """Physics of the part of the world around the robot."""
        return self._following.at(self._xy)

    def advance(self, command: Command, count: int) -> Array:
        """Drive ``count`` physics steps towards ``command`` and return the state after each, (count, 13 + 2 wheels)."""
        here = self.surroundings
        model, data, contacts = here.model, here.data, here.contacts
        qpos, qvel, ctrl = data.qpos, data.qvel, data.ctrl
        commands = ramp(self._command, command, np.arange(1, count + 1) * STEP_S, self._rig.robot)
        turning = _WHEELS + len(self._rig.wheels.names)
        states = np.empty((count, len(qpos) + len(qvel)))
        for state, speeds in zip(states, wheel_speeds(commands, self._rig.wheels), strict=True):
            ctrl[:] = speeds
            if self.step % EVERY == 0:
                here.is_near_ground = here.hull.is_near_ground(qpos)
            contacts.update()
            mujoco.mj_step(model, data)
            self.step += 1
            state[:7], state[7:turning], state[turning:] = qpos[:7], qvel, qpos[7:]
            if contacts.read():
                self._monitor.fail(f"touched {here.touched()}", self.seconds, *state[:2])
        self._command, self._xy = Command(*commands[-1]), states[-1, :2]
        self._monitor.check(self.seconds, states[-1, _POSITION], states[-1, _QUATERNION])
        return states


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

    def columns(which: NDArray[np.intp]) -> Array:
        return np.concatenate([block[:, which] for block in merged])

    def turn_rate(block: Array) -> Array:
        rates = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(block[:, _QUATERNION]), block[:, _TURN_RATE])
        return np.asarray(rates)

    swept = Motion(
        stamps_ns=np.arange(1, sum(map(len, merged)) + 1, dtype=np.int64) * STEP_NS,
        position=columns(_POSITION),
        quaternion_wxyz=columns(_QUATERNION),
        linear_velocity=columns(_VELOCITY),
        angular_velocity=np.concatenate([turn_rate(block) for block in merged]),
    )
    motion = swept.first(count)
    speeds, angles = np.split(np.arange(_WHEELS, merged[0].shape[1]), 2)
    wheels = WheelMotion(angle=columns(angles)[:count], speed=columns(speeds)[:count])
    return Track(motion=motion, swept=swept, base=_base(motion, wheels, commands, rig))


def _base(motion: Motion, wheels: WheelMotion, commands: Array, rig: Rig) -> Base | None:
    if not rig.reports_wheels:
        return None
    stamps = motion.stamps_ns[steps_at_rate(rig.imu.rate_hz, int(motion.stamps_ns[-1])) - 1]
    return Base(wheels=wheels, commands=Commands(stamps_ns=stamps, command=commands[: len(stamps)].reshape(-1, 2)))
