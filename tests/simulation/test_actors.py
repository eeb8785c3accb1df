# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Actors beside a robot: seen at each ray's own instant, equal however the drive is cut, hit, and waited for."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world
from stepped_clouds import alike, clouds_of

from fieldtruth import pipeline
from fieldtruth.annotation import annotate
from fieldtruth.bag import topics
from fieldtruth.bag.geometry import ModelStatesReader
from fieldtruth.bag.reader import decoder, open_bag
from fieldtruth.bag.run import open_run
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, DriveError, FieldtruthWarning
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.files import dump_experiment, parse_experiment, validated
from fieldtruth.sense.scene import Scene
from fieldtruth.simulation.company import Company
from fieldtruth.simulation.fleet import Fleet
from fieldtruth.simulation.motion import motion_along
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import World

LIDAR = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 30.0, "spinning": True}
RIG: dict[str, Any] = {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, LIDAR]}
ROUTE = {"metres": {"start": (0.0, 0.0), "waypoints": [(8.0, 0.0)]}}
CROSSER = {"kind": "person", "script": [{"at_s": 0.0, "xy": (3.0, -1.4)}, {"at_s": 2.0, "xy": (3.0, 1.4)}]}
"""At 1.4 m/s over the way of the robot."""
BY_CHANCE = {"kind": "person", "behaviour": "wander", "start": (4.0, 3.0)}


def acted(actors: dict[str, Any], **values: Any) -> Experiment:
    given = {"name": "acted", "environment": "park", "rig": RIG, "route": ROUTE, "actors": actors}
    return Experiment.model_validate(given | values)


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return make_world()


def test_points_lie_on_a_walker_where_its_script_has_it_at_their_instants(world: World) -> None:
    """Each column of a scan meets it 1.4 mm farther than the one before; a body that stood would be 14 cm off."""
    simulation = Simulation(acted({"anna": CROSSER}, seconds=1.5, control={"speed": 0.01}), world=world)
    cloud = clouds_of(simulation, [1.5])[9]
    own = cloud.label == Label.PERSON
    assert cloud.instance is not None
    assert cloud.t_ns is not None
    assert set(cloud.instance[own]) == {simulation.world.object_names.index("anna")}
    assert np.count_nonzero(own) > 100
    mount = simulation.experiment.rig.sensors[2].mount.base_from_sensor  # type: ignore[attr-defined]
    points = np.c_[cloud.xyz[own], np.ones(np.count_nonzero(own))] @ (simulation.robot.world_from_base @ mount).T
    at = -1.4 + 1.4 * (cloud.stamp_ns + cloud.t_ns[own]) / 1e9
    aside = points[:, 1] - at
    assert abs(np.median(aside)) < 0.06
    assert np.abs(aside).max() < 0.6  # arms and legs that swing along its way
    assert np.abs(points[:, 0] - 3.0).max() < 0.35
    assert points[:, 2].max() < 2.0


def test_steps_of_any_length_give_the_readings_of_a_run(world: World, tmp_path: Path) -> None:
    experiment = acted({"anna": CROSSER, "ben": BY_CHANCE}, seconds=0.55)
    one = clouds_of(Simulation(experiment, world=world), [0.55])
    other = clouds_of(Simulation(experiment, world=world), [0.003, 0.1, 0.017, 0.23, 0.2])
    run = open_run(pipeline.generate(experiment, tmp_path, world=world, workers=2).parent)
    assert len(one) == len(other) == len(run["lidar"]) == 5
    assert all(map(alike, one, other))
    assert all(map(alike, one, run["lidar"]))
    assert parse_experiment(dump_experiment(experiment)) == experiment


def test_going_back_gives_the_same_again(world: World) -> None:
    experiment = acted({"anna": CROSSER, "ben": BY_CHANCE}, seconds=3.0)
    simulation = Simulation(experiment, world=world)
    clouds_of(simulation, [0.215])
    state = pickle.loads(pickle.dumps(simulation.save()))
    after = simulation.step(0.3).all["lidar"]
    simulation.restore(state)
    assert all(map(alike, simulation.step(0.3).all["lidar"], after))
    another = Simulation(experiment, world=world)
    another.restore(state)
    assert all(map(alike, another.step(0.3).all["lidar"], after))


