# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs among plants that yield: equal however they are made, none in the hull, retraced; a wrong lean is found."""

import dataclasses
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world

from fieldtruth import pipeline
from fieldtruth.bag.bodies import leans_in
from fieldtruth.bag.run import open_run
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.sense.leaning import plants_of
from fieldtruth.sense.pressed import PressedPlants
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.validation import world as validated_world
from fieldtruth.validation.runner import validate
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Swarm, World
from fieldtruth.world.plants import GRASSES, grow_clump

REEDS = 2
"""Instance id."""


def reeds() -> World:
    rng = np.random.default_rng(3)
    clump = grow_clump({GRASSES["reed"]: 1.0}, name="clump", radius=0.5, per_m2=13, rng=rng, detail=0.3)
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :2, 3] = [[0.9, 0.2], [1.3, -0.5]]
    swarm = Swarm(
        name="reeds", kind="high_grass", object_id=REEDS, meshes=("clump",), mesh=np.zeros(2, np.int32),
        world_from_object=poses, tint=np.ones((2, 3), np.float32),
    )  # fmt: skip
    world = make_world([])
    own = {name: dataclasses.replace(MATERIALS[name], texture="soil") for name in clump.materials}
    names = (*world.object_names, "reeds")
    return dataclasses.replace(
        world, meshes={"clump": clump}, swarms=(swarm,), materials={**world.materials, **own}, object_names=names
    )


def crossing(**values: Any) -> Experiment:
    lidar = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 10.0, "spinning": True,
             "mount": {"xyz": [0.0, 0.0, 0.9]}}  # fmt: skip
    inside = lidar | {
        "name": "inside",
        "topic": "/inside/points",
        "min_range": 0.05,
        "spinning": False,
        "mount": {"xyz": [0.0, 0.0, 0.28]},
    }
    given: dict[str, Any] = {
        "name": "crossing",
        "environment": "park",
        "seconds": 1.25,
        "rig": {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, lidar, inside]},
        "route": {"metres": {"start": (0.0, 0.0), "waypoints": [(4.0, 0.0)]}},
        "control": {"speed": 1.0},
        "plants": {"yielding": True},
    }
    return Experiment.model_validate(given | values)


def clouds_of(simulation: Simulation, steps: list[float], sensor: str = "lidar") -> list[Cloud]:
    simulation.reset()
    return [cloud for seconds in steps for cloud in simulation.step(seconds).all.get(sensor, ())]


def alike(one: Cloud, other: Cloud) -> bool:
    return all(np.array_equal(getattr(one, key), getattr(other, key)) for key in ("xyz", "label", "instance"))


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return reeds()


@pytest.fixture(name="run", scope="module")
def _run(world: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pipeline.generate(crossing(), tmp_path_factory.mktemp("runs"), world=world, workers=2).parent


def test_readings_do_not_depend_on_steps_workers_or_going_back(world: World, run: Path) -> None:
    recorded = open_run(run)["lidar"]
    simulation = Simulation(crossing(), world=world)
    one = clouds_of(simulation, [0.003, 0.4, 0.117, 0.73])
    assert len(one) == len(recorded) == 12
    assert all(alike(each, recorded[k]) for k, each in enumerate(one))
    clouds_of(simulation, [0.615])
    state = pickle.loads(pickle.dumps(simulation.save()))
    after = simulation.step(0.3).all["lidar"]
    simulation.restore(state)
    assert all(map(alike, simulation.step(0.3).all["lidar"], after))
    assert parse_experiment(dump_experiment(crossing())) == crossing()


def test_another_drive_begins_with_plants_that_stand(world: World) -> None:
    """Neither a reset nor a saved state takes leans of a drive that went another way."""
    one, other = (Simulation(crossing(seconds=2.0), world=world, sensors=["lidar"]) for _ in range(2))
    right = clouds_of(other, [0.3, 0.6])
    state = other.save()
    one.reset(start=(0.0, 1.0, -20.0))
    aside = one.step(0.9).all["lidar"]
    assert not any(map(alike, aside, right))
    assert all(map(alike, clouds_of(one, [0.3, 0.6]), right))
    one.reset(start=(0.0, 1.0, -20.0))
    assert all(map(alike, one.step(0.9).all["lidar"], aside))
    one.restore(state)
    assert all(map(alike, one.step(0.2).all["lidar"], other.step(0.2).all["lidar"]))


def test_a_bag_and_its_recording_have_the_same_plants(world: World, run: Path) -> None:
    """Those near the whole route, also where the drive of 1.25 s ended before."""
    swarm = world.swarms[0]
    poses = swarm.world_from_object.copy()
    poses[:, 0, 3] += 3.0
    far = dataclasses.replace(world, swarms=(dataclasses.replace(swarm, world_from_object=poses),))
    simulation = Simulation(crossing(), world=far)
    simulation.reset()
    (again,) = leans_in(far, open_run(run), crossing())
    assert simulation.company is not None
    assert np.array_equal(again.rows, simulation.company.leans[0].rows)
    assert np.array_equal(again.rows, np.arange(len(plants_of(far).top)))


def hull_hits(cloud: Cloud, experiment: Experiment) -> int:
    """Points of plants in the box of the hull, seen from just above it."""
    lidar = experiment.rig.sensors[3].mount.base_from_sensor  # type: ignore[attr-defined]
    points = np.c_[cloud.xyz, np.ones(len(cloud.xyz))] @ lidar.T
    length, width, height = experiment.rig.robot.outline
    low = np.array([-length / 2, -width / 2, 0.0])
    high = np.array([length / 2, width / 2, height - experiment.rig.robot.ground_clearance])
    inside = ((points[:, :3] > low) & (points[:, :3] < high)).all(axis=1)
    assert cloud.instance is not None
    return int((inside & (cloud.instance == REEDS)).sum())


def test_no_point_of_a_plant_is_in_the_hull(world: World, run: Path) -> None:
    """Plants that do not yield stand in it."""
    experiment = crossing()
    yielding = [hull_hits(cloud, experiment) for cloud in open_run(run)["inside"]]
    stiff = crossing(plants={"yielding": False})
    standing = [hull_hits(cloud, stiff) for cloud in clouds_of(Simulation(stiff, world=world), [1.25], "inside")]
    assert max(standing) > 20
    assert max(yielding) == 0


def test_a_run_is_retraced_and_a_wrong_sign_of_the_lean_is_found(
    world: World, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validated_world, "world_of", lambda _: world)
    checks = {check.name: check for check in validate(run, workers=2)}
    assert [check.name for check in checks.values() if check.passed is False] == []
    assert checks["retraced clouds"].passed
    assert checks["independent rays"].passed
    right = PressedPlants.__call__
    monkeypatch.setattr(PressedPlants, "__call__", lambda *given: -right(*given))
    wrong = {check.name: check for check in validate(run, workers=2)}
    assert wrong["retraced clouds"].passed is False


def test_stiff_plants_and_none_leave_no_trace_in_the_experiment() -> None:
    text = dump_experiment(crossing(plants={"yielding": False}))
    assert "yielding" not in text
    assert "through" not in text
