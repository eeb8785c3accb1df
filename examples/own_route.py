# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Drive a route of your own through the park, LiDAR only: python own_route.py [OUT [SECONDS]]."""

import sys

import fieldtruth as ft

START = (-33.0, -6.0)  # x north, y west [m]; the origin is the middle of the world
WAYPOINTS = [(-22.0, -3.0), (-10.0, 2.0), (0.0, 0.0)]


def main(out: str = "data", seconds: str | None = None) -> None:
    """Check the route against the world before driving, then drive it."""
    route = ft.route_from_metres(START, WAYPOINTS)
    experiment = ft.Experiment(
        name="my_route",
        environment="park",
        route=route,
        seconds=None if seconds is None else float(seconds),
    )
    experiment = ft.with_overrides(experiment, cameras=False)
    world = ft.load_world(experiment.environment, experiment.seed)
    ft.plan_route(world, experiment)  # raises RouteError: which waypoint is blocked, where, by what
    print(ft.route_yaml(route), end="")  # paste it into an experiment's file

    bag = ft.generate(experiment, out)
    print(f"{ft.open_run(bag).duration_s:.1f} s in {bag}")


if __name__ == "__main__":
    main(*sys.argv[1:])
