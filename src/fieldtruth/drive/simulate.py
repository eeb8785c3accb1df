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

from fieldtruth.core.arrays import Array
from fieldtruth.core.frames import rotation_from_quaternion_wxyz
from fieldtruth.drive import sensors
from fieldtruth.drive.bearing import bearing_field
from fieldtruth.drive.controller import WaypointFollower, horizontal_from_geodetic
from fieldtruth.drive.hull import EVERY, Hull
from fieldtruth.drive.husky import CHASSIS_BIT, STOP, Command, ramp, wheel_speeds
from fieldtruth.drive.monitor import DriveMonitor
from fieldtruth.drive.odometry import read_odometry
from fieldtruth.drive.physics import STEP_NS, STEP_S, build_physics, resting_pose
from fieldtruth.drive.soil_contact import SoilContact
from fieldtruth.drive.track import Base, Commands, Motion, Track, WheelMotion
from fieldtruth.drive.wheel_contacts import Soil, WheelContacts
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.world.model import World

STOP_SECONDS: Final = 0.5
"""From the fix that reaches the last waypoint to the end of the drive; braking from 0.3 m/s takes 0.1 s of it."""
SETTLE_SECONDS: Final = 2.0
"""The robot rests this long before time 0, so that the contacts are settled at the first reading."""

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
    state = robot.spawn(world, horizontal_from_geodetic(route.start), follower.waypoints_xy[0])
    _read_fix(follower, state, rig)

    end = math.inf if experiment.seconds is None else max(1, round(experiment.seconds / STEP_S))
    imu_steps, gnss_steps = sensors.due_steps(rig.imu.rate_hz), sensors.due_steps(rig.gnss.rate_hz)
    next_fix, sweep = next(gnss_steps), sensors.sweep_steps(rig.lidar)
    arrived = False
    blocks: list[Array] = []
    commands: list[Command] = []
    while True:
        if follower.finished and not arrived:
            arrived, end = True, min(end, robot.step + round(STOP_SECONDS / STEP_S))
        commands.append(follower.command(sensors.heading(state[_QUATERNION])))
        if robot.step >= end + sweep:
            break
        began = robot.step
        block = robot.advance(commands[-1], int(min(next(imu_steps), end + sweep)) - began)
        blocks.append(block)
        state = block[-1]
        while next_fix <= robot.step:
            _read_fix(follower, block[next_fix - began - 1], rig)
            next_fix = next(gnss_steps)
        if progress is not None and int(robot.seconds) > int(began * STEP_S):
            progress(robot.seconds)
    return _track(np.concatenate(blocks), int(end), np.array(commands[1:]), rig)


class SimulatedHusky:
    """The robot in the physics simulation. ``step`` counts the physics steps since the recording began."""

    def __init__(self, world: World, rig: Rig, monitor: DriveMonitor, soil: Soil | None = None) -> None:
        self.step = 0
        self._model, self._obstacles = build_physics(world, rig)
        self._data = mujoco.MjData(self._model)
        self._contacts = WheelContacts(self._model, self._data, bearing_field(world), rig, soil)
        self._ground, self._hull = self._model.geom("ground").id, Hull(bearing_field(world), rig)
        self._wheels = rig.wheels
        self._rig = rig
        self._monitor = monitor
        self._command = STOP

    @property
    def seconds(self) -> float:
        """Simulated time [s]; 0 while the robot settles."""
        return max(0, self.step) * STEP_NS / 1e9

    def spawn(self, world: World, start_xy: Array, ahead_xy: Array) -> Array:
        """Put the robot at ``start_xy`` [m], facing ``ahead_xy``, let it settle, and return the state at time 0."""
        north, west = ahead_xy - start_xy
        pose = resting_pose(bearing_field(world), start_xy, math.atan2(west, north), self._rig)
        self._data.qpos[:3], self._data.qpos[3:7] = pose
        self.step = -round(SETTLE_SECONDS / STEP_S)
        settled: Array = self.advance(STOP, -self.step)[-1]
        return settled

    def advance(self, command: Command, count: int) -> Array:
        """Drive ``count`` physics steps towards ``command`` and return the state after each, (count, 21)."""
        model, data = self._model, self._data
        qpos, qvel, ctrl = data.qpos, data.qvel, data.ctrl
        commands = ramp(self._command, command, np.arange(1, count + 1) * STEP_S)
        states = np.empty((count, 21))
        for state, speeds in zip(states, wheel_speeds(commands, self._wheels), strict=True):
            ctrl[:] = speeds
            if self.step % EVERY == 0:
                near = self._hull.is_near_ground(qpos)
                model.geom_conaffinity[self._ground] = CHASSIS_BIT if near else 0
            self._contacts.update()
            mujoco.mj_step(model, data)
            self.step += 1
            state[:7], state[7:17], state[17:] = qpos[:7], qvel, qpos[7:]
            if self._contacts.read():
                self._monitor.fail(f"touched {self._touched()}", self.seconds, *state[:2])
        self._command = Command(*commands[-1])
        self._monitor.check(self.seconds, state[_POSITION], state[_QUATERNION])
        return states

    def _touched(self) -> str:
        return next(self._obstacles[g] for g in self._data.contact.geom.ravel().tolist() if g in self._obstacles)


def _read_fix(follower: WaypointFollower, state: Array, rig: Rig) -> None:
    latitude, longitude, _ = sensors.antenna_geodetic(state[_POSITION], state[_QUATERNION], rig.gnss.mount)
    follower.update_fix(float(latitude), float(longitude))


def _track(states: Array, count: int, commands: Array, rig: Rig) -> Track:
    """Return the track of the first ``count`` states; those behind are the sweep of the last scan.

    ``commands`` (n, 2) are those at all readings of the IMU, up to the end or later.
    """
    quaternion = states[:, _QUATERNION]
    turn_rate = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(quaternion), states[:, _TURN_RATE])
    swept = Motion(
        stamps_ns=np.arange(1, len(states) + 1, dtype=np.int64) * STEP_NS,
        position=states[:, _POSITION],
        quaternion_wxyz=quaternion,
        linear_velocity=states[:, _VELOCITY],
        angular_velocity=turn_rate,
    )
    motion = swept.first(count)
    imu, wheels = (
        sensors.read_imu(motion, rig.imu),
        WheelMotion(angle=states[:count, _ANGLES], speed=states[:count, _SPEEDS]),
    )
    base = Base(
        wheels=wheels,
        tachometers=sensors.read_tachometers(motion, wheels.speed, rig.tachometers),
        odometry=read_odometry(motion.stamps_ns, wheels, rig),
        commands=Commands(stamps_ns=imu.stamps_ns, command=commands[: len(imu.stamps_ns)].reshape(-1, 2)),
    )
    gnss = sensors.read_gnss(motion, rig.gnss)
    return Track(motion=motion, swept=swept, imu=imu, gnss=gnss, base=base if rig.tachometers.enabled else None)
