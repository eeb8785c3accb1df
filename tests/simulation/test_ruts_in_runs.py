# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs on soil that keeps ruts: equal however they are made, retraced; ruts on the wrong side are found."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world
from stepped_clouds import alike, check_steps, clouds_of

from fieldtruth import pipeline
from fieldtruth.bag.provenance import sha256_of
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.degradation import degrade
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment, with_overrides
from fieldtruth.sense import ruts as under_test
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.validation import world as validated_world
from fieldtruth.validation.runner import validate
from fieldtruth.world.model import World

SAND_M = 0.02188
"""Sinkage of the robot's wheels in sand, rounded."""


def sandy(**values: Any) -> Experiment:
    lidar = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 10.0, "spinning": True,
             "mount": {"xyz": [-0.3, 0.0, 0.5], "rpy_deg": [0.0, 35.0, 180.0]}}  # fmt: skip
    given: dict[str, Any] = {
        "name": "sandy",
        "environment": "park",
        "seconds": 1.25,
        "rig": {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, lidar]},
        "route": {"metres": {"start": (0.0, 0.0), "waypoints": [(4.0, 0.0)]}},
        "control": {"speed": 1.0},
        "soil": {"trodden_earth": "sand"},
        "ground": {"ruts": True},
    }
    return Experiment.model_validate(given | values)


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return make_world([], spacing=0.05, side=12.0)


@pytest.fixture(name="run", scope="module")
def _run(world: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pipeline.generate(sandy(), tmp_path_factory.mktemp("runs"), world=world, workers=2).parent


def test_readings_do_not_depend_on_steps_workers_or_going_back(world: World, run: Path) -> None:
    simulation = Simulation(sandy(), world=world)
    one = check_steps(simulation, run)
    simulation.reset(start=(0.0, 1.0, -20.0))
    assert not any(map(alike, simulation.step(0.9).all["lidar"], one))
    assert all(map(alike, clouds_of(simulation, [0.9]), one))


def test_points_of_the_bag_lie_in_both_ruts_behind_the_robot(run: Path) -> None:
    """They are as deep as a wheel sinks into sand, and nothing is deeper; between the wheels the plane is at 0."""
    experiment, opened = sandy(), open_run(run)
    cloud = opened["lidar"][11]
    mount = experiment.rig.sensors[2].mount.base_from_sensor  # type: ignore[attr-defined]
    pose = opened.trajectory.world_from_base(cloud.stamp_ns)
    points = transforms.transform(pose @ mount, cloud.xyz)
    behind = (points[:, 0] > -0.2) & (points[:, 0] < 0.3)
    track = np.abs(np.abs(points[:, 1]) - experiment.rig.wheels.half_track)
    for side in (-1, 1):
        inside = behind & (track < 0.03) & (side * points[:, 1] > 0)
        assert inside.sum() > 5
        assert np.median(points[inside, 2]) == pytest.approx(-SAND_M, abs=0.001)
    assert points[behind, 2].min() > -SAND_M - 0.002
    assert np.abs(points[behind & (track > 0.15), 2]).max() < 0.002


def test_a_run_is_retraced_and_ruts_on_the_wrong_side_are_found(
    world: World, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validated_world, "world_of", lambda _: world)
    checks = {check.name: check for check in validate(run, workers=2)}
    assert [check.name for check in checks.values() if check.passed is False] == []
    assert checks["retraced clouds"].passed
    assert checks["independent rays"].passed
    right = under_test._wheels

    def aside(*given: Any) -> Any:
        wheels = right(*given)
        wheels[:, 1] += 0.1
        return wheels

    monkeypatch.setattr(under_test, "_wheels", aside)
    wrong = {check.name: check for check in validate(run, workers=2)}
    assert wrong["retraced clouds"].passed is False
    assert wrong["independent rays"].passed is False


def test_a_degraded_lidar_sees_the_ruts_of_a_run_with_noise(world: World, run: Path, tmp_path: Path) -> None:
    signal = {"lidar": {"range_noise": [[12.0, 0.02]]}}
    whole = pipeline.generate(with_overrides(sandy(), signal=signal), tmp_path / "noisy", world=world)
    assert sha256_of(degrade(run, tmp_path / "degraded", signal=signal, scene=Scene(world))) == sha256_of(whole)


def test_ground_that_keeps_no_ruts_leaves_no_trace_in_the_experiment() -> None:
    assert parse_experiment(dump_experiment(sandy())) == sandy()
    assert "ruts" not in dump_experiment(sandy(ground={"ruts": False}))
    with pytest.raises(ValueError, match="ruts"):
        sandy(route=None, drive={"track": "flight.csv"})
