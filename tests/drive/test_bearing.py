# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ground that bears wheels has every hard object of a swarm that rays see, at its height, and no other."""

from dataclasses import replace

import numpy as np
import pytest
from drive_worlds import HeightFunction, flat, hills, make_robot, make_world, tilted, with_stones
from sense_worlds import at, box, trace_rays

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz
from fieldtruth.drive.ground import BEARING_SPACING, bearing_field
from fieldtruth.drive.physics import Command
from fieldtruth.drive.traversability import stone_outlines
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import WHEELS
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import load_world, reserved_corridors
from fieldtruth.world.model import FALLEN, LITTER, World
from fieldtruth.world.rocks import ROCK_TYPES, make_rock

STONE_SIZE = (0.06, 0.04, 0.05)
STONE = box("stone", STONE_SIZE, "rock_granite")
"""12 x 8 cm; half of its height of 10 cm is in the ground."""


def pebbled(count: int = 300) -> World:
    """Stones of 2 to 7 cm height, upright in the soil of hills, in a square of 6 m."""
    rng = np.random.default_rng(1)
    stones = [
        make_rock(ROCK_TYPES[kind], name=f"{kind}_{k}", size=size, rng=rng, triangles=80, solid=False)
        for k, size in enumerate((0.06, 0.15))
        for kind in ("granite", "slab")
    ]
    world = make_world(hills, size=(8.0, 8.0))
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :2, 3] = rng.uniform(-3, 3, (count, 2))
    poses[:, 2, 3] = world.terrain.field.height_at(poses[:, 0, 3], poses[:, 1, 3])
    return with_stones(world, stones, rng.integers(4, size=count).tolist(), poses)


