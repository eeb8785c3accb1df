# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Landscapes that are files of layers: counts, densities and depths are those of the file, corridors are free."""

from collections import Counter

import numpy as np
import pytest
from sense_worlds import without_textures

from fieldtruth.core.classes import Label
from fieldtruth.drive.traversability import Blockage, Traversability
from fieldtruth.world.build import build_world, layout_model, reserved_corridors
from fieldtruth.world.environments import ENVIRONMENTS, PAPER
from fieldtruth.world.environments.layered.config import DESCRIPTIONS
from fieldtruth.world.environments.layered.objects import Objects
from fieldtruth.world.grids import Line
from fieldtruth.world.model import World

LANDSCAPES = ("boreal", "scrub", "wet_meadow")
SIZE = (24.0, 16.0)


def small(name: str, **layout: object) -> World:
    """A small world without textures and land beyond."""
    with without_textures():
        return build_world(name, 0, {"size": list(SIZE), "beyond": False, "litter": 0} | layout)


@pytest.fixture(scope="module")
def meadow() -> World:
    return small("wet_meadow")


@pytest.fixture(scope="module")
def scrub() -> World:
    return small("scrub")


@pytest.fixture(scope="module")
def boreal() -> World:
    return small("boreal", size=[30, 30], grid=0.1)  # the bog begins 5 m from the middle


@pytest.mark.parametrize("name", LANDSCAPES)
def test_objects_are_as_many_to_the_hectare_as_the_file_says(name: str, request: pytest.FixtureRequest) -> None:
    world: World = request.getfixturevalue("meadow" if name == "wet_meadow" else name)
    model = layout_model(name)
    share, expected = world.size[0] * world.size[1] / 5000.0, Counter[str]()
    layers = DESCRIPTIONS[name].objects
    for key, layer in layers.items():
        if isinstance(layer, Objects) and layer.count:
            expected[layer.kind or key] += round(share * model.model_fields[key].default)
    found = Counter(each.kind for each in world.instances)
    assert expected
    assert {kind: found[kind] for kind in expected} == expected


@pytest.mark.parametrize("name", LANDSCAPES)
def test_corridors_are_free_and_can_be_driven(name: str, request: pytest.FixtureRequest) -> None:
    world: World = request.getfixturevalue("meadow" if name == "wet_meadow" else name)
    points = np.concatenate([line.points for line in reserved_corridors(name)])
    inside = points[(np.abs(points) < np.array(world.size) / 2 - 1.6).all(axis=1)]
    assert len(inside) > 300
    way = Traversability(world)
    assert set(way.blockage_at(inside).tolist()) == {Blockage.NONE}
    assert way.clearance_at(inside).min() > 0.0


def test_two_builds_are_equal(meadow: World) -> None:
    again = small("wet_meadow")
    np.testing.assert_array_equal(again.terrain.field.heights, meadow.terrain.field.heights)
    np.testing.assert_array_equal(again.terrain.cover.values, meadow.terrain.cover.values)
    assert [mesh.vertices.tobytes() for mesh in again.meshes.values()] == [
        mesh.vertices.tobytes() for mesh in meadow.meshes.values()
    ]
    for one, other in zip(meadow.swarms, again.swarms, strict=True):
        np.testing.assert_array_equal(other.world_from_object, one.world_from_object)


@pytest.mark.parametrize(
    ("name", "season"),
    [
        pytest.param("wet_meadow", "winter", marks=pytest.mark.slow),
        pytest.param("boreal", "autumn", marks=pytest.mark.slow),
        pytest.param("scrub", "winter", marks=pytest.mark.slow),
    ],
)
def test_a_season_changes_leaves_only(name: str, season: str, request: pytest.FixtureRequest) -> None:
    """Objects stay where they are; evergreen shrubs keep their leaves."""
    summer: World = request.getfixturevalue("meadow" if name == "wet_meadow" else name)
    other = small(name, season=season, size=summer.size, grid=summer.terrain.field.spacing)
    np.testing.assert_array_equal(other.terrain.field.heights, summer.terrain.field.heights)
    for one, two in zip(summer.instances, other.instances, strict=True):
        np.testing.assert_array_equal(two.world_from_object, one.world_from_object)
    for material, least, most in (("leaf_willow", 0.0, 0.7), ("leaf_birch", 0.0, 0.7), ("leaf_mastic", 1.0, 1.0)):
        if before := leaves(summer, material):
            assert least <= leaves(other, material) / before <= most, material


def leaves(world: World, material: str) -> int:
    """Triangles of a material, in all its colours, in all meshes."""
    pairs = [
        (mesh, k)
        for mesh in world.meshes.values()
        for k, name in enumerate(mesh.materials)
        if name.startswith(material)
    ]
    return sum(int((mesh.material == k).sum()) for mesh, k in pairs)


