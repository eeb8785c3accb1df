# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drive of an experiment's route: physics at 1 kHz, the follower at the IMU's rate, the whole motion recorded.

GNSS receiver and IMU run before the recording begins, so the follower has a fix and a heading at time 0, when the robot
starts to move. The drive ends half a second after the fix that reaches the last waypoint, with the robot at rest.
"""

import math
from collections.abc import Callable
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.frames import rotation_from_quaternion_wxyz
from fieldtruth.drive import sensors
from fieldtruth.drive.controller import WaypointFollower, horizontal_from_geodetic
from fieldtruth.drive.hull import EVERY
from fieldtruth.drive.husky import CHASSIS_BIT, STOP, Command, ramp, wheel_speeds
from fieldtruth.drive.monitor import DriveMonitor
from fieldtruth.drive.odometry import read_odometry
from fieldtruth.drive.physics import STEP_NS, STEP_S, resting_pose
from fieldtruth.drive.soil_contact import SoilContact
from fieldtruth.drive.surroundings import Following, Surroundings
from fieldtruth.drive.track import Base, Commands, Motion, Track, WheelMotion
from fieldtruth.drive.wheel_contacts import Soil
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.world.model import World

STOP_SECONDS: Final = 0.5
"""From the fix that reaches the last waypoint to the end of the drive; braking from 0.3 m/s takes 0.1 s of it."""
SETTLE_SECONDS: Final = 2.0
"""The robot rests this long before time 0, so that the contacts are settled at the first reading."""

_MERGED: Final = 1000
"""Blocks of states that become one array: a few large ones are handled faster than many small ones."""

# A state is one row: base_link's position, quaternion, velocity in the world, turn rate in base_link; wheel speeds and
# angles.
_POSITION, _QUATERNION, _VELOCITY, _TURN_RATE, _SPEEDS, _ANGLES = np.split(np.arange(21), [3, 7, 10, 13, 17])


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
    rig, route = experiment.rig, geodetic_route(experiment.route)
    follower = WaypointFollower(route.waypoints, experiment.control)
    monitor = DriveMonitor(world, follower, experiment.control)
    robot = SimulatedHusky(world, rig, monitor, SoilContact(world, rig.wheels, experiment.soil))
    state = robot.spawn(horizontal_from_geodetic(route.start), follower.waypoints_xy[0])
    _read_fix(follower, state, rig)

    end = math.inf if experiment.seconds is None else max(1, round(experiment.seconds / STEP_S))
    imu_steps, gnss_steps = sensors.due_steps(rig.imu.rate_hz), sensors.due_steps(rig.gnss.rate_hz)
    next_fix, sweep = next(gnss_steps), sensors.sweep_steps(rig.lidar)
    arrived = False
    blocks, recent = list[Array](), list[Array]()
    commands: list[Command] = []
    while True:
        if follower.finished and not arrived:
            arrived, end = True, min(end, robot.step + round(STOP_SECONDS / STEP_S))
        commands.append(follower.command(sensors.heading(state[_QUATERNION])))
        if robot.step >= end + sweep:
            break
        began = robot.step
        block = robot.advance(commands[-1], int(min(next(imu_steps), end + sweep)) - began)
        recent.append(block)
        if len(recent) == _MERGED:
            blocks, recent = [*blocks, np.concatenate(recent)], []
        state = block[-1]
        while next_fix <= robot.step:
            _read_fix(follower, block[next_fix - began - 1], rig)
            next_fix = next(gnss_steps)
        if progress is not None and int(robot.seconds) > int(began * STEP_S):
            progress(robot.seconds)
    return _track([*blocks, *recent], int(end), np.array(commands[1:]), rig)


class SimulatedHusky:
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
        """Drive ``count`` physics steps towards ``command`` and return the state after each, (count, 21)."""
        here = self.surroundings
        model, data, contacts = here.model, here.data, here.contacts
        qpos, qvel, ctrl = data.qpos, data.qvel, data.ctrl
        commands = ramp(self._command, command, np.arange(1, count + 1) * STEP_S)
        states = np.empty((count, 21))
        for state, speeds in zip(states, wheel_speeds(commands, self._rig.wheels), strict=True):
            ctrl[:] = speeds
            if self.step % EVERY == 0:
                near = here.hull.is_near_ground(qpos)
                model.geom_conaffinity[here.ground] = CHASSIS_BIT if near else 0
            contacts.update()
            mujoco.mj_step(model, data)
            self.step += 1
            state[:7], state[7:17], state[17:] = qpos[:7], qvel, qpos[7:]
            if contacts.read():
                self._monitor.fail(f"touched {here.touched()}", self.seconds, *state[:2])
        self._command, self._xy = Command(*commands[-1]), states[-1, :2]
        self._monitor.check(self.seconds, states[-1, _POSITION], states[-1, _QUATERNION])
        return states


def _read_fix(follower: WaypointFollower, state: Array, rig: Rig) -> None:
    latitude, longitude, _ = sensors.antenna_geodetic(state[_POSITION], state[_QUATERNION], rig.gnss.mount)
    follower.update_fix(float(latitude), float(longitude))


def _track(blocks: list[Array], count: int, commands: Array, rig: Rig) -> Track:
    """Return the track of the first ``count`` states; those behind are the sweep of the last scan.

    ``blocks`` are those of all states, (n, 21) each; each column is copied once, so that hours fit into memory.
    ``commands`` (n, 2) are those at all readings of the IMU, up to the end or later.
    """

    def columns(which: NDArray[np.intp]) -> Array:
        return np.concatenate([block[:, which] for block in blocks])

    def turn_rate(block: Array) -> Array:
        rates = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(block[:, _QUATERNION]), block[:, _TURN_RATE])
        return np.asarray(rates)

    swept = Motion(
        stamps_ns=np.arange(1, sum(map(len, blocks)) + 1, dtype=np.int64) * STEP_NS,
        position=columns(_POSITION),
        quaternion_wxyz=columns(_QUATERNION),
        linear_velocity=columns(_VELOCITY),
        angular_velocity=np.concatenate([turn_rate(block) for block in blocks]),
    )
    motion = swept.first(count)
    imu, wheels = (
        sensors.read_imu(motion, rig.imu),
        WheelMotion(angle=columns(_ANGLES)[:count], speed=columns(_SPEEDS)[:count]),
    )
    base = Base(
        wheels=wheels,
        tachometers=sensors.read_tachometers(motion, wheels.speed, rig.tachometers),
        odometry=read_odometry(motion.stamps_ns, wheels, rig),
        commands=Commands(stamps_ns=imu.stamps_ns, command=commands[: len(imu.stamps_ns)].reshape(-1, 2)),
    )
    gnss = sensors.read_gnss(motion, rig.gnss)
    return Track(motion=motion, swept=swept, imu=imu, gnss=gnss, base=base if rig.tachometers.enabled else None)
