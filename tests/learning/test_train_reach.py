# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The example that trains a policy for Reach: what it sees, the follower that it corrects, and what is saved."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

sb3 = pytest.importorskip("stable_baselines3")
train_reach = pytest.importorskip("train_reach")


def observation(goal: tuple[float, float], *stones: tuple[float, float]) -> dict[str, NDArray[Any]]:
    """Return what is seen with a goal, x and y ahead and to the left [m], and stones of 0.3 m x 0.3 m x 0.4 m."""
    seen = np.zeros((2, 64, 64), np.float32)
    seen[1] = 1.0
    for x, y in stones:
        row, column = (round((3.15 - value) / 0.1) for value in (x, y))
        seen[0, row - 1 : row + 2, column - 1 : column + 2] = 0.4
    return {"state": np.array([*goal, *10 * (0.0,)], np.float32), "elevation/seen": seen}


def test_distances_end_at_the_stone_in_its_direction() -> None:
    free = train_reach.free_ahead(observation((9.0, 0.0), (1.95, 0.05))["elevation/seen"])
    ahead = len(train_reach.DIRECTIONS) // 2
    assert free[0, ahead] == free[1, ahead] == pytest.approx(1.75, abs=0.06)  # its face, less the cell of the step
    assert free[2, ahead] == train_reach.FARTHEST  # it is lower than 0.6 m
    assert free[1, [0, -1]].tolist() == 2 * [train_reach.FARTHEST]


def test_the_follower_drives_to_the_goal_and_beside_what_is_before_it() -> None:
    act = train_reach.Reactive()
    assert act(observation((9.0, 0.0))).tolist() == pytest.approx([0.8, 0.0])
    assert act(observation((0.0, 9.0)))[1] == 1.0  # the goal is to the left
    assert act(observation((0.0, -9.0)))[1] == -1.0
    beside_left = act(observation((9.0, 0.0), (1.5, -0.2)))
    beside_right = act(observation((9.0, 0.0), (1.5, 0.2)))
    assert beside_left[1] > 0.2
    assert beside_right[1] < -0.2
    assert beside_left[0] < 0.8


def test_a_policy_without_training_is_the_follower(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import gymnasium
    import torch

    class Still(gymnasium.Env[Any, Any]):
        observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, train_reach.seen_by(observation((9.0, 0.0)))[0].shape, np.float32
        )
        action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    model = sb3.PPO("MlpPolicy", Still(), device="cpu")
    torch.nn.init.zeros_(model.policy.action_net.weight)
    model.save(tmp_path / "policy.zip")
    monkeypatch.setenv("REACH_POLICY", str(tmp_path / "policy.zip"))
    seen = observation((5.0, 3.0))
    np.testing.assert_array_equal(train_reach.Agent()(seen), train_reach.Reactive()(seen))
    with torch.no_grad():
        model.policy.action_net.bias += torch.tensor([0.0, 0.3])
    model.save(tmp_path / "left.zip")
    monkeypatch.setenv("REACH_POLICY", str(tmp_path / "left.zip"))
    assert train_reach.Agent()(seen)[1] == pytest.approx(train_reach.Reactive()(seen)[1] + 0.3)
