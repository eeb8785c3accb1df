# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conversion of routes between metres and degrees."""

import numpy as np
import yaml

from fieldtruth.experiment.config import RouteConfig, metres_from_route, route_from_metres, route_yaml


def test_round_trip_of_metres_and_degrees_is_within_a_tenth_of_a_millimetre() -> None:
    metres = [(-33.0, -6.0), (0.0, 0.0), (49.9, 24.9)]
    route = route_from_metres(metres[0], metres[1:])
    assert np.abs(metres_from_route(route) - metres).max() < 1e-4
    assert route.waypoints[0] == (49.9, 8.9)  # the world's origin


def test_latitude_increases_northwards_and_longitude_decreases_westwards() -> None:
    route = route_from_metres((0, 0), [(10, 10)])
    (latitude, longitude), metre = route.waypoints[0], 180 / np.pi / 6_378_137
    assert abs(latitude - 49.9 - 10 * metre) < 1e-6
    assert abs(longitude - 8.9 + 10 * metre / np.cos(np.radians(49.9))) < 1e-6


def test_printed_route_parses_to_the_same_route() -> None:
    route = route_from_metres((-33, -6), [(-22, -3.5), (0, 0)])
    text = route_yaml(route)
    assert RouteConfig.model_validate(yaml.safe_load(text)["route"]) == route
    assert "# x -22.0 m, y  -3.5 m" in text
    assert "-0.0" not in text
