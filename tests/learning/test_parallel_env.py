# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Several robots in one world: PettingZoo's own tests, equal bits, hits, and what robots see of each other."""

import importlib
import sys
import warnings
from itertools import combinations
from typing import Any, Final

import numpy as np
import pytest
from drive_worlds import make_world
from numpy.typing import NDArray
from pettingzoo.test import parallel_api_test, parallel_seed_test

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import FieldtruthError
from fieldtruth.experiment.rig import Box, body_parts
from fieldtruth.learning import tasks
from fieldtruth.learning.config import OBSERVATIONS, experiment_of
from fieldtruth.learning.parallel import ReachTogether, parallel_env
from fieldtruth.learning.task_world import TaskWorld
from fieldtruth.world.model import World

EVERY: Final = tuple(name for name in OBSERVATIONS if name != "camera/photo")
LENGTH, WIDTH = 0.99, 0.67  # [m] of a Husky
MASS: Final = 50.0  # [kg]
Actions = dict[str, NDArray[np.float32]]


@pytest.fixture(scope="module")
def plane() -> World:
    """Level ground."""
    return make_world(size=(40.0, 40.0))


@pytest.fixture(scope="module")
def pair(plane: World) -> ReachTogether:
    """Two robots that have the LiDAR and the map of heights."""
    return parallel_env(2, world=plane, observation=("state", "lidar", "lidar/class", "elevation", "camera/label"))


def face_to_face(env: ReachTogether, gap: float, *, heading: float = np.pi) -> dict[str, Any]:
    """Put the second robot before the first one, which looks along x, and return what they observe."""
    options = {
        "robot_0": {"start": (0.0, 0.0), "goal": (15.0, 0.0), "heading": 0.0},
        "robot_1": {"start": (gap, 0.0), "goal": (gap, 10.0), "heading": heading},
    }
    return env.reset(seed=0, options=options)[0]


def speeds(*values: float) -> Actions:
    """Straight ahead, with shares of the greatest speed."""
    return {f"robot_{k}": np.array([value, 0.0], np.float32) for k, value in enumerate(values)}


def driven(env: ReachTogether, actions: Actions, steps: int) -> list[tuple[Any, ...]]:
    """Repeat the actions of those that drive until the first robot ends; what each step returns."""
    found: list[tuple[Any, ...]] = []
    while len(found) < steps and "robot_0" in env.agents:
        found.append(env.step({name: actions[name] for name in env.agents}))
    return found


def test_tests_of_pettingzoo_pass(plane: World) -> None:
    with warnings.catch_warnings(action="error"):
        parallel_api_test(parallel_env(3, world=plane, time_limit=0.5))
        parallel_seed_test(lambda: parallel_env(2, world=plane))


def test_equal_seeds_and_actions_give_equal_bits(plane: World) -> None:
    used, fresh = (parallel_env(3, world=plane, observation=EVERY) for _ in range(2))
    face_to_face(used, 4.0)
    driven(used, speeds(1.0, 0.5, 0.2), 5)
    rng = np.random.default_rng(0)
    actions = [{name: rng.uniform(-1.0, 1.0, 2) for name in used.possible_agents} for _ in range(8)]
    begun = [env.reset(seed=7) for env in (used, fresh)]
    assert begun[0][1] == begun[1][1]
    for action in actions:
        (seen, *rest), (other, *other_rest) = (env.step(action) for env in (used, fresh))
        assert rest == other_rest
        for robot in used.possible_agents:
            for name in EVERY:
                np.testing.assert_array_equal(seen[robot][name], other[robot][name])


def test_robots_that_drive_at_each_other_both_end_between_their_starts(pair: ReachTogether) -> None:
    face_to_face(pair, 4.0)
    *_, infos = driven(pair, speeds(1.0, 1.0), 30)[-1]
    assert pair.agents == []
    for name, x in (("robot_0", 2.0 - LENGTH / 2), ("robot_1", 2.0 + LENGTH / 2)):
        assert infos[name]["cause"] == "hit another robot"
        assert infos[name]["metrics"]["hardest_hit_j"] == pytest.approx(0.5 * MASS * 2.0**2, rel=0.03)
        np.testing.assert_allclose(pair.robots[name].robot.now.xy, [x, 0.0], atol=0.02)
    assert pair.step({}) == ({}, {}, {}, {}, {})


def test_robot_that_is_driven_into_goes_on_and_sees_the_one_that_has_ended(pair: ReachTogether) -> None:
    face_to_face(pair, 3.0)
    seen, _, terminated, _, infos = driven(pair, speeds(1.0, 0.0), 30)[-1]
    assert infos["robot_0"]["cause"] == "hit another robot"
    assert not terminated["robot_1"]
    assert pair.agents == ["robot_1"]
    x = pair.robots["robot_0"].robot.now.xy[0]
    for _ in range(5):
        seen, *_, infos = pair.step({"robot_1": np.array([-0.8, 0.0])})
    assert pair.robots["robot_0"].robot.now.xy[0] == x
    assert (seen["robot_1"]["lidar/class"][:, 85:96] == Label.ROBOT).any()
    while pair.agents:
        *_, infos = pair.step({"robot_1": np.array([1.0, 0.0])})
    assert infos["robot_1"]["cause"] == "hit another robot"


