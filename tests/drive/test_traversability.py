# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Blockage and clearance of the traversability map against closed forms, to the cell."""

import dataclasses

import numpy as np
import pytest
from drive_worlds import F8, HeightFunction, make_world, obstacle, tilted, with_stones
from sense_worlds import at, box, make_mesh

from fieldtruth.core import transforms
from fieldtruth.drive.ground import bearing_field
from fieldtruth.drive.traversability import (
    CELL,
    Blockage,
    Outline,
    Traversability,
    distance_to,
    gap_to,
    max_step,
    obstacle_outlines,
    robot_radius,
    stone_outlines,
)
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Collider, merge_meshes

ROBOT_RADIUS, MAX_STEP = robot_radius(RobotConfig()), max_step()
SQUARE = Outline("square", np.array([(1.0, -1.0), (3.0, -1.0), (3.0, 1.0), (1.0, 1.0)]))


def test_distance_to_outline_in_closed_form() -> None:
    points = np.array([(0.0, 0.0), (0.0, -2.0), (2.0, 5.0), (2.0, 0.5), (1.0, 0.0)])
    np.testing.assert_allclose(distance_to(SQUARE, points), [1.0, np.sqrt(2), 4.0, -0.5, 0.0], atol=1e-12)


def test_gap_of_the_robot_outline_depends_on_its_heading() -> None:
    poses = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2), (0.0, 0.0, np.pi), (0.6, 0.0, 0.0), (2.0, 5.0, 0.0)])
    gaps = [1 - 0.495, 1 - 0.335, 1 - 0.495, 0.4 - 0.495, 4 - 0.335]
    np.testing.assert_allclose(gap_to(SQUARE, poses), gaps, atol=1e-12)
    diagonal = gap_to(SQUARE, np.array([(0.0, 0.0, np.pi / 4)]))
    assert diagonal[0] == pytest.approx(1 - (0.495 + 0.335) / np.sqrt(2), abs=1e-12)


def test_outlines_are_of_colliders_between_ground_and_robot_height() -> None:
    world = make_world(
        obstacles=[
            obstacle("post", "cylinder", (0.2, 4.0), 3.0, 1.0, scale=1.5),
            obstacle("table", "box", (2.0, 1.0, 0.1), -5.0, 0.0, yaw=90.0, z=0.7),
            obstacle("branch", "cylinder", (1.0, 0.2), 0.0, 5.0, z=1.3),
            obstacle("root", "cylinder", (1.0, 0.2), 0.0, -5.0, z=-0.3),
        ]
    )
    post, table = obstacle_outlines(world)
    assert (post.name, table.name) == ("post", "table")
    assert post.circle == pytest.approx((3.0, 1.0, 0.3), abs=0.003)
    np.testing.assert_allclose([table.corners.min(axis=0), table.corners.max(axis=0)], [(-5.5, -1.0), (-4.5, 1.0)])


def test_fallen_trunk_blocks_its_length_and_leaning_trunk_its_low_part() -> None:
    trunk = Collider(shape="cylinder", size=(0.2, 6.0))
    lying = transforms.pose((0.0, 0.0, 0.15), (0.0, 90.0, 0.0))
    leaning = transforms.pose((0.0, 5.0, 0.0), (0.0, 60.0, 0.0))  # 60 deg off the vertical, towards +x
    low, high = obstacle_outlines(make_world(obstacles=[("lying", trunk, lying), ("leaning", trunk, leaning)]))
    np.testing.assert_allclose([low.corners.min(axis=0), low.corners.max(axis=0)], [(0.0, -0.2), (6.0, 0.2)], atol=0.01)
    # Its underside rises above 1.2 m at (1.2 + 0.2 sin 60) / cos 60 along the axis.
    along = (1.2 + 0.2 * np.sin(np.pi / 3)) / np.cos(np.pi / 3)
    leaves = along * np.sin(np.pi / 3) + 0.2 * np.cos(np.pi / 3)
    assert leaves - 0.25 < high.corners[:, 0].max() <= leaves + 0.01


