# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Episodes as a data set of LeRobot, read by pandas, Hugging Face's ``datasets`` and, if installed, LeRobot itself."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import gymnasium
import numpy as np
import pandas as pd
import pytest
from drive_worlds import make_world
from gymnasium import spaces
from numpy.typing import NDArray

from fieldtruth import cli
from fieldtruth.learning import lerobot_data
from fieldtruth.learning.driven import Drives, Episode
from fieldtruth.learning.episodes import record_episodes
from fieldtruth.learning.policies import policy_of

datasets = pytest.importorskip("datasets")
LENGTHS: Final = (4, 3)
SHAPES: Final = {"state": (12,), "lidar/class": (2, 5), "elevation/seen": (2, 3, 4), "camera/photo": (6, 8, 3)}
DTYPES: Final = {"lidar/class": np.uint8, "camera/photo": np.uint8}
FEATURES: Final = {
    "state": "observation.state",
    "lidar/class": "observation.lidar_class",
    "elevation/seen": "observation.elevation_seen",
    "camera/photo": "observation.images.camera",
}
DRIVES: Final = Drives(policy_of("path"), episodes=2, arguments={"observation": tuple(SHAPES), "split": "test"})


def episode_of(steps: int, *, success: bool) -> Episode:
    """Episode of random values; it ends at the goal, or by the time."""
    rng = np.random.default_rng(steps)
    seen: dict[str, NDArray[Any]] = {
        name: rng.integers(0, 256, (steps + 1, *shape)).astype(DTYPES.get(name, np.float32))
        for name, shape in SHAPES.items()
    }
    ends = [False] * (steps - 1)
    actions = rng.uniform(-1.0, 1.0, (steps, 2)).astype(np.float32)
    return Episode(
        None, seen, actions, rng.normal(size=steps).tolist(), [*ends, success], [*ends, not success], success
    )


