# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Environments in worlds that are built: several processes, seeds of worlds, photographs, difficulty, memory."""

from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
import pytest
from rl import episode
from small_park import LAYOUT

import fieldtruth.learning  # noqa: F401 (it registers the environments)
from fieldtruth.learning.environment import FieldEnv
from fieldtruth.learning.policies import path_follower, straight_follower
from fieldtruth.world.build import load_world

SMALL: Final[dict[str, Any]] = {"environment": "park", "layout": LAYOUT}


def test_processes_give_the_observations_of_one_environment() -> None:
    load_world("park", 0, LAYOUT)  # the processes read it from the cache
    envs = gymnasium.make_vec("fieldtruth/Reach-v0", 2, "async", time_limit=0.4, **SMALL)
    alone = gymnasium.make("fieldtruth/Reach-v0", time_limit=0.4, **SMALL)
    try:
        seen, _ = envs.reset(seed=4)
        own, _ = alone.reset(seed=5)
        np.testing.assert_array_equal(seen[1], own)
        for step in range(5):
            action = np.full((2, 2), 0.3, np.float32)
            seen, _, _, truncated, _ = envs.step(action)
            own = alone.step(action[1])[0] if step < 4 else alone.reset()[0]  # the processes begin another episode
            np.testing.assert_array_equal(seen[1], own)
            assert truncated[1] == (step == 3)
    finally:
        envs.close()


def test_worlds_of_training_and_test_are_apart() -> None:
    def seeds(**values: Any) -> set[int]:
        env = gymnasium.make("fieldtruth/Reach-v0", **values).unwrapped
        assert isinstance(env, FieldEnv)
        return {*env.config.seeds}

    assert seeds(worlds=3) == {0, 1, 2}
    assert seeds(worlds=3, split="test") == {1000, 1001, 1002}
    assert not seeds(worlds=1000) & seeds(worlds=1000, split="test")
    assert seeds(worlds=[5, 7]) == {5, 7}


@pytest.mark.usefixtures("small_sky", "in_park")
def test_photographs_and_rendering() -> None:
    env = gymnasium.make("fieldtruth/Reach-v0", observation="camera", render_mode="rgb_array", **SMALL)
    seen, _ = env.reset(seed=0)
    assert seen["camera/photo"].shape == (54, 96, 3)
    assert seen["camera/photo"].std() > 10.0
    assert {*np.unique(seen["camera/label"])} <= {*range(18)}
    picture: Any = env.render()
    assert picture.shape == (270, 480, 3)
    before = picture[120:, 120:360].astype(
        int
    )  # the robot, in the middle, moves with the camera; what is around does not
    for _ in range(30):
        env.step(np.array([1.0, 0.0], np.float32))
    after: Any = env.render()
    assert np.abs(after[120:, 120:360].astype(int) - before).mean() > 1.0


@pytest.mark.slow
def test_memory_does_not_grow_with_episodes() -> None:
    env = gymnasium.make("fieldtruth/Reach-v0", observation=("state", "elevation/seen"), **SMALL)

    def megabytes() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

    sizes = []
    for k in range(121):
        env.reset(seed=0 if k == 0 else None)
        env.step(env.action_space.sample())
        if k % 40 == 0:
            sizes.append(megabytes())
    assert sizes[-1] - sizes[1] < 3.0


@pytest.mark.slow
def test_success_of_the_straight_follower_falls_with_difficulty() -> None:
    shares = {}
    for difficulty in (0.0, 0.5, 1.0):
        for policy in (straight_follower, path_follower):
            env = gymnasium.make("fieldtruth/Reach-v0", observation="privileged", difficulty=difficulty)
            found = [episode(env, policy, 0 if k == 0 else None) for k in range(16)]
            shares[policy, difficulty] = np.mean([each["success"] for each in found])
    straight = [shares[straight_follower, difficulty] for difficulty in (0.0, 0.5, 1.0)]
    assert straight[0] >= 0.85
    assert straight[0] > straight[1] > straight[2]
    assert straight[2] <= 0.25
    assert shares[path_follower, 1.0] > straight[2] + 0.3
