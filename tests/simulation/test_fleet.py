# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Robots that are stepped together: they see each other, touch each other, and are equal however they are stepped."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import make_world
from stepped_clouds import alike

from fieldtruth import pipeline
from fieldtruth.bag.decode import count_messages
from fieldtruth.bag.file import BagError
from fieldtruth.bag.run import open_run
from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, DriveError, OutputError, UnknownNameError
from fieldtruth.core.readings import Cloud
from fieldtruth.experiment.config import Experiment
from fieldtruth.experiment.rig import body_parts
from fieldtruth.kernels.robot import SKIN
from fieldtruth.sense.robot import part_table
from fieldtruth.simulation.company import Company
from fieldtruth.simulation.due import Frame
from fieldtruth.simulation.fleet import Fleet
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import World

LIDAR = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 30.0, "spinning": True}
RIG: dict[str, Any] = {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, LIDAR]}


def route(*points: tuple[float, float]) -> dict[str, Any]:
    return {"metres": {"start": points[0], "waypoints": points[1:]}}


AHEAD = {"route": route((0.0, 0.0), (8.0, 1.0))}
NEAR = {"route": route((0.0, 0.0), (2.2, 0.0))}
"""It arrives 2 m before the waypoint, with the fix at 0.5 s, and stands at 1.0 s."""
BEHIND = {"route": route((-2.5, 0.0), (8.0, 1.0)), "control": {"speed": 0.5}}


def duo(leader: dict[str, Any], follower: dict[str, Any], **values: Any) -> Experiment:
    """Two robots with a LiDAR each."""
    given = {"name": "duo", "environment": "park", "rig": RIG, "robots": {"leader": leader, "follower": follower}}
    return Experiment.model_validate(given | values)


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    return make_world()


def driven(fleet: Fleet, seconds: list[float]) -> dict[str, list[Cloud]]:
    """Clouds of each robot."""
    clouds: dict[str, list[Cloud]] = {name: [] for name in fleet.robots}
    fleet.reset()
    for each in seconds:
        for name, frame in fleet.step(each).items():
            clouds[name] += frame.all.get("lidar", ())
    return clouds


def test_points_lie_on_the_other_robot_at_the_time_of_their_rays(world: World) -> None:
    fleet = Fleet(duo(AHEAD, BEHIND, seconds=1.0), world=world)
    clouds = driven(fleet, [1.0])["follower"]
    assert fleet.world.object_names[-2:] == ("leader", "follower")
    motions = {name: each.track.swept for name, each in fleet.drive().items()}
    cloud = clouds[4]
    own = cloud.label == Label.ROBOT
    assert cloud.instance is not None
    assert set(cloud.instance[own]) == {fleet.world.object_names.index("leader")}
    assert np.count_nonzero(own) > 50
    table = part_table(body_parts(fleet.robots["leader"].experiment.rig))
    mount = fleet.robots["follower"].experiment.rig.sensors[2].mount.base_from_sensor  # type: ignore[attr-defined]
    assert cloud.t_ns is not None
    for point, since in zip(cloud.xyz[own], cloud.t_ns[own], strict=True):
        row = int(np.searchsorted(motions["leader"].stamps_ns, cloud.stamp_ns + int(since)))
        poses = {
            name: transforms.pose_from_quaternion_wxyz(each.position[row], each.quaternion_wxyz[row])
            for name, each in motions.items()
        }
        in_leader = transforms.inverse(poses["leader"]) @ poses["follower"] @ mount @ np.append(point, 1.0)
        outside = np.abs(in_leader[:3] - table[:, 1:4]) - table[:, 4:]  # of the boxes around the parts
        assert np.abs(outside.max(axis=1)).min() < 0.01
        assert outside.max(axis=1).min() < SKIN


def test_steps_of_any_length_give_the_readings_of_a_run(world: World, tmp_path: Path) -> None:
    """The leader arrives before the follower's end."""
    experiment = duo(NEAR, BEHIND, seconds=1.22)
    stepped = driven(Fleet(experiment, world=world), [0.01] * 93 + [0.15, 0.14])
    folder = pipeline.generate(experiment, tmp_path, world=world, workers=2)
    for name, count in (("leader", 10), ("follower", 12)):
        run = open_run(folder / name)
        assert len(run["lidar"]) == len(stepped[name]) == count
        assert all(map(alike, run["lidar"], stepped[name]))


def test_a_run_of_each_robot_has_its_topics_in_its_namespace(world: World, tmp_path: Path) -> None:
    experiment = duo(AHEAD, BEHIND, seconds=0.2, static_objects="latched")
    folder = pipeline.generate(experiment, tmp_path, world=world, workers=1)
    assert folder == tmp_path / "duo"
    bag = folder / "leader" / "duo_leader.bag"
    names = set(count_messages(bag))
    assert {"/clock", "/leader/tf", "/leader/tf_static", "/leader/os1_cloud_node/points"} < names
    assert all(name.startswith("/leader/") for name in names - {"/clock"})
    run = open_run(folder / "leader")
    assert {"/tf", "/os1_cloud_node/points"} < run.counts.keys()
    assert run.experiment is not None
    assert run.experiment.of_robot("follower") == experiment.of_robot("follower")
    again = pipeline.generate(run.experiment, tmp_path / "again", world=world, workers=1)
    assert again.read_bytes() == bag.read_bytes()
    with pytest.raises(OutputError, match="already finished"):
        pipeline.generate(experiment, tmp_path, world=world)
    with pytest.raises(BagError, match=r"a run of each of several robots; give one: .*follower, .*leader"):
        open_run(folder)
    (folder / "follower" / "duo_follower.bag").rename(tmp_path / "moved")
    pipeline.generate(experiment, tmp_path, world=world)  # makes what is missing
    assert (folder / "follower" / "duo_follower.bag").read_bytes() == (tmp_path / "moved").read_bytes()


