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
from stepped_clouds import alike, check_steps, clouds_of

from fieldtruth import pipeline
from fieldtruth.annotation import annotate
from fieldtruth.bag.bodies import moving_in
from fieldtruth.bag.reader import open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.errors import FieldtruthWarning
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment
from fieldtruth.sense.leaning import LEAN_KNOT_NS, plants_of
from fieldtruth.sense.pressed import PressedPlants
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.company import Company
from fieldtruth.simulation.fleet import Fleet
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


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return reeds()


@pytest.fixture(name="run", scope="module")
def _run(world: World, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pipeline.generate(crossing(), tmp_path_factory.mktemp("runs"), world=world, workers=2).parent


def test_readings_do_not_depend_on_steps_workers_or_going_back(world: World, run: Path) -> None:
    check_steps(Simulation(crossing(), world=world), run)
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
    leaning = moving_in(far, open_run(run), crossing())[1].leaning
    assert leaning is not None
    (again,) = leaning.causes
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


def test_plants_far_from_the_route_lean_where_a_user_drives(world: World) -> None:
    """Where no plant leans along the route, 10 m away, however the drive is cut; the scene of the start stays."""
    swarm = world.swarms[0]
    poses = swarm.world_from_object.copy()
    poses[:, 1, 3] += 10.0
    far = dataclasses.replace(world, swarms=(dataclasses.replace(swarm, world_from_object=poses),))
    found = list[list[Cloud]]()
    for steps in ([1.25], [0.213, 0.4, 0.637]):
        simulation = Simulation(crossing(), world=far, sensors=["inside"])
        simulation.reset(start=(0.0, 10.0, 0.0))
        found.append([cloud for seconds in steps for cloud in simulation.step(seconds, (1.0, 0.0)).all["inside"]])
    assert max(hull_hits(cloud, crossing()) for cloud in found[0]) == 0
    assert all(map(alike, *found))
    assert simulation.scene.plants is None


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


def followed(world: World, first: str, second: str) -> Fleet:
    """A robot and another one 0.1 m behind it."""
    starts = {first: 0.0, second: -1.1}
    robots = {
        name: {"route": {"metres": {"start": (starts[name], 0.0), "waypoints": [(8.0, 0.0)]}}}
        for name in sorted(starts)
    }
    rig = {"sensors": [{"kind": "imu"}, {"kind": "gnss"}]}
    return Fleet(crossing(route=None, robots=robots, seconds=2.8, rig=rig), world=world)


def test_a_robot_behind_another_feels_that_its_stems_lie(world: World) -> None:
    """In 1.1 s no more than 0.35 (1 - exp(-1.1 / 25)) = 1.5 % of what the first took comes back."""
    fleet = followed(world, "a", "b")
    fleet.step(2.8)
    first, second = (each.robot for each in fleet.robots.values())
    assert second.pose[0][0] > 1.35  # its front is behind the last reeds
    assert first.stems is not None
    assert second.stems is not None
    assert first.stems.work > 10.0
    assert 0.0 < second.stems.work < 0.015 * first.stems.work


@pytest.mark.slow
def test_steps_and_the_order_of_robots_change_nothing(world: World) -> None:
    one, other = followed(world, "a", "b"), followed(world, "b", "a")
    for seconds in (0.01, 1.23, 1.56):
        one.step(seconds)
    driven = other.drive()
    for name, other_name in (("a", "b"), ("b", "a")):
        motion = one.robots[name].track.motion
        assert np.array_equal(motion.position[-1], driven[other_name].track.motion.position[-1])
        assert np.array_equal(motion.quaternion_wxyz[-1], driven[other_name].track.motion.quaternion_wxyz[-1])


def test_another_process_finds_the_leans_of_a_drive(world: World) -> None:
    one, other = (Company(crossing(), lambda: world) for _ in range(2))
    one.drive()
    other.know(pickle.loads(pickle.dumps(one.known())))
    stamps = np.arange(20) * LEAN_KNOT_NS
    (leans,), (again,) = one.leans, other.leans
    assert np.array_equal(again(again.rows, stamps), leans(leans.rows, stamps))
    assert np.abs(leans(leans.rows, stamps)).max() > 1.0


def test_annotation_of_a_run_finds_its_plants_pressed(world: World, run: Path, tmp_path: Path) -> None:
    with pytest.warns(FieldtruthWarning, match="/recorded"):
        made = annotate(run, "park", rig=crossing().rig, scene=Scene(world), out=tmp_path / "again.bag", workers=2)
    assert same_clouds(made, "/inside/points") == 12


def same_clouds(bag: Path, topic: str) -> int:
    """Number of clouds of a topic, all of which are as those that were recorded."""
    with open_bag(bag) as stored:
        found = {name: [raw.data for raw in stored.messages([name])] for name in (topic, f"/recorded{topic}")}
    again, recorded = found.values()
    assert again == recorded
    return len(again)


def test_stiff_plants_and_none_leave_no_trace_in_the_experiment() -> None:
    text = dump_experiment(crossing(plants={"yielding": False}))
    assert "yielding" not in text
    assert "through" not in text
