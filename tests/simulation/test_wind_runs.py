# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs in wind: the same readings however they are made, and hits that are where the lean has the plant."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sense_worlds import F8, at, box, limbed_tree, make_world
from stepped_clouds import alike, clouds_of

from fieldtruth import pipeline
from fieldtruth.bag.run import open_run
from fieldtruth.experiment.config import Experiment
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.wind import leaning_of
from fieldtruth.simulation.stepped import Simulation
from fieldtruth.world.model import World

LIDAR = {"kind": "lidar", "columns": 256, "rings": 32, "max_range": 30.0, "spinning": True}
WALL, TREE = 2, 3
"""Instance ids."""


def windy(**values: Any) -> Experiment:
    given: dict[str, Any] = {
        "name": "windy",
        "environment": "park",
        "seconds": 0.35,
        "rig": {"sensors": [{"kind": "imu"}, {"kind": "gnss"}, LIDAR]},
        "route": {"metres": {"start": (0.0, 0.0), "waypoints": [(8.0, 0.0)]}},
        "control": {"speed": 0.01},
        "wind": {"speed_m_s": 12.0, "direction_deg": 200.0},
    }
    return Experiment.model_validate(given | values)


@pytest.fixture(name="world", scope="module")
def _world() -> World:
    """A wall of leaves beside the robot, whose plane is known, and a tree with limbs on its other side."""
    wall = box("wall", (3.0, 0.05, 1.5), "leaf")
    vertices = wall.vertices + np.array([0, 0, 1.4], np.float32)
    hedge = replace(wall, vertices=vertices, species=("hazel",), footprint=0.1)
    return make_world([(hedge, at(0, 4, 0)), (limbed_tree(), at(1, -5, 0))])


def test_steps_of_any_length_and_any_number_of_workers_give_the_same_readings(world: World, tmp_path: Path) -> None:
    experiment = windy()
    one = clouds_of(Simulation(experiment, world=world), [0.35])
    other = clouds_of(Simulation(experiment, world=world, scene=Scene(world)), [0.003, 0.1, 0.017, 0.23])
    bags = [pipeline.generate(experiment, tmp_path / str(n), world=world, workers=n) for n in (1, 3)]
    assert bags[0].read_bytes() == bags[1].read_bytes()
    recorded = open_run(bags[0].parent)["lidar"]
    assert len(one) == len(other) == 3
    assert sum(np.count_nonzero(each.instance == TREE) for each in one) > 100
    assert all(map(alike, one, other))
    assert all(alike(each, recorded[k]) for k, each in enumerate(one))
    still = clouds_of(Simulation(windy(wind=None), world=world), [0.35])
    assert not any(map(alike, one, still))


def test_steps_of_half_a_knot_forget_nothing_that_an_interval_among_plants_needs(world: World) -> None:
    """The interval of a scan begins at a knot of plants, up to 0.1 s before it, and bodies are asked for there."""
    lidar = {"kind": "lidar", "columns": 64, "rings": 8, "rate_hz": 20.0, "spinning": True}
    actors = {"anna": {"kind": "person", "behaviour": "stand", "start": (4.0, -3.0)}}
    experiment = windy(seconds=2.0, rig={"sensors": [lidar]}, actors=actors)
    steps = clouds_of(Simulation(experiment, world=world), [0.05] * 24)
    at_once = clouds_of(Simulation(experiment, world=world), [1.2])
    assert len(steps) == len(at_once) > 20
    assert all(map(alike, steps, at_once))


def test_each_point_lies_on_the_plane_of_the_wall_at_its_own_instant(world: World) -> None:
    experiment = windy()
    simulation = Simulation(experiment, world=world)
    cloud = clouds_of(simulation, [0.35])[1]
    assert cloud.instance is not None
    assert cloud.t_ns is not None
    own = cloud.instance == WALL
    lidar = simulation.experiment.rig.sensors[2].mount.base_from_sensor  # type: ignore[attr-defined]
    points = np.c_[cloud.xyz[own], np.ones(np.count_nonzero(own))] @ (simulation.robot.world_from_base @ lidar).T
    right = heights(experiment, world, points, cloud.stamp_ns + cloud.t_ns[own].astype(np.int64))
    turned = windy(wind={"speed_m_s": 12.0, "direction_deg": 20.0})
    wrong = heights(turned, world, points, cloud.stamp_ns + cloud.t_ns[own].astype(np.int64))
    assert len(points) > 300
    assert np.median(np.abs(right)) < 0.004  # the robot creeps 3.5 mm meanwhile
    assert np.median(np.abs(wrong)) > 0.02


def heights(experiment: Experiment, world: World, points: F8, stamps: np.ndarray[Any, np.dtype[np.int64]]) -> F8:
    """Distances [m] of points (n, 4) from the face of the wall at stamps (n,), by the inverse of its pose."""
    leaning = leaning_of(experiment.wind, world, experiment.seed)
    assert leaning is not None
    poses = leaning.at(np.array([0]), stamps)[:, 0]
    square = np.concatenate([poses, np.tile([[[0.0, 0.0, 0.0, 1.0]]], (len(poses), 1, 1))], axis=1)
    return np.asarray((np.linalg.inv(square) @ points[..., None])[:, 1, 0] + 0.05)
