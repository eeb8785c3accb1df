# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where actors go: the model in closed form, behaviours, hard limits, errors."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import pytest
import sense_worlds
from drive_worlds import make_world, obstacle

from fieldtruth.actors.behaviour import Member, RobotState
from fieldtruth.actors.crowd import Crowd
from fieldtruth.actors.figure import Placement
from fieldtruth.actors.places import Places
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.traversability import distance_to, obstacle_outlines
from fieldtruth.experiment.actor_config import ActorConfig
from fieldtruth.world.model import Raster, World

FIGURES: Final = {
    "person": (0.3, 1.34, 6.0, 0.0), "dog": (0.4, 1.8, 9.0, 0.0), "deer": (0.5, 1.0, 11.0, 0.0),
    "cow": (1.0, 0.8, 4.0, 0.0), "cyclist": (0.9, 4.0, 8.0, 2.5), "multirotor": (0.4, 3.0, 15.0, 0.0),
}  # fmt: skip
"""Radius, speed, top speed, turning radius."""
WAY: Final = np.column_stack([np.linspace(-15.0, 15.0, 301), np.zeros(301)])
TAU: Final = 0.54


def member(name: str, kind: str = "person", group: str = "", **values: Any) -> Member:
    config = ActorConfig.model_validate({"kind": kind, **values})
    return Member(name, config, *FIGURES[kind], flies=kind == "multirotor", group=group)


def script(*points: tuple[float, float, float], **values: Any) -> dict[str, Any]:
    return {"script": [{"at_s": t, "xy": (x, y)} for t, x, y in points]} | values


def robot_at(x: float, y: float = 0.0, speed: float = 0.0) -> RobotState:
    return RobotState(x, y, 0.0, speed, 0.6)


def run(
    world: World, members: Sequence[Member], seconds: float, robot: Callable[[float], RobotState] | None = None,
    seed: int = 0,
) -> Array:  # fmt: skip
    """Placements (knots, members, 4): x, y, heading, speed."""
    robots: Callable[[int], list[RobotState]] = lambda k: [] if robot is None else [robot(k / 100)]  # noqa: E731
    crowd = Crowd(world, members, seed=seed, ways=[WAY], robots=robots(0))
    found = [crowd.placements, *(crowd.step(robots(k)) for k in range(round(100 * seconds)))]
    return np.array([[(p.x, p.y, p.heading, p.speed) for p in placements] for placements in found])


def towards(world: World, start: tuple[float, float], end: tuple[float, float], **values: Any) -> Crowd:
    """A crowd of one person on the way from start to end."""
    crowd = Crowd(world, [member("walker", start=start, behaviour="wander", **values)], seed=0, ways=[WAY], robots=())
    set_off(crowd, 0, end)
    return crowd


def set_off(crowd: Crowd, row: int, end: tuple[float, float]) -> None:
    state = crowd.save()
    start = state.position[row]
    line = start + np.linspace(0.0, 1.0, 41)[:, None] * (np.array(end) - start)
    mind = state.minds[row]
    mind.task, mind.path, mind.leg, mind.pace, mind.lane = "go", line, 0, crowd.members[row].pace, 0.0
    state.heading[row] = math.atan2(end[1] - start[1], end[0] - start[0])
    crowd.restore(state)


def pond(x: Array, y: Array) -> Array:
    return np.where(np.hypot(x - 8.0, y + 5.0) < 3.0, -1.0, 0.0)