def test_another_process_finds_the_actors_of_a_drive(world: World) -> None:
    experiment = acted({"anna": CROSSER, "ben": BY_CHANCE}, seconds=0.3)
    one, other = (Company(experiment, lambda: world) for _ in range(2))
    one.drive()
    other.know(pickle.loads(pickle.dumps(one.known())))
    stamps = np.arange(0, 400_000_000, 5_000_000)
    bodies = list(zip(one.moving("").bodies, other.moving("").bodies, strict=True))
    assert all(np.array_equal(body.at(stamps), again.at(stamps)) for body, again in bodies)
    assert any(np.ptp(body.at(stamps)[:, 1, 3]) > 0.3 for body, _ in bodies)


def test_annotation_of_a_run_finds_its_actors(world: World, tmp_path: Path) -> None:
    still = {"sensors": [*RIG["sensors"][:2], LIDAR | {"spinning": False}]}
    experiment = acted({"anna": CROSSER}, seconds=0.3, rig=still)
    run = pipeline.generate(experiment, tmp_path, world=world, workers=1)
    with pytest.warns(FieldtruthWarning, match="/recorded"):
        made = annotate(run, "park", rig=experiment.rig, scene=Scene(world), out=tmp_path / "again.bag", workers=1)
    recorded = open_run(run)["lidar"]
    with pytest.warns(FieldtruthWarning, match="paper's rig"):
        again = open_run(made)["lidar"]
    assert len(again) == len(recorded) == 3
    assert all(alike(again[k], recorded[k]) for k in range(3))
    assert (recorded[0].label == Label.PERSON).any()


def test_bag_has_poses_and_joints_of_actors(world: World, tmp_path: Path) -> None:
    """Between two knots the root is on the straight line of the script; a wrong sign or stamp is centimetres off."""
    bag = pipeline.generate(acted({"anna": CROSSER}, seconds=0.4), tmp_path, world=world, workers=1)
    reader, joints = ModelStatesReader(), []
    with open_bag(bag) as stored:
        decode = decoder(stored)
        for raw in stored.messages([topics.MODEL_STATES]):
            row = reader.row(raw.data, "anna")
            pose, twist = reader.poses(raw.data)[row], reader.twists(raw.data)[row]
            np.testing.assert_allclose(pose[:2], [3.0, -1.4 + 1.4 * raw.stamp_ns / 1e9], atol=1e-9)
            np.testing.assert_allclose(twist[:2], [0.0, 1.4], atol=1e-6)
        joints = [decode(raw) for raw in stored.messages([topics.ACTOR_JOINTS])]
    assert len(joints) == 40
    assert all(name.startswith("anna/") for name in joints[0].name)
    values, speeds = (np.array([getattr(each, key) for each in joints]) for key in ("position", "velocity"))
    np.testing.assert_allclose(np.diff(values, axis=0), 0.01 * speeds[1:], atol=1e-9)
    assert np.ptp(values, axis=0).max() > 0.1  # legs swing


def test_robot_that_does_not_yield_hits_one_who_stands_in_its_way(world: World) -> None:
    stander = {"kind": "person", "script": [{"at_s": 0.0, "xy": (3.0, 0.0)}]}
    simulation = Simulation(acted({"anna": stander}, control={"speed": 1.0}), world=world, sensors=["imu"])
    simulation.reset()
    with pytest.raises(DriveError, match=r"robot touched anna at \d\.\d\d s, .*; control\.yield_to makes it wait"):
        simulation.step(10.0)
    gap = 3.0 - simulation.robot.pose[0][0] - simulation.experiment.rig.robot.outline[0] / 2
    assert 0.1 < gap < 0.5  # the radius of a person


