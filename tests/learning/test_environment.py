# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments of Gymnasium in tiny worlds: interface, equal bits, ends by construction, bad input."""

import dataclasses
import subprocess
import sys
import warnings
from typing import Any, Final

import gymnasium
import numpy as np
import pytest
from drive_worlds import make_world, obstacle
from gymnasium.utils.env_checker import check_env

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError, RouteError, UnknownNameError
from fieldtruth.learning.config import OBSERVATIONS
from fieldtruth.world.model import Raster, World

SIZE: Final = (40.0, 40.0)
EVERY: Final = tuple(name for name in OBSERVATIONS if name != "camera/photo")
AHEAD: Final = np.array([1.0, 0.0], np.float32)


def with_trail(world: World) -> World:
    """A straight trail along x, 3 m wide."""
    _, y = np.meshgrid(np.arange(-20.0, 20.5, 0.5), np.arange(-20.0, 20.5, 0.5), indexing="ij")
    distance = Raster(values=(np.abs(y) - 1.5).astype(np.float32), spacing=0.5, x0=-20.0, y0=-20.0)
    return dataclasses.replace(world, terrain=dataclasses.replace(world.terrain, trail_distance=distance))


@pytest.fixture(scope="module")
def plane() -> World:
    """Level ground with a trail."""
    return with_trail(make_world(size=SIZE))


@pytest.fixture(scope="module")
def blocks() -> World:
    """Level ground with a wall, a block and a trail."""
    walls = [obstacle("wall", "box", (1.0, 6.0, 2.0), 6.0, 0.0), obstacle("block", "box", (2.0, 2.0, 2.0), -8.0, 8.0)]
    return with_trail(make_world(size=SIZE, obstacles=walls))


def made(name: str, world: World, **values: Any) -> gymnasium.Env[Any, Any]:
    """An environment without Gymnasium's own wrappers."""
    return gymnasium.make(f"fieldtruth/{name}-v0", world=world, **values).unwrapped


def ended(env: gymnasium.Env[Any, Any], action: Any, steps: int = 400) -> tuple[float, dict[str, Any]]:
    """Repeat an action until the episode ends; the last reward and info."""
    for _ in range(steps):
        _, reward, terminated, truncated, info = env.step(action)
        if terminated or truncated:
            return float(reward), info
    pytest.fail("the episode does not end")


@pytest.mark.parametrize("name", ["Reach", "Follow", "Explore"])
def test_gymnasium_checks_each_environment(name: str, blocks: World) -> None:
    with warnings.catch_warnings(action="error"):
        check_env(made(name, blocks, observation=EVERY), skip_render_check=True)


@pytest.mark.parametrize("name", ["Reach", "Follow", "Explore"])
def test_equal_seeds_and_actions_give_equal_bits(name: str, blocks: World) -> None:
    used, fresh = (made(name, blocks, observation=EVERY) for _ in range(2))
    used.reset(seed=1)
    for _ in range(20):
        used.step(AHEAD)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (12, 2)).astype(np.float32)
    runs = []
    for env in (used, fresh):
        values, _ = env.reset(seed=7)
        run = [values, *(env.step(action) for action in actions)]
        runs.append(run)
    first, second = runs
    for name_ in EVERY:
        np.testing.assert_array_equal(first[0][name_], second[0][name_])
        for one, other in zip(first[1:], second[1:], strict=True):
            np.testing.assert_array_equal(one[0][name_], other[0][name_])
    assert [each[1] for each in first[1:]] == [each[1] for each in second[1:]]


def test_reward_is_the_formula_on_a_plane(plane: World) -> None:
    env = made("Reach", plane, reward={"progress": 0.0, "straight": 1.0})
    env.reset(seed=0, options={"start": (-10.0, 0.0), "goal": (10.0, 0.0), "heading": 0.0})
    before, action = env.step(AHEAD)[0], np.array([1.0, 0.5], np.float32)
    after, reward, _, _, info = env.step(action)
    gained = np.hypot(*before[:2]) - np.hypot(*after[:2])
    assert 0.02 < gained < 0.1
    change = np.array([0.0, 0.25])
    assert reward == pytest.approx(gained - 0.1 * 0.1 - 0.05 * change @ change, abs=2e-6)
    assert reward == sum(info["reward"].values())


