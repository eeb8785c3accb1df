# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A route that cannot be driven is rejected before the run, with the waypoint, its position and the obstacle."""

import re

import numpy as np
import pytest
from drive_worlds import F8, make_experiment, make_world, obstacle, tilted, with_stones
from sense_worlds import at, box

import fieldtruth
from fieldtruth.core.errors import DriveError, FieldtruthError, RouteError
from fieldtruth.drive.plan import plan_route
from fieldtruth.drive.simulate import drive
from fieldtruth.experiment.config import ControlConfig, Experiment, metres_from_route, random_route
from fieldtruth.experiment.files import load_experiment, parse_experiment
from fieldtruth.experiment.names import EXPERIMENTS
from fieldtruth.world.model import World

POST = obstacle("post_7", "cylinder", (0.3, 2.0), 6.0, 0.0)


def rejection(world: World, *waypoints: tuple[float, float], **changes: object) -> str:
    with pytest.raises(RouteError) as caught:
        plan_route(world, make_experiment(waypoints, **changes))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, FieldtruthError)
    return str(caught.value)


def test_free_route_is_returned_unchanged(flat_world: World) -> None:
    experiment = make_experiment([(6.0, 0.0), (12.0, 3.0)])
    assert plan_route(flat_world, experiment) == experiment.route


def test_route_in_metres_is_returned_in_degrees() -> None:
    text = "{name: a, environment: park, route: {metres: {start: [0, 0], waypoints: [[6, 1], [12, 3]]}}}"
    planned = plan_route(make_world(), parse_experiment(text))
    np.testing.assert_allclose(metres_from_route(planned), [(0, 0), (6, 1), (12, 3)], atol=1e-4)


def test_waypoint_in_an_obstacle_is_rejected() -> None:
    text = rejection(make_world(obstacles=[POST]), (4.0, 4.0), (6.0, 0.1), (10.0, 0.0))
    assert text == "waypoint 2 of 3 at x 6.0 m, y 0.1 m is in post_7; move it to free ground"
    text = rejection(make_world(obstacles=[POST]), (12.0, 0.0), start=(6.1, 0.0))
    assert text == "the start at x 6.1 m, y 0.0 m is in post_7; move it to free ground"


def test_high_stone_is_rejected_by_the_name_of_its_swarm_and_a_low_one_is_driven_over() -> None:
    stones = [box("high", [0.1, 0.1, 0.12], "rock_granite"), box("low", [0.1, 0.1, 0.06], "rock_granite")]
    text = rejection(with_stones(make_world(), stones, [0], at(6.0, 0.2, 0.0)[None]), (10.0, 0.0))
    assert text.startswith(
        "the leg from the start to waypoint 1 passes an object of swarm stones at a distance of 0.10 m"
    )
    experiment = make_experiment([(10.0, 0.0)])
    world = with_stones(make_world(), stones, [1], at(6.0, 0.2, 0.0)[None])
    assert plan_route(world, experiment) == experiment.route


def test_waypoint_outside_the_world_or_near_its_edge_is_rejected(flat_world: World) -> None:
    for x in (19.0, 24.0):
        text = rejection(flat_world, (10.0, 0.0), (x, 0.0))
        assert text == (
            f"waypoint 2 of 2 at x {x:.1f} m, y 0.0 m is outside the world or less than 1.5 m from its edge"
        )


def test_waypoints_must_be_1_to_25_m_apart(flat_world: World) -> None:
    text = rejection(flat_world, (5.0, 0.0), (5.5, 0.0))
    assert text == "waypoint 2 of 2 at x 5.5 m, y 0.0 m must be between 1 and 25 m from the previous one, got 0.50 m"
    text = rejection(flat_world, (12.0, 0.0), start=(-14.0, 0.0))
    assert text == "waypoint 1 of 1 at x 12.0 m, y 0.0 m must be between 1 and 25 m from the start, got 26.00 m"
    plan_route(flat_world, make_experiment([(5.0, 0.0), (-18.0, 0.0), (-17.0, 0.0)]))


def test_leg_too_close_to_an_obstacle_is_rejected_with_the_distance() -> None:
    world = make_world(obstacles=[POST])
    text = rejection(world, (-4.0, 0.4), (12.0, 0.4), start=(-10.0, 0.4))
    assert text == (
        "the leg from waypoint 1 to 2 passes post_7 at a distance of 0.10 m, at x 6.0 m, y 0.4 m; "
        "the robot needs 0.40 m"
    )
    plan_route(world, make_experiment([(-4.0, 0.75), (12.0, 0.75)], start=(-10.0, 0.75)))
    text = rejection(world, (12.0, 0.0))
    assert text.startswith("the leg from the start to waypoint 1 passes post_7 at a distance of 0.00 m")


def test_corner_cut_through_an_obstacle_is_rejected() -> None:
    bin_inside = obstacle("bin_1", "cylinder", (0.2, 1.0), 8.8, 0.7)
    text = rejection(make_world(obstacles=[bin_inside]), (10.0, 0.0), (10.0, 8.0))
    assert re.match(
        r"on the leg from waypoint 1 to 2 the robot cuts the corner and comes within 0\.\d\d m of bin_1, at x 8\.\d",
        text,
    )
    route = make_experiment([(10.0, 0.0), (10.0, 8.0)])
    with pytest.raises(DriveError, match="touched bin_1"):
        drive(make_world(obstacles=[bin_inside]), route)


def test_legs_through_water_and_over_steep_ground_are_rejected() -> None:
    def trough(x: F8, y: F8) -> F8:
        return 0.02 * np.minimum(np.abs(x - 5.0), 5.0) + 0.0 * y

    text = rejection(make_world(trough, water_level=0.01), (10.0, 0.0))
    assert text.startswith("the leg from the start to waypoint 1 is in the water, at x 2.")
    assert "is in the water" in rejection(make_world(trough, water_level=0.01), (5.0, 0.0))
    text = rejection(make_world(tilted(25.0, 0.0)), (10.0, 0.0))
    assert text == "the start at x 0.0 m, y 0.0 m is on a slope of more than 20 deg"


def test_waypoint_that_the_robot_would_circle_is_rejected() -> None:
    control = ControlConfig(speed=1.0, max_turn_rate=0.6, arrival_distance=0.5)
    text = rejection(make_world(), (3.0, 0.0), (3.0, 2.0), control=control)
    assert text.startswith("the robot cannot reach waypoint 2 of 2 at x 3.0 m, y 2.0 m, it circles it; ")


def test_random_route_must_be_planned_before_the_drive(flat_world: World) -> None:
    experiment = make_experiment([(5.0, 0.0)]).model_copy(update={"route": random_route(50, 0)})
    with pytest.raises(RouteError, match="has no waypoints before it is planned"):
        drive(flat_world, experiment)


def test_drive_into_water_is_an_error() -> None:
    with pytest.raises(DriveError, match=r"^robot in the water at .* s, x, y = 3\.\d\d, .* waypoint 1 of 1$"):
        drive(make_world(tilted(-2.0, 0.0), water_level=-0.12), make_experiment([(10.0, 0.0)]))


DEFAULT = ("park_1",)


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in DEFAULT else pytest.mark.slow) for n in EXPERIMENTS])
def test_built_in_routes_pass_the_check(name: str) -> None:
    experiment: Experiment = load_experiment(name)
    world = fieldtruth.load_world(experiment.environment, experiment.seed)
    assert plan_route(world, experiment) == experiment.route
