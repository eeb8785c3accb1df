# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Waypoint follower of the paper's section 3, its kinematic simulation, and the monitor that ends a hopeless drive.

The follower drives with constant speed and a turn rate proportional to the heading error. Its only inputs are the
latest fix of the GNSS antenna and the heading of the IMU; between two fixes it steers from the position of the last
one.

The kinematic simulation is a unicycle under this follower, milliseconds instead of minutes. Control law, fix rate,
arrival distance and turn rate limit are those of the drive. A slope tilts the mast and with it the GNSS antenna: 15 deg
shift it by 0.23 m, and the robot then drives that far beside its line.
"""

import math
from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError
from fieldtruth.core.geodesy import PAPER_ORIGIN, Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.core.readings import Fix
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.ground import slopes
from fieldtruth.drive.physics import STOP, Command
from fieldtruth.experiment.config import ControlConfig, Experiment
from fieldtruth.experiment.fields import Mount
from fieldtruth.world.model import Heightfield, World, node_axes

_STEP_S: Final = 0.1
_TIMEOUT_S: Final = 30.0
MAX_TILT_DEG: Final = 60.0  # beyond it a Husky tips over: half track 0.29 m, centre of mass 0.19 m high
OUTSIDE: Final = "outside the world"
IN_WATER: Final = "in the water"
TIPPED: Final = "tipped over"
STUCK_SECONDS: Final = 5.0
STUCK_SHARE: Final = 0.2  # of the distance that the commanded speed makes in that time
TIMEOUT_SECONDS: Final = 30.0  # without getting closer to the waypoint, in addition to the time for one full turn


class FollowerState(NamedTuple):
    """Waypoints, current one and last fix of a ``WaypointFollower``."""

    waypoints_xy: Array
    target: int
    antenna_xy: Array


class WaypointFollower:
    """Drives to each waypoint in turn and stops at the last one.

    ``waypoints`` (n, 2) are latitude and longitude [deg]. ``target`` is the row of the current waypoint, and the number
    of waypoints once the last one is reached. ``antenna_xy`` [m] is the last fix. ``origin`` is that of the world.
    """

    def __init__(self, waypoints: ArrayLike, control: ControlConfig, origin: Origin = PAPER_ORIGIN) -> None:
        self._origin = origin
        # Each by itself: of many at once, the last digit can depend on how many there are.
        self.waypoints_xy: Array = np.array([self._horizontal(w) for w in np.asarray(waypoints)])  # (n, 2) [m]
        self.target = 0
        self._control = control
        self.antenna_xy = self.waypoints_xy[0]

    @property
    def finished(self) -> bool:
        """True once the last waypoint is reached."""
        return self.target == len(self.waypoints_xy)

    def update_fix(self, latitude_deg: float, longitude_deg: float) -> None:
        """Take a GNSS fix; below the arrival distance the next waypoint becomes the target."""
        self._arrive(self._horizontal((latitude_deg, longitude_deg)))

    def add(self, waypoint: ArrayLike) -> None:
        """Drive on to a waypoint (2,) after those that there are."""
        self.waypoints_xy = np.vstack([self.waypoints_xy, self._horizontal(waypoint)])
        self._arrive(self.antenna_xy)

    def save(self) -> FollowerState:
        """Return what ``restore`` needs to go on from here."""
        return FollowerState(self.waypoints_xy, self.target, self.antenna_xy)

    def restore(self, saved: FollowerState) -> None:
        """Go on from where ``save`` was called, and forget waypoints that were added since then."""
        self.waypoints_xy, self.target, self.antenna_xy = saved

    def _horizontal(self, geodetic: ArrayLike) -> Array:
        return horizontal_from_geodetic(geodetic, self._origin)

    def _arrive(self, antenna_xy: Array) -> None:
        self.antenna_xy = antenna_xy
        while not self.finished and self.distance < self._control.arrival_distance:
            self.target += 1

    @property
    def distance(self) -> float:
        """Distance [m] from the last fix to the target."""
        return math.dist(self.antenna_xy, self.waypoints_xy[self.target])

    def command(self, heading: float) -> Command:
        """Command at this ``heading`` [rad]: 0 is north, positive towards west."""
        if self.finished:
            return STOP
        north, west = self.waypoints_xy[self.target] - self.antenna_xy
        return Command(self._control.speed, turn_rate(math.atan2(west, north) - heading, self._control))


def turn_rate(heading_error: float, control: ControlConfig) -> float:
    """Turn rate [rad/s], proportional to the heading error [rad] up to the limit."""
    rate = control.heading_gain * math.remainder(heading_error, math.tau)
    return min(max(rate, -control.max_turn_rate), control.max_turn_rate)


def horizontal_from_geodetic(geodetic: ArrayLike, origin: Origin = PAPER_ORIGIN) -> Array:
    """World x, y (..., 2) [m] of latitude and longitude (..., 2) [deg] at the height of the origin."""
    latitude_longitude = np.asarray(geodetic, np.float64)
    height = np.full((*latitude_longitude.shape[:-1], 1), origin.height)
    return world_from_geodetic(np.concatenate([latitude_longitude, height], axis=-1), origin)[..., :2]


def antenna_geodetic(position: Array, quaternion_wxyz: Array, mount: Mount, origin: Origin = PAPER_ORIGIN) -> Array:
    """Latitude [deg], longitude [deg], height [m] (n, 3) of the antenna for poses of base_link (n, 3) and (n, 4)."""
    lever = rotation_from_quaternion_wxyz(quaternion_wxyz) @ np.array(mount.xyz)
    return geodetic_from_world(position + lever, origin)


def heading(quaternion_wxyz: Array) -> float:
    """Heading [rad] of base_link (the attitude of an IMU, turned by its mount): 0 north, positive towards west."""
    w, x, y, z = quaternion_wxyz
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


class KinematicState(NamedTuple):
    """Position x, y [m], heading [rad], last GNSS fix [m] and its age [s]."""

    x: float
    y: float
    heading: float
    fix: tuple[float, float]
    fix_age: float = 0.0


class KinematicSimulator:
    """Drives between waypoints with an experiment's control and GNSS receiver; without ``field``, on a plane."""

    def __init__(self, experiment: Experiment, field: Heightfield | None = None) -> None:
        self.control: ControlConfig = experiment.control
        self._fix_period = 1.0 / experiment.rig.first(Fix).rate_hz
        self._antenna = experiment.rig.first(Fix).mount.xyz
        self._field = field
        self._slopes = None if field is None else slopes(field, 2 * experiment.rig.wheels.half_track)

    def start(self, start_xy: Array, ahead_xy: Array) -> KinematicState:
        """State at ``start_xy`` [m], heading for ``ahead_xy``, with a first fix."""
        x, y = map(float, start_xy)
        heading = math.atan2(float(ahead_xy[1]) - y, float(ahead_xy[0]) - x)
        return KinematicState(x, y, heading, self._fix_at(x, y, heading))

    def drive_leg(self, state: KinematicState, target_xy: Array) -> tuple[Array, KinematicState | None]:
        """Drive until a fix is within the arrival distance of ``target_xy`` [m].

        Returns:
            Poses (n, 3) of x, y [m] and heading [rad], the first one that of ``state``; and the state on arrival, None
            if the robot never arrives but circles the target.
        """
        tx, ty = map(float, target_xy)
        x, y, heading, fix, age = state
        poses = [(x, y, heading)]
        control = self.control
        timeout = _TIMEOUT_S + math.tau / control.max_turn_rate + 2 * math.dist((x, y), (tx, ty)) / control.speed
        for _ in range(int(timeout / _STEP_S)):
            if math.dist(fix, (tx, ty)) < control.arrival_distance:
                return np.array(poses), KinematicState(x, y, heading, fix, age)
            turn = turn_rate(math.atan2(ty - fix[1], tx - fix[0]) - heading, control) * _STEP_S
            x += control.speed * _STEP_S * math.cos(heading + turn / 2)
            y += control.speed * _STEP_S * math.sin(heading + turn / 2)
            heading += turn
            poses.append((x, y, heading))
            age += _STEP_S
            if age >= self._fix_period - 1e-9:
                age = max(0.0, age - self._fix_period) if age < 2 * self._fix_period else 0.0
                fix = self._fix_at(x, y, heading)
        return np.array(poses), None

    def drive_route(self, corners: Array) -> tuple[list[Array], int | None]:
        """Drive a route of start and waypoints (1 + n, 2) [m].

        Returns:
            Poses of each leg, and the index of the leg that never arrives, None if all do.
        """
        state = self.start(corners[0], corners[1])
        legs = []
        for row, target in enumerate(corners[1:]):
            poses, arrived = self.drive_leg(state, target)
            legs.append(poses)
            if arrived is None:
                return legs, row
            state = arrived
        return legs, None

    def _fix_at(self, x: float, y: float, heading: float) -> tuple[float, float]:
        forward, left, up = self._antenna
        cos, sin = math.cos(heading), math.sin(heading)
        slope_x, slope_y = self._slope_at(x, y)
        lean = up / math.sqrt(1.0 + slope_x**2 + slope_y**2)
        return x + cos * forward - sin * left - lean * slope_x, y + sin * forward + cos * left - lean * slope_y

    def _slope_at(self, x: float, y: float) -> tuple[float, float]:
        if self._field is None or self._slopes is None:
            return 0.0, 0.0
        nx, ny = self._field.heights.shape
        i = min(max(round((x - self._field.x0) / self._field.spacing), 0), nx - 1)
        j = min(max(round((y - self._field.y0) / self._field.spacing), 0), ny - 1)
        return float(self._slopes[0][i, j]), float(self._slopes[1][i, j])


