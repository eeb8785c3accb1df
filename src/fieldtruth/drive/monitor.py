# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ends a drive that cannot succeed, with the cause, the time, the position and the waypoint."""

import math
from typing import Final, NamedTuple

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError
from fieldtruth.drive.controller import WaypointFollower
from fieldtruth.experiment.config import ControlConfig
from fieldtruth.world.model import World

MAX_TILT_DEG: Final = 60.0  # beyond it a Husky tips over: half track 0.29 m, centre of mass 0.19 m high
STUCK_SECONDS: Final = 5.0
STUCK_SHARE: Final = 0.2  # of the distance that the commanded speed makes in that time
TIMEOUT_SECONDS: Final = 30.0  # without getting closer to the waypoint, in addition to the time for one full turn


class Nearing(NamedTuple):
    """How the robot gets on: when [s] it was where, when it came nearer to its target, and to which [m]."""

    moved_at: float
    moved_from: tuple[float, float]
    nearer_at: float
    nearest: float
    target: int


class DriveMonitor:
    """Checks the state once per control step, and raises ``DriveError``. ``progress`` is all that changes."""

    def __init__(self, world: World, follower: WaypointFollower, control: ControlConfig) -> None:
        self._half_size = (world.size[0] / 2, world.size[1] / 2)
        self._field = world.terrain.field
        self._wet = None if world.water_level is None else self._field.heights < world.water_level
        self._follower = follower
        self._min_distance = STUCK_SHARE * control.speed * STUCK_SECONDS
        self._timeout = TIMEOUT_SECONDS + math.tau / control.max_turn_rate
        self.progress = Nearing(0.0, (math.inf, math.inf), 0.0, math.inf, -1)

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array, *, is_following: bool = True) -> None:
        """Raise if the robot at this pose of base_link has left the world, is in water, tipped over or stuck.

        A robot that other commands than those of the follower drive is never stuck.
        """
        x, y = float(position[0]), float(position[1])
        if not (abs(x) <= self._half_size[0] and abs(y) <= self._half_size[1]):  # also true for nan
            self.fail("outside the world", time_s, x, y)
        if self._wet is not None and self._wet[self._node(x, y)]:
            self.fail("in the water", time_s, x, y)
        up = 1 - 2 * float(quaternion_wxyz[1] ** 2 + quaternion_wxyz[2] ** 2)
        if up < math.cos(math.radians(MAX_TILT_DEG)):
            self.fail("tipped over", time_s, x, y)
        if not is_following:
            self.progress = Nearing(time_s, (x, y), time_s, math.inf, -1)
        elif not self._follower.finished:
            self._check_progress(time_s, x, y)

    def _node(self, x: float, y: float) -> tuple[int, int]:
        """Nearest node of the terrain, which covers the whole world."""
        field = self._field
        return round((x - field.x0) / field.spacing), round((y - field.y0) / field.spacing)

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

    def fail(self, what: str, time_s: float, x: float, y: float) -> None:
        """Raise ``DriveError``: the robot is ``what`` at this time [s] and position [m]."""
        count = len(self._follower.waypoints_xy)
        number = min(self._follower.target + 1, count)
        where = f"at {time_s:.2f} s, x, y = {x:.2f}, {y:.2f} m"
        raise DriveError(f"robot {what} {where}, heading for waypoint {number} of {count}")
