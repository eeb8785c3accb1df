# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Routes before the drive: checked, found at random, or expected without physics.

On rough ground the robot skids away from the path that is expected, so a random route is driven while it is planned.
What the robot does up to a waypoint depends on no later one: a route that fails is not driven anew from its start, the
drive goes back to the last waypoint that is kept.

The expected path ignores slip and uneven ground. In the park the real drive stays within 0.25 m of it (5 cm on
average); it takes 20 ms instead of 20 s.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.core.progress import Advance
from fieldtruth.drive.controller import KinematicSimulator
from fieldtruth.drive.physics import resting_pose
from fieldtruth.drive.routes import RandomRoutePlanner, check_route
from fieldtruth.drive.simulate import Checkpoint, Drive, drive
from fieldtruth.drive.stems import world_through
from fieldtruth.drive.track import Track
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import (
    Experiment,
    RandomRouteConfig,
    RouteConfig,
    geodetic_route,
    metres_from_route,
    route_from_metres,
)
from fieldtruth.experiment.environment_file import is_environment_file, world_name
from fieldtruth.experiment.files import load_experiment, validated
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import Heightfield, World


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
        route = route_from_metres(corners[0].tolist(), corners[1:].tolist(), self._world.origin)
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


def plan_route(world: World, experiment: Experiment, *, verify: bool = True) -> RouteConfig:
    """Return the waypoints that ``experiment`` drives in ``world``: its own, checked, or those of a random route.

    Checked are each waypoint and the spacing, the straight lines between them, and the path of the follower, which cuts
    corners. The result depends on the world and the experiment only, not on ``experiment.seconds``.

    Args:
        world: the world to drive in.
        experiment: supplies route, control and rig.
        verify: drive a random route in the physics simulation while it is planned (some 20 s for 150 m): on rough
            ground the robot skids farther from the expected path than the kinematic simulation predicts.

    Raises:
        RouteError: a waypoint or a leg that the robot cannot take, with its number and the obstacle; or no free route
            of the requested length, with the longest that was found.
    """
    route, _ = _planned(world, experiment, verify=verify)
    return route


def expected_seconds(experiment: Experiment) -> float | None:
    """Return the simulated time [s] of a drive at full speed along straight legs; None without a route."""
    if experiment.route is None or experiment.seconds is not None:
        return experiment.seconds
    if isinstance(experiment.route, RandomRouteConfig):
        length = experiment.route.random.length_m
    else:
        corners = metres_from_route(experiment.route, experiment.origin)
        length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
    return length / experiment.control.speed


def plan_and_drive(world: World, experiment: Experiment, advance: Advance | None = None) -> Track:
    """Plan the route as ``plan_route`` does, and drive it for ``experiment.seconds``.

    A random route is driven while it is planned, and that drive is the result. ``advance`` receives the simulated time
    [s] that was driven.

    Raises:
        RouteError: as ``plan_route``.
        DriveError: the robot cannot drive the given waypoints.
    """
    done = None if advance is None else _increments(advance)
    route, track = _planned(world, experiment, verify=True, progress=done)
    if track is None or experiment.seconds is not None:
        return drive(world, experiment.model_copy(update={"route": route}), progress=done)
    return track


def _increments(advance: Advance) -> Callable[[float], None]:
    """Report the time that was reached, of drives that go back, as what is new of it."""
    reached = 0.0

    def report(time_s: float) -> None:
        nonlocal reached
        advance(max(0.0, time_s - reached))
        reached = max(reached, time_s)

    return report


def _planned(
    world: World, experiment: Experiment, *, verify: bool, progress: Callable[[float], None] | None = None
) -> tuple[RouteConfig, Track | None]:
    """Return the route and, if it is a random one that was verified, the track of the whole of it."""
    route, rig = experiment.route, experiment.rig
    free = world_through(world, experiment.plan.through, rig.robot.ground_clearance)
    ground, simulator = Traversability(free, rig), KinematicSimulator(experiment, world.terrain.field)
    if not isinstance(route, RandomRouteConfig):
        planned = geodetic_route(route, world.origin)
        check_route(ground, simulator, metres_from_route(planned, world.origin))
        return planned, None
    rng = np.random.default_rng(route.random.seed)
    trial, longest = TrialDrive(world, experiment, progress) if verify else None, 0.0
    reached = None if trial is None else trial.reached
    for corners, length in RandomRoutePlanner(ground, simulator, route.random.length_m, rng, reached).proposals():
        longest = max(longest, length)
        if corners is None:
            continue
        planned = route_from_metres(corners[0].tolist(), corners[1:].tolist(), world.origin)
        with suppress(RouteError, DriveError):
            check_route(ground, simulator, metres_from_route(planned, world.origin))
            return planned, None if trial is None else trial.finish()
    raise RouteError(
        f"no free route of {route.random.length_m:g} m found in {world.name} (seed {world.seed}); "
        f"the longest that was found is {longest:.0f} m"
    )


def experiments_in(environment: str) -> list[Experiment]:
    """Return the built-in experiments of an environment, not living ones, by name; of a file, a random one."""
    if is_environment_file(environment):
        return [validated({"name": world_name(environment), "environment": environment}, environment)]
    experiments = map(load_experiment, EXPERIMENTS)
    return [each for each in experiments if each.environment == environment and not each.is_living]


def expected_path(experiment: Experiment, world: World) -> Array:
    """Return the expected poses, every few centimetres: (n, 3) of x, y [m] and heading [rad], from start to end.

    Raises:
        RouteError: no free random route was found.
    """
    route = plan_route(world, experiment) if isinstance(experiment.route, RandomRouteConfig) else experiment.route
    legs, _ = KinematicSimulator(experiment).drive_route(metres_from_route(route, world.origin))
    return np.concatenate(legs)


def poses_along(path: Array, spacing: float) -> Array:
    """Return rows (m, 3) of a path (n, 3), one every ``spacing`` [m], the first at half of that."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1))])
    at = np.arange(spacing / 2, max(arc[-1], spacing), spacing)
    return path[np.minimum(np.searchsorted(arc, at), len(path) - 1)]


def pose_on_ground(field: Heightfield, pose: Array, rig: Rig) -> Array:
    """Return world_from_base (4, 4) of a robot at rest on the ground at x, y [m] with a heading [rad]."""
    x, y, heading = pose
    return transforms.pose_from_quaternion_wxyz(*resting_pose(field, np.array([x, y]), float(heading), rig))