def test_robot_that_yields_waits_until_its_way_is_free(world: World) -> None:
    """One who stands in the way for 6 s and then goes aside."""
    points = [(0.0, (3.0, 0.0)), (6.0, (3.0, 0.0)), (8.0, (3.0, 3.0))]
    stander = {"kind": "person", "script": [{"at_s": at, "xy": xy} for at, xy in points]}
    control = {"speed": 1.0, "yield_to": 3.0}
    simulation = Simulation(acted({"anna": stander}, control=control), world=world, sensors=["imu"])
    simulation.reset()
    simulation.step(5.5)
    position, (velocity, _) = simulation.robot.pose[0], simulation.robot.velocity
    gap = 3.0 - position[0] - simulation.experiment.rig.robot.outline[0] / 2
    assert 1.2 < gap < 2.0  # YIELD_GAP from the circle around her
    assert abs(velocity[0]) < 0.05
    simulation.step(6.0)
    assert simulation.robot.pose[0][0] > position[0] + 2.0


def test_robot_that_yields_follows_and_does_not_mind_what_flies(world: World) -> None:
    """Behind one who walks at half of its speed, below a multirotor that hovers over its way."""
    slow = {"kind": "person", "script": [{"at_s": 0.0, "xy": (3.0, 0.0)}, {"at_s": 20.0, "xy": (8.0, 0.0)}]}
    drone = {"kind": "multirotor", "script": [{"at_s": 0.0, "xy": (1.5, 0.0), "height_m": 2.0}]}
    control = {"speed": 0.5, "yield_to": 3.0}
    experiment = acted({"anna": slow, "drone": drone}, control=control)
    simulation = Simulation(experiment, world=world, sensors=["imu"])
    simulation.reset()
    simulation.step(12.0)
    gap = 3.0 + 0.25 * 12.0 - simulation.robot.pose[0][0]
    assert 1.5 < gap < 3.5
    assert simulation.robot.velocity[0][0] == pytest.approx(0.25, abs=0.05)


def test_two_robots_see_the_same_actor(world: World) -> None:
    other = {"metres": {"start": (0.0, 4.0), "waypoints": [(8.0, 4.0)]}}
    experiment = acted({"anna": CROSSER}, seconds=0.4, robots={"a": {}, "b": {"route": other}})
    fleet = Fleet(experiment, world=world)
    fleet.reset()
    frames = fleet.step(0.4)
    assert fleet.world.object_names[-3:] == ("a", "b", "anna")
    for frame in frames.values():
        assert np.count_nonzero(frame.all["lidar"][1].label == Label.PERSON) > 15


def test_one_run_of_a_world_with_actors_knows_their_classes(world: World) -> None:
    simulation = Simulation(acted({"anna": CROSSER}), world=world)
    assert [row.label for row in simulation.world.classes.coloured][-1] == Label.PERSON
    assert [row.label for row in world.classes.coloured][-1] == Label.PARTICLE


@pytest.mark.parametrize(
    ("actors", "message"),
    [
        ({"anna": {"kind": "cat"}}, r"actors\.anna\.kind must be one of person, dog"),
        ({"anna": {"kind": "person", "behaviour": "orbit"}}, r"actors\.anna\.behaviour must be one of trails"),
        ({"crowd": {"kind": "person", "count": 201}}, r"actors must be 200 at most, got 201"),
        ({"Anna": {"kind": "person"}}, r"actors\.Anna must be named by"),
        ({"a_1": {"kind": "person"}, "a": {"kind": "person", "count": 2}}, r"actors and robots .* got a_1 twice"),
    ],
)
def test_actors_that_are_not_allowed(actors: dict[str, Any], message: str) -> None:
    given = {"name": "x", "environment": "park", "route": ROUTE, "actors": actors}
    with pytest.raises(ConfigurationError, match=message):
        validated(given, "")