@pytest.fixture(scope="module")
def park() -> World:
    """A trail along x, pillars, a wall, a bench and a pond."""
    xs, ys = (-12.0, -6.0, 0.0, 6.0), (-3.0, 3.0)
    pillars: list[Any] = [("pillar", "cylinder", (0.3, 2.0), x, y) for x in xs for y in ys]
    boxes: list[Any] = [("wall", "box", (0.4, 6.0, 2.0), -3.0, 6.0), ("bench", "box", (0.7, 1.7, 0.9), 3.0, 4.0)]
    world = make_world(
        pond,
        obstacles=[obstacle(f"{name}_{k}", *rest) for k, (name, *rest) in enumerate([*pillars, *boxes])],
        water_level=-0.5,
    )
    y = np.linspace(-10.0, 10.0, 201)
    trail = Raster(values=np.tile(np.abs(y) - 1.2, (401, 1)).astype(np.float32), spacing=0.1, x0=-20.0, y0=-10.0)
    kinds = [dataclasses.replace(i, kind="bench" if i.name.startswith("bench") else i.kind) for i in world.instances]
    return dataclasses.replace(
        world, instances=tuple(kinds), terrain=dataclasses.replace(world.terrain, trail_distance=trail)
    )


def test_a_free_walker_comes_to_its_speed_as_the_model_says(flat_world: World) -> None:
    crowd = towards(flat_world, (-10.0, 0.0), (10.0, 0.0))
    speeds = np.array([crowd.step(())[0].speed for _ in range(300)])
    times = 0.01 * np.arange(1, 301)
    assert np.abs(speeds - 1.34 * (1 - np.exp(-times / TAU))).max() < 1e-3


def test_two_who_meet_head_on_pass_without_a_touch(flat_world: World) -> None:
    people = [member("a", start=(-4.0, 0.0), behaviour="wander"), member("b", start=(4.0, 0.0), behaviour="wander")]
    crowd = Crowd(flat_world, people, seed=0, ways=[WAY], robots=())
    set_off(crowd, 0, (9.0, 0.0))
    set_off(crowd, 1, (-9.0, 0.0))
    tracks = np.array([[(p.x, p.y, p.speed) for p in crowd.step(())] for _ in range(600)])
    gap = np.hypot(*(tracks[:, 0, :2] - tracks[:, 1, :2]).T) - 0.6
    assert gap.min() > 0.02
    assert tracks[-1, 0, 0] > 2.0
    assert tracks[-1, 1, 0] < -2.0
    assert tracks[100:, :, 2].min() > 0.5, "one of them stopped"
    nearest = tracks[int(np.argmin(gap))]
    assert nearest[0, 1] < nearest[1, 1], "each keeps to its right"


def test_a_walker_before_a_wall_goes_around_it() -> None:
    world = make_world(obstacles=[obstacle("wall", "box", (0.4, 6.0, 2.0), 0.0, 0.0)])
    crowd = towards(world, (-4.0, 0.5), (4.0, 0.5))
    track = np.array([(p.x, p.y) for _ in range(300) for p in crowd.step(())])
    assert distance_to(obstacle_outlines(world)[0], track).min() >= 0.3
    stays = Crowd(world, [member("walker", start=(-4.0, 0.5), behaviour="wander")], seed=0, ways=[WAY], robots=())
    path = stays._places.path_to(
        stays._places.ways_from(stays._places.node_at(np.array([-4.0, 0.5]), 0.3), 0.3, np.inf),
        stays._places.node_at(np.array([4.0, 0.5]), 0.3),
    )
    straight, around = 8.0, math.hypot(4.0, 2.8) * 2
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    assert straight + 1.0 < length < 1.15 * around


def test_a_walker_who_is_sent_into_a_wall_brakes_in_time() -> None:
    world = make_world(obstacles=[obstacle("wall", "box", (0.4, 6.0, 2.0), 0.0, 0.0)])
    crowd = towards(world, (-4.0, 0.0), (4.0, 0.0), speed=3.0)
    track = np.array([(p.x, p.speed) for _ in range(230) for p in crowd.step(())])
    assert track[:, 0].max() <= -0.5
    assert np.diff(track[:, 1]).min() > -0.0301
    assert track[:, 1].max() > 2.0


