# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Random routes are free, of the requested length, drivable to their end, and the same for the same seed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from drive_worlds import F8, make_experiment, make_world, obstacle, tilted

import fieldtruth
from fieldtruth import pipeline
from fieldtruth.core.errors import DriveError, RouteError
from fieldtruth.drive.controller import KinematicSimulator
from fieldtruth.drive.plan import TrialDrive, expected_seconds, plan_and_drive, plan_route
from fieldtruth.drive.routes import RouteGrid
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.config import ControlConfig, Experiment, RouteConfig, metres_from_route, random_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.world.model import World


def random_experiment(length_m: float, seed: int, **changes: object) -> Experiment:
    route = random_route(length_m, seed)
    return make_experiment([(5.0, 0.0)], **changes).model_copy(update={"route": route})  # type: ignore[arg-type]


def path_of(route: RouteConfig, experiment: Experiment, world: World | None = None) -> F8:
    field = None if world is None else world.terrain.field
    legs, endless = KinematicSimulator(experiment, field).drive_route(metres_from_route(route))
    assert endless is None
    return np.concatenate(legs)


def path_length(path: F8) -> float:
    """Length [m] in plan view."""
    return float(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum())


def forest(count: int = 60, free: Sequence[tuple[float, float]] = ()) -> World:
    """Trunks at random positions."""
    rng = np.random.default_rng(5)
    points = [p for p in rng.uniform((-19, -9), (19, 9), (count, 2)) if all(np.hypot(*(p - f)) > 1.5 for f in free)]
    trunks = [obstacle(f"tree_{k}", "cylinder", (0.2, 5.0), float(x), float(y)) for k, (x, y) in enumerate(points)]
    return make_world(obstacles=trunks)


@pytest.mark.parametrize(("length", "speed"), [(20.0, 1.0), (50.0, 0.3), (200.0, 1.0)])
def test_length_is_as_requested_and_waypoints_are_5_to_20_m_apart(length: float, speed: float) -> None:
    experiment = random_experiment(length, 1, control=ControlConfig(speed=speed))
    route = plan_route(make_world(), experiment, verify=False)
    assert path_length(path_of(route, experiment)) == pytest.approx(length, rel=0.02)
    spacing = np.linalg.norm(np.diff(metres_from_route(route), axis=0), axis=1)
    assert spacing.max() <= 20.0
    assert np.median(spacing) >= 5.0


@pytest.mark.slow
def test_length_on_a_slope_is_measured_along_the_ground() -> None:
    world, experiment = make_world(tilted(15.0, 0.0)), random_experiment(30.0, 1)
    route = plan_route(world, experiment, verify=False)
    assert path_length(path_of(route, experiment, world)) < 29.5
    track = drive(world, experiment.model_copy(update={"route": route}))
    assert track.length_m == pytest.approx(30.0, rel=0.02)


def test_same_seed_gives_same_route_and_other_seed_another() -> None:
    world = forest()
    routes = [plan_route(world, random_experiment(40.0, seed), verify=False) for seed in (3, 3, 4)]
    assert routes[0] == routes[1]
    assert len({route.start for route in routes}) == 2


def test_path_keeps_its_gap_to_every_trunk() -> None:
    world = forest()
    trunks = np.array([i.world_from_object[:2, 3] for i in world.instances])
    for seed in range(2):
        experiment = random_experiment(80.0, seed)
        path = path_of(plan_route(world, experiment, verify=False), experiment)
        away = np.linalg.norm(path[:, None, :2] - trunks, axis=-1).min()
        assert away > 0.2 + 0.335 + 0.15  # the trunk's radius, half the robot's width, and a gap
        assert (np.abs(path[:, :2]) < (18.5, 8.5)).all()


