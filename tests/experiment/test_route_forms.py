# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The three forms of a route (degrees, metres, random): round trip and one-line errors."""

import numpy as np
import pytest

from fieldtruth import RandomRouteConfig, RouteConfig, route_from_metres
from fieldtruth.core.errors import ConfigurationError, RouteError
from fieldtruth.experiment.config import Experiment, MetresRouteConfig, geodetic_route, metres_from_route, random_route
from fieldtruth.experiment.files import dump_experiment, parse_experiment, with_overrides

FORMS = (
    "one of {start: ..., waypoints: ...}, {metres: {start: ..., waypoints: ...}}, {random: {length_m: ..., seed: ...}}"
)


def experiment(route: str) -> Experiment:
    return parse_experiment(f"name: a\nenvironment: park\nroute: {route}\n", "a.yaml")


METRES = "{metres: {start: [-33, -6], waypoints: [[-17, -3.5], [1, 3]]}}"
RANDOM = "{random: {length_m: 150, seed: 3}}"
DEGREES = "{start: [49.9, 8.9], waypoints: [[49.9001, 8.9]]}"


@pytest.mark.parametrize(
    ("text", "kind"), [(DEGREES, RouteConfig), (METRES, MetresRouteConfig), (RANDOM, RandomRouteConfig)]
)
def test_each_form_survives_dump_and_load(text: str, kind: type) -> None:
    read = experiment(text)
    assert type(read.route) is kind
    assert parse_experiment(dump_experiment(read)) == read
    assert with_overrides(read, seed=4).route == read.route


def test_forms_have_the_values_of_the_file() -> None:
    np.testing.assert_array_equal(metres_from_route(experiment(METRES).route), [(-33, -6), (-17, -3.5), (1, 3)])
    assert geodetic_route(experiment(METRES).route) == route_from_metres((-33, -6), [(-17, -3.5), (1, 3)])
    assert geodetic_route(experiment(DEGREES).route) == experiment(DEGREES).route
    assert experiment(RANDOM).route == random_route(150, seed=3)
    assert "length_m: 150.0\n    seed: 3\n" in dump_experiment(experiment(RANDOM))


def test_random_route_has_no_points_before_it_is_planned() -> None:
    with pytest.raises(RouteError, match=r"fieldtruth\.plan_route"):
        metres_from_route(random_route(150, seed=3))


BAD_ROUTES = [
    ("4", f"route must be {FORMS}, got 4"),
    ("null", f"route is required: {FORMS}; or drive: {{track: FILE}}, or frames: {{count: NUMBER}}"),
    (
        "{random: {length_m: 150, seed: 3}, start: [49, 8]}",
        f"route must be {FORMS}, got {{'random': {{'length_m': 150, 'seed': 3}}, 'start': [49, 8]}}",
    ),
    (
        "{randm: {seed: 3}}",
        "unknown key 'route.randm'; did you mean 'route.random'? Available: start, waypoints, metres, random "
        "(and 2 more)",
    ),
    ("{random: 4}", "route.random must be a mapping with the keys length_m, seed, got 4"),
    ("{random: {length_m: 5, seed: 3}}", "route.random.length_m must be a number between 20 and 5000, got 5"),
    (
        "{random: {length_m: 50, seed: -3}}",
        "route.random.seed must be an integer between 0 and 9223372036854775807, got -3",
    ),
    (
        "{random: {length: 50, seed: 3}}",
        "unknown key 'route.random.length'; did you mean 'route.random.length_m'? Available: length_m, seed "
        "(and 1 more)",
    ),
    ("{metres: {start: [0, 1]}}", "route.metres.waypoints is required: a list with at least one [x, y] in metres"),
    (
        "{metres: {start: [0, 1], waypoints: []}}",
        "route.metres.waypoints must be a list with at least one [x, y] in metres, got []",
    ),
    (
        "{metres: {start: [0, .nan], waypoints: [[1, 2]]}}",
        "route.metres.start[1] must be a number between -10000 and 10000, got nan",
    ),
    (
        "{metres: {start: [0, 1], waypoints: [[1, 2, 3]]}}",
        "route.metres.waypoints[0] must be a list of 2 numbers, got [1, 2, 3] (and 1 more)",
    ),
    ("{}", "route.start is required: [latitude, longitude] in degrees (and 1 more)"),
]


@pytest.mark.parametrize(("text", "message"), BAD_ROUTES, ids=[text for text, _ in BAD_ROUTES])
def test_invalid_route_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        experiment(text)
    assert str(refusal.value) == f"a.yaml: {message}"


def test_missing_route_reports_the_forms() -> None:
    with pytest.raises(ConfigurationError) as refusal:
        parse_experiment("{name: a, environment: park}")
    assert str(refusal.value) == f"route is required: {FORMS}; or drive: {{track: FILE}}, or frames: {{count: NUMBER}}"