def test_who_crosses_does_so_ahead_of_the_robot(flat_world: World) -> None:
    people = [member(f"walker_{k}", behaviour="cross") for k in range(5)]
    track = run(flat_world, people, 14.0, lambda t: robot_at(-15.0 + 0.8 * t, 0.0, 0.8))
    robot = -15.0 + 0.8 * 0.01 * np.arange(len(track))
    crossed = 0
    for row in range(5):
        x, y = track[:, row, :2].T
        over = np.flatnonzero(np.diff(np.sign(y)) != 0)
        if len(over) and robot[over[0]] < x[over[0]]:
            crossed += 1
            assert 0.9 < x[over[0]] - robot[over[0]] < 8.0, "it waits for the robot, and not too long"
            assert abs(y[0]) > 2.0
            assert np.ptp(y[: max(over[0] - 500, 1)]) < 0.5
        gap = np.hypot(x - robot, y) - 0.9
        assert gap.min() > 0.0
    assert crossed >= 4


def test_a_standing_person_steps_out_of_the_way_of_a_robot(flat_world: World) -> None:
    person = [member("walker", behaviour="stand", start=(0.0, 0.1))]
    track = run(flat_world, person, 6.0, lambda t: robot_at(-4.0 + 1.0 * t, 0.0, 1.0))
    robot = -4.0 + 0.01 * np.arange(len(track))
    assert (np.hypot(track[:, 0, 0] - robot, track[:, 0, 1]) - 0.9).min() > 0.0


def test_deer_flee_from_a_robot_that_comes_near(flat_world: World) -> None:
    deer = [member("deer", "deer", start=(5.0, 3.0))]
    far = run(flat_world, deer, 5.0, lambda t: robot_at(-15.0))
    assert far[:, 0, 3].max() < 1.1
    near = run(flat_world, deer, 6.0, lambda t: robot_at(-9.5 + t, 0.0, 1.0))
    start = int(np.argmax(near[:, 0, 3] > 2.0))
    gap = np.hypot(near[start, 0, 0] + 9.5 - 0.01 * start, near[start, 0, 1]) - 0.6
    assert 10.0 < gap < 12.0
    assert 5.0 < near[:, 0, 3].max() <= 11.0


def test_deer_watch_a_robot_that_moves_before_they_flee(flat_world: World) -> None:
    """From 15 m on, with their heads up and turned to it; they graze on where it stands."""
    deer = [member("deer", "deer", start=(5.0, 3.0))]

    def placements(speed: float) -> list[Placement]:
        crowd = Crowd(flat_world, deer, seed=3, ways=[WAY], robots=[robot_at(-8.5, 0.0, speed)])
        return [crowd.step([robot_at(-8.5 + 0.01 * speed * k, 0.0, speed)])[0] for k in range(1200)]

    for k, it in enumerate(placements(0.1)):  # it comes from 13.2 m to 12.1 m
        if 200 < k < 1100:
            towards = math.atan2(-it.y, -8.5 + 0.001 * k - it.x)
            assert it.action != "graze"
            assert it.speed < 0.05
            assert abs(math.remainder(it.heading - towards, math.tau)) < 0.1
    assert any(it.action == "graze" for it in placements(0.0))


def test_grazing_animals_stop_with_their_heads_down(flat_world: World) -> None:
    crowd = Crowd(flat_world, [member("cow", "cow")], seed=3, ways=[WAY], robots=())
    found = [crowd.step(())[0] for _ in range(2500)]
    eating = np.mean([p.action == "graze" for p in found])
    assert eating > 0.4
    assert np.mean([p.speed < 0.02 for p in found]) > 0.3
    assert max(p.speed for p in found) < 0.9


def test_a_script_is_exact(flat_world: World) -> None:
    points = ((1.0, -3.0, 1.0), (4.37, 2.0, 1.5), (6.0, 2.0, -1.0))
    crowd = Crowd(flat_world, [member("actor", **script(*points))], seed=0, ways=[WAY], robots=())
    found = [crowd.placements[0], *(crowd.step(())[0] for _ in range(700))]
    assert (found[0].x, found[0].y, found[0].speed) == (-3.0, 1.0, 0.0)
    share = (2.5 - 1.0) / 3.37
    assert found[250].x == pytest.approx(-3.0 + 5.0 * share, abs=1e-9)
    assert found[250].y == pytest.approx(1.0 + 0.5 * share, abs=1e-9)
    assert found[250].speed == pytest.approx(math.hypot(5.0, 0.5) / 3.37, abs=1e-9)
    assert (found[437].x, found[437].y) == pytest.approx((2.0, 1.5), abs=1e-9)
    assert (found[600].x, found[600].y) == pytest.approx((2.0, -1.0), abs=1e-9)
    assert found[700].speed == 0.0
    assert np.abs(np.diff([p.heading for p in found])).max() <= 0.0301