EPISODES: Final = [episode_of(LENGTHS[0], success=True), episode_of(LENGTHS[1], success=False)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a data set of the two episodes."""
    return written(tmp_path_factory.mktemp("lerobot"))


def written(root: Path) -> Path:
    boxes = {name: spaces.Box(0, 255, shape, DTYPES.get(name, np.float32)) for name, shape in SHAPES.items()}
    env: Any = SimpleNamespace(observation_space=boxes)
    lerobot_data.write(DRIVES, env, EPISODES, root)
    assert lerobot_data.id_of(DRIVES) == "fieldtruth/park-reach-path-test"
    return root / lerobot_data.id_of(DRIVES)


def read(folder: Path) -> Any:
    """All rows, as ``datasets`` reads them."""
    files = sorted(str(path) for path in folder.glob("data/*/*.parquet"))
    return datasets.Dataset.from_parquet(files, cache_dir=str(folder.parent / "cache"))


def all_seen(name: str) -> NDArray[Any]:
    """Observations at which the policy acted."""
    return np.concatenate([episode.seen[name][:-1] for episode in EPISODES])


def test_rows_are_the_steps_of_the_episodes(folder: Path) -> None:
    rows = read(folder)
    for name, feature in FEATURES.items():
        found = np.array([np.asarray(value) for value in rows[feature]])
        np.testing.assert_array_equal(found, all_seen(name), err_msg=name)
    assert isinstance(rows.features["observation.images.camera"], datasets.Image)
    np.testing.assert_array_equal(rows["action"], np.concatenate([episode.actions for episode in EPISODES]))
    np.testing.assert_allclose(
        rows["next.reward"], np.concatenate([episode.rewards for episode in EPISODES]), rtol=1e-6
    )
    assert [*rows["index"]] == [0, 1, 2, 3, 4, 5, 6]
    assert [*rows["episode_index"]] == [0, 0, 0, 0, 1, 1, 1]
    assert [*rows["frame_index"]] == [0, 1, 2, 3, 0, 1, 2]
    assert [*rows["task_index"]] == [0] * 7
    np.testing.assert_allclose(rows["timestamp"], [0.0, 0.1, 0.2, 0.3, 0.0, 0.1, 0.2], atol=1e-7)
    for name, at in (("next.done", (3, 6)), ("next.success", (3,)), ("next.truncated", (6,))):
        assert np.flatnonzero(rows[name]).tolist() == [*at]


def test_metadata_tell_episodes_tasks_and_features(folder: Path) -> None:
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["robot_type"]) == ("v3.0", 10, "husky")
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (2, 7, 1)
    assert info["splits"] == {"test": "0:2"}
    assert [*info["features"]] == [*read(folder).features]
    assert not any("/" in name for name in info["features"])
    camera = info["features"]["observation.images.camera"]
    assert camera == {"dtype": "image", "shape": [6, 8, 3], "names": ["height", "width", "channels"]}
    assert info["features"]["observation.lidar_class"] == {"dtype": "uint8", "shape": [2, 5], "names": None}
    tasks = pd.read_parquet(folder / "meta/tasks.parquet")
    assert tasks.iloc[0].name == "drive to the goal"
    assert tasks.loc["drive to the goal"].task_index == 0
    episodes = pd.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    assert episodes["dataset_from_index"].tolist() == [0, 4]
    assert episodes["dataset_to_index"].tolist() == [4, 7]
    assert episodes["length"].tolist() == [4, 3]
    assert [task.tolist() for task in episodes["tasks"]] == [["drive to the goal"]] * 2
    np.testing.assert_allclose(episodes["stats/action/mean"][1], EPISODES[1].actions.mean(0), rtol=1e-6)


def test_statistics_are_those_of_all_steps(folder: Path) -> None:
    stats = json.loads((folder / "meta/stats.json").read_text())
    for name, feature in FEATURES.items():
        values = all_seen(name).astype(np.float64)
        flat = values.reshape(-1, values.shape[-1])
        if name == "camera/photo":
            flat = flat.reshape(-1, 3, 1, 1) / 255.0
        for key, value in (("min", flat.min(0)), ("max", flat.max(0)), ("mean", flat.mean(0)), ("std", flat.std(0))):
            np.testing.assert_allclose(stats[feature][key], value, rtol=1e-9, err_msg=f"{name} {key}")
        assert stats[feature]["count"] == [7]
    medians = [np.median(episode.actions, 0) for episode in EPISODES]
    np.testing.assert_allclose(stats["action"]["q50"], (4 * medians[0] + 3 * medians[1]) / 7, rtol=1e-6)


def test_large_data_are_several_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lerobot_data, "_FILE_MB", 1e-6)
    monkeypatch.setattr(lerobot_data, "_CHUNK", 1)
    folder = written(tmp_path)
    assert len(pd.read_parquet(folder / "data/chunk-000/file-000.parquet")) == 4
    assert len(pd.read_parquet(folder / "data/chunk-001/file-000.parquet")) == 3
    episodes = pd.read_parquet(folder / "meta/episodes/chunk-000/file-000.parquet")
    assert episodes["data/chunk_index"].tolist() == [0, 1]
    assert episodes["data/file_index"].tolist() == [0, 0]


def test_lerobot_itself_reads_it(folder: Path) -> None:
    """In LeRobot's words: images are float tensors (3, h, w) from 0 to 1."""
    library = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason="pip install lerobot")
    later = {"action": [0.0, 0.1], "observation.state": [-0.1, 0.0]}
    whole = library.LeRobotDataset(lerobot_data.id_of(DRIVES), root=folder)
    second = library.LeRobotDataset(lerobot_data.id_of(DRIVES), root=folder, episodes=[1], delta_timestamps=later)
    assert (len(whole), whole.num_episodes, whole.fps, len(second)) == (7, 2, 10, 3)
    photo = all_seen("camera/photo").transpose(0, 3, 1, 2)
    for k in range(7):
        np.testing.assert_array_equal(np.round(255.0 * whole[k]["observation.images.camera"].numpy()), photo[k])
        for name in ("state", "lidar/class", "elevation/seen"):
            np.testing.assert_array_equal(whole[k][FEATURES[name]].numpy(), all_seen(name)[k])
        assert whole[k]["task"] == "drive to the goal"
    np.testing.assert_array_equal(second[1]["action"].numpy(), EPISODES[1].actions[1:])
    np.testing.assert_array_equal(second[1]["observation.state"].numpy(), EPISODES[1].seen["state"][:2])
    np.testing.assert_allclose(
        whole.meta.stats["action"]["max"], whole.hf_dataset.with_format("numpy")["action"][:].max(0)
    )


def test_a_driven_episode_is_what_an_environment_gives(tmp_path: Path) -> None:
    arguments: dict[str, Any] = {
        "world": make_world(size=(40.0, 40.0)),
        "observation": ("state", "lidar"),
        "difficulty": 0.0,
    }
    drives = Drives(policy_of("path"), episodes=2, seed=5, arguments=arguments)
    name = record_episodes(drives, tmp_path, to="lerobot")
    assert [path.name for path in tmp_path.iterdir()] == ["fieldtruth"]
    rows = read(tmp_path / name).with_format("numpy")
    env = gymnasium.make("fieldtruth/Reach-v0", **arguments)
    for row in rows:
        if row["frame_index"] == 0:
            seen, _ = env.reset(seed=5 if row["episode_index"] == 0 else None)
        np.testing.assert_array_equal(row["observation.state"], seen["state"])
        np.testing.assert_array_equal(row["observation.lidar"], seen["lidar"])
        seen, reward, terminated, truncated, info = env.step(row["action"])
        assert row["next.reward"] == np.float32(reward)
        assert row["next.done"] == (terminated or truncated)
        assert row["next.success"] == info.get("metrics", {"success": False})["success"]
    assert [int(value) for value in rows["episode_index"][[0, -1]]] == [0, 1]


def test_without_pyarrow_it_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert cli.main(["episodes", "path", "--to", "lerobot", "--out", str(tmp_path)]) == 2
    assert "pip install 'fieldtruth[huggingface]'" in capsys.readouterr().err.strip().splitlines()[-1]
    assert [*tmp_path.iterdir()] == []
