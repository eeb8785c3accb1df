# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A drive without physics: a unicycle that obeys the way-point follower, milliseconds instead of minutes.

The law is the follower's own: the antenna's fixes at their rate, the arrival distance, the turn rate and its limit. The
ground tilts the mast, and with it the antenna: 15 deg are 0.23 m, by which the robot then drives beside its line.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.controller import turn_rate
from fieldtruth.drive.ground import slopes
from fieldtruth.experiment.config import ControlConfig, Experiment
from fieldtruth.world.model import Heightfield

STEP_S: Final = 0.1
_PATIENCE_S: Final = 30.0


class Stage(NamedTuple):
    """Where the robot is and what it knows: x, y [m], heading [rad], the last fix [m], time since then [s]."""

    x: float
    y: float
    heading: float
    fix: tuple[float, float]
    fix_age: float = 0.0


class KinematicSimulator:
    """Drives between way-points with the controls and the receiver of an experiment; without ``field``, on a plane."""

    def __init__(self, experiment: Experiment, field: Heightfield | None = None) -> None:
        self.control: ControlConfig = experiment.control
        self._fix_period = 1.0 / experiment.rig.gnss.rate_hz
        self._antenna = experiment.rig.gnss.mount.xyz
        self._field = field
        self._slopes = None if field is None else slopes(field, 2 * experiment.rig.wheels.half_track)

    def start(self, start_xy: Array, ahead_xy: Array) -> Stage:
        """Stand at ``start_xy`` [m], facing ``ahead_xy``, with a first fix."""
        x, y = map(float, start_xy)
        heading = math.atan2(float(ahead_xy[1]) - y, float(ahead_xy[0]) - x)
        return Stage(x, y, heading, self._seen(x, y, heading))

    def leg(self, stage: Stage, target_xy: Array) -> tuple[Array, Stage | None]:
        """Drive until a fix lies within the arrival distance of ``target_xy`` [m].

        Returns:
            Poses (n, 3) of x, y [m] and heading [rad] on the way, the first one ``stage``'s; and the stage on arrival,
            None if the robot does not get there, but circles about it.
        """
        tx, ty = map(float, target_xy)
        x, y, heading, fix, age = stage
        poses = [(x, y, heading)]
        control = self.control
        longest = _PATIENCE_S + math.tau / control.max_turn_rate + 2 * math.dist((x, y), (tx, ty)) / control.speed
        for _ in range(int(longest / STEP_S)):
            if math.dist(fix, (tx, ty)) < control.arrival_distance:
                return np.array(poses), Stage(x, y, heading, fix, age)
            turn = turn_rate(math.atan2(ty - fix[1], tx - fix[0]) - heading, control) * STEP_S
            x += control.speed * STEP_S * math.cos(heading + turn / 2)
            y += control.speed * STEP_S * math.sin(heading + turn / 2)
            heading += turn
            poses.append((x, y, heading))
            age += STEP_S
            if age >= self._fix_period - 1e-9:
                age = max(0.0, age - self._fix_period) if age < 2 * self._fix_period else 0.0
                fix = self._seen(x, y, heading)
        return np.array(poses), None

    def legs(self, corners: Array) -> tuple[list[Array], int | None]:
        """Drive a whole route of (1 + n, 2) [m]: poses of each leg, and the leg that has no end, if there is one."""
        stage: Stage | None = self.start(corners[0], corners[1])
        legs = []
        for row, target in enumerate(corners[1:]):
            assert stage is not None
            poses, stage = self.leg(stage, target)
            legs.append(poses)
            if stage is None:
                return legs, row
        return legs, None

    def _seen(self, x: float, y: float, heading: float) -> tuple[float, float]:
        forward, left, up = self._antenna
        cos, sin = math.cos(heading), math.sin(heading)
        along_x, along_y = self._slope_at(x, y)
        lean = up / math.sqrt(1.0 + along_x**2 + along_y**2)
        return x + cos * forward - sin * left - lean * along_x, y + sin * forward + cos * left - lean * along_y

    def _slope_at(self, x: float, y: float) -> tuple[float, float]:
        if self._field is None or self._slopes is None:
            return 0.0, 0.0
        nx, ny = self._field.heights.shape
        i = min(max(round((x - self._field.x0) / self._field.spacing), 0), nx - 1)
        j = min(max(round((y - self._field.y0) / self._field.spacing), 0), ny - 1)
        return float(self._slopes[0][i, j]), float(self._slopes[1][i, j])


def way_length(poses: Array) -> float:
    """Length [m] of a path through poses (n, 2 or 3)."""
    return float(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).sum())
