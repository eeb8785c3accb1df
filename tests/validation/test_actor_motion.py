# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs with actors: retraced among bodies that the bag places; a wrong sign in each kind of their truth is found."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_bags import rewritten
from sense_worlds import at, box, make_world

from fieldtruth import pipeline
from fieldtruth.bag import topics as table
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.messages import STORE
from fieldtruth.bag.reader import RawMessage
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import load_experiment
from fieldtruth.validation import Check, world
from fieldtruth.validation.runner import validate
from fieldtruth.world.model import Collider, World

pytestmark = pytest.mark.usefixtures("small_sky")

LIDAR = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 20.0, "spinning": True}
CAMERA = {"kind": "camera", "name": "eye", "width": 160, "height": 120, "rate_hz": 10,
          "mount": {"xyz": [0.3, 0.0, 0.5]}}  # fmt: skip
Row = np.ndarray[Any, Any]


def tiny() -> World:
    collider = Collider(shape="box", size=(0.4, 0.4, 2.0), position=(0.0, 0.0, -1.0))
    pillar = replace(box("pillar", (0.2, 0.2, 1.0)), colliders=(collider,))
    return make_world([(pillar, at(6.0, 3.0, 1.0))])


@pytest.fixture(name="run", scope="module")
def _run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    experiment = Experiment.model_validate({
        "name": "acted",
        "environment": "park",
        "seconds": 0.6,
        "rig": {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, {"kind": "wheel_odometry"}, LIDAR, CAMERA]},
        "route": {"metres": {"start": [0, 0], "waypoints": [[8, 0]]}},
        "actors": {
            "anna": {"kind": "person", "script": [{"at_s": 0, "xy": [3, -1]}, {"at_s": 2, "xy": [4, 1]}]},
            "ben": {"kind": "person", "behaviour": "wander", "start": [4, 2]},
            "far": {"kind": "car", "script": [{"at_s": 0, "xy": [-8, 8]}]},
        },
    })  # fmt: skip
    return pipeline.generate(experiment, tmp_path_factory.mktemp("runs"), world=tiny(), workers=2).parent


@pytest.fixture(autouse=True)
def _tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world, "world_of", lambda _: tiny())


def by_name(run: Path) -> dict[str, Check]:
    return {check.name: check for check in validate(run, workers=2)}


def test_intact_run_passes(run: Path) -> None:
    checks = by_name(run)
    assert [check.name for check in checks.values() if check.passed is False] == []
    assert checks["actors"].passed
    assert checks["retraced clouds"].passed
    assert checks["retraced images"].passed
    assert checks["independent rays"].passed


def changed(change: Callable[[Row, Row], None]) -> Callable[[RawMessage, int], RawMessage]:
    """Change pose (7,) and twist (6,) of anna in the model states."""
    states = ModelStatesReader()

    def rewrite(raw: RawMessage, _: int) -> RawMessage:
        if raw.topic != table.MODEL_STATES:
            return raw
        poses, twists, data = states.poses(raw.data).copy(), states.twists(raw.data).copy(), bytearray(raw.data)
        row, end = states.names.index("anna"), len(data)
        change(poses[row], twists[row])
        data[end - twists.nbytes :] = twists.tobytes()
        first = end - twists.nbytes - 4 - poses.nbytes
        data[first : first + poses.nbytes] = poses.tobytes()
        return raw._replace(data=bytes(data))

    return rewrite


def test_wrong_signs_of_pose_and_twist_are_found(run: Path, tmp_path: Path) -> None:
    def mirrored(pose: Row, twist: Row) -> None:
        pose[1], twist[1] = -pose[1], -twist[1]

    def backwards(_: Row, twist: Row) -> None:
        twist[:2] = -twist[:2]

    def below(pose: Row, _: Row) -> None:
        pose[2] -= 1.0

    def inside(pose: Row, _: Row) -> None:
        pose[:2] += 6.0 - 3.0 - 0.15, 3.0 + 0.7

    found = {
        change.__name__: by_name(rewritten(run, tmp_path / change.__name__, changed(change)))
        for change in (mirrored, backwards, below, inside)
    }
    assert found["mirrored"]["retraced clouds"].passed is False
    assert found["mirrored"]["retraced images"].passed is False
    assert found["backwards"]["moving objects"].passed is False
    for name in ("below", "inside"):
        assert found[name]["actors"].passed is False
    assert "on the ground" in found["below"]["actors"].text
    assert "outside of solid objects" in found["inside"]["actors"].text


def test_a_wrong_sign_of_the_joints_is_found(run: Path, tmp_path: Path) -> None:
    """Arms and legs that swing the other way."""

    def rewrite(raw: RawMessage, _: int) -> RawMessage:
        if raw.topic != table.ACTOR_JOINTS:
            return raw
        message: Any = STORE.deserialize_ros1(raw.data, raw.msgtype)
        message.position = -message.position
        return raw._replace(data=bytes(STORE.serialize_ros1(message, raw.msgtype)))

    checks = by_name(rewritten(run, tmp_path, rewrite))
    assert checks["actors"].passed is False
    assert checks["retraced clouds"].passed is False


def test_commands_of_a_robot_that_yields_are_a_share_of_the_followers(run: Path, tmp_path: Path) -> None:
    """A run that does not yield, with slower commands, passes only if its experiment says that it yields."""

    def slower(raw: RawMessage, _: int) -> RawMessage:
        if raw.topic != table.COMMANDS:
            return raw
        message: Any = STORE.deserialize_ros1(raw.data, raw.msgtype)
        message.linear.x, message.angular.z = 0.5 * message.linear.x, 0.5 * message.angular.z
        return raw._replace(data=bytes(STORE.serialize_ros1(message, raw.msgtype)))

    given = load_experiment(run / "experiment.yaml")
    yields = given.model_copy(update={"control": given.control.model_copy(update={"yield_to": 4.0})})
    for name, experiment, passed in (("never", given, False), ("yields", yields, True)):
        assert by_name(rewritten(run, tmp_path / name, slower, experiment))["commands"].passed is passed