def test_a_walker_gives_way_to_one_with_a_script(flat_world: World) -> None:
    people = [
        member("tram", **script((0.0, -3.0, 0.0), (6.0, 3.0, 0.0))),
        member("idle", behaviour="stand", start=(0.0, 0.05)),
    ]
    track = run(flat_world, people, 6.0)
    assert (np.hypot(*(track[:, 0, :2] - track[:, 1, :2]).T) - 0.6).min() > -0.02


def test_sitting_is_on_a_bench(park: World) -> None:
    people = [member("a", behaviour="sit", group="g"), member("b", behaviour="sit", group="g")]
    found = Crowd(park, people, seed=1, ways=[WAY], robots=()).placements
    assert sorted((p.x, round(p.y, 6)) for p in found) == [(3.0, 3.55), (3.0, 4.45)]
    assert {p.action for p in found} == {"sit"}


def test_no_two_sit_on_one_seat(park: World) -> None:
    """The first is given a place beside the bench, and sits where the second would."""
    people = [member(f"a_{k}", behaviour="sit", count=2, start=(2.5, 3.6)) for k in (1, 2)]
    found = Crowd(park, people, seed=1, ways=[WAY], robots=()).placements
    assert sorted((p.x, round(p.y, 6)) for p in found) == [(3.0, 3.55), (3.0, 4.45)]


def test_only_the_first_multirotor_has_the_start_that_is_given(flat_world: World) -> None:
    flying = [member(f"a_{k}", "multirotor", behaviour="hover", count=2, start=(2.0, 1.0)) for k in (1, 2)]
    one, other = Crowd(flat_world, flying, seed=0, ways=[WAY], robots=()).placements
    assert math.dist((one.x, one.y), (2.0, 1.0)) < 0.5
    assert math.dist((one.x, one.y), (other.x, other.y)) > 1.0


def test_a_flight_by_a_script_is_free_of_ground_and_objects(monkeypatch: pytest.MonkeyPatch, park: World) -> None:
    """Over a tree of 2 m, through it on the way up, and into the ground at its end."""

    def air(_: Places, height: float) -> Raster:
        free = np.full((161, 81), 9.0, np.float32)
        free[60:68] = 0.0 if height < 2.0 else 9.0
        return Raster(values=free, spacing=0.25, x0=-20.0, y0=-10.0)

    monkeypatch.setattr(Places, "_make_air", air)

    def flight(*heights: float) -> Crowd:
        points = [{"at_s": 5.0 * k, "xy": (-6.0 + 6.0 * k, 6.0), "height_m": h} for k, h in enumerate(heights)]
        return Crowd(park, [member("a", "multirotor", script=points)], seed=0, ways=[WAY], robots=())

    assert flight(6.0, 9.0).placements[0].height == pytest.approx(6.0)
    for heights in ((1.0, 1.0), (0.5, 3.0)):
        with pytest.raises(ConfigurationError, match=r"script\[1\]: .* is in an object, or outside at \(-5"):
            flight(*heights)
    with pytest.raises(ConfigurationError, match=r"script\[1\]: .* is in the ground at"):
        flight(8.0, 0.0)


