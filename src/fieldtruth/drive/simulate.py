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
from fieldtruth.drive.controller import WaypointFollower, horizontal_from_geodetic
from fieldtruth.drive.husky import STOP, Command, ramp, wheel_speeds
from fieldtruth.drive.monitor import DriveMonitor
from fieldtruth.drive.physics import STEP_NS, STEP_S, build_physics, resting_pose
from fieldtruth.drive.track import Motion, Track
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.world.model import World

STOP_SECONDS: Final = 0.5
"""From the fix that reaches the last waypoint to the end of the drive; braking from 0.3 m/s takes 0.1 s of it."""
SETTLE_SECONDS: Final = 2.0
"""The robot rests this long before time 0, so that the contacts are settled at the first reading."""

# A state is one row: base_link's position, quaternion, velocity in the world, turn rate in base_link; wheel speeds.
_POSITION, _QUATERNION, _VELOCITY, _TURN_RATE, _WHEELS = np.split(np.arange(17), [3, 7, 10, 13])


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
    robot = SimulatedHusky(world, rig, monitor)
    state = robot.spawn(world, horizontal_from_geodetic(route.start), follower.waypoints_xy[0])
    _read_fix(follower, state, rig)

    end = math.inf if experiment.seconds is None else max(1, round(experiment.seconds / STEP_S))
    imu_steps, gnss_steps = sensors.due_steps(rig.imu.rate_hz), sensors.due_steps(rig.gnss.rate_hz)
    next_fix = next(gnss_steps)
    arrived = False
    blocks: list[Array] = []
    while robot.step < end:
        if follower.finished and not arrived:
            arrived, end = True, min(end, robot.step + round(STOP_SECONDS / STEP_S))
        command = follower.command(sensors.heading(state[_QUATERNION]))
        began = robot.step
        block = robot.advance(command, int(min(next(imu_steps), end)) - began)
        blocks.append(block)
        state = block[-1]
        while next_fix <= robot.step:
            _read_fix(follower, block[next_fix - began - 1], rig)
            next_fix = next(gnss_steps)
        if progress is not None and int(robot.seconds) > int(began * STEP_S):
            progress(robot.seconds)
    return _track(np.concatenate(blocks), rig)


class SimulatedHusky:
    """The robot in the physics simulation. ``step`` counts the physics steps since the recording began."""

    def __init__(self, world: World, rig: Rig, monitor: DriveMonitor) -> None:
        self.step = 0
        self._model, self._obstacles = build_physics(world, rig)
        self._data = mujoco.MjData(self._model)
        self._ground = self._model.geom("ground").id
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
        pose = resting_pose(world.terrain.field, start_xy, math.atan2(west, north), self._rig)
        self._data.qpos[:3], self._data.qpos[3:7] = pose
        self.step = -round(SETTLE_SECONDS / STEP_S)
        settled: Array = self.advance(STOP, -self.step)[-1]
        return settled

    def advance(self, command: Command, count: int) -> Array:
        """Drive ``count`` physics steps towards ``command`` and return the state after each, (count, 17)."""
        model, data = self._model, self._data
        commands = ramp(self._command, command, np.arange(1, count + 1) * STEP_S)
        states = np.empty((count, 17))
        for state, speeds in zip(states, wheel_speeds(commands, self._wheels), strict=True):
            data.ctrl[:] = speeds
            mujoco.mj_step(model, data)
            self.step += 1
            state[:7] = data.qpos[:7]
            state[7:] = data.qvel
            # In contacts with the heightfield, the heightfield is always geom1.
            if (data.contact.geom1 != self._ground).any():
                self._monitor.fail(f"touched {self._touched()}", self.seconds, *state[:2])
        self._command = Command(*commands[-1])
        self._monitor.check(self.seconds, state[_POSITION], state[_QUATERNION])
        return states

    def _touched(self) -> str:
        return next(self._obstacles[g] for g in self._data.contact.geom.ravel().tolist() if g in self._obstacles)


def _read_fix(follower: WaypointFollower, state: Array, rig: Rig) -> None:
    latitude, longitude, _ = sensors.antenna_geodetic(state[_POSITION], state[_QUATERNION], rig.gnss.mount)
    follower.update_fix(float(latitude), float(longitude))


def _track(states: Array, rig: Rig) -> Track:
    quaternion = states[:, _QUATERNION]
    turn_rate = np.einsum("nij,nj->ni", rotation_from_quaternion_wxyz(quaternion), states[:, _TURN_RATE])
    motion = Motion(
        stamps_ns=np.arange(1, len(states) + 1, dtype=np.int64) * STEP_NS,
        position=states[:, _POSITION],
        quaternion_wxyz=quaternion,
        linear_velocity=states[:, _VELOCITY],
        angular_velocity=turn_rate,
    )
    wheels = rig.tachometers
    return Track(
        motion=motion,
        imu=sensors.read_imu(motion, rig.imu),
        gnss=sensors.read_gnss(motion, rig.gnss),
        tachometers=sensors.read_tachometers(motion, states[:, _WHEELS], wheels) if wheels.enabled else None,
    )
