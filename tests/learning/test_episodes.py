# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes as a data set of Minari, read by its own loader: what was seen, done and got, as an environment gives it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import minari
import numpy as np
import pytest
from drive_worlds import make_world
from small_park import LAYOUT

from fieldtruth import cli
from fieldtruth.core.errors import ConfigurationError, OutputError
from fieldtruth.learning.driven import Drives
from fieldtruth.learning.episodes import record_episodes
from fieldtruth.learning.policies import Policy, policy_of


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, Any]:
    """Root folder, id and world of three episodes of the follower along the path, whose observation is not recorded."""
    root, world = tmp_path_factory.mktemp("minari"), make_world(size=(40.0, 40.0))
    arguments = {"world": world, "observation": ("state", "lidar"), "difficulty": 0.0}
    name = record_episodes(Drives(policy_of("path"), episodes=3, seed=5, arguments=arguments), root)
    return root, name, world


def test_minari_reads_what_an_environment_gives(
    recorded: tuple[Path, str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    root, name, world = recorded
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    data = minari.load_dataset(name)
    assert name == "fieldtruth/park/reach-path-train-v0"
    assert data.total_episodes == 3
    env = gymnasium.make("fieldtruth/Reach-v0", world=world, observation=("state", "lidar"), difficulty=0.0)
    assert data.observation_space == env.observation_space
    assert data.action_space == env.action_space
    for k, episode in enumerate(data.iterate_episodes()):
        seen, _ = env.reset(seed=5 if k == 0 else None)
        assert {*episode.observations} == {"state", "lidar"}
        assert len(episode.observations["state"]) == len(episode.actions) + 1
        for step, action in enumerate(episode.actions):
            for part in ("state", "lidar"):
                np.testing.assert_array_equal(episode.observations[part][step], seen[part])
            seen, reward, terminated, truncated, info = env.step(action)
            assert (reward, terminated, truncated) == (
                episode.rewards[step], episode.terminations[step], episode.truncations[step],
            )  # fmt: skip
        assert info["metrics"]["success"]


def test_an_existing_data_set_is_kept(recorded: tuple[Path, str, Any]) -> None:
    root, _, world = recorded
    with pytest.raises(OutputError, match="already exists"):
        record_episodes(Drives(policy_of("path"), episodes=1, arguments={"world": world}), root)
    for overwrite in (False, True):
        drives = Drives(policy_of("straight"), episodes=1, arguments={"world": world, "time_limit": 1.0})
        again = record_episodes(drives, root, overwrite=overwrite)
        assert again == "fieldtruth/park/reach-straight-train-v0"


def test_a_policy_that_fails_keeps_the_data_set_and_leaves_nothing_else(tmp_path: Path) -> None:
    agent = tmp_path / "agent.py"
    agent.write_text("def act(seen):\n    return [0.1, 0.0]\n")
    root, arguments = tmp_path / "minari", {"world": make_world(size=(40.0, 40.0)), "time_limit": 0.5}
    record_episodes(Drives(policy_of(f"{agent}:act"), episodes=1, arguments=arguments), root)
    before = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    failing = replace(policy_of(f"{agent}:act"), observation="lidar/class")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Policy, "load", lambda self: lambda: lambda seen: 1 / 0)
        with pytest.raises(ConfigurationError, match="ZeroDivisionError: division by zero"):
            record_episodes(Drives(failing, episodes=1, arguments=arguments), root, overwrite=True)
    assert {path: path.read_bytes() for path in root.rglob("*") if path.is_file()} == before


def test_a_data_set_knows_its_environment_and_that_of_the_test_worlds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = {"environment": "park", "layout": LAYOUT, "worlds": 1, "time_limit": 0.3}
    name = record_episodes(Drives(policy_of("path"), episodes=1, arguments=arguments), tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    data = minari.load_dataset(name)
    for evaluate, seeds in ((False, (0,)), (True, (1000,))):
        env = data.recover_environment(eval_env=evaluate)
        assert env.observation_space == data.observation_space
        assert env.unwrapped.config.seeds == seeds
        assert env.unwrapped.config.layout == LAYOUT


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["path", "--split", "val"], "split"),
        (["path", "--record", "smell"], "unknown observation 'smell'"),
        (["path", "--task", "Park"], "unknown task 'Park'"),
        (["path", "--difficulty", "2"], "difficulty"),
        (["fast"], "unknown policy 'fast'"),
        (["path", "--environment", "moon"], "moon"),
        (["path", "--to", "hdf5"], "unknown format 'hdf5'"),
        (["path", "--record", "state,lidar,lidar/class"], "Minari cannot hold both lidar and lidar/class"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["episodes", *arguments, "--out", str(tmp_path / "data")]) == 2
    assert text in capsys.readouterr().err.strip().splitlines()[-1]
    assert not any(path.is_file() for path in tmp_path.rglob("*"))