class Nearing(NamedTuple):
    """Progress of the robot: when [s] it was where, when it came nearer to its target, and to which [m]."""

    moved_at: float
    moved_from: tuple[float, float]
    nearer_at: float
    nearest: float
    target: int


class Hazards:
    """Finds what is fatal at a pose in ``world``, whatever the robot does there."""

    def __init__(self, world: World) -> None:
        self._half_size = (world.size[0] / 2, world.size[1] / 2)
        self._field = world.terrain.field
        x, y = node_axes(self._field)
        dry = world.water_level is None
        self._wet = None if dry else self._field.heights < world.water_at(x[:, None], y)

    def at(self, position: Array, quaternion_wxyz: Array) -> str:
        """State that a robot at this pose of base_link has left the world, is in water or tipped over; empty: none."""
        x, y = float(position[0]), float(position[1])
        if not (abs(x) <= self._half_size[0] and abs(y) <= self._half_size[1]):  # also true for nan
            return OUTSIDE
        if self._wet is not None and self._wet[self._node(x, y)]:
            return IN_WATER
        up = 1 - 2 * float(quaternion_wxyz[1] ** 2 + quaternion_wxyz[2] ** 2)
        return TIPPED if up < math.cos(math.radians(MAX_TILT_DEG)) else ""

    def _node(self, x: float, y: float) -> tuple[int, int]:
        """Nearest node of the terrain, which covers the whole world."""
        field = self._field
        return round((x - field.x0) / field.spacing), round((y - field.y0) / field.spacing)


