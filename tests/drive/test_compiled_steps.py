# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Steps that compiled code makes are those from Python, bit by bit, with every touch, and MuJoCo's memory is known."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drive_worlds import hills, make_world, obstacle
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.drive import stepping
from fieldtruth.drive.physics import Command
from fieldtruth.drive.simulate import SimulatedRobot
from fieldtruth.drive.soil import SoilContact
from fieldtruth.drive.surroundings import Surroundings
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import World

WAY = ((1.0, 0.0, 60), (1.0, 0.3, 150), (-0.5, 0.0, 77), (0.8, -0.4, 200))
"""Speed, turn rate and steps, one after the other."""


class Notes:
    """A monitor that ends nothing."""

    def __init__(self) -> None:
        self.touches = list[tuple[str, float, float]]()

    def check(self, time_s: float, position: Array, quaternion_wxyz: Array) -> None:
        pass

    def touch(self, name: str, speed: float, time_s: float, position: Array) -> None:
        self.touches.append((name, speed, time_s))


@pytest.fixture(scope="module")
def world() -> World:
    """Hills of sand, with two posts in the way that begins at the origin."""
    posts = [obstacle("left", "box", (0.1, 0.1, 1.0), 1.1, 0.2), obstacle("right", "cylinder", (0.1, 1.0), 1.1, -0.2)]
    return make_world(hills, ground_type="sand", obstacles=posts)


def driven(
    world: World, robot: str, step_ns: int, start: tuple[float, float] = (0.0, 0.0)
) -> tuple[NDArray[Any], Notes, SimulatedRobot]:
    """Drive ``WAY`` and a bit further, go back, and drive that bit once more."""
    rig, notes = Rig.model_validate({"robot": robot}), Notes()
    soil = SoilContact(world, rig.wheels, {}, step_ns / 1e9)
    moved = SimulatedRobot(world, rig, notes, soil, step_ns)
    found = [moved.spawn(np.array(start), np.array([start[0] + 1.0, start[1]]), 0.2)[None]]
    for speed, turn, count in WAY:
        found.append(moved.advance(Command(speed, turn), count))
    saved = moved.save()
    found.append(moved.advance(Command(1.0, 0.0), 101))
    moved.restore(saved)
    found.append(moved.advance(Command(1.0, 0.0), 101))
    np.testing.assert_array_equal(found[-1], found[-2])
    return np.concatenate(found), notes, moved


@pytest.mark.parametrize(
    ("robot", "step_ns"), [("husky", 5_000_000), ("jackal", 1_000_000), ("generic_differential", 3_000_000)]
)
def test_compiled_steps_are_those_from_python(
    world: World, monkeypatch: pytest.MonkeyPatch, robot: str, step_ns: int
) -> None:
    states, notes, compiled = driven(world, robot, step_ns)
    assert compiled.surroundings.is_compiled
    monkeypatch.setattr(Surroundings, "is_compiled", False)
    expected, due, plain = driven(world, robot, step_ns)
    assert states.tobytes() == expected.tobytes()
    assert compiled.work == plain.work > 0
    assert notes.touches == due.touches
    if step_ns == 5_000_000:  # 2 m
        assert {name for name, *_ in notes.touches} == {"left", "right"}


def test_far_from_obstacles_none_are_looked_for_and_near_them_all(world: World) -> None:
    *_, robot = driven(world, "husky", 5_000_000, (-9.0, 5.0))
    here = robot.surroundings
    assert not here.model.body_contype.any()
    here.reset()
    bodies = here.model.body_contype
    assert sorted(bodies[bodies > 0].tolist()) == [2, 2, 2, 2, 3]
    robot.spawn(np.array([-2.0, 0.0]), np.zeros(2), 0.1)
    assert not here.model.body_contype.any()
    robot.advance(Command(1.0, 0.0), 400)  # against the first post
    assert (here.model.body_contype == bodies).all()


def test_a_state_that_is_not_finite_ends_in_no_crash(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log
    *_, robot = driven(world, "husky", 5_000_000)
    robot.surroundings.data.qpos[2] = math.nan
    assert np.isnan(robot.advance(Command(1.0, 0.0), 8)[-1, 2])


def test_another_memory_of_mujoco_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    offsets = stepping._offsets()
    assert offsets is not None
    assert stepping._fits(*offsets)
    for k in range(len(offsets)):
        moved = [each + 8 * (n == k) for n, each in enumerate(offsets)]
        assert not stepping._fits(*moved)
    monkeypatch.delitem(stepping._TYPES, "mjtSize")  # a type that is not known
    assert stepping._offsets.__wrapped__() is None
    monkeypatch.setattr(stepping, "_offsets", lambda: None)
    assert stepping.engine_of(None, None) is None
