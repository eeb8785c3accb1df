# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Commands to the robot, compared with those of the controller."""

from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.frames import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.drive.controller import WaypointFollower, antenna_geodetic
from fieldtruth.experiment.route import geodetic_route
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import Checker, Context, at

# The controller's first fix is that of time 0, the first known one a millisecond later.
COMMAND: Final = Rule("commands are those of the controller for fix and heading", 1e-5, "m/s or rad/s")
COMMANDS: Final[Spec] = Spec("commands", (COMMAND,), "commands", f"no {table.COMMANDS}, or no waypoints")


class Commands(Checker):
    """Commands against the controller, which gets the ideal fixes and headings of the bag."""

    def __init__(self, context: Context) -> None:
        self._context, self._tally = context, context.tally(COMMANDS)
        self._imu, self._gnss = context.rig.imu, context.rig.gnss
        self._fixes, readings = (each.true_topic(each.topic) for each in (self._gnss, self._imu))
        self.topics = (readings, self._fixes, table.COMMANDS)
        self.tallies = [self._tally]
        self._heading: tuple[int, float] = (0, 0.0)
        self._follower: WaypointFollower | None = None
        experiment = context.experiment
        if experiment is None:
            return
        if not (self._imu.enabled and self._gnss.enabled):
            self._tally.skipped = "the IMU or the GNSS receiver that steers the robot is not enabled"
            return
        try:
            self._follower = WaypointFollower(geodetic_route(experiment.route).waypoints, experiment.control)
        except FieldtruthError:
            return  # a random route has no waypoints before it is planned, a track file has none
        context.motion.when_known(0, self._see_start)

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message; at equal stamps, IMU and fix come before the command."""
        follower = self._follower
        if follower is None:
            return
        if raw.topic == self._fixes:
            follower.update_fix(message.latitude, message.longitude)
        elif raw.topic != table.COMMANDS:
            q = message.orientation
            world_from_imu = rotation_from_quaternion_wxyz(np.array([q.w, q.x, q.y, q.z]))
            base_from_imu = self._imu.mount.base_from_sensor[:3, :3]
            self._heading = raw.stamp_ns, float(yaw_from_rotation(world_from_imu @ base_from_imu.T))
        elif self._heading[0] == raw.stamp_ns:
            due, found = follower.command(self._heading[1]), (message.linear.x, message.angular.z)
            self._tally[COMMAND].measure(float(np.abs(np.subtract(due, found)).max()), at(raw))

    def _see_start(self) -> None:
        assert self._follower is not None
        state = self._context.motion.state(0)
        antenna = antenna_geodetic(state.position, state.quaternion_wxyz, self._gnss.mount)
        self._follower.update_fix(float(antenna[0]), float(antenna[1]))