def test_clearance_is_the_free_distance_around_the_robot() -> None:
    ground = Traversability(make_world(obstacles=[obstacle("post", "cylinder", (0.3, 2.0), 0.0, 0.0)]))
    for distance in (1.0, 1.5, 3.0):
        free = distance - 0.3 - ROBOT_RADIUS
        for angle in np.linspace(0, 2 * np.pi, 12):
            found = ground.clearance_at([(distance * np.cos(angle), distance * np.sin(angle))])[0]
            assert free - 2.0 * CELL < found <= free + 0.02  # never more than is free
    assert ground.blockage_at([(0.2, 0.0), (1.0, 0.0)]).tolist() == [Blockage.OBSTACLE, Blockage.NONE]


def test_cells_near_the_edge_are_blocked() -> None:
    ground = Traversability(make_world(size=(20.0, 12.0)))
    points = [(8.4, 0.0), (8.7, 0.0), (0.0, -4.4), (0.0, -4.7), (30.0, 0.0)]
    expected = [Blockage.NONE, Blockage.EDGE, Blockage.NONE, Blockage.EDGE, Blockage.EDGE]
    assert ground.blockage_at(points).tolist() == expected
    assert np.isneginf(ground.clearance_at([(30.0, 0.0)])).all()


@pytest.mark.parametrize(("slope", "blockage"), [(19.0, Blockage.NONE), (21.0, Blockage.STEEP)])
@pytest.mark.parametrize("spacing", [0.1, 0.2])
def test_ramps_steeper_than_20_deg_are_blocked(slope: float, blockage: Blockage, spacing: float) -> None:
    for ramp in (tilted(slope, 0.0), tilted(0.0, -slope)):
        ground = Traversability(make_world(ramp, spacing=spacing))
        assert (ground.blockage_at([(0.0, 0.0), (5.0, -3.0), (-12.0, 6.0)]) == blockage).all()


def step(height: float) -> HeightFunction:
    def heights(x: F8, y: F8) -> F8:
        return np.where(x < 0.0, 0.0, height) + 0.0 * y

    return heights


def ridge(x: F8, y: F8) -> F8:
    """Along y at every even x, 5 cm high and 0.2 m wide."""
    return np.asarray(0.05 * (np.abs((x + 1) % 2 - 1) < 0.11) + 0.0 * y)


def boulder(x: F8, y: F8) -> F8:
    return np.asarray(0.3 * (np.hypot(x, y) < 0.35))


def test_steps_and_boulders_of_the_terrain_are_blocked() -> None:
    assert Traversability(make_world(step(0.05))).blockage_at([(0.0, 0.0)])[0] == Blockage.NONE
    assert Traversability(make_world(step(0.5))).blockage_at([(0.0, 0.0)])[0] in (Blockage.ROUGH, Blockage.STEEP)
    ground = Traversability(make_world(boulder))
    assert ground.blockage_at([(0.0, 0.0)])[0] in (Blockage.ROUGH, Blockage.STEEP)
    assert ground.blockage_at([(2.0, 0.0), (0.0, -2.0)]).tolist() == [Blockage.NONE, Blockage.NONE]


def test_a_stone_higher_than_a_step_is_an_obstacle_and_a_lower_one_is_not() -> None:
    stones = [
        box("high", [0.1, 0.06, MAX_STEP + 0.002], "rock_granite"),
        box("low", [0.1, 0.06, MAX_STEP - 0.002], "rock_granite"),
    ]
    world = with_stones(make_world(), stones, [0, 1], np.array([at(3.0, 1.0, 0.0), at(-3.0, 1.0, 0.0)]))
    (high,) = stone_outlines(world)
    assert high.name == "an object of swarm stones"
    np.testing.assert_allclose(
        [high.corners.min(axis=0), high.corners.max(axis=0)], [(2.9, 0.94), (3.1, 1.06)], atol=1e-6
    )
    ground = Traversability(world)
    assert ground.blockage_at([(3.0, 1.0), (-3.0, 1.0)]).tolist() == [Blockage.OBSTACLE, Blockage.NONE]
    assert ground.clearance_at([(3.0, 1.4)])[0] < 0 < ground.clearance_at([(-3.0, 1.4)])[0]


