# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``render_mode="human"``: episodes in a recording of rerun, read by its own reader."""

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from drive_worlds import make_world

import fieldtruth.learning  # noqa: F401 (registers the environments)
from fieldtruth.core.errors import OutputError

rerun = pytest.importorskip("rerun", reason="the viewer's package is not installed")


def rows_of(file: Path) -> dict[str, list[dict[str, Any]]]:
    """Rows by entity, with components by name."""
    from rerun.chunk import RrdReader

    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for chunk in RrdReader(str(file)).stream():
        batch = chunk.to_record_batch()
        for row in batch.to_pylist():
            found[chunk.entity_path].append(row)
    return found


def test_the_viewer_gets_poses_scans_goal_and_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "episode.rrd"
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(rerun, "spawn", lambda recording, **_: recording.save(str(file)))
    env = gymnasium.make(
        "fieldtruth/Reach-v0", world=make_world(size=(40.0, 40.0)), observation=("state", "lidar"), render_mode="human"
    )
    inner: Any = env.unwrapped
    poses, scans, goals = [], [], []
    for _ in range(2):
        env.reset(seed=4, options={"difficulty": 0.0})
        goals.append(inner.task.goal)
        for step in range(4):
            if step:
                env.step(np.array([0.5, 0.2], np.float32))
            poses.append(inner.robot.now.world_from_base[:3, 3])
            scans.append(len(inner.senses.cloud.xyz))
        assert env.render() is None
    env.close()
    rows = rows_of(file)
    shown = sorted(rows["/world/base_link"], key=lambda row: row["time"])
    assert [row["time"].total_seconds() for row in shown] == pytest.approx([0, 0.1, 0.2, 0.3, 0.3, 0.4, 0.5, 0.6])
    np.testing.assert_allclose([row["Transform3D:translation"][0] for row in shown], poses, atol=1e-5)
    clouds = sorted(rows["/world/base_link/lidar"], key=lambda row: row["time"])
    assert [len(row["Points3D:positions"]) for row in clouds] == scans
    np.testing.assert_allclose([row["Points3D:positions"][0][:2] for row in rows["/world/goal"]], goals, atol=1e-5)
    path = np.array(rows["/world/path"][0]["LineStrips3D:strips"][0])
    assert np.linalg.norm(path[-1, :2] - goals[0]) < 1.5
    assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).max() < 2.5


@pytest.mark.parametrize("missing", ["display", "rerun"])
def test_without_a_viewer_it_is_one_line(missing: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    if missing == "rerun":
        monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(
        OutputError, match="no display" if missing == "display" else r"pip install 'fieldtruth\[view\]'"
    ):
        gymnasium.make("fieldtruth/Reach-v0", world=make_world(size=(40.0, 40.0)), render_mode="human")