def missing_height(world: World, xy: Array) -> Array:
    """Height [m], (n,), by which rays from above meet rock higher than the bearing ground at positions (n, 2).

    The ground is that of the nearest node; on a slope the soil's own rise from there is no part of a stone. Without
    rock it is -inf.
    """
    soil, ground = world.terrain.field, bearing_field(world)
    start = np.column_stack([xy, soil.height_at(*xy.T) + 0.4])
    scene = Scene(world)
    rock, z = np.zeros(len(xy), bool), np.zeros(len(xy))
    for rows in np.array_split(np.arange(len(xy)), 1 + len(xy) // 50_000):
        rays = trace_rays(scene, start[rows], np.tile([0.0, 0.0, -1.0], (len(rows), 1)))
        rock[rows], z[rows] = rays.label == Label.ROCK, start[rows, 2] - rays.range_m
    node = np.rint((xy - (ground.x0, ground.y0)) / ground.spacing).astype(int)
    at_node = ground.heights[node[:, 0], node[:, 1]].astype(float)
    near = np.array([ground.x0, ground.y0]) + node * ground.spacing
    rise = np.maximum(0.0, soil.height_at(*xy.T) - soil.height_at(*near.T))
    return np.where(rock, z - rise - at_node, -np.inf)


def test_without_stones_it_is_the_terrain_itself(flat_world: World) -> None:
    assert bearing_field(flat_world) is flat_world.terrain.field


def test_a_box_raises_the_nodes_whose_squares_it_touches() -> None:
    world = with_stones(make_world(size=(8.0, 8.0)), [STONE], [0], at(1.01, 0.5, 0.0)[None])
    ground = bearing_field(world)
    assert ground is bearing_field(world)
    assert ground.spacing == pytest.approx(BEARING_SPACING)
    i, j = np.nonzero(ground.heights)
    assert np.unique(ground.x0 + i * ground.spacing) == pytest.approx([0.95, 1.0, 1.05])  # 0.95 to 1.07, less half 5 cm
    assert np.unique(ground.y0 + j * ground.spacing) == pytest.approx([0.45, 0.5, 0.55])
    assert ground.heights[i, j] == pytest.approx(0.05)


def test_the_soil_between_stones_is_unchanged() -> None:
    world = with_stones(make_world(hills, size=(8.0, 8.0)), [STONE], [0], at(0.0, 0.0, 0.0)[None])
    xy = np.random.default_rng(0).uniform(0.2, 4.0, (1000, 2))
    assert bearing_field(world).height_at(*xy.T) == pytest.approx(world.terrain.field.height_at(*xy.T), abs=1e-6)


def test_a_stone_in_the_soil_of_a_slope_raises_nothing() -> None:
    """Its level top is 1 mm below the lowest ground above it, and higher than the ground further downhill."""
    slope = tilted(25.0, 0.0)
    x = np.array(1.0)
    top = float(slope(x - 0.06, x)) - 0.001
    world = with_stones(make_world(slope, size=(8.0, 8.0)), [STONE], [0], at(1.0, 0.0, top - 0.05)[None])
    bare = make_world(slope, size=(8.0, 8.0), spacing=BEARING_SPACING).terrain.field
    np.testing.assert_allclose(bearing_field(world).heights, bare.heights, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("material", ["blade_dry", "leaf_gorse", "frond_fern"])
def test_what_bends_does_not_bear(material: str) -> None:
    grass = box("grass", [0.06, 0.06, 0.2], material)
    world = with_stones(make_world(size=(8.0, 8.0)), [grass], [0], at(0.0, 0.0, 0.0)[None])
    assert not bearing_field(world).heights.any()


@pytest.mark.parametrize("height", [flat, hills, tilted(12.0, -7.0)])
def test_no_node_is_higher_than_the_stone(height: HeightFunction) -> None:
    z = float(height(np.array(1.0), np.array(0.5)))
    world = with_stones(make_world(height, size=(8.0, 8.0)), [STONE], [0], at(1.0, 0.5, z)[None])
    bare = make_world(height, size=(8.0, 8.0), spacing=BEARING_SPACING).terrain.field
    raised = bearing_field(world).heights - bare.heights
    assert 0.05 - 1e-5 <= raised.max() <= 0.05 + 0.06 * np.tan(np.radians(12.0)) + 0.04 * np.tan(np.radians(7.0)) + 1e-3


def test_rays_from_above_meet_no_stone_that_is_missing() -> None:
    world = pebbled()
    xy = np.random.default_rng(2).uniform(-3.1, 3.1, (40_000, 2))
    missing = missing_height(world, xy)
    assert np.isfinite(missing).sum() > 1500  # hits on rock
    assert missing.max() < 1e-3


@pytest.mark.slow
def test_rays_along_the_hillside_meet_no_stone_that_is_missing() -> None:
    line = reserved_corridors("hillside")[0].points
    rng = np.random.default_rng(3)
    xy = line[rng.integers(len(line), size=200_000)] + rng.uniform(-0.7, 0.7, (200_000, 2))
    missing = missing_height(load_world("hillside"), xy)
    assert np.isfinite(missing).sum() > 1000
    assert missing.max() < 1e-3


def wheel_rise(material: str, y: float) -> Array:
    """Rise [m], (n, 4), of the wheel centres every ms over objects of 5 cm height at x = 1 m, +-``y`` [m]."""
    pose = np.array([at(1.0, y, 0.0), at(1.0, -y, 0.0)])
    robot = make_robot(with_stones(make_world(size=(8.0, 8.0)), [box("stone", STONE_SIZE, material)], [0, 0], pose))
    states = robot.advance(Command(0.3, 0.0), 6500)
    mounts = np.array([Rig().mounts()[f"{name}_wheel"].xyz for name in WHEELS])
    rotation = rotation_from_quaternion_wxyz(states[:, 3:7])
    centres = states[:, None, :3] + np.einsum("nij,wj->nwi", rotation, mounts)
    assert states[-1, 0] > 1.5  # both axles have passed
    return np.asarray(centres[:, :, 2] - centres[0, :, 2])


def test_wheels_rise_by_the_height_of_the_stones_that_they_roll_over() -> None:
    """Each wheel in turn, the rear ones after the wheelbase; a tyre on a stone of 12 x 8 cm stands on its top."""
    rise = wheel_rise("rock_granite", 0.2854)
    assert rise.max(axis=0) == pytest.approx(0.05, abs=0.003)
    peaks = rise.argmax(axis=0)
    assert (peaks[2:] - peaks[:2]) * 0.3e-3 == pytest.approx(0.512, abs=0.08)
    assert rise[-1] == pytest.approx(0.0, abs=5e-4)


def test_a_stone_between_the_wheels_and_grass_below_them_lift_nothing() -> None:
    assert np.abs(wheel_rise("rock_granite", 0.1)).max() < 1e-3  # it pitches as it starts
    assert np.abs(wheel_rise("blade_dry", 0.2854)).max() < 1e-3


@pytest.mark.parametrize(("kind", "bears"), [("rock", True), (LITTER, False), (FALLEN, False)])
def test_what_lies_loose_bears_no_wheel_and_is_no_obstacle(kind: str, bears: bool) -> None:
    """Leaves lie on a layer of grass, which may be higher than the step that a robot can climb."""
    world = make_world(flat, size=(4.0, 4.0))
    poses = np.eye(4)[None]
    poses[0, 2, 3] = 0.15
    world = with_stones(world, [STONE], [0], poses)
    world = replace(world, swarms=tuple(replace(swarm, kind=kind) for swarm in world.swarms))
    assert (bearing_field(world).heights.max() > 0.1) == bears
    assert bool(stone_outlines(world)) == bears