def test_path_passes_through_a_gap_in_a_wall() -> None:
    """A wall along y at x = 0 from edge to edge with a gap of 2 m about y = 4."""
    wall = [
        obstacle("south", "box", (0.3, 13.0, 1.0), 0.0, -3.5),
        obstacle("north", "box", (0.3, 5.0, 1.0), 0.0, 7.5),
    ]
    world = make_world(obstacles=wall)
    for seed in range(2):
        experiment = random_experiment(120.0, seed)
        path = path_of(plan_route(world, experiment, verify=False), experiment)
        crossing = path[1:][np.diff(np.sign(path[:, 0])) != 0]
        assert len(crossing)
        assert (np.abs(crossing[:, 1] - 4.0) < 1.0 - 0.335 - 0.2 + 1e-3).all()  # half the robot's width and its gap


def test_path_visits_all_quarters_of_the_world() -> None:
    experiment = random_experiment(300.0, 2)
    path = path_of(plan_route(make_world(size=(60.0, 40.0)), experiment, verify=False), experiment)
    quarters = {(x > 0, y > 0) for x, y in path[:, :2]}
    assert len(quarters) == 4
    assert np.ptp(path[:, 0]) > 40.0
    assert np.ptp(path[:, 1]) > 22.0


@pytest.mark.slow
def test_error_states_the_longest_route_that_was_found() -> None:
    """A corridor 2 m wide, too narrow to turn, and 36 m long: 20 m fit, 60 m do not."""
    walls = [obstacle(f"wall_{k}", "box", (40.0, 8.0, 1.0), 0.0, y) for k, y in enumerate((-5.0, 5.0))]
    world = make_world(obstacles=walls)
    path = path_of(plan_route(world, random_experiment(20.0, 0), verify=False), random_experiment(20.0, 0))
    assert np.abs(path[:, 1]).max() < 0.4
    with pytest.raises(RouteError) as caught:
        plan_route(world, random_experiment(60.0, 0), verify=False)
    text = str(caught.value)
    assert text.startswith("no free route of 60 m found in test (seed 0); the longest that was found is ")
    assert 18.0 < float(text.split()[-2]) < 37.0


def test_world_without_free_ground_is_rejected() -> None:
    with pytest.raises(RouteError, match="the longest that was found is 0 m"):
        plan_route(
            make_world(obstacles=[obstacle("rock", "box", (50.0, 50.0, 1.0), 0.0, 0.0)]), random_experiment(20.0, 0)
        )


@pytest.mark.slow
def test_random_route_in_the_park_is_driven_to_its_end() -> None:
    world = fieldtruth.load_world("park", 0)
    experiment = load_experiment("park_1").model_copy(update={"route": random_route(40.0, 0)})
    route = plan_route(world, experiment, verify=False)
    track = drive(world, experiment.model_copy(update={"route": route}))  # a collision would be a DriveError
    assert track.length_m == pytest.approx(40.0, rel=0.02)
    path = path_of(route, experiment, world)
    away = np.linalg.norm(track.motion.position[::500, None, :2] - path[None, :, :2], axis=-1).min(axis=1)
    assert away.max() < 0.15


@pytest.mark.parametrize("seconds", [pytest.param(None, marks=pytest.mark.slow), 1.0])
def test_the_drive_of_the_planning_is_the_result_and_a_shorter_run_is_its_beginning(seconds: float | None) -> None:
    world, quick = make_world(), ControlConfig(speed=1.0)
    experiment = random_experiment(20.0, 3, control=quick).model_copy(update={"seconds": seconds})
    route = plan_route(world, experiment, verify=False)
    expected = drive(world, experiment.model_copy(update={"route": route}))
    advanced = list[float]()
    track = plan_and_drive(world, experiment, advanced.append)
    np.testing.assert_array_equal(track.motion.position, expected.motion.position)
    assert min(advanced) >= 0.0
    assert sum(advanced) == pytest.approx(20.0, abs=2.0)
    assert expected_seconds(experiment) == (seconds or 20.0)


@pytest.mark.slow
def test_a_run_with_a_random_route_keeps_the_original_experiment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_scene(*_: object) -> None:
        raise DriveError("enough")

    monkeypatch.setattr(pipeline, "sensor_factory", no_scene)
    experiment = random_experiment(20.0, 3).model_copy(update={"environment": "park"})
    with pytest.raises(DriveError, match="enough"):
        pipeline.generate(experiment, tmp_path, world=make_world())
    assert load_experiment(tmp_path / "test" / "experiment.yaml") == experiment


