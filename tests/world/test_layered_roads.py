# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Roads of layers: trails that the ground's rules paint, tints of soils, the side of a trail, trails that wander."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from sense_worlds import without_textures
from test_layered import environment

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.drive.traversability import Blockage, Traversability
from fieldtruth.world.build import build_world, reserved_corridors
from fieldtruth.world.environments.layered.build import wandered
from fieldtruth.world.grids import Line
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import World

TEXT = """
description: "a road through a meadow"
size: [24, 16]
parameters: {red: {value: 0.5, low: 0, high: 1}}
trails: [[[-20, 1], [20, 1]]]
trail_width: 4
trail: {material: gravel, border: gravel, ragged: 0, painted: true, also: 6.5 - abs(x)}
relief: {bank: 2 * (left < -5)}
ground: {meadow: 1, gravel: trail < 0, mud: abs(left) < 0.5}
tints: {mud: [1 + red, 1, 1 - red]}
beyond: {hills: 0, trails: 10}
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    with environment(tmp_path_factory.mktemp("roads") / "road.yaml", TEXT) as name, without_textures():
        yield build_world(name, 3)


def test_rules_of_the_ground_paint_trails(world: World) -> None:
    terrain = world.terrain
    share = dict(zip(terrain.ground_materials, terrain.cover.at([0.0, 0.0, 0.0], [1.0, 2.2, 4.0]).T, strict=True))
    np.testing.assert_allclose(share["mud"], [1, 0, 0])
    np.testing.assert_allclose(share["gravel"], [0, 1, 0])
    np.testing.assert_allclose(share["meadow"], [0, 0, 1])
    assert terrain.trail_materials == ()
    assert terrain.label_at([0, 0], [1.0, 4.0]).tolist() == [Label.TRAIL, Label.GROUND]
    assert terrain.label_at([6, 7, -7], [4.0, 4.0, -6.0]).tolist() == [Label.GROUND, Label.TRAIL, Label.TRAIL]  # `also`
    assert world.backdrop is not None
    assert "gravel" in world.backdrop.materials  # of the trails that go on


def test_tints_are_factors_on_a_materials_own(world: World) -> None:
    np.testing.assert_allclose(world.materials["mud"].tint, [1.5, 1.0, 0.5])
    assert world.materials["gravel"] == MATERIALS["gravel"]


def test_left_is_the_side_of_a_trail(world: World) -> None:
    """The bank begins 5 m to the right of the centre line at y = 1 m: below y = -4 m."""
    high = world.terrain.field.height_at(np.array([0.0, 0.0, 0.0]), np.array([-5.0, -3.0, 7.0]))
    np.testing.assert_allclose(high, [2, 0, 0], atol=0.1)
    line = Line.through([(0.0, 0.0), (10.0, 0.0)])
    np.testing.assert_allclose(line.left([[4.0, 2.0], [4.0, -3.0], [-3.0, 4.0]]), [2.0, -3.0, 5.0], atol=1e-9)


def test_trails_wander_by_the_seed_and_meet_where_they_met() -> None:
    trails = (((-90.0, 0.0), (0.0, 0.0), (90.0, 0.0)), ((0.0, 0.0), (0.0, 40.0)))
    assert wandered(trails, 0.0, 1) == trails
    moved = [np.array(line) for line in wandered(trails, 2.0, 1)]
    assert np.linalg.norm(moved[0] - moved[1][0], axis=1).min() < 0.5  # of corners 3 m apart
    off = [np.array(wandered(trails, 2.0, seed)[0])[:, 1] for seed in range(60)]
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(2.0 / np.sqrt(2.0), rel=0.15)  # in each direction
    bend = np.abs(np.diff(np.degrees(np.arctan2(*np.diff(moved[0], axis=0).T[::-1]))))
    assert bend.max() < 15  # smooth


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1 + red", "1 + green", "tints.mud: unknown field 'green'"),
        ("tints: {mud", "tints: {mad", "tints: unknown material 'mad'"),
    ],
)
def test_a_tint_of_an_unknown_parameter_or_material_is_refused(
    tmp_path: Path, old: str, new: str, message: str
) -> None:
    with pytest.raises(ConfigurationError, match=message), environment(tmp_path / "wrong.yaml", TEXT.replace(old, new)):
        pass


@pytest.mark.slow
def test_a_forest_road_can_be_driven_between_walls_of_bushes() -> None:
    layout = {"size": [24, 24], "grid": 0.1, "beyond": False, "litter": 0, "open": 0}
    with without_textures():
        world = build_world("forest_road", 1, layout)
    points = np.concatenate([line.points for line in reserved_corridors("forest_road")])
    points = points[(np.abs(points) < 10.4).all(axis=1)]
    way = Traversability(world)
    assert set(way.blockage_at(points).tolist()) == {Blockage.NONE}
    edge = world.terrain.trail_distance
    bushes = np.array([each.world_from_object[:2, 3] for each in world.instances if each.kind == "bush"])
    away = edge.at(*bushes.T)
    assert away.min() > 1.0
    assert (away < 6).mean() > 0.7  # they are a wall, not all over the wood


@pytest.mark.slow
def test_bare_gravel_of_a_quarry_is_trail_wherever_it_is() -> None:
    """What looks alike has one class: tracks and gravel of the yard are trail, litter and grass of banks are not."""
    with without_textures():
        terrain = build_world("quarry", 1, {"size": [50, 40], "grid": 0.1, "beyond": False, "litter": 0}).terrain
    most = np.array(terrain.ground_materials)[terrain.cover.values.argmax(axis=-1)]
    is_trail = terrain.trail_distance.values < 0
    assert is_trail[most == "road_track"].mean() > 0.95
    assert is_trail[most == "road_gravel"].mean() > 0.8
    assert is_trail[np.isin(most, ["litter", "dry_grass", "rough_grass"])].mean() < 0.05
    steep = np.hypot(*np.gradient(terrain.field.heights, terrain.field.spacing))
    assert np.degrees(np.arctan(np.percentile(steep, 99))) < 50.0  # loose rock lies at 30 to 40 deg, and is rough
