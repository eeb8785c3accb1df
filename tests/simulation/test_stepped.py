# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of a simulation that is stepped, of ``frames`` and of the bag are equal, for every kind of sensor."""

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import make_experiment
from sense_worlds import make_world
from small_park import in_small_park
from stepped_rigs import SCENE, experiment, messages_in, messages_of, sensors

import fieldtruth as ft
from fieldtruth.drive.simulate import drive


def steps(made: ft.Experiment, seconds: float) -> Iterator[ft.Frame]:
    sim = ft.Simulation(made, scene=SCENE)
    sim.reset()
    while not sim.done:
        yield sim.step(seconds)


@pytest.mark.parametrize(("real", "seconds"), [(False, 0.1), (True, 0.037)], ids=["ideal", "signal and clock"])
def test_frames_of_steps_of_threads_and_of_the_bag_are_equal(real: bool, seconds: float, tmp_path: Path) -> None:
    """Steps of the period of sensors, which end at their stamps, and steps of no period."""
    made = experiment(signal=real, clock=real)
    bag = messages_in(ft.generate(made, tmp_path, scene=SCENE, workers=1), made)
    assert len(bag) > 20
    for frames in (steps(made, seconds), ft.frames(made, scene=SCENE, workers=2)):
        found = messages_of(frames, made)
        assert found.keys() == bag.keys()
        for topic, messages in bag.items():
            assert found[topic] == messages, topic


def motion_only(made: ft.Experiment) -> list[str]:
    return [config.name for config in made.rig.in_order() if not config.sees]


def equal(found: list[ft.Frame], expected: list[ft.Frame], made: ft.Experiment) -> None:
    assert messages_of(found, made) == messages_of(expected, made)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.pose, other.pose)


def test_a_restored_simulation_goes_on_with_the_same_bits() -> None:
    """Every kind with all errors, first by commands and then by the follower, in the same object and in another."""
    made = experiment(signal=True, clock=True, seconds=0.3)
    sim = ft.Simulation(made, scene=SCENE)
    sim.reset(seed=4)
    sim.step(0.13, (0.5, 0.3))
    state = pickle.loads(pickle.dumps(sim.save()))

    def go_on(simulation: ft.Simulation) -> list[ft.Frame]:
        return [simulation.step(0.06, (0.5, -0.4)), simulation.step(0.05), simulation.step(1.0)]

    expected = go_on(sim)
    assert sim.done
    assert "zed/left" in expected[2]
    sim.restore(state)
    assert not sim.done
    sim.step(0.06, (-0.5, 0.0), sensors=["front"])  # another path, with photographs at the same stamps
    sim.restore(state)
    equal(go_on(sim), expected, made)
    other = ft.Simulation(made, scene=SCENE)
    other.restore(state)
    equal(go_on(other), expected, made)


def test_seeds_and_commands_decide_everything() -> None:
    made = experiment(signal=True, seconds=0.3)
    names = [*motion_only(made), "flash"]

    def driven(seed: int, *sizes: float, turn_rate: float = 0.2) -> tuple[ft.Frame, dict[str, Any]]:
        sim = ft.Simulation(made, scene=SCENE, sensors=names)
        sim.reset(seed)
        frames = [sim.step(size, (0.4, turn_rate)) for size in sizes]
        return frames[-1], messages_of(frames, made)

    end, messages = driven(3, 0.25)
    for sizes in ((0.25,), (0.001, 0.002, 0.2, 0.047)):
        again, same = driven(3, *sizes)
        np.testing.assert_array_equal(again.pose, end.pose)
        assert same == messages
    seeded, noise = driven(4, 0.25)
    np.testing.assert_array_equal(seeded.pose, end.pose)  # the world is given: only the errors differ
    for topic in ("/imu/data", "/navsat/fix", "/flash/points"):
        assert noise[topic] != messages[topic]
    assert noise["/imu/data/truth"] == messages["/imu/data/truth"]
    turned, _ = driven(3, 0.25, turn_rate=-0.2)
    assert abs(turned.pose - end.pose).max() > 1e-3


