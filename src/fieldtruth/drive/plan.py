# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Route planning before the drive: check the given waypoints against the world, or find a random route."""

import contextlib
from collections.abc import Callable

import numpy as np

from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.core.progress import Advance
from fieldtruth.drive.kinematics import KinematicSimulator
from fieldtruth.drive.random_route import RandomRoutePlanner
from fieldtruth.drive.route_check import check_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.track import Track
from fieldtruth.drive.traversability import Traversability
from fieldtruth.drive.trial import TrialDrive
from fieldtruth.experiment.config import Experiment, RandomRouteConfig, RouteConfig
from fieldtruth.experiment.route import geodetic_route, metres_from_route, route_from_metres
from fieldtruth.world.model import World


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
        corners = metres_from_route(geodetic_route(experiment.route))
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
    ground, simulator = Traversability(world, experiment.rig), KinematicSimulator(experiment, world.terrain.field)
    route = experiment.route
    if not isinstance(route, RandomRouteConfig):
        planned = geodetic_route(route)
        check_route(ground, simulator, metres_from_route(planned))
        return planned, None
    rng = np.random.default_rng(route.random.seed)
    trial, longest = TrialDrive(world, experiment, progress) if verify else None, 0.0
    reached = None if trial is None else trial.reached
    for corners, length in RandomRoutePlanner(ground, simulator, route.random.length_m, rng, reached).proposals():
        longest = max(longest, length)
        if corners is None:
            continue
        planned = route_from_metres(corners[0].tolist(), corners[1:].tolist())
        with contextlib.suppress(RouteError, DriveError):
            check_route(ground, simulator, metres_from_route(planned))
            return planned, None if trial is None else trial.finish()
    raise RouteError(
        f"no free route of {route.random.length_m:g} m found in {world.name} (seed {world.seed}); "
        f"the longest that was found is {longest:.0f} m"
    )