def test_straight_drive_on_a_plane_has_the_metrics_of_a_ruler(plane: World) -> None:
    env = made("Reach", plane)
    _, info = env.reset(seed=0, options={"start": (-9.0, 0.0), "goal": (6.0, 0.0), "heading": 0.0})
    assert info["shortest_m"] == pytest.approx(15.0, abs=0.3)
    reward, info = ended(env, AHEAD)
    metrics = info["metrics"]
    assert info["cause"] == "reached"
    assert metrics["success"] is True
    assert metrics["spl"] == 1.0  # it stops a metre before
    assert metrics["length_m"] == pytest.approx(14.0, abs=0.15)
    assert metrics["seconds"] == pytest.approx(14.0 * 1.05, rel=0.1)  # a little slip
    assert metrics["max_tilt_deg"] < 1.0
    assert metrics["collisions"] == 0
    assert reward > 9.0


def test_energy_on_a_plane_is_that_against_the_resistance_of_the_soil(plane: World) -> None:
    """Motors work against the drag on the hubs and the torque of the rolling tyres, at the speed of the treads."""
    env = made("Reach", plane)
    env.reset(seed=1, options={"start": (-10.0, 0.0), "goal": (10.0, 0.0), "heading": 0.0})
    inner: Any = env.unwrapped
    physics, forces = inner.robot.physics, list[float]()
    for step in range(120):
        if step == 20:  # it drives evenly
            work, angles = physics.work, physics.wheel_angles
        env.step(np.array([0.8, 0.0], np.float32))
        wheels = physics.surroundings.contacts.wheels
        forces.append(-wheels.drag.sum() - wheels.torque.sum() / inner.senses.rig.wheels.radius)
    metres = (physics.wheel_angles - angles).mean() * inner.senses.rig.wheels.radius
    assert metres == pytest.approx(8.0, rel=0.01)
    assert (physics.work - work) / metres == pytest.approx(np.mean(forces[20:]), rel=0.01)
    assert np.mean(forces[20:]) > 10.0


def test_state_shows_the_goal_and_the_motion(plane: World) -> None:
    env = made("Reach", plane)
    state, _ = env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (3.0, 4.0), "heading": np.pi / 2})
    np.testing.assert_allclose(state[:2], [4.0, -3.0], atol=0.02)
    np.testing.assert_allclose(state[2:7], 0.0, atol=0.01)
    for _ in range(20):
        state = env.step(AHEAD)[0]
    wheels, slip = state[7:11], state[11]
    assert state[2] == pytest.approx(wheels.mean() * 0.165 * (1.0 - slip), rel=0.01)
    assert 0.9 < state[2] < 1.0
    assert abs(state[4]) < 0.02


def test_wheels_drive_as_the_same_command_does(plane: World) -> None:
    ends = []
    for action, values in (("speed", (0.4, 0.25)), ("wheels", None)):
        env = made("Reach", plane, action=action)
        env.reset(seed=3)
        if values is None:
            side = 0.5 * 0.2854 * (1 + (0.256 / 0.2854) ** 2)
            values = (0.4 - side, 0.4 + side)
        for _ in range(20):
            state = env.step(np.array(values, np.float32))[0]
        ends.append(state)
    np.testing.assert_allclose(ends[0], ends[1], atol=0.02)


def test_wall_ends_an_episode_by_a_hard_hit_only(blocks: World) -> None:
    env = made("Reach", blocks)
    options = {"start": (2.0, 0.0), "goal": (12.0, 0.0), "heading": 0.0}
    env.reset(seed=0, options=options)
    reward, info = ended(env, AHEAD)
    assert info["cause"] == "hit an obstacle"
    assert info["metrics"]["hardest_hit_j"] == pytest.approx(0.5 * 50.0 * 0.95**2, rel=0.15)
    assert reward < -10.0
    env.reset(seed=0, options=options)
    _, info = ended(env, 0.25 * AHEAD)
    assert info["cause"] == "stuck"  # it leans against the wall
    assert info["metrics"]["collisions"] >= 1
    assert 0.1 < info["metrics"]["hardest_hit_j"] < 5.0


def test_robot_that_stands_is_stuck_after_ten_seconds(plane: World) -> None:
    env = made("Reach", plane)
    env.reset(seed=0)
    _, info = ended(env, np.zeros(2, np.float32))
    assert info["cause"] == "stuck"
    assert info["metrics"]["seconds"] == pytest.approx(10.0, abs=0.11)
    assert not info["metrics"]["success"]


def test_robot_tips_over_a_cliff() -> None:
    world = make_world(lambda x, y: np.where(x > 3.0, -3.0, 0.0) + 0.0 * y, size=SIZE)
    env = made("Explore", world)
    env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (1.0, 0.0), "heading": 0.0})
    assert ended(env, AHEAD)[1]["cause"] == "tipped over"