class DriveMonitor:
    """Checks the state once per control step, and raises ``DriveError``. ``progress`` is all that changes.

    ``others`` are names of robots and actors for which the robot could wait.
    """

    def __init__(
        self, world: World, follower: WaypointFollower, control: ControlConfig, others: Collection[str] = ()
    ) -> None:
        self._hazards, self._others, self._yields = Hazards(world), others, control.yield_to is not None
        self._follower = follower
        self._min_distance = STUCK_SHARE * control.speed * STUCK_SECONDS
        self._timeout = TIMEOUT_SECONDS + math.tau / control.max_turn_rate
        self.progress = Nearing(0.0, (math.inf, math.inf), 0.0, math.inf, -1)

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array, *, is_following: bool = True) -> None:
        """Raise if the robot at this pose of base_link has left the world, is in water, tipped over or stuck.

        A robot that other commands than those of the follower drive is never stuck.
        """
        x, y = float(position[0]), float(position[1])
        if what := self._hazards.at(position, quaternion_wxyz):
            self.fail(what, time_s, x, y)
        if not is_following:
            self.progress = Nearing(time_s, (x, y), time_s, math.inf, -1)
        elif not self._follower.finished:
            self._check_progress(time_s, x, y)

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        """Raise: the robot has touched an object."""
        hint = "" if self._yields or name not in self._others else "; control.yield_to makes it wait"
        self.fail(f"touched {name}", time_s, float(position[0]), float(position[1]), hint)

    def _check_progress(self, time_s: float, x: float, y: float) -> None:
        seen, target = self.progress, self._follower.target
        if math.dist((x, y), seen.moved_from) > self._min_distance:
            seen = seen._replace(moved_at=time_s, moved_from=(x, y))
        elif time_s - seen.moved_at > STUCK_SECONDS:
            self.fail(f"stuck (moved less than {self._min_distance:.2g} m in {STUCK_SECONDS:.0f} s)", time_s, x, y)
        distance = math.dist((x, y), self._follower.waypoints_xy[target])
        if target != seen.target or distance < seen.nearest - 0.1:
            seen = seen._replace(nearer_at=time_s, nearest=distance, target=target)
        elif time_s - seen.nearer_at > self._timeout:
            self.fail(f"stuck (no closer to its waypoint for {self._timeout:.0f} s)", time_s, x, y)
        self.progress = seen

    def fail(self, what: str, time_s: float, x: float, y: float, hint: str = "") -> None:
        """Raise ``DriveError``: the robot is ``what`` at this time [s] and position [m]."""
        count = len(self._follower.waypoints_xy)
        number = min(self._follower.target + 1, count)
        where = f"at {time_s:.2f} s, x, y = {x:.2f}, {y:.2f} m"
        raise DriveError(f"robot {what} {where}, heading for waypoint {number} of {count}{hint}")
