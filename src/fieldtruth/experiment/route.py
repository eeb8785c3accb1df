# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion between the forms of a route: metres in the world frame, geodetic (as in the paper), random.

Print a route given in metres in its geodetic form::

    print(fieldtruth.route_yaml(fieldtruth.route_from_metres((-33, -6), [(-22, -3), (-10, 2)])))
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from fieldtruth.core import geodesy
from fieldtruth.core.errors import RouteError
from fieldtruth.experiment.config import MetresRouteConfig, RandomConfig, RandomRouteConfig, Route, RouteConfig

DECIMALS: Final = 9
"""Decimals of a degree: 0.1 mm on the ground."""


def route_from_metres(start: Sequence[float], waypoints: Sequence[Sequence[float]]) -> RouteConfig:
    """Make a geodetic route of points (x north, y west) [m] in the world frame, at the height of its origin."""
    points = np.array([start, *waypoints], np.float64)
    geodetic = geodesy.geodetic_from_world(np.column_stack([points, np.zeros(len(points))]))
    pairs = [
        (round(float(latitude), DECIMALS), round(float(longitude), DECIMALS)) for latitude, longitude, _ in geodetic
    ]
    return RouteConfig(start=pairs[0], waypoints=tuple(pairs[1:]))


def random_route(length_m: float, seed: int) -> RandomRouteConfig:
    """Make a random route of this length [m]; another seed gives another route through the same world."""
    return RandomRouteConfig(random=RandomConfig(length_m=length_m, seed=seed))


def geodetic_route(route: Route | None) -> RouteConfig:
    """Return the route with its points in degrees.

    Raises:
        RouteError: no route, as in an experiment with a track file; or a random one, which must be planned first.
    """
    if route is None:
        raise RouteError("the experiment has no route: it follows a track file, or makes frames on free ground")
    if isinstance(route, RandomRouteConfig):
        raise RouteError(
            "a random route has no waypoints before it is planned; call fieldtruth.plan_route(world, experiment)"
        )
    if isinstance(route, MetresRouteConfig):
        return route_from_metres(route.metres.start, route.metres.waypoints)
    return route


def metres_from_route(route: Route | None) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Start and n waypoints (1 + n, 2) of a route as x, y [m] in the world frame.

    Raises:
        RouteError: as for ``geodetic_route``.
    """
    if isinstance(route, MetresRouteConfig):
        return np.array([route.metres.start, *route.metres.waypoints], np.float64)
    route = geodetic_route(route)
    points = np.array([route.start, *route.waypoints], np.float64)
    return geodesy.world_from_geodetic(np.column_stack([points, np.zeros(len(points))]))[:, :2]


def route_yaml(route: RouteConfig) -> str:
    """Return the ``route:`` part of an experiment file, each point with its x, y [m] in a comment."""
    pairs = [route.start, *route.waypoints]
    metres = np.round(metres_from_route(route), 1) + 0.0  # no -0.0
    texts = [
        f"[{latitude:.{DECIMALS}f}, {longitude:.{DECIMALS}f}]  # x {x:5.1f} m, y {y:5.1f} m"
        for (latitude, longitude), (x, y) in zip(pairs, metres, strict=True)
    ]
    return (
        "\n".join(["route:", f"  start: {texts[0]}", "  waypoints:", *(f"    - {text}" for text in texts[1:])]) + "\n"
    )