def test_robot_drives_into_water() -> None:
    world = make_world(lambda x, y: -0.15 * np.maximum(x - 3.0, 0.0) + 0.0 * y, size=SIZE, water_level=-0.3)
    env = made("Explore", world)
    env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (1.0, 0.0), "heading": 0.0})
    assert ended(env, AHEAD)[1]["cause"] == "in the water"


def test_robot_leaves_the_world_and_the_trail(plane: World) -> None:
    env = made("Reach", plane, time_limit=60.0)
    env.reset(seed=0, options={"start": (15.0, 5.0), "goal": (0.0, 0.0), "heading": 0.0})
    assert ended(env, AHEAD)[1]["cause"] == "outside the world"
    env = made("Follow", plane)
    env.reset(seed=0, options={"heading": np.pi / 2})
    assert ended(env, AHEAD)[1]["cause"] == "off the trail"


def test_time_truncates(plane: World) -> None:
    env = made("Reach", plane, time_limit=1.0)
    env.reset(seed=0)
    *_, truncated, info = [env.step(0.1 * AHEAD) for _ in range(10)][-1]
    assert truncated
    assert info["cause"] == "time"


def test_follow_starts_on_the_trail_along_it(plane: World) -> None:
    env = made("Follow", plane, difficulty=0.1)
    for seed in range(3):
        env.reset(seed=seed)
        task = env.task  # type: ignore[attr-defined]
        assert abs(task.start[1]) < 1.5
        assert task.shortest == pytest.approx(15.0, abs=2.0)
        assert abs(np.sin(task.heading)) < 0.75
        assert np.sign(np.cos(task.heading)) == np.sign(task.goal[0] - task.start[0])
    _, info = ended(env, AHEAD)
    assert info["cause"] in ("reached", "off the trail", "outside the world")


def test_elevation_is_the_ground_around_the_robot() -> None:
    step = make_world(lambda x, y: np.where(x > 2.0, 0.3, 0.0) + 0.0 * y, size=SIZE, spacing=0.1)
    env = made("Reach", step, observation=("elevation", "elevation/seen"))
    seen, _ = env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (-5.0, 0.0), "heading": 0.0})
    true = seen["elevation"]
    np.testing.assert_allclose(true[:10], 0.3, atol=0.01)  # 2.2 m ahead and farther
    np.testing.assert_allclose(true[14:], 0.0, atol=0.01)
    height, known = seen["elevation/seen"]
    assert 0.02 < known.mean() < 0.9
    np.testing.assert_allclose(height[known == 1.0], true[known == 1.0], atol=0.31)
    assert (np.abs(height - true)[known == 1.0] < 0.02).mean() > 0.8
    before = known.mean()
    for _ in range(10):
        seen = env.step(0.5 * AHEAD)[0]
    assert seen["elevation/seen"][1].mean() > before


def test_range_image_has_what_is_ahead_in_its_middle() -> None:
    from sense_worlds import at, box
    from sense_worlds import make_world as world_with

    wall = world_with([(box("wall", (0.5, 30.0, 3.0)), at(8.0, 0.0, 0.0))], side=60.0)
    env = made("Explore", wall, observation=("lidar", "lidar/class"))
    seen, _ = env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (1.0, 0.0), "heading": 0.0})
    ranges, classes = seen["lidar"], seen["lidar/class"]
    assert ranges[2, 90] == pytest.approx((7.5 - 0.09) / np.cos(np.radians(1.0)), abs=0.03)  # 1 deg upwards
    assert classes[2, 90] != classes[15, 0]
    assert ranges[2, 0] == 0.0  # nothing behind
    assert ranges[15, 0] == pytest.approx(ranges[15, 179], abs=0.05)


