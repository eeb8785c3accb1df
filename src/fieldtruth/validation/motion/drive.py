# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The drive as a whole, against the route or the track file of the experiment."""

from typing import Any, Final

import numpy as np

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.bag.track_file import read_track_file
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError, RouteError
from fieldtruth.experiment.config import FRAME_RATE, Experiment
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.validation.check import Rule, Spec
from fieldtruth.validation.context import STEP_NS, Checker, Context

# The robot settles for two seconds before the recording, in which it may creep.
START: Final = Rule("the drive begins at the start of the route", 0.3, "m")
END: Final = Rule(
    "the drive lasts as long as the experiment says, or until the robot stops at the last waypoint, or the track ends"
)
# Poses between two steps of the physics are compared with the linear interpolation, 1e-6 m from the spline at 10 m/s^2.
FOLLOWS: Final = Rule("the robot passes through the poses of the track file", 1e-4, "m or of a rotation")
DRIVE: Final[Spec] = Spec("drive", (START, END, FOLLOWS), skipped="no experiment, or no true motion")
_SPARSE_NS: Final = 10_000_000
"""Of the poses of a track file, one in this time [ns] is compared."""
_STOPPING: Final = 0.5  # [m] from the fix that reaches the last waypoint to standstill, at most
_STANDING: Final = 0.05  # [m/s]


class Drive(Checker):
    """Beginning and end of the drive, or its poses, against the experiment."""

    topics = (table.MODEL_STATES,)

    def __init__(self, context: Context) -> None:
        self._context = context
        self._tally = context.tally(DRIVE)
        self.tallies = [self._tally]
        self._first: Array | None = None
        self._last_ns = 0
        self._given, self._next = self._read_given(), 0

    def see(self, raw: RawMessage, message: Any) -> None:
        """Process a message, after the motion window has."""
        motion = self._context.motion
        if self._first is None and motion.started:
            self._first = motion.state(raw.stamp_ns).position.copy()
        self._last_ns = raw.stamp_ns
        given = self._given
        while given is not None and self._next < len(given) and given.stamps_ns[self._next] <= raw.stamp_ns:
            stamp = int(given.stamps_ns[self._next])
            if stamp >= STEP_NS and motion.started:
                apart = motion.state(stamp).world_from_base - given.world_from_base(stamp)
                self._tally[FOLLOWS].measure(float(np.abs(apart).max()), f"at {stamp} ns")
            self._next += 1

    def finish(self) -> None:
        """Finish the checks after the last message."""
        experiment, goal = self._context.experiment, None
        if experiment is None or self._first is None:
            return
        try:
            if experiment.frames is not None:
                raise RouteError("frames do not begin at the start of a route")
            corners = metres_from_route(experiment.route)
        except FieldtruthError:
            pass  # a random route has no waypoints before it is planned, a track file and frames have none
        else:
            away, goal = float(np.linalg.norm(self._first[:2] - corners[0])), corners[-1]
            self._tally[START].measure(away, f"the first pose is {away:.2f} m from the start")
        self._check_end(experiment, goal)

    def _read_given(self) -> Trajectory | None:
        """Return the poses of the track file, with simulated time as stamps; None without a readable file."""
        experiment = self._context.experiment
        if experiment is None or experiment.drive is None:
            return None
        try:
            file = read_track_file(experiment.drive)
            poses = file.in_world(experiment.drive, experiment.rig)
        except FieldtruthError as error:
            self._tally.skipped = str(error)
            return None
        stamps = poses.stamps_ns - file.start_ns(experiment.drive)
        _, rows = np.unique(stamps // _SPARSE_NS, return_index=True)
        rows = np.append(rows[:-1], len(stamps) - 1)  # the last says when the track ends
        return Trajectory(stamps[rows], poses.position[rows], poses.quaternion_wxyz[rows])

    def _check_end(self, experiment: Experiment, goal: Any) -> None:
        seconds, asked, end = self._last_ns / 1e9, experiment.seconds, self._tally[END]
        due = None if asked is None else max(1, round(asked * 1e9 / STEP_NS)) * STEP_NS
        if experiment.frames is not None:
            due = round(experiment.frames.count * 1e9 / FRAME_RATE)
        if self._given is not None:
            over = int(self._given.stamps_ns[-1]) // STEP_NS * STEP_NS
            due = over if due is None else min(due, over)
        if due is not None and (self._last_ns >= due or self._given is not None or experiment.frames is not None):
            end.see(self._last_ns == due, f"{seconds:g} s instead of {due / 1e9:g} s")
            self._tally.note = f"{seconds:g} s as in the experiment"
        elif goal is not None:
            state = self._context.motion.state(self._last_ns)
            antenna = transforms.transform(state.world_from_base, np.array([experiment.rig.gnss.mount.xyz]))[0]
            away, speed = float(np.linalg.norm(antenna[:2] - goal)), float(np.linalg.norm(state.linear_velocity))
            self._tally.note = f"{seconds:g} s, then {away:.2f} m from the last waypoint at {speed:.2f} m/s"
            arrived = away < experiment.control.arrival_distance + _STOPPING and speed < _STANDING
            end.see(arrived, f"it ends after {self._tally.note}")