def test_waypoints_that_are_not_reached_are_planned_anew_and_those_before_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The whole route is driven, even if the experiment ends earlier."""
    world, tried = make_world(), list[F8]()
    experiment = random_experiment(80.0, 3).model_copy(update={"seconds": 1.0})
    first = metres_from_route(plan_route(world, experiment, verify=False))

    def all_but_the_third_at_first(_: TrialDrive, corners: F8) -> int:
        tried.append(corners)
        return 2 if len(tried) == 1 else len(corners) - 1

    monkeypatch.setattr(TrialDrive, "reached", all_but_the_third_at_first)
    monkeypatch.setattr(TrialDrive, "finish", lambda _: None)
    route = metres_from_route(plan_route(world, experiment))
    assert len(tried[0]) == 4
    np.testing.assert_allclose(route, tried[-1], atol=1e-3)
    np.testing.assert_allclose(route[:3], first[:3], atol=1e-3)
    assert np.abs(route[3] - first[3]).max() > 0.1
    assert path_length(path_of(plan_route(world, experiment), experiment)) == pytest.approx(80.0, rel=0.02)


def test_a_last_waypoint_that_is_not_reached_is_replaced(monkeypatch: pytest.MonkeyPatch) -> None:
    world, tried = make_world(), list[F8]()
    experiment = random_experiment(50.0, 3)
    first = metres_from_route(plan_route(world, experiment, verify=False))

    def all_but_this_end(_: TrialDrive, corners: F8) -> int:
        tried.append(corners)
        return len(corners) - 1 - int(np.allclose(corners[-1], first[-1], atol=1e-3))

    monkeypatch.setattr(TrialDrive, "reached", all_but_this_end)
    monkeypatch.setattr(TrialDrive, "finish", lambda _: None)
    route = metres_from_route(plan_route(world, experiment))
    assert any(np.allclose(corners[-1], first[-1], atol=1e-3) for corners in tried)
    np.testing.assert_allclose(route, tried[-1], atol=1e-3)
    assert np.abs(route[-1] - first[-1]).max() > 0.1


def short_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.drive.ground.WHOLE", 20.0)
    monkeypatch.setattr("fieldtruth.drive.routes.REACH", 12.0)


def test_paths_of_a_part_end_within_its_reach_and_small_worlds_are_one_part(monkeypatch: pytest.MonkeyPatch) -> None:
    ground = Traversability(forest())
    grid, corner = RouteGrid(ground), np.array([-15.0, -7.0])
    whole = grid.anywhere(np.random.default_rng(0))
    assert grid.around(corner) is whole
    assert grid.around(-corner) is whole
    short_reach(monkeypatch)
    part = RouteGrid(Traversability(forest())).around(corner)
    inside = (np.abs(whole.nodes - corner) <= 12.0 + 0.16).all(axis=1)
    assert 0 < inside.sum() < len(whole.nodes)
    assert abs(len(part.nodes) - inside.sum()) <= 0.05 * inside.sum()
    assert {tuple(node) for node in part.nodes.round(6)} <= {tuple(node) for node in whole.nodes.round(6)}


def test_a_route_can_be_much_longer_than_the_part_that_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    short_reach(monkeypatch)
    experiment = random_experiment(200.0, 1)
    route = plan_route(make_world(), experiment, verify=False)
    assert path_length(path_of(route, experiment)) == pytest.approx(200.0, rel=0.02)
    assert np.ptp(metres_from_route(route)[:, 0]) > 24.0


@pytest.mark.slow
def test_two_kilometres_in_a_large_world() -> None:
    experiment, world = random_experiment(2000.0, 3), make_world(size=(160.0, 120.0))
    route = plan_route(world, experiment, verify=False)
    assert path_length(path_of(route, experiment)) == pytest.approx(2000.0, rel=0.02)