def test_commands_move_the_robot_as_far_as_they_say() -> None:
    """On level ground: a ramp with the robot's acceleration a to the speed v takes v^2 / 2a less than v t."""
    flat = ft.Scene(make_world(side=40.0))
    sim = ft.Simulation(make_experiment([(15.0, 0.0)], seconds=5.0), scene=flat, sensors=[])
    start = sim.reset().pose
    for _ in range(20):
        end = sim.step(0.1, (0.5, 0.0)).pose
    speed, acceleration = 0.5, ft.Rig().robot.max_acceleration
    assert end[0, 3] - start[0, 3] == pytest.approx(speed * 2.0 - speed**2 / (2 * acceleration), abs=0.01)
    assert end[1, 3] == pytest.approx(start[1, 3], abs=0.01)
    assert sim.robot.velocity[0][0] == pytest.approx(speed, abs=0.01)
    while not sim.done:
        sim.step(0.5, (0.0, 0.0))  # a robot that stands by command is not stuck
    assert sim.seconds == 5.0


def test_a_drive_ends_at_its_last_waypoint() -> None:
    made = make_experiment([(1.1, 0.0)])
    sim, track = ft.Simulation(made, scene=SCENE, sensors=["imu"]), drive(SCENE.world, made)
    while not sim.done:
        frame = sim.step(0.3)
    assert frame.stamp_ns == int(track.motion.stamps_ns[-1])
    with pytest.raises(ft.DriveError, match=r"^the drive has ended at .* s; reset\(\) begins another$"):
        sim.step(0.1)
    assert sim.reset().stamp_ns == 0
    assert not sim.done


def test_what_is_due_and_asked_for_is_sensed() -> None:
    made = experiment(seconds=0.4)
    sim = ft.Simulation(made, scene=SCENE, sensors=["turning", "flash", "imu"])
    first = sim.step(0.15)
    assert set(first) == {"flash", "imu"}  # the turn that begins at 0.1 s is complete at 0.2 s
    assert [reading.stamp_ns for reading in first.all["imu"]] == [round(k * 1000 / 300) * 10**6 for k in range(1, 46)]
    with pytest.raises(ft.UnknownNameError, match=r"^unknown reading at 0.15 s 'turning'; .*Available: "):
        first["turning"]
    second = sim.step(0.05, sensors=["turning"])
    assert set(second) == {"turning"}
    assert second["turning"].stamp_ns == 100_000_000
    last = sim.step(9.0)
    assert [cloud.stamp_ns for cloud in last.all["turning"]] == [200_000_000, 300_000_000, 400_000_000]
    assert [cloud.stamp_ns for cloud in last.all["flash"]] == [285_714_286]
    assert sim.done


def test_mistakes_are_one_line() -> None:
    sim = ft.Simulation(experiment(), scene=SCENE, sensors=["imu"])
    mistakes: list[tuple[dict[str, Any], str]] = [
        ({"seconds": -0.1}, "seconds must be between 0.001 and 86400, got -0.1"),
        ({"seconds": float("nan")}, "seconds must be between 0.001 and 86400, got nan"),
        ({"seconds": 0.1, "command": (9.0, 0.0)}, "command: speed must be from -1 to 1 m/s, got 9.0"),
        ({"seconds": 0.1, "command": (0.0, float("inf"))}, "command: turn rate must be from -2 to 2 rad/s, got inf"),
        ({"seconds": 0.1, "sensors": ["lidr"]}, "unknown sensor 'lidr'; .*Available: "),
    ]
    for step, message in mistakes:
        with pytest.raises(ft.FieldtruthError, match=f"^{message}"):
            sim.step(**step)
    assert sim.step(0.01).stamp_ns == 10**7  # and nothing has happened


