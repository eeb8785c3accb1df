# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Kinematic simulation of a drive: a unicycle under the waypoint follower, milliseconds instead of minutes.

Control law, fix rate, arrival distance and turn rate limit are those of the drive. A slope tilts the mast and with it
the GNSS antenna: 15 deg shift it by 0.23 m, and the robot then drives that far beside its line.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.readings import Fix
from fieldtruth.drive.controller import turn_rate
from fieldtruth.drive.ground import slopes
from fieldtruth.experiment.config import ControlConfig, Experiment
from fieldtruth.world.model import Heightfield

STEP_S: Final = 0.1
_TIMEOUT_S: Final = 30.0


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
        for _ in range(int(timeout / STEP_S)):
            if math.dist(fix, (tx, ty)) < control.arrival_distance:
                return np.array(poses), KinematicState(x, y, heading, fix, age)
            turn = turn_rate(math.atan2(ty - fix[1], tx - fix[0]) - heading, control) * STEP_S
            x += control.speed * STEP_S * math.cos(heading + turn / 2)
            y += control.speed * STEP_S * math.sin(heading + turn / 2)
            heading += turn
            poses.append((x, y, heading))
            age += STEP_S
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