def test_the_outline_of_a_stone_is_that_of_its_part_above_the_step() -> None:
    """A pyramid of 0.4 m width and 4 x MAX_STEP height stands in the soil; at MAX_STEP it is 0.3 m wide."""
    corners = [(-0.2, -0.2, 0.0), (0.2, -0.2, 0.0), (0.2, 0.2, 0.0), (-0.2, 0.2, 0.0), (0.0, 0.0, 4 * MAX_STEP)]
    pyramid = make_mesh("pyramid", corners, [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], "rock_granite")
    (outline,) = stone_outlines(with_stones(make_world(), [pyramid], [0], at(1.0, 2.0, 0.0)[None]))
    np.testing.assert_allclose([outline.corners.min(axis=0), outline.corners.max(axis=0)], [(0.85, 1.85), (1.15, 2.15)])


def test_roots_that_spread_beyond_the_collider_bear_and_block() -> None:
    """A trunk of 0.1 m radius with a foot 0.6 m wide and 0.1 m high, and a bough 0.3 m above the ground."""
    name, collider, pose = obstacle("oak_1", "cylinder", (0.1, 2.0), 2.0, 0.0)
    foot = box("oak_1", [0.3, 0.3, 0.1], "bark_oak")
    bough = box("oak_1", [0.8, 0.05, 0.35], "bark_oak")
    world = make_world(obstacles=[(name, collider, pose)])
    bough.vertices[bough.vertices[:, 2] < 0, 2] = 0.3
    tree = dataclasses.replace(merge_meshes(name, [foot, bough], footprint=1.0), colliders=(collider,))
    materials = {material: MATERIALS[material] for material in tree.materials}
    world = dataclasses.replace(world, meshes={name: tree}, materials=materials)
    ground = bearing_field(world)
    assert ground.height_at([2.0, 2.28, 2.7], [0.0, 0.28, 0.0]) == pytest.approx([0.1, 0.1, 0.0])
    (outline,) = stone_outlines(world)
    assert outline.name == "oak_1"
    np.testing.assert_allclose([outline.corners.min(axis=0), outline.corners.max(axis=0)], [(1.7, -0.3), (2.3, 0.3)])


def test_no_stone_on_a_ridge_is_lost_between_the_points_of_the_chassis() -> None:
    """The chassis clears a ridge of 5 cm, and a stone of 8 cm on plane ground; not the stone on the ridge."""
    stone = box("stone", [0.02, 0.02, 0.08], "rock_granite")
    rng = np.random.default_rng(0)
    xy = np.column_stack([np.linspace(-14, 14, 15) + rng.uniform(-0.05, 0.05, 15), rng.uniform(-0.25, 0.25, 15)])
    poses = np.tile(np.eye(4), (15, 1, 1))
    poses[:, :2, 3], poses[:, 2, 3] = xy, ridge(*xy.T)
    bare = make_world(ridge, spacing=0.05)
    assert (Traversability(bare).blockage_at(xy) == Blockage.NONE).all()
    assert (Traversability(with_stones(bare, [stone], [0] * 15, poses)).blockage_at(xy) == Blockage.ROUGH).all()
    level = with_stones(
        make_world(), [stone], [0] * 15, poses - np.array([[0, 0, 0, 0]] * 2 + [[0, 0, 0, 0.05], [0, 0, 0, 0]])
    )
    assert (Traversability(level).blockage_at(xy) == Blockage.NONE).all()


def test_water_is_blocked_and_its_bank_has_no_clearance() -> None:
    ground = Traversability(make_world(tilted(0.0, 10.0), water_level=0.0))
    assert ground.blockage_at([(0.0, -0.5), (0.0, 1.0)]).tolist() == [Blockage.WATER, Blockage.NONE]
    dry = 0.05 / np.tan(np.radians(10.0))  # [m] from the shoreline to ground 0.05 m above it
    assert ground.clearance_at([(0.0, dry + ROBOT_RADIUS - 0.1)])[0] < 0
    assert ground.clearance_at([(0.0, dry + ROBOT_RADIUS + 0.3)])[0] > 0


def test_plane_is_free_except_for_its_edge() -> None:
    ground = Traversability(make_world())
    assert (ground.clearance_of(range(20, 381), range(20, 181)) > 0).all()
    assert ground.clearance_at([(0.0, 0.0)])[0] == pytest.approx(8.5, abs=CELL)