def test_a_drive_that_fails_ends_the_simulation_with_the_reason() -> None:
    sim = ft.Simulation(make_experiment([(6.0, 0.0)], start=(-17.0, 0.0)), scene=SCENE, sensors=[])
    with pytest.raises(ft.DriveError, match="outside the world"):
        sim.step(50.0, (-1.0, 0.0))
    assert sim.done
    with pytest.raises(ft.DriveError, match=r"outside the world .*; reset\(\) begins another drive$"):
        sim.step(0.5)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "one of experiment, environment and world is required"),
        ({"experiment": "park_9"}, "unknown experiment 'park_9'; "),
        ({"experiment": "park_1", "environment": "lake"}, "environment must be None where an experiment is given"),
        ({"experiment": "park_1", "robot": "jackal", "rig": ft.Rig()}, "robot must be None where a rig is given"),
        ({"experiment": "park_1", "sensors": ["os2"]}, "unknown sensor 'os2'; "),
        ({"environment": "moor"}, "unknown environment 'moor'; "),
        ({"world": "park"}, "world must be a World, got 'park'; see load_world"),
        ({"scene": SCENE, "world": make_world()}, "scene must be of the given world "),
    ],
)
def test_what_is_simulated_must_be_clear(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ft.FieldtruthError, match=f"^{message}"):
        ft.Simulation(**given)


def test_what_is_simulated() -> None:
    assert ft.Simulation(environment="lake").experiment.name == "lake_1"
    jackal = ft.Simulation("park_1", robot="jackal")
    assert jackal.experiment.rig.robot.model == "jackal"
    world = ft.Simulation(world=make_world(side=30.0), sensors=["imu"])
    assert world.world.size == (30.0, 30.0)
    assert world.step(0.1)["imu"].angular_velocity.shape == (3,)
    assert world.robot.command.speed > 0.0


def test_names_of_transforms_that_were_in_frames_still_work() -> None:
    with pytest.warns(DeprecationWarning, match="ft.transforms.pose"):
        old = ft.frames.pose((1.0, 2.0, 3.0))  # type: ignore[attr-defined]
    np.testing.assert_array_equal(old, ft.transforms.pose((1.0, 2.0, 3.0)))


def test_poses_that_are_given_can_be_stepped_too(tmp_path: Path) -> None:
    """Along a track file, and at separate frames of a robot that stands."""
    rows = [f"{0.1 * k} {0.05 * k - 3.0} {0.02 * k} 0.5 0 0 0 1" for k in range(8)]
    (tmp_path / "path.tum").write_text("\n".join(rows) + "\n")
    made = experiment()
    ideal = made.rig.with_sensors(ft.CameraConfig, enabled=False)
    along = {"route": None, "seconds": None, "drive": {"track": str(tmp_path / "path.tum")}, "rig": ideal.model_dump()}
    standing = {"route": None, "seconds": None, "frames": {"count": 3}}
    flash = {"sensors": [item for item in sensors() if item.get("name") == "flash"]}
    for changes in (along, standing | {"rig": flash}):
        given = ft.Experiment.model_validate(made.model_dump() | changes)
        sim = ft.Simulation(given, scene=SCENE)
        frames = [sim.reset()]
        while not sim.done:
            frames.append(sim.step(0.06))
        found = messages_of(frames, sim.experiment)
        assert found == messages_of(ft.frames(given, scene=SCENE, workers=1), sim.experiment)
        assert len(found["/flash/points"]) == (4 if "drive" in changes else 3)
        sim.reset()
        with pytest.raises(ft.ConfigurationError, match=r"^command must be None: this experiment has poses"):
            sim.step(0.1, (0.1, 0.0))
        with pytest.raises(ft.ConfigurationError, match=r"no robot in the physics$"):
            _ = sim.robot


@pytest.mark.slow
def test_a_drive_in_the_park_equals_its_bag(tmp_path: Path) -> None:
    rig = ft.paper_rig(cameras=ft.StereoConfig(width=160, height=88, depth=True, instances=True))
    made = in_small_park(seconds=0.3, rig=rig)
    bag = messages_in(ft.generate(made, tmp_path), made)
    sim, found = ft.Simulation(made), list[ft.Frame]()
    while not sim.done:
        found.append(sim.step(0.1))
    assert messages_of(found, made, sim.world) == bag
    assert messages_of(ft.frames(made), made, sim.world) == bag