def test_hit_from_behind_has_the_energy_of_the_difference_of_the_speeds(pair: ReachTogether) -> None:
    face_to_face(pair, 3.0, heading=0.0)
    found = driven(pair, speeds(1.0, 0.7), 90)
    hits = np.array([[-5.0 * info[name]["reward"]["hit"] for name in pair.possible_agents] for *_, info in found])
    first = hits[np.flatnonzero(hits[:, 0])[0]]
    assert first[0] == pytest.approx(0.5 * MASS * 0.3**2, rel=0.1)
    assert first[1] == 0.0
    assert len(pair.agents) == 2


def test_lidar_sees_the_other_robot_at_the_range_of_its_box(pair: ReachTogether) -> None:
    seen = face_to_face(pair, 4.0)["robot_0"]
    senses = pair.robots["robot_0"].senses
    box = next(part for part in body_parts(senses.rig) if isinstance(part, Box))
    scanner = (np.linalg.inv(pair.robots["robot_0"].robot.now.world_from_base) @ senses.world_from_scanner)[:3, 3]
    row = 8  # 11 deg downwards
    ahead = 4.0 - (box.centre[0] + box.size[0] / 2) - scanner[0]
    height = scanner[2] - ahead * np.tan(np.radians(11.0)) - box.centre[2]
    assert abs(height) < box.size[2] / 2
    assert seen["lidar/class"][row, 90] == Label.ROBOT
    assert seen["lidar"][row, 90] == pytest.approx(ahead / np.cos(np.radians(11.0)), abs=0.01)
    assert (seen["lidar/class"][:, :60] != Label.ROBOT).all()


def test_camera_and_map_of_heights_show_the_other_robot(pair: ReachTogether) -> None:
    face_to_face(pair, 3.0)
    seen = driven(pair, speeds(0.0, 0.5), 8)[-1][0]["robot_0"]
    ahead = pair.robots["robot_1"].robot.now.xy[0] - pair.robots["robot_0"].robot.now.xy[0] - LENGTH / 2
    high = np.argwhere(seen["elevation"] > 0.5)
    assert high[:, 0].max() == int(31.5 - ahead / 0.1)
    assert high[:, 1].min() == np.ceil(31.5 - WIDTH / 2 / 0.1)
    assert high[:, 1].max() == int(31.5 + WIDTH / 2 / 0.1)
    _, columns = np.nonzero(seen["camera/label"] == Label.ROBOT)
    assert len(columns) > 50
    assert 40 < columns.mean() < 60


def test_most_ways_cross_and_their_ends_are_apart(plane: World) -> None:
    experiment = experiment_of()
    made = TaskWorld(plane, experiment.rig, experiment.light)
    crossing = []
    for seed, count in ((0, 4), (1, 4), (2, 4), (3, 8)):
        found = tasks.crossing_tasks(made, 0.1, count, np.random.default_rng(seed))
        for one, other in combinations(found, 2):
            assert one.goal is not None
            assert other.goal is not None
            sides = [
                is_left(one.start, one.goal, other.start) != is_left(one.start, one.goal, other.goal),
                is_left(other.start, other.goal, one.start) != is_left(other.start, other.goal, one.goal),
            ]
            crossing.append(all(sides))
        ends = [end for task in found for end in (task.start, task.goal) if end is not None]
        assert min(float(np.linalg.norm(one - other)) for one, other in combinations(ends, 2)) >= 3.0
    assert np.mean(crossing) > 0.7


def is_left(start: Array, end: Array, point: Array) -> bool:
    """Return whether a point is left of a line."""
    (x, y), (u, v) = end - start, point - start
    return bool(x * v > y * u)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"robots": 1}, "robots must be a whole number from 2 to 8, got 1"),
        ({"robots": 9}, "robots must be a whole number from 2 to 8, got 9"),
        ({"robots": 2.5}, "robots must be a whole number from 2 to 8, got 2.5"),
        ({"observation": "radar"}, "unknown observation 'radar'"),
        ({"render_mode": "ansi"}, "unknown render_mode 'ansi'"),
    ],
)
def test_bad_values_are_one_line(values: dict[str, Any], text: str, plane: World) -> None:
    with pytest.raises(FieldtruthError) as found:
        parallel_env(world=plane, **values)
    assert text in str(found.value)
    assert "\n" not in str(found.value)


def test_bad_options_and_actions_are_one_line(pair: ReachTogether) -> None:
    with pytest.raises(FieldtruthError, match="unknown option 'weather'"):
        pair.reset(options={"weather": 1})
    with pytest.raises(FieldtruthError, match="unknown option 'robot_2'; did you mean 'robot_"):
        pair.reset(options={"robot_2": {}})
    with pytest.raises(FieldtruthError, match=r"unknown option 'world'; .*start, goal, heading"):
        pair.reset(options={"robot_0": {"world": 1}})
    with pytest.raises(FieldtruthError, match=r"robot_0 and robot_1 start 1\.00 m from each other; allowed are"):
        face_to_face(pair, 1.0)
    face_to_face(pair, 4.0)
    with pytest.raises(FieldtruthError, match="actions must be those of robot_0, robot_1; got those of robot_1"):
        pair.step({"robot_1": np.zeros(2)})
    with pytest.raises(FieldtruthError, match="action must be two finite numbers"):
        pair.step({"robot_0": np.zeros(3), "robot_1": np.zeros(2)})
    with pytest.raises(FieldtruthError, match="unknown agent 'robot_7'"):
        pair.action_space("robot_7")


def test_import_without_pettingzoo_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "fieldtruth.learning.parallel")
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(FieldtruthError, match=r"pettingzoo is not installed; run: pip install 'fieldtruth\[rl\]'"):
        importlib.import_module("fieldtruth.learning.parallel")