def test_a_flight_by_a_script_is_free_of_large_plain_walls() -> None:
    """A wall of 8 m x 8 m has vertices at its corners only; over it and beside it the air is free."""
    wall = sense_worlds.box("wall", (4.0, 0.1, 4.0))
    world = sense_worlds.make_world([(wall, sense_worlds.at(0.0, 5.0, 4.0))])

    def flight(x: float, height: float) -> Crowd:
        points = [{"at_s": 5.0 * k, "xy": (x, 9.0 - 8.0 * k), "height_m": height} for k in range(2)]
        return Crowd(world, [member("a", "multirotor", script=points)], seed=0, ways=[WAY], robots=())

    for x, height in ((0.0, 4.0), (1.1, 2.3), (-2.2, 5.7)):
        with pytest.raises(ConfigurationError, match=r"script\[1\]: .* is in an object, or outside at "):
            flight(x, height)
    assert flight(0.0, 11.0).placements[0].height == pytest.approx(11.0)
    assert flight(8.0, 4.0).placements[0].height == pytest.approx(4.0)


def test_multirotors_hover_orbit_and_pass(flat_world: World) -> None:
    kinds = ("hover", "orbit", "pass")
    track = run(
        flat_world, [member(k, "multirotor", behaviour=k, height_m=4.0 + 4 * n) for n, k in enumerate(kinds)], 25.0
    )
    hover, orbit, across = (track[:, row, :2] for row in range(3))
    assert 0.1 < np.ptp(hover, axis=0).max() < 0.6
    centre = (orbit.max(axis=0) + orbit.min(axis=0)) / 2
    assert np.ptp(np.hypot(*(orbit - centre).T)) < 0.02
    assert np.hypot(*np.diff(orbit, axis=0).T)[700:] == pytest.approx(0.03, abs=1e-4)
    assert (np.diff(np.sign(across[:, 1])) != 0).any(), "over the robot's way"
    assert np.hypot(*np.diff(across, axis=0).T).max() < 0.0301


def test_those_who_go_together_stay_together(park: World) -> None:
    people = [member(f"p_{k}", group="p") for k in range(3)]
    track = run(park, people, 15.0)[800:, :, :2]
    middle = track.mean(axis=1, keepdims=True)
    spread = np.hypot(*np.moveaxis(track - middle, -1, 0)).max(axis=1)
    assert np.median(spread) < 1.2
    assert np.hypot(*(track[-1].mean(axis=0) - track[0].mean(axis=0))) > 3.0


def crowd_of_thirty() -> list[Member]:
    return [
        *(member(f"walker_{k}") for k in range(8)), *(member(f"pair_{k}", group="pair") for k in range(2)),
        *(member(f"wanderer_{k}", behaviour="wander") for k in range(6)),
        *(member(f"dog_{k}", "dog") for k in range(3)),
        *(member(f"idle_{k}", behaviour="stand") for k in range(3)),
        *(member(f"cross_{k}", behaviour="cross") for k in range(2)),
        *(member(f"cow_{k}", "cow", group="herd") for k in range(2)), member("deer", "deer"),
        *(member(f"bike_{k}", "cyclist", behaviour="wander") for k in range(3)),
    ]  # fmt: skip


@pytest.fixture(scope="module", params=[8.0, pytest.param(60.0, marks=pytest.mark.slow)])
def busy(park: World, request: pytest.FixtureRequest) -> Array:
    return run(
        park,
        crowd_of_thirty(),
        request.param,
        lambda t: robot_at(min(-15.0 + 0.6 * t, 12.0), 0.0, 0.6 if t < 45 else 0.0),
    )


def test_nobody_is_in_anything(park: World, busy: Array) -> None:
    people = crowd_of_thirty()
    radius = np.array([m.radius for m in people])
    for outline in obstacle_outlines(park):
        for row, own in enumerate(radius):
            assert distance_to(outline, busy[::5, row, :2]).min() > own, (outline.name, people[row].name)
    x, y = busy[..., 0], busy[..., 1]
    assert (np.hypot(x - 8.0, y + 5.0) - radius).min() > 3.0 - 0.2, (
        "in the pond, whose shore falls over a cell of 0.2 m"
    )
    assert (np.abs(x) + radius).max() <= 20.0
    assert (np.abs(y) + radius).max() <= 10.0
    apart = np.hypot(x[:, :, None] - x[:, None], y[:, :, None] - y[:, None]) - radius[:, None] - radius
    apart[:, np.arange(30), np.arange(30)] = 1.0
    assert apart.min() >= 0.0