def test_actor_at_the_start_of_the_robot_is_refused(world: World) -> None:
    with pytest.raises(ConfigurationError, match=r"actors\.anna\.start: .* is in the robot's start"):
        Simulation(acted({"anna": {"kind": "person", "start": (0.2, 0.0)}}), world=world).reset()


def test_actors_move_beside_a_robot_that_follows_given_poses(world: World, tmp_path: Path) -> None:
    """The same stepped and in a run; the robot moves as the file says."""
    (track := tmp_path / "track.csv").write_text(
        "t,x,y,z,qx,qy,qz,qw\n" + "".join(f"{0.1 * k},{0.05 * k},0,0.2,0,0,0,1\n" for k in range(9))
    )
    given = {"name": "flown", "environment": "park", "rig": RIG, "drive": {"track": str(track)}, "seconds": 0.45}
    experiment = Experiment.model_validate(given | {"actors": {"anna": CROSSER, "ben": BY_CHANCE}})
    stepped = clouds_of(Simulation(experiment, world=world), [0.03, 0.12, 0.3])
    run = open_run(pipeline.generate(experiment, tmp_path / "out", world=world, workers=2).parent)
    assert len(stepped) == len(run["lidar"]) == 4
    assert all(map(alike, stepped, run["lidar"]))
    assert np.count_nonzero(stepped[2].label == Label.PERSON) > 60


def test_knots_of_given_poses_are_those_of_the_track_file(world: World) -> None:
    """At 2 m/s and 1 rad/s, a millisecond is 2 mm and 0.06 deg."""
    stamps = np.arange(0, 400, 20) * 1_000_000
    angle = stamps / 1e9
    quaternion = np.stack([np.cos(angle / 2), *np.zeros((2, len(angle))), np.sin(angle / 2)], axis=1)
    position = np.stack([2.0 * stamps / 1e9, np.zeros(len(stamps)), np.full(len(stamps), 0.2)], axis=1)
    company = Company(acted({"anna": CROSSER}), lambda: world)
    company.follow(motion_along(stamps, position, quaternion, 0), 380_000_000)
    for knot, pose in zip(stamps, company.poses[""](stamps), strict=True):
        turn = knot / 1e9
        assert pose[:3, 3] == pytest.approx([2.0 * turn, 0.0, 0.2], abs=1e-9)
        assert pose[:2, 0] == pytest.approx([np.cos(turn), np.sin(turn)], abs=1e-9)


def test_motion_is_forgotten_but_for_what_may_still_be_read(world: World) -> None:
    """A reading that was handed out keeps what it needs, and is the same later; a saved state goes on."""
    experiment = acted({"anna": CROSSER, "ben": BY_CHANCE}, seconds=8.0, control={"speed": 0.01})
    simulation, patient = (Simulation(experiment, world=world) for _ in range(2))
    waiting = [each for each in patient.due(0.55) if each.output.name == "lidar"]
    at_once = clouds_of(simulation, [0.55])
    state = simulation.save()
    for _ in range(10):
        patient.step(0.2, sensors=["imu"])
        simulation.step(0.2, sensors=["imu"])
    known = [len(made.company.cast.actors["ben"].roots.save()[1]) for made in (patient, simulation)]  # type: ignore[union-attr]
    assert known[0] > 250
    assert known[1] < 160  # half a second for the GNSS, and what is forgotten together
    assert len(simulation.company.poses[""]) == 256  # type: ignore[union-attr]
    assert all(map(alike, [each.read() for each in waiting], at_once))
    waiting.clear()
    after, _ = patient.step(0.2, sensors=["imu"]), patient.step(0.2, sensors=["imu"])
    assert len(patient.company.cast.actors["ben"].roots.save()[1]) < 160  # type: ignore[union-attr]
    assert after.stamp_ns == 2_750_000_000
    simulation.restore(state)
    other = Simulation(experiment, world=world)
    clouds_of(other, [0.55])
    assert all(map(alike, simulation.step(0.3).all["lidar"], other.step(0.3).all["lidar"]))