@pytest.mark.usefixtures("small_sky")
def test_image_shows_the_sky_above_and_what_is_left_of_the_way_on_the_left() -> None:
    """A pinhole camera at the paper's left one, looking along x of base_link, shows a block's front and right side."""
    from sense_worlds import at, box
    from sense_worlds import make_world as world_with

    block = world_with([(box("block", (0.5, 0.5, 0.5), "wood"), at(6.5, 2.0, 1.0))], side=60.0)
    env = made("Explore", block, observation=("camera/photo", "camera/label"))
    label = env.reset(seed=0, options={"start": (0.0, 0.0), "goal": (1.0, 0.0), "heading": 0.0})[0]["camera/label"]
    x, y, z = 0.15, 0.06, 0.72 + 0.132  # [m]; base_link is 0.132 m above the ground
    fx, fy = 48.0 / np.tan(np.radians(69.0 / 2.0)), 27.0 / np.tan(np.radians(42.0 / 2.0))
    rows, columns = np.nonzero(label == Label.BENCH)
    seen = [columns.min() - 0.5, columns.max() + 0.5, rows.min() - 0.5, rows.max() + 0.5]
    known = [
        fx * (y - 2.5) / (6.0 - x),
        fx * (y - 1.5) / (7.0 - x),
        fy * (z - 1.5) / (6.0 - x),
        fy * (z - 0.5) / (6.0 - x),
    ]
    np.testing.assert_allclose(seen, np.add(known, [47.5, 47.5, 26.5, 26.5]), atol=0.6)
    assert (label[:18] == Label.SKY).all()
    assert (label[-20:] == Label.GROUND).all()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"observation": "radar"}, "unknown observation 'radar'; did you mean 'lidar'? Available: state, lidar"),
        ({"observation": ()}, "observation must be one or several of state"),
        ({"difficulty": 1.5}, "difficulty must be a number from 0 to 1"),
        ({"action": "legs"}, "action must be speed or wheels"),
        ({"reward": {"joy": 1.0}}, "unknown key 'reward.joy'"),
        ({"physics_ms": 3}, "physics_ms must be 1, 2, 4 or 5, got 3"),
        ({"control_hz": 7.0}, "control_hz must make whole steps"),
        ({"render_mode": "ansi"}, "unknown render_mode 'ansi'"),
        ({"sensors": {"sonar": {}}}, "unknown key 'sensors.sonar'"),
        ({"split": "val"}, "split must be train or test"),
        ({"worlds": []}, "worlds must be a number of worlds from 1 to 1000, or a list of their seeds, got"),
    ],
)
def test_bad_values_are_one_line(values: dict[str, Any], text: str, plane: World) -> None:
    given: dict[str, Any] = {} if {"split", "worlds"} & {*values} else {"world": plane}
    with pytest.raises(FieldtruthError) as found:
        gymnasium.make("fieldtruth/Reach-v0", **given, **values)
    assert text in str(found.value)
    assert "\n" not in str(found.value)


def test_goal_in_an_obstacle_and_options_that_do_not_exist(blocks: World) -> None:
    env = made("Reach", blocks)
    with pytest.raises(RouteError, match=r"the goal at x 6\.0 m, y 0\.0 m is in wall; move it to free ground"):
        env.reset(options={"start": (0.0, 0.0), "goal": (6.0, 0.0)})
    with pytest.raises(UnknownNameError, match="unknown option 'weather'"):
        env.reset(options={"weather": 1})
    env.reset(seed=0)
    with pytest.raises(ConfigurationError, match="action must be two finite numbers"):
        env.step(np.array([np.nan, 0.0]))


def test_worlds_that_no_route_crosses() -> None:
    steep = make_world(lambda x, y: 2.0 * x + 0.0 * y, size=SIZE)
    with pytest.raises(RouteError, match=r"no route crosses test \(seed 0\)"):
        made("Reach", steep).reset(seed=0)
    with pytest.raises(RouteError, match="has no trail to follow"):
        made("Follow", make_world(size=SIZE)).reset(seed=0)
    ditch = make_world(lambda x, y: np.where(np.abs(x) < 1.0, -3.0, 0.0) + 0.0 * y, size=SIZE)
    with pytest.raises(RouteError, match="no free path leads from the start"):
        made("Reach", ditch).reset(options={"start": (-8.0, 0.0), "goal": (8.0, 0.0)})


def test_import_without_gymnasium_is_one_line() -> None:
    code = "import sys; sys.modules['gymnasium'] = None\nimport fieldtruth.learning"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (
        run.stderr.strip()
        .splitlines()[-1]
        .endswith("ConfigurationError: the library gymnasium is not installed; run: pip install 'fieldtruth[rl]'")
    )


@pytest.mark.slow
def test_longer_steps_of_the_physics_drive_the_same_path(plane: World) -> None:
    ends = []
    for physics_ms in (1, 2, 5):
        env = made("Reach", plane, physics_ms=physics_ms, observation="privileged")
        env.reset(seed=0, options={"start": (-5.0, 0.0), "goal": (10.0, 0.0), "heading": 0.0})
        for k in range(60):
            state = env.step(np.array([0.6, 0.4 * np.sin(k / 10.0)], np.float32))[0]
        ends.append(state[12:14])
    np.testing.assert_allclose(ends[1], ends[0], atol=0.005)
    np.testing.assert_allclose(ends[2], ends[0], atol=0.02)
