# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The drive as a whole: it begins at the route's start, and lasts as long as was asked for or to its last way-point.

The robot is set down at the start and settles for two seconds before the recording; it does not creep 0.3 m then. The
last way-point is taken when the antenna is nearer than the arrival distance, and the robot stands half a second later.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag import topics as table
from fieldtruth.bag.reader import RawMessage
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.validation.check import Check
from fieldtruth.validation.law import check_of
from fieldtruth.validation.subject import STEP_NS, Examiner, Subject

F8 = NDArray[np.float64]

START_BOUND: Final = 0.3  # [m]
STOP_WAY: Final = 0.5  # [m] driven at most from the fix that reaches the last way-point to standing
STANDING: Final = 0.05  # [m/s]


class Drive(Examiner):
    """Beginning and end of the drive, against the experiment."""

    topics = (table.MODEL_STATES,)

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._start = subject.law("the drive begins at the route's start", START_BOUND, "m")
        self._end = subject.law("the drive ends as the experiment has it")
        self._figures = ""
        self._first: F8 | None = None
        self._last_ns = 0

    def feed(self, raw: RawMessage, message: Any) -> None:
        """See a message, after the motion did."""
        if self._first is None and self._subject.motion.started:
            self._first = self._subject.motion.state(raw.stamp_ns).position.copy()
        self._last_ns = raw.stamp_ns

    def finish(self) -> None:
        """See the end of the bag."""
        experiment = self._subject.experiment
        if experiment is None or self._first is None:
            return
        try:
            corners = metres_from_route(experiment.route)
        except FieldtruthError:
            corners = None  # a random route has no points before it is planned
        if corners is not None:
            away = float(np.linalg.norm(self._first[:2] - corners[0]))
            self._start.measure(away, f"the first pose is {away:.2f} m from the start")
        self._judge_end(experiment, None if corners is None else corners[-1])

    def results(self) -> list[Check]:
        """Drive."""
        return [check_of("drive", [self._start, self._end], self._figures, "no experiment, or no true motion")]

    def _judge_end(self, experiment: Experiment, goal: Any) -> None:
        seconds, asked = self._last_ns / 1e9, experiment.seconds
        due = None if asked is None else max(1, round(asked * 1e9 / STEP_NS)) * STEP_NS
        if due is not None and self._last_ns == due:
            self._end.see(True, "")
            self._figures = f"{seconds:g} s as asked for"
            return
        if due is not None and self._last_ns > due:
            self._end.see(False, f"it lasts {seconds:g} s, {asked:g} s were asked for")
            return
        if goal is None:
            return
        state = self._subject.motion.state(self._last_ns)
        antenna = state.world_from_base @ [*experiment.rig.gnss.mount.xyz, 1.0]
        away, speed = float(np.linalg.norm(antenna[:2] - goal)), float(np.linalg.norm(state.linear_velocity))
        place = f"{seconds:g} s, at {away:.2f} m from the last way-point with {speed:.2f} m/s"
        self._end.see(
            away < experiment.control.arrival_distance + STOP_WAY and speed < STANDING, f"it ends after {place}"
        )
        self._figures = f"{place}: arrived"
