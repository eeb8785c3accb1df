# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A route in degrees, in metres, or asked for by its length: read, written, and refused in one line."""

import numpy as np
import pytest

from fieldtruth import RandomRouteConfig, RouteConfig, route_from_metres
from fieldtruth.core.errors import ConfigurationError, RouteError
from fieldtruth.experiment.config import Experiment, MetresRouteConfig
from fieldtruth.experiment.files import dump_experiment, parse_experiment, with_overrides
from fieldtruth.experiment.route import geodetic_route, metres_from_route, random_route

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
def test_each_form_survives_being_written_and_read(text: str, kind: type) -> None:
    read = experiment(text)
    assert type(read.route) is kind
    assert parse_experiment(dump_experiment(read)) == read
    assert with_overrides(read, seed=4).route == read.route


def test_the_forms_say_what_was_written() -> None:
    np.testing.assert_array_equal(metres_from_route(experiment(METRES).route), [(-33, -6), (-17, -3.5), (1, 3)])
    assert geodetic_route(experiment(METRES).route) == route_from_metres((-33, -6), [(-17, -3.5), (1, 3)])
    assert geodetic_route(experiment(DEGREES).route) == experiment(DEGREES).route
    assert experiment(RANDOM).route == random_route(150, seed=3)
    assert "length_m: 150.0\n    seed: 3\n" in dump_experiment(experiment(RANDOM))


def test_a_random_route_has_no_points_before_it_is_planned() -> None:
    with pytest.raises(RouteError, match=r"fieldtruth\.plan_route"):
        metres_from_route(random_route(150, seed=3))


BAD_ROUTES = [
    ("4", f"route is 4; allowed is {FORMS}"),
    ("null", f"route is None; allowed is {FORMS}"),
    (
        "{random: {length_m: 150, seed: 3}, start: [49, 8]}",
        f"route is {{'random': {{'length_m': 150, 'seed': 3}}, 'start': [49, 8]}}; allowed is {FORMS}",
    ),
    (
        "{randm: {seed: 3}}",
        "no key 'route.randm'; there is: route.random, route.waypoints, route.start, route.metres (and 2 more)",
    ),
    ("{random: 4}", "route.random is 4; allowed is a mapping with the keys length_m, seed"),
    ("{random: {length_m: 5, seed: 3}}", "route.random.length_m is 5; allowed is a number from 20 up to 5000"),
    (
        "{random: {length_m: 50, seed: -3}}",
        "route.random.seed is -3; allowed is a whole number from 0 below 9223372036854775808",
    ),
    (
        "{random: {length: 50, seed: 3}}",
        "no key 'route.random.length'; there is: route.random.length_m, route.random.seed (and 1 more)",
    ),
    (
        "{metres: {start: [0, 1]}}",
        "route.metres.waypoints is missing; needed is a list of at least one [x, y] in metres",
    ),
    (
        "{metres: {start: [0, 1], waypoints: []}}",
        "route.metres.waypoints is []; allowed is a list of at least one [x, y] in metres",
    ),
    (
        "{metres: {start: [0, .nan], waypoints: [[1, 2]]}}",
        "route.metres.start[1] is nan; allowed is a number from -10000 up to 10000",
    ),
    (
        "{metres: {start: [0, 1], waypoints: [[1, 2, 3]]}}",
        "route.metres.waypoints[0] is [1, 2, 3]; allowed is a list of 2 numbers (and 1 more)",
    ),
    ("{}", "route.start is missing; needed is [latitude, longitude] in degrees (and 1 more)"),
]


@pytest.mark.parametrize(("text", "complaint"), BAD_ROUTES, ids=[text for text, _ in BAD_ROUTES])
def test_a_bad_route_is_refused_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(ConfigurationError) as refusal:
        experiment(text)
    assert str(refusal.value) == f"a.yaml: {complaint}"


def test_a_missing_route_names_the_forms() -> None:
    with pytest.raises(ConfigurationError) as refusal:
        parse_experiment("{name: a, environment: park}")
    assert str(refusal.value) == f"route is missing; needed is {FORMS}"
