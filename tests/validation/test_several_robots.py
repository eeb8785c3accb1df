# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs of several robots: clouds and images are retraced among the robots that move, and a wrong pose is found."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_bags import rewritten
from sense_worlds import make_world

from fieldtruth import cli, pipeline
from fieldtruth.bag import topics as table
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import RawMessage
from fieldtruth.experiment.config import Experiment
from fieldtruth.validation import Check, world
from fieldtruth.validation.runner import validate

pytestmark = pytest.mark.usefixtures("small_sky")

LIDAR = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 20.0, "spinning": True}
CAMERA = {"kind": "camera", "name": "eye", "width": 160, "height": 120, "rate_hz": 10,
          "mount": {"xyz": [0.3, 0.0, 0.5]}}  # fmt: skip


@pytest.fixture(name="runs", scope="module")
def _runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the runs of a leader and of what follows it 3 m behind."""
    experiment = Experiment.model_validate({
        "name": "duo",
        "environment": "park",
        "seconds": 0.5,
        "rig": {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, LIDAR, CAMERA]},
        "robots": {
            "leader": {"route": {"metres": {"start": [0, 1], "waypoints": [[8, 2]]}}, "control": {"speed": 1.0}},
            "follower": {"route": {"metres": {"start": [-2.5, 1], "waypoints": [[8, 1.5]]}}},
        },
    })  # fmt: skip
    return pipeline.generate(experiment, tmp_path_factory.mktemp("runs"), world=make_world(), workers=2)


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "world_of", lambda _: make_world())


def by_name(run: Path, *, quick: bool = False) -> dict[str, Check]:
    return {check.name: check for check in validate(run, workers=2, quick=quick)}


def test_intact_runs_pass(runs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["validate", str(runs)]) == 0  # each of them
    text = capsys.readouterr().out
    assert "FAIL" not in text
    assert text.count("pass     retraced clouds") == text.count("pass     retraced images") == 2
    assert text.count("pass     independent rays") == 2


def moved(change: Callable[[np.ndarray[Any, Any]], None], of: str = "poses") -> Callable[[RawMessage, int], RawMessage]:
    """Change the pose (7,), or twist (6,), of the leader in the model states of another robot."""
    states = ModelStatesReader()

    def changed(raw: RawMessage, _: int) -> RawMessage:
        if raw.topic != table.MODEL_STATES:
            return raw
        rows, data = getattr(states, of)(raw.data), bytearray(raw.data)
        pose = rows[row := states.names.index("leader")].copy()
        at = raw.data.index(rows[row].tobytes())
        change(pose)
        data[at : at + pose.nbytes] = pose.tobytes()
        return raw._replace(data=bytes(data))

    return changed


def test_a_wrong_sign_in_the_pose_of_another_robot_is_found(runs: Path, tmp_path: Path) -> None:
    def mirrored(pose: np.ndarray[Any, Any]) -> None:
        pose[1] = -pose[1]

    def turned(pose: np.ndarray[Any, Any]) -> None:
        pose[5] = -pose[5] - 0.3  # of the quaternion

    for number, change in enumerate((mirrored, turned)):
        checks = by_name(rewritten(runs / "follower", tmp_path / str(number), moved(change)))
        assert checks["retraced clouds"].passed is False
        assert checks["retraced images"].passed is False
        assert checks["world"].passed is True


def test_the_own_robot_has_one_pose(runs: Path, tmp_path: Path) -> None:
    def lifted(pose: np.ndarray[Any, Any]) -> None:
        pose[2] += 0.01

    checks = by_name(rewritten(runs / "leader", tmp_path, moved(lifted)))
    assert checks["static objects"].passed is False
    assert "'leader'" in checks["static objects"].text


def test_velocities_and_points_of_what_moves_are_checked_without_the_world(runs: Path, tmp_path: Path) -> None:
    def reversed_(twist: np.ndarray[Any, Any]) -> None:
        twist[:3] = -twist[:3]

    def turning(twist: np.ndarray[Any, Any]) -> None:
        twist[5] += 0.1

    def shifted(pose: np.ndarray[Any, Any]) -> None:
        pose[1] += 0.1

    intact = by_name(runs / "follower", quick=True)["moving objects"]
    assert intact.passed is True
    assert "m outside (tolerance 0.03)" in intact.text
    for number, (change, of, text) in enumerate((
        (reversed_, "twists", "what moves beside the robot has the velocity of its poses: "),
        (turning, "twists", "what moves beside the robot has the turn rate of its poses: "),
        (shifted, "poses", "points on what moves are in its box at the time of their rays: "),
    )):  # fmt: skip
        found = by_name(rewritten(runs / "follower", tmp_path / str(number), moved(change, of)), quick=True)
        assert [name for name, check in found.items() if check.passed is False] == ["moving objects"]
        assert found["moving objects"].text.startswith(text)
        assert "'leader'" in found["moving objects"].text
    frozen = by_name(rewritten(runs / "follower", tmp_path / "late", delayed(100)), quick=True)
    assert "points on what moves are in its box" in frozen["moving objects"].text  # poses of another time


def delayed(steps: int) -> Callable[[RawMessage, int], RawMessage]:
    """Give the leader the pose and twist of some steps before."""
    states, before = ModelStatesReader(), list[tuple[bytes, bytes]]()

    def changed(raw: RawMessage, _: int) -> RawMessage:
        if raw.topic != table.MODEL_STATES:
            return raw
        row = states.row(raw.data, "leader")
        now = states.poses(raw.data)[row].tobytes(), states.twists(raw.data)[row].tobytes()
        before.append(now)
        data = raw.data
        for old, new in zip(now, before[max(0, len(before) - 1 - steps)], strict=True):
            data = data.replace(old, new)
        return raw._replace(data=data)

    return changed