def test_motion_is_smooth(busy: Array) -> None:
    people = crowd_of_thirty()
    turns = np.abs(np.diff(busy[..., 2], axis=0)) / 0.01
    assert turns.max() <= 3.0 + 1e-9
    top = np.array([m.top_speed for m in people])
    assert (busy[..., 3] <= top).all()
    limit = np.array([{"deer": 6.0, "dog": 5.0}.get(m.config.kind, 3.0) for m in people])
    hard = np.abs(np.diff(busy[..., 3], axis=0)) / 0.01 > limit + 1e-6
    assert hard.sum() <= 30, "hard stops are the exception"
    step = np.hypot(*np.moveaxis(np.diff(busy[..., :2], axis=0), -1, 0)) / 0.01
    assert np.abs(step - np.abs(busy[1:, :, 3])).max() < 1e-9
    bikes = [row for row, m in enumerate(people) if m.turn_radius]
    assert (turns[:, bikes] <= np.abs(busy[:-1, bikes, 3]) / 2.5 + 1e-9).all()


def test_most_of_them_get_on(busy: Array) -> None:
    people = crowd_of_thirty()
    lengths = np.hypot(*np.moveaxis(np.diff(busy[..., :2], axis=0), -1, 0)).sum(axis=0)
    going = [row for row, m in enumerate(people) if m.name.startswith(("walker", "wanderer", "dog", "bike"))]
    assert np.median(lengths[going]) > 0.6 * 0.01 * len(busy)
    assert (lengths[going] > 0.2 * 0.01 * len(busy)).mean() > 0.85


def test_equal_input_gives_equal_bits_and_a_seed_another_motion(park: World, busy: Array) -> None:
    again = run(park, crowd_of_thirty(), 1.5, lambda t: robot_at(-15.0 + 0.6 * t, 0.0, 0.6))
    assert again.tobytes() == busy[: len(again)].tobytes()
    other = run(park, crowd_of_thirty(), 0.0, lambda t: robot_at(-15.0), seed=1)
    assert np.abs(other[0, :, :2] - busy[0, :, :2]).max(axis=1).min() > 0.01


def test_another_actor_changes_no_start(park: World) -> None:
    few = run(park, crowd_of_thirty()[:5], 0.0)
    more = run(park, crowd_of_thirty(), 0.0)
    assert few[0].tobytes() == more[0, :5].tobytes()


def test_going_on_from_a_saved_state_is_going_on(park: World) -> None:
    crowd = Crowd(park, crowd_of_thirty(), seed=0, ways=[WAY], robots=[robot_at(-15.0)])

    def on(count: int) -> list[list[Placement]]:
        return [crowd.step([robot_at(-15.0)]) for _ in range(count)]

    on(50)
    saved = crowd.save()
    first = on(60)
    crowd.restore(saved)
    assert on(60) == first
    crowd.restore(saved)
    assert crowd.placements != first[-1]


