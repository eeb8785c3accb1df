# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The route before the drive: found, where the program is to find one, and checked against the world in any case."""

import numpy as np

from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.drive.kinematics import KinematicSimulator
from fieldtruth.drive.random_route import wander
from fieldtruth.drive.route_check import check_route
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.traversability import traversability
from fieldtruth.experiment.config import Experiment, RandomRouteConfig, RouteConfig
from fieldtruth.experiment.route import geodetic_route, metres_from_route, route_from_metres
from fieldtruth.world.model import World


def plan_route(world: World, experiment: Experiment, *, proven: bool = True) -> RouteConfig:
    """The way-points that ``experiment`` drives in ``world``: its own, checked, or those that the program finds.

    Checked are every way-point and the spacing, the straight lines between them, and the path of the follower, which
    cuts corners. A route that the program finds is also driven to its end in the physics before it is handed out
    (some 20 s for 150 m), unless ``proven`` is off: on rough ground the robot skids farther from the expected path than
    any rehearsal tells. Same world, same experiment, same route, whatever ``experiment.seconds`` says.

    Raises:
        RouteError: a way-point or a way that the robot cannot take, by its number, with what is in the way; or no free
            route of the wished length, with the longest that was found.
    """
    ground, rehearsal = traversability(world), KinematicSimulator(experiment, world.terrain.field)
    route = experiment.route
    if not isinstance(route, RandomRouteConfig):
        planned = geodetic_route(route)
        check_route(ground, rehearsal, metres_from_route(planned))
        return planned
    rng = np.random.default_rng(route.random.seed)
    longest = 0.0
    for corners, length in wander(ground, rehearsal, route.random.length_m, rng):
        longest = max(longest, length)
        if corners is None:
            continue
        planned = route_from_metres(corners[0].tolist(), corners[1:].tolist())
        try:
            check_route(ground, rehearsal, metres_from_route(planned))
        except RouteError:
            continue
        if not proven or _arrives(world, experiment, planned):
            return planned
    raise RouteError(
        f"no free route of {route.random.length_m:g} m found in {world.name} (seed {world.seed}); "
        f"the longest that was found is {longest:.0f} m"
    )


def _arrives(world: World, experiment: Experiment, route: RouteConfig) -> bool:
    try:
        drive(world, experiment.model_copy(update={"route": route, "seconds": None}))
    except DriveError:
        return False
    return True