def test_ditches_are_as_deep_and_wide_as_the_file_says(meadow: World) -> None:
    """0.95 m at the bottom with a deviation of 8 cm of silt, ground beside it at 0 with one of 0.11 m; 2.4 m wide."""
    x = np.linspace(-11, 11, 441)
    ditch = Line.through([(-60, 6.8), (-38, 6.2), (-14, 7.1), (9, 6.3), (33, 7.2), (60, 6.6)])
    middle = ditch.points[np.abs(ditch.points[:, 0]) < 11]
    field = meadow.terrain.field
    bottom = field.height_at(*middle.T)
    assert np.median(bottom) == pytest.approx(-0.95, abs=0.16)
    assert (bottom < meadow.water_at(*middle.T) - 0.15).mean() > 0.9
    beside = field.height_at(x, np.full_like(x, 2.6))
    assert np.median(beside) == pytest.approx(0.0, abs=0.2)
    across = np.linspace(-2.5, 2.5, 101)
    normal = np.array([-ditch.tangents[0, 1], ditch.tangents[0, 0]])
    rows = middle[::20, None] + across[:, None] * normal
    profile = np.mean(field.height_at(rows[..., 0], rows[..., 1]), axis=0)
    half = (profile < (np.median(beside) + np.median(bottom)) / 2).sum() * (across[1] - across[0])
    assert half == pytest.approx(1.6, abs=0.35)  # 2.4 m at the top, 0.8 m at the bottom


def test_ditches_and_pools_are_negative_obstacles(meadow: World, boreal: World) -> None:
    way = Traversability(meadow)
    ditch = np.column_stack([np.linspace(-9, 9, 40), np.full(40, 6.6)])
    assert set(way.blockage_at(ditch).tolist()) <= {Blockage.WATER, Blockage.STEEP, Blockage.EDGE}
    drain = np.array([[-5.4, -4.5], [-5.3, -5.2], [-5.5, -6.0]])  # dry or wet, it has banks of 40 deg
    assert (way.clearance_at(drain) < 0).all()
    axes = [np.linspace(-13, 13, 131), np.linspace(-13, -6, 36)]
    bog = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    water = boreal.terrain.field.height_at(*bog.T) < boreal.water_at(*bog.T)
    assert 0.02 < water.mean() < 0.5
    assert (Traversability(boreal).clearance_at(bog[water]) < 0).all()


def test_terraces_are_steps_of_the_walls_height(scrub: World) -> None:
    """Walls stand where the ground rises by 88 % of 1.1 m within 0.7 m uphill, on level ground downhill."""
    walls = [each.world_from_object for each in scrub.instances if each.kind == "wall"]
    assert len(walls) > 8
    field = scrub.terrain.field
    foot, top, below = [], [], []
    for pose in walls:
        uphill = pose[:2, 1]
        foot.append(field.height_at(*(pose[:2, 3] - 0.5 * uphill)))
        top.append(field.height_at(*(pose[:2, 3] + 0.9 * uphill)))
        below.append(field.height_at(*(pose[:2, 3] - 2.0 * uphill)))
    rises, level = np.subtract(top, foot), np.subtract(foot, below)
    assert np.median(rises) == pytest.approx(0.97, abs=0.2)
    assert np.median(level) == pytest.approx(0.0, abs=0.15)
    headings = np.array([pose[:2, 0] for pose in walls])
    assert np.abs(headings[:, 0]).min() > 0.5  # along the slope, which falls along y


def test_walls_and_fallen_trunks_stop_a_robot(scrub: World, boreal: World) -> None:
    for world, kind in ((scrub, "wall"), (boreal, "fallen_trunk"), (boreal, "stump")):
        found = [each for each in world.instances if each.kind == kind]
        at = np.array([each.world_from_object[:2, 3] for each in found])
        assert len(found) > 0, kind
        assert (Traversability(world).clearance_at(at) < 0).all()


def test_no_classes_are_missing(scrub: World, boreal: World, meadow: World) -> None:
    labels = {
        name: {material.label for material in world.materials.values()}
        for name, world in (("scrub", scrub), ("boreal", boreal), ("meadow", meadow))
    }
    assert {Label.ROCK, Label.BUSH, Label.TREETOP, Label.TRUNK, Label.HIGH_GRASS, Label.TRAIL} <= labels["scrub"]
    assert {Label.WATER, Label.HIGH_GRASS, Label.GROUND, Label.TRAIL} <= labels["meadow"] & labels["boreal"]


@pytest.mark.parametrize("name", [name for name in ENVIRONMENTS if name not in PAPER])
def test_the_list_of_environments_has_the_descriptions_of_their_files(name: str) -> None:
    assert ENVIRONMENTS[name].description == DESCRIPTIONS[name].description