@pytest.mark.parametrize(
    ("actor", "words"),
    [
        (member("a", start=(-6.0, 3.1)), r"actors.a.start: \(-6, 3.1\) is in pillar_\d"),
        (member("a", start=(8.0, -5.0)), "is in the water"),
        (member("a", start=(25.0, 0.0)), "is outside the world"),
        (member("a", start=(-15.0, 0.5)), "is in the robot's start"),
        (member("a", **script((0.0, -5.0, 6.0), (10.0, -1.0, 6.0))), r"a.script\[1\]: .* is in wall_8 at \(-3.5"),
        (member("a", **script((0.0, 8.0, 0.0), (10.0, 8.0, -5.0))), "in the water"),
        (member("a", **script((0.0, 8.0, 0.0), (20.0, 8.0, 12.0))), "outside the world"),
        (member("a", **script((0.0, 8.0, 0.0), (0.1, 10.0, 0.0))), "needs 20.0 m/s .* at most at 6 m/s"),
        (member("a", start=(-5.0, 0.0), behaviour="sit"), "no free bench"),
        (member("a", **script((0.0, -15.0, 0.0), (9.0, -5.0, 0.0))), r"script\[0\]: .* is in the robot's start"),
        (member("a", speed=7.0), "actors.a.speed: must be at most 6 m/s for a person, got 7"),
        (Member("a", ActorConfig(kind="car"), 15.0, 3.0, 9.0, 5.0), "no trail for behaviour trails of a car"),
        (member("a", "multirotor", height_m=5.0, start=(39.0, 0.0), behaviour="hover"), "no free air in test to hover"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_one_line(park: World, actor: Member, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words) as caught:
        Crowd(park, [actor], seed=0, ways=[WAY], robots=[robot_at(-15.0)])
    assert "\n" not in str(caught.value)


def test_without_a_bench_a_trail_or_room_there_is_an_error(flat_world: World) -> None:
    with pytest.raises(ConfigurationError, match="no free bench"):
        Crowd(flat_world, [member("a", behaviour="sit")], seed=0, ways=[WAY], robots=())
    with pytest.raises(ConfigurationError, match="no trail"):
        Crowd(flat_world, [member("a", behaviour="trails")], seed=0, ways=[WAY], robots=())
    with pytest.raises(ConfigurationError, match="both sides of the robot's way"):
        Crowd(flat_world, [member("a", behaviour="cross")], seed=0, ways=[WAY[:1]], robots=())
    both = [member("a", start=(1.0, 3.0), behaviour="wander"), member("b", start=(1.2, 3.0), behaviour="wander")]
    with pytest.raises(ConfigurationError, match="in the place of the actor b"):
        Crowd(flat_world, both, seed=0, ways=[WAY], robots=())


def test_who_crosses_does_so_on_one_of_several_ways(flat_world: World) -> None:
    """The ways are apart and run against each other; no one waits between the end of one and the start of the other."""
    ways = [np.column_stack([order * WAY[:, 0], np.full(301, y)]) for y, order in ((-6.0, 1), (6.0, -1))]
    people = [member(f"walker_{k}", behaviour="cross") for k in range(12)]
    people += [member("given", behaviour="cross", start=(-3.0, -2.5)), member("eye", "multirotor", behaviour="orbit")]
    crowd = Crowd(flat_world, people, seed=1, ways=ways, robots=[robot_at(-15.0, -6.0), robot_at(15.0, 6.0)])
    state = crowd.save()
    across = np.array([mind.across for mind in state.minds[:13]])
    assert np.abs(np.abs(across[:, 1]) - 6.0).max() < 1e-9
    assert 2 <= np.count_nonzero(across[:12, 1] > 0) <= 10
    assert across[12, 1] == -6.0
    driven = np.where(across[:, 1] < 0, across[:, 0] + 15.0, 15.0 - across[:, 0])
    assert driven[:12].min() > 4.9  # time to cross ahead of the robot of this way
    for (x, y), (cx, _) in zip(state.position[:13], across, strict=True):
        assert abs(x - cx) < 1e-6 + 3.0 * (abs(y) < 3)
        assert 2.4 < abs(abs(y) - 6.0) < 5.0


@pytest.mark.parametrize(("second", "goes"), [((12.0, 0.0), True), ((2.0, 0.8), False)])
def test_who_crosses_minds_all_robots(flat_world: World, second: tuple[float, float], *, goes: bool) -> None:
    """The first robot is far enough and comes in time; the second, which comes from the other side, is too near."""
    crowd = Crowd(flat_world, [member("a", behaviour="cross", start=(0.0, 3.0))], seed=0, ways=[WAY], robots=())
    needed = 3.0 + 0.6 + 0.35 + 0.5
    first = RobotState(-0.6 - 0.8 * (needed / 1.3 + 2.5), 0.0, 0.0, 0.8, 0.6)
    for _ in range(12):
        crowd.step([first, RobotState(second[0], 0.0, math.pi, second[1], 0.6)])
    assert (crowd.save().minds[0].task == "go") is goes