def test_errors_of_equal_sensors_of_two_robots_differ(world: World) -> None:
    rig = {"sensors": [{"kind": "imu", "signal": "datasheet"}, {"kind": "gnss"}]}
    fleet = Fleet(duo(AHEAD, {"route": route((0.0, 5.0), (8.0, 6.0))}, rig=rig, seconds=0.1), world=world)
    fleet.reset()
    frames = fleet.step(0.1)
    one, other = (frames[name]["imu"].linear_acceleration - frames[name]["imu/truth"].linear_acceleration
                  for name in ("leader", "follower"))  # fmt: skip
    assert np.abs(one - other).min() > 1e-4
    seeds = {each.experiment.noise_seed for each in fleet.robots.values()}
    assert len(seeds | {fleet.experiment.seed}) == 3


def test_a_robot_that_runs_into_another_one_ends_its_drive(world: World) -> None:
    slow = {"route": route((0.0, 0.0), (8.0, 0.0)), "control": {"speed": 0.1}}
    experiment = duo(slow, {"route": route((-1.5, 0.0), (8.0, 0.0)), "control": {"speed": 1.0}})
    with pytest.raises(DriveError, match=r"^follower: robot touched leader at 0\.\d\d s"):
        Company(experiment, lambda: world).drive()
    fleet = Fleet(experiment, world=world, sensors=["imu"])
    fleet.reset()
    with pytest.raises(DriveError, match=r"^follower: robot touched leader"):
        fleet.step(2.0)
    stopped = fleet.seconds
    assert fleet.robots["follower"].done
    before = fleet.robots["leader"].robot.pose[0][0]
    frame = fleet.step(0.5)["follower"]
    assert fleet.seconds == pytest.approx(stopped + 0.5)
    assert fleet.robots["leader"].robot.pose[0][0] == pytest.approx(before + 0.05, abs=0.01)
    assert frame.pose[0, 3] == pytest.approx(-0.99, abs=0.08)  # it stands one length behind the leader, where it hit


def test_robots_that_start_within_each_other_are_refused_in_one_line(world: World) -> None:
    for start in ((0.0, 0.0), (0.4, 0.3)):
        experiment = duo(AHEAD, {"route": route(start, (8.0, 5.0))}, seconds=1.0)
        with pytest.raises(DriveError, match=r"^leader: robot touched follower at 0\.0\d s"):
            Company(experiment, lambda: world).drive()


def test_a_robot_whose_drive_has_ended_stands_and_is_seen(world: World) -> None:
    fleet = Fleet(duo(NEAR, {"route": route((-4.0, 0.0), (8.0, 5.0))}, seconds=1.5), world=world, sensors=["lidar"])
    fleet.reset()
    fleet.step(1.0)
    assert fleet.robots["leader"].done
    assert not fleet.done
    cloud = fleet.step(0.2)["follower"]["lidar"]
    assert np.count_nonzero(cloud.label == Label.ROBOT) > 20
    assert fleet.step(0.3)["leader"].readings == {}
    assert fleet.done
    with pytest.raises(DriveError, match=r"all drives have ended at 1\.5 s"):
        fleet.step(0.1)


def test_commands_move_one_robot_and_the_follower_of_its_route_the_other(world: World) -> None:
    fleet = Fleet(duo(AHEAD, BEHIND), world=world, sensors=["imu"])
    frames: dict[str, Frame] = fleet.step(1.0, {"follower": (0.0, 0.0)})
    assert frames["follower"].pose[0, 3] == pytest.approx(-2.5, abs=0.01)
    assert frames["leader"].pose[0, 3] == pytest.approx(0.28, abs=0.05)


def test_one_robot_has_the_experiment_file_of_before(world: World, tmp_path: Path) -> None:
    values = {"name": "one", "environment": "park", "rig": RIG, "route": AHEAD["route"], "seconds": 0.2}
    bag = pipeline.generate(Experiment.model_validate(values), tmp_path, world=world)
    assert bag == tmp_path / "one" / "one.bag"
    text = (tmp_path / "one" / "experiment.yaml").read_text()
    assert "robots" not in text
    assert "namespace" not in text
    assert Experiment.model_validate(values).noise_seed == 0


def test_bad_input_is_refused_in_one_line(world: World) -> None:
    experiment = duo(AHEAD, BEHIND)
    with pytest.raises(ConfigurationError, match=r"duo has several robots \(leader, follower\), which a Fleet drives"):
        Simulation(experiment, world=world).reset()
    one = Experiment.model_validate({"name": "one", "environment": "park", "route": AHEAD["route"]})
    with pytest.raises(ConfigurationError, match="one has one robot"):
        Fleet(one, world=world)
    fleet = Fleet(experiment, world=world, sensors=["imu"])
    for seconds in (0.015, 0.0, -1.0, float("nan"), 1e6):
        with pytest.raises(ConfigurationError, match=r"seconds must be a multiple of 0\.01"):
            fleet.step(seconds)
    with pytest.raises(UnknownNameError, match="unknown robot 'leadr'"):
        fleet.step(0.1, {"leadr": (0.0, 0.0)})
    with pytest.raises(ConfigurationError, match="speed must be from -1 to 1 m/s, got 9"):
        fleet.step(0.1, {"leader": (9.0, 0.0)})
