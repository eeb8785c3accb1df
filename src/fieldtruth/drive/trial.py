# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drives a route while it is being planned: on rough ground the robot skids away from the path that is expected.

What the robot does up to a waypoint depends on no later one, so a route that fails is not driven anew from its start:
the drive goes back to the last waypoint that is kept.
"""

from collections.abc import Callable
from contextlib import suppress

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError
from fieldtruth.drive.simulate import Checkpoint, Drive
from fieldtruth.drive.track import Track
from fieldtruth.experiment.config import Experiment, RouteConfig
from fieldtruth.experiment.route import route_from_metres
from fieldtruth.world.model import World


class TrialDrive:
    """The drive in ``world`` of a route that changes; ``experiment`` supplies control, soil and rig.

    ``progress`` is called after every simulated second with the simulated time [s].
    """

    def __init__(self, world: World, experiment: Experiment, progress: Callable[[float], None] | None = None) -> None:
        self._world, self._experiment, self._progress = world, experiment, progress
        self._drive: Drive | None = None
        self._start: tuple[float, float] | None = None
        self._waypoints: list[tuple[float, float]] = []
        self._checkpoints: list[Checkpoint] = []  # where each of the waypoints was reached

    def reached(self, corners: Array) -> int:
        """Drive start and waypoints (1 + n, 2) [m], and return how many waypoints the robot reaches."""
        route = route_from_metres(corners[0].tolist(), corners[1:].tolist())
        with suppress(DriveError):
            drive = self._back_to(route)
            for row in range(len(self._waypoints), len(route.waypoints)):
                if row:  # the first one decides how the robot stands at the start
                    drive.add(route.waypoints[row])
                self._checkpoints.append(drive.reach_last())
                self._waypoints.append(route.waypoints[row])
        return len(self._waypoints)

    def finish(self) -> Track:
        """Stop at the last waypoint that was reached, and return the track of the whole drive; it is the last call.

        Raises:
            DriveError: it cannot stop there.
        """
        if self._drive is None or not self._checkpoints:
            raise DriveError("the robot reaches no waypoint")
        self._drive.restore(self._checkpoints[-1])
        return self._drive.finish()

    def _back_to(self, route: RouteConfig) -> Drive:
        """Return the drive at the last waypoint that it has in common with ``route``."""
        pairs = zip(self._waypoints, route.waypoints, strict=False)
        common = next((row for row, (ours, new) in enumerate(pairs) if ours != new), len(self._waypoints))
        common = min(common, len(route.waypoints)) if self._start == route.start else 0
        del self._waypoints[common:], self._checkpoints[common:]
        if self._drive is not None and common:
            self._drive.restore(self._checkpoints[-1])
        else:
            self._start = route.start
            first = RouteConfig(start=route.start, waypoints=route.waypoints[:1])
            self._drive = Drive(self._world, self._experiment, first, self._progress)
        return self._drive
