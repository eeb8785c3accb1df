# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""An environment of layers does what its file says: ground, objects and plants are where the rules have them."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError, FieldtruthError
from fieldtruth.world.build import build_world
from fieldtruth.world.environments import ENVIRONMENTS, Environment
from fieldtruth.world.environments.layered.config import DESCRIPTIONS, FLAT, LATE, SHAPED, Description, model_of
from fieldtruth.world.environments.layered.expressions import DRAWN, FUNCTIONS, Expression
from fieldtruth.world.environments.layered.fields import border_distance
from fieldtruth.world.environments.layered.land import PLACE, Beyond, waves
from fieldtruth.world.environments.layered.steps import STEPS
from fieldtruth.world.environments.layout import PLANTINGS
from fieldtruth.world.model import Instance, World
from fieldtruth.world.rocks import rim_vertices

pytestmark = pytest.mark.usefixtures("untextured")

FIELDS = {
    "x": np.array([-3.0, 0.0, 2.0, 7.0]),
    "y": np.array([1.0, 4.0, -2.0, 0.5]),
    "a": np.array([0.2, 0.9, 0.4, 0.7]),
}
X, Y, A = FIELDS.values()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 + 2 * 3 - 4 / 8", np.full(4, 6.5)),
        ("-x ** 2 % 5", -(X**2) % 5),
        ("0 < x <= 2", (X > 0) & (X <= 2)),
        ("0 < 1 < x", X > 1),
        ("a > 0.3 and x < 5", (A > 0.3) & (X < 5)),
        ("a and 0.5", np.minimum(A, 0.5)),
        ("a or 0.5", np.maximum(A, 0.5)),
        ("not a", 1 - A),
        (
            "clip(x, -1, 1) + min(x, y, 0) + max(x, y)",
            X.clip(-1, 1) + np.minimum(np.minimum(X, Y), 0) + np.maximum(X, Y),
        ),
        ("smooth(a, 0, 1)", 3 * A**2 - 2 * A**3),
        ("smooth(a, 1, 0)", 1 - (3 * A**2 - 2 * A**3)),
        ("hypot(x, y)", np.hypot(X, Y)),
        ("rows(4)", [1.0, 0.0, 2.0, 0.5]),
        ("rows(4, 90)", [1.0, 0.0, 2.0, 1.0]),
        ("rows(4, 0, 1)", [0.0, 1.0, 1.0, 0.5]),
    ],
)
def test_an_expression_has_the_values_of_arithmetic(text: str, expected: object) -> None:
    found = Expression(text).values(FIELDS.__getitem__)
    np.testing.assert_allclose(np.broadcast_to(found, 4), np.asarray(expected, np.float64), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x +", "not an expression"),
        ("__import__('os').remove('a')", "must be of numbers"),
        ("x.real", "must be of numbers"),
        ("[x]", "must be of numbers"),
        ("'a'", "must be of numbers"),
        ("True", "must be of numbers"),
        ("x if a else y", "must be of numbers"),
        ("clip(x)", "takes 3 to 3 values"),
        ("clp(x, 0, 1)", "did you mean 'clip'"),
        ("x == 1", "must be of numbers"),
        ("+".join("x" * 400), "at most 600 characters"),
        ("(" * 250 + "x" + ")" * 250, "not an expression"),
    ],
)
def test_text_that_is_no_arithmetic_is_refused(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Expression(text)


TEXT = """
description: "a plain with a ditch"
size: [24, 16]
fields:
  wet: smooth(ditch, 3, 1)
  patch: noise(6, 3)
lines:
  ditch: [[[-20, 4], [20, 4]]]
relief:
  slope: 0.05 * x
  cut: -0.8 * smooth(ditch, 1.5, 0.5)
water: {level: -0.4}
ground:
  rough_grass: 1
  mud: wet
  soil: 0.25
groups:
  tree: {form: tree, name: "tree_{species}_{k}", species: {oak: [3, 4]}, detail: 0.2}
  stone: {form: rock, name: "stone_{species}_{k}", species: {granite: [0.3, 0.5]}, triangles: 80}
  grass: {form: tuft, name: "{species}_{k}", species: {meadow: [0.2, 0.3]}, detail: 0.3}
objects:
  row_trees: {group: tree, rows: {spacing: 4, every: 3, offset: -2}, where: y < 1}
  stones: {group: stone, kind: rock, count: 6, where: x > 4 and y < -1}
  posts: {furniture: [lamp_post_0], along: {line: ditch, every: 5, offset: 2}, aligned: true}
plants:
  grass: {group: grass, kind: high_grass, per_m2: 4, where: ditch > 3 and crown < 0.5}
litter_amount: 0
corridors:
  - [[-10, 1.5], [10, 1.5]]
"""


@contextmanager
def environment(path: Path, text: str = TEXT) -> Iterator[str]:
    """A file of layers as an environment, for a while."""
    path.write_text(text)
    try:
        DESCRIPTIONS.add(path)
        ENVIRONMENTS[path.stem] = Environment("", "fieldtruth.world.environments.layered")
        yield path.stem
    finally:
        ENVIRONMENTS.pop(path.stem, None)
        for library in (DESCRIPTIONS, PLANTINGS):
            library.remove(path.stem)
        model_of.cache_clear()


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    with environment(tmp_path_factory.mktemp("layers") / "plain.yaml") as name:
        return build_world(name, 3)


def of_kind(world: World, kind: str) -> list[Instance]:
    return [each for each in world.instances if each.kind == kind]


def positions(objects: list[Instance]) -> np.ndarray:
    return np.array([each.world_from_object[:2, 3] for each in objects])


def test_the_ground_is_the_sum_of_the_reliefs_layers(world: World) -> None:
    """Microrelief of rough grass has 1 cm: a profile's mean over 16 m is far nearer."""
    x = np.linspace(-11, 11, 2001)
    for y, cut in ((-6.0, 0.0), (4.0, -0.8), (4.5, -0.8), (5.0, -0.4), (5.5, 0.0)):
        off = world.terrain.field.height_at(x, y) - 0.05 * x
        assert off.mean() == pytest.approx(cut, abs=0.02), y


def test_water_stands_at_its_level(world: World) -> None:
    [sheet] = of_kind(world, "water")
    assert (world.water_level, sheet.world_from_object[2, 3]) == (-0.4, -0.4)


def test_each_material_covers_what_is_below_it(world: World) -> None:
    cover = dict(zip(world.terrain.ground_materials, np.moveaxis(world.terrain.cover.values, -1, 0), strict=True))
    y = world.terrain.cover.y0 + world.terrain.cover.spacing * np.arange(cover["mud"].shape[1])
    t = np.clip((3 - np.abs(y - 4)) / 2, 0, 1)
    wet = t * t * (3 - 2 * t)
    for name, share in (("rough_grass", 0.75 * (1 - wet)), ("mud", 0.75 * wet), ("soil", np.full(len(y), 0.25))):
        np.testing.assert_allclose(cover[name], np.broadcast_to(share, cover[name].shape), atol=2e-3)


def test_rows_of_objects_are_straight_and_keep_the_corridor_free(world: World) -> None:
    xy = positions(of_kind(world, "row_trees"))
    lattice = {(3.0 * i, 4.0 * j - 2) for i in range(-4, 5) for j in range(-3, 4)}
    found = {(round(x, 9), round(y, 9)) for x, y in xy.tolist()}
    assert found <= lattice
    expected = {(x, y) for x, y in lattice if y < 1 and abs(x) < 11 and abs(y) < 7 and abs(y - 1.5) > 2}
    assert expected <= found


def test_objects_are_where_their_rule_allows_them(world: World) -> None:
    stones = positions(of_kind(world, "rock"))
    assert len(stones) == 6
    assert (stones[:, 0] > 4).all()
    assert (stones[:, 1] < -1).all()


def test_objects_along_a_line_have_its_distance_and_direction(world: World) -> None:
    posts = of_kind(world, "posts")
    np.testing.assert_allclose(positions(posts)[:, 1], 6.0, atol=1e-9)
    np.testing.assert_allclose(np.diff(positions(posts)[:, 0]), 5.0, atol=0.05)
    for post in posts:
        np.testing.assert_allclose(post.world_from_object[:2, 0], (1, 0), atol=1e-9)


def test_plants_keep_off_the_ditch_and_the_shade(world: World) -> None:
    [grass] = world.swarms
    x, y = grass.world_from_object[:, :2, 3].T
    assert (np.abs(y - 4) > 3).all()
    trunks = positions(of_kind(world, "row_trees"))
    assert np.hypot(x[:, None] - trunks[:, 0], y[:, None] - trunks[:, 1]).min() > 0.3
    assert len(y) == pytest.approx(4 * 24 * (16 - 6), rel=0.35)  # but for the crowns


def test_a_further_layer_leaves_the_others_alone(world: World, tmp_path: Path) -> None:
    first = "objects:\n  first: {group: stone, kind: pebble, count: 2, where: y > 6}"
    far = "beyond: {swarms: {far_grass: {group: grass, kind: high_grass, per_m2: 0.1}}}\ncorridors:"
    more = TEXT.replace("objects:", first, 1).replace("corridors:", far)
    with environment(tmp_path / "more.yaml", more) as name:
        other = build_world(name, 3)
    for kind in ("row_trees", "rock", "posts"):
        np.testing.assert_array_equal(positions(of_kind(other, kind)), positions(of_kind(world, kind)))
    np.testing.assert_array_equal(other.terrain.field.heights, world.terrain.field.heights)
    assert world.meshes.keys() <= other.meshes.keys()
    for name, mesh in world.meshes.items():
        np.testing.assert_array_equal(other.meshes[name].vertices, mesh.vertices)


def test_the_layers_are_keys_of_the_layout(tmp_path: Path) -> None:
    with environment(tmp_path / "few.yaml") as name:
        other = build_world(name, 3, {"stones": 2, "row_trees": 0.0, "grass": 0.0, "size": [16, 12]})
        with pytest.raises(ConfigurationError, match="layout: unknown key 'stone'; did you mean 'stones'"):
            build_world(name, 3, {"stone": 2})
    assert len(of_kind(other, "rock")) == 2
    assert not of_kind(other, "row_trees")
    assert not other.swarms


def test_objects_along_contours_have_the_larger_side_to_their_left(tmp_path: Path) -> None:
    """Contours of the distance from the middle are circles; trunks lie where their rule allows all of them."""
    text = TEXT.replace("  patch:", "  away: hypot(x, y)\n  patch:").replace(
        "objects:",
        "objects:\n  logs: {group: log, kind: log, count: 5, where: y < -3}\n"
        "  ring: {furniture: [trash_bin_0], along: {contours: away, step: 5, every: 1, offset: -0.5}, aligned: true}",
        1,
    )
    groups = (
        '  log: {form: log, name: "log_{species}_{k}", species: {oak: [2, 3]}, count: 2, radius: 0.15, detail: 0.3}\n'
    )
    with environment(tmp_path / "round.yaml", text.replace("  stone: {form", groups + "  stone: {form", 1)) as name:
        world = build_world(name, 3)
    poses = np.array([each.world_from_object for each in of_kind(world, "ring")])
    radii = np.hypot(*poses[:, :2, 3].T)
    assert len(poses) > 15
    np.testing.assert_allclose(np.abs(radii - np.round((radii + 0.5) / 5) * 5 + 0.5), 0.0, atol=0.02)
    np.testing.assert_allclose((poses[:, :2, 1] * poses[:, :2, 3]).sum(axis=1) / radii, 1.0, atol=0.02)
    logs = of_kind(world, "log")
    assert len(logs) == 5
    for log in logs:
        ends = log.world_from_object[:2, 3, None] + log.world_from_object[:2, :1] * [-0.7, 0.7]
        assert (ends[1] < -3).all()


def test_a_forest_beyond_closes_the_view_and_the_land_goes_on(tmp_path: Path) -> None:
    text = TEXT + "beyond: {hills: 0, land: 0.05 * x, canopy: {height: 8, behind: 20}}\n"
    with environment(tmp_path / "closed.yaml", text) as name:
        mesh = build_world(name, 3).backdrop
    assert mesh is not None
    x, y, z = mesh.vertices.astype(np.float64).T
    outside = np.hypot(np.maximum(np.abs(x) - 12, 0), np.maximum(np.abs(y) - 8, 0))
    near, far = (outside > 14) & (outside < 17), (outside > 23) & (outside < 30)
    assert np.median(z[near] - 0.05 * x[near]) == pytest.approx(0.01 * 20, abs=0.3)
    assert np.median(z[far] - 0.05 * x[far]) == pytest.approx(8 + 0.25 * 6 + 0.01 * 35, abs=2.5)  # and its crowns
    canopy = mesh.faces[mesh.material == mesh.materials.index("canopy")]
    assert 14 < outside[canopy].min() < 20  # triangles of which the middle is behind 19 m


def test_parameters_are_keys_of_the_layout_and_constants_of_all_rules(tmp_path: Path) -> None:
    text = (
        TEXT.replace("fields:", "parameters: {deep: {value: 0.8, low: 0, high: 1}, level: -0.4}\nfields:")
        .replace("-0.8 * smooth", "-deep * smooth")
        .replace("{level: -0.4}", "{level: level - 0.1}")
        + "beyond: {hills: 0, land: 2 * deep}\n"
    )
    with environment(tmp_path / "deep.yaml", text) as name:
        usual, other = (build_world(name, 3, {"grass": 0.0, "stones": 0, **own}) for own in ({}, {"deep": 0.3}))
        with pytest.raises(ConfigurationError, match=r"layout: deep must be a number between 0 and 1, got 1.2"):
            build_world(name, 3, {"deep": 1.2})
    x = np.linspace(-11, 11, 2001)
    for world, deep in ((usual, 0.8), (other, 0.3)):
        cut = (world.terrain.field.height_at(x, np.full(2001, 4.0)) - 0.05 * x).mean()
        assert cut == pytest.approx(-deep, abs=0.02)
        assert world.water_level == pytest.approx(-0.5)
        assert world.backdrop is not None
        far = world.backdrop.vertices[np.hypot(*world.backdrop.vertices[:, :2].T) > 500, 2]
        assert far == pytest.approx(2 * deep, abs=1e-4)


def test_distances_and_means_of_fields_are_those_of_the_plane(tmp_path: Path) -> None:
    """A disc's distance is the radius less the distance from its middle; a mean keeps a slope and lessens a wave."""
    text = TEXT.replace(
        "  slope: 0.05 * x\n  cut: -0.8 * smooth(ditch, 1.5, 0.5)\n",
        "  disc: 0.1 * distance(25 - x * x - y * y)\n"
        "  wave: 0.3 * cos(6.2832 * x / 4)\n"
        "  worn: {smooth: {length: 1, share: y > 0}}\n",
    )
    with environment(tmp_path / "disc.yaml", text.replace("water: {level: -0.4}\n", "")) as name:
        field = build_world(name, 3, {"grass": 0.0, "stones": 0, "row_trees": 0.0}).terrain.field
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-9, 9.1, 0.5), np.arange(-6, 6.1, 0.5)))
    wave = np.where(y > 0, np.exp(-0.5 * (2 * np.pi / 4) ** 2), 1.0) * 0.3 * np.cos(2 * np.pi * x / 4)
    off = field.height_at(x, y) - 0.1 * (5 - np.hypot(x, y)) - wave
    free = (np.abs(y) > 0.5) & (np.hypot(x, y) > 2)  # away from the border of what is smoothed, and from the top
    assert np.sqrt((off[free] ** 2).mean()) < 0.03  # of which the microrelief has 0.01


def test_parameters_have_bounds_and_may_hide_the_distance_to_the_edge(tmp_path: Path) -> None:
    text = (
        TEXT.replace(
            "fields:",
            "parameters:\n  few: {value: 2, low: 1, high: 9, integer: true}\n"
            "  thick: {value: 0.5, above: 0}\n  edge: 3\nfields:",
        )
        .replace("triangles: 80", "triangles: 80, count: 2 * few - 1")
        .replace("per_m2: 4", "per_m2: 8 * thick")
        .replace("where: ditch > 3 and crown < 0.5", "where: y < edge")
    )
    with environment(tmp_path / "few.yaml", text) as name:
        keys = model_of(name).model_fields
        usual, other = build_world(name, 3), build_world(name, 3, {"few": 3, "thick": 1.5})
        for wrong, message in (
            ({"few": 2.5}, "few must be an integer between 1 and 9"),
            ({"thick": 0}, "number above 0"),
        ):
            with pytest.raises(ConfigurationError, match=message):
                build_world(name, 3, wrong)
    assert "grass" not in keys
    for world, stones, per_m2 in ((usual, 3, 4), (other, 5, 12)):
        assert len({each.mesh for each in of_kind(world, "rock")}) == stones
        [grass] = [each.world_from_object[:, :2, 3] for each in world.swarms if each.name == "grass"]
        assert grass[:, 1].max() < 3
        assert len(grass) == pytest.approx(per_m2 * 24 * 11, rel=0.1)


def test_a_count_may_grow_with_the_worlds_length_and_water_has_a_name_and_a_width(tmp_path: Path) -> None:
    text = TEXT.replace("count: 6,", "count: 6, grows: length,").replace("-0.4}", "-0.4, name: pond, beyond: 300}")
    with environment(tmp_path / "long.yaml", text) as name:
        config = model_of(name).model_validate({"size": [48, 64]}).for_size()
        world = build_world(name, 3, {"grass": 0.0, "row_trees": 0.0})
    assert config.stones == 12  # type: ignore[attr-defined]
    [water] = of_kind(world, "water")
    sheet = world.meshes[water.mesh].vertices
    assert water.name == "pond_1"
    assert (sheet.min(axis=0)[:2].tolist(), sheet.max(axis=0)[:2].tolist()) == ([-312, -308], [312, 308])


def test_grass_at_feet_stands_at_posts_and_not_in_water_or_under_wires(tmp_path: Path) -> None:
    text = TEXT.replace("where: ditch > 3 and crown < 0.5", "where: foot < 0.5").replace(
        "objects:", "objects:\n  wires: {type: power_line, y: -5, pole_distance: 20}", 1
    )
    with environment(tmp_path / "feet.yaml", text) as name:
        world = build_world(name, 3, {"row_trees": 0.0, "size": [40, 16]})
    [grass] = [each for each in world.swarms if each.name == "grass"]
    stands = positions([each for each in world.instances if each.kind in ("posts", "rock", "power_pole")])
    away = np.linalg.norm(grass.world_from_object[:, None, :2, 3] - stands, axis=2)
    assert len(away) > 5
    assert away.min(axis=1).max() < 1.0


def test_fields_of_the_relief_know_the_puddles_that_are_dug(tmp_path: Path) -> None:
    """Mud covers what lies lower than the ground about it: the puddles, which were not there when they were placed."""
    puddles = "puddles: {count: 3, where: y < -1 and hollow > -9, radius: [0.9, 1], depth: [0.3, 0.3]}"
    text = (
        TEXT.replace("water: {level: -0.4}", puddles)
        .replace("patch: noise(6, 3)", "patch: noise(6, 3)\n  hollow: blur(height, 1.5) - height")
        .replace("soil: 0.25", "soil: hollow > 0.12")
    )
    with environment(tmp_path / "dug.yaml", text) as name:
        world = build_world(name, 3, {"stones": 0})
    middles = positions(of_kind(world, "water")) + [
        world.meshes[each.mesh].vertices[0, :2] for each in of_kind(world, "water")
    ]
    soil = world.terrain.cover.at(*middles.T)[:, world.terrain.ground_materials.index("soil")]
    assert (soil > 0.8).all()


def test_rows_are_the_same_wherever_the_first_one_is(tmp_path: Path) -> None:
    """Rows 4 m apart are as many with an offset of 58 m as with -2 m; a density by a rule plants them, too."""
    found = []
    for offset in (-2, 58):
        text = TEXT.replace("offset: -2", f"offset: {offset}").replace(
            "per_m2: 4, where: ditch > 3 and crown < 0.5",
            f"per_m2: 0.5 + 0.5, rows: {{spacing: 4, every: 1, offset: {offset}}}",
        )
        with environment(tmp_path / f"rows_{offset + 2}.yaml", text) as name:
            world = build_world(name, 3, {"stones": 0})
        [grass] = world.swarms
        found.append((positions(of_kind(world, "row_trees")), grass.world_from_object[:, :2, 3]))
    for usual, other in zip(*found, strict=True):
        assert len(usual) > 10
        np.testing.assert_allclose(sorted(other.tolist()), sorted(usual.tolist()), atol=1e-9)


@pytest.mark.parametrize("inside", [True, False])
def test_without_a_border_all_is_far_from_it(inside: bool) -> None:
    far = border_distance(np.full((4, 5), inside), 0.2)
    assert (far == (1000.0 if inside else -1000.0)).all()


def test_a_layer_of_objects_is_a_distance_for_what_follows(tmp_path: Path) -> None:
    text = TEXT.replace("where: ditch > 3 and crown < 0.5", "where: posts < 2")
    rule = "posts > 9 and beyond > 3"
    text += f"beyond: {{swarms: {{far: {{group: grass, kind: high_grass, per_m2: 2, within: 6, where: {rule}}}}}}}\n"
    with environment(tmp_path / "near.yaml", text) as name:
        world = build_world(name, 3, {"stones": 0})
    posts = positions(of_kind(world, "posts"))
    swarms = {each.name: each.world_from_object[:, :2, 3] for each in world.swarms}

    def away(xy: np.ndarray) -> np.ndarray:
        return np.asarray(np.linalg.norm(xy[:, None] - posts, axis=2).min(axis=1))

    assert 1.5 < away(swarms["grass"]).max() < 2
    assert 9 < away(swarms["far"]).min() < 11
    outside = np.hypot(*np.maximum(np.abs(swarms["far"]) - (12, 8), 0).T)
    assert 3 < outside.min() < 3.5


def test_waves_have_deviation_one_and_the_materials_of_the_land_follow_its_rules(tmp_path: Path) -> None:
    x, y = np.random.default_rng(0).uniform(-900, 900, (2, 20_000))
    values = np.concatenate([waves(20, 60, np.random.default_rng(seed))(x, y) for seed in range(8)])
    assert (values.mean(), values.std()) == pytest.approx((0.0, 1.0), abs=0.05)
    text = TEXT + "beyond: {fields: {broad: 'waves(60, 200)'}, materials: {mud: broad > 0.2 and beyond > 20}}\n"
    with environment(tmp_path / "woods.yaml", text) as name:
        mesh = build_world(name, 3).backdrop
    assert mesh is not None
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    outside = np.hypot(*np.maximum(np.abs(middle[:, :2]) - (12, 8), 0).T)
    muddy = mesh.material == mesh.materials.index("mud")
    assert not muddy[outside < 19.9].any()
    assert 0.2 < muddy[outside > 20].mean() < 0.65


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("litter_amount: 0", "beyond: {fields: {a: b, b: a + 1}}", "beyond.fields.[ab]: follows from itself"),
        (
            "slope: 0.05 * x",
            "slope: {pits_and_mounds: {per_ha: 9, where: noise(5) > 0}}",
            r"relief.slope.where: noise\(\) is allowed",
        ),
        (
            "slope: 0.05 * x",
            "slope: {collapse: {repose_deg: noise(5)}}",
            r"relief.slope.repose_deg: noise\(\) is allowed",
        ),
        ("{level: -0.4}", "{level: rows(3)}", "water.level: unknown field 'x'"),
        ("{group: stone, kind: rock, count: 6", "{type: [a], group: stone", "objects.stones: unknown type"),
        ("count: 6, where", "count: 6, scales: [2, 1], where", "objects.stones.scales: the first must not be above"),
        ("count: 6, where", "count: 6, bedded: true, stand: true, where", "objects.stones: bedded .* excludes stand"),
        ("fields:", "parameters: {wide: {value: 3, high: 2}}\nfields:", "parameters.wide: value must be between"),
        (
            "litter_amount: 0",
            "surroundings: {far: {margin: 5, spacing: 5, relief: {}}}",
            "surroundings.far: margin must be two spacings",
        ),
        (
            "litter_amount: 0",
            "surroundings: {a: {margin: 20, spacing: 2, relief: {}}, b: {margin: 60, spacing: 2, relief: {}}}",
            "surroundings: the widest must be first",
        ),
        (
            "litter_amount: 0",
            "surroundings: {a: {margin: 20, spacing: 2, relief: {}}}\nbeyond: {canopy: {height: 8, behind: 9}}",
            "either surroundings or beyond.canopy is allowed",
        ),
        (
            "objects:",
            "objects:\n  one: {type: power_line, y: 3}\n  two: {type: power_line, y: 6}",
            "objects: one power_line is allowed",
        ),
        ("patch: noise(6, 3)", "patch: waves(6, 30)", r"fields.patch: waves\(\) is allowed in beyond.fields only"),
        ("slope: 0.05 * x", "slope: {smoth: {length: 1}}", "relief.slope: unknown step 'smoth'; did you mean 'smooth'"),
        ("slope: 0.05 * x", "slope: {smooth: {length: 0}}", "relief.slope.smooth.length must be a number above 0"),
        ("slope: 0.05 * x", "slope: {smooth: {length: 1, share: crown}}", "relief.slope.share: unknown field 'crown'"),
        ("{group: stone, kind: rock, count: 6", "{type: bed, group: stone", "objects.stones: unknown type 'bed'"),
        ("count: 6, where", "cont: 6, where", "unknown key 'objects.stones.cont'; did you mean 'objects.stones.count'"),
        ("where: y < 1", "where: stones > 3", "objects.row_trees.where: unknown field 'stones'"),
        ("fields:", "parameters: {wet: 1}\nfields:", "fields.wet: the name is taken"),
        ("fields:", "fields:\n  edge: 1", "fields.edge: the name is taken"),
        ("triangles: 80", "triangles: 80, count: many", "groups.stone.count: unknown field 'many'"),
        (
            "group: stone, kind: rock, count: 6, where: x > 4 and y < -1",
            "type: power_line, y: patch",
            "objects.stones.y: unknown field 'patch'",
        ),
        ("{level: -0.4}", "{level: x}", "water.level: unknown field 'x'"),
        ("litter_amount: 0", "beyond: {land: height}", "beyond.land: unknown field 'height'"),
        (
            "litter_amount: 0",
            "beyond: {fields: {a: 'waves(9, 2)'}}",
            r"waves\(\) takes a shortest .* got waves\(9, 2\)",
        ),
        ("litter_amount: 0", "beyond: {materials: {mad: 1}}", "beyond: unknown material 'mad'"),
        ("mud: wet", "mad: wet", "ground: unknown material 'mad'; did you mean 'mud'"),
        ("mud: wet", "mud: wett", "ground.mud: unknown field 'wett'; did you mean 'wet'"),
        ("slope: 0.05 * x", "slope: 0.05 * crown", "relief.slope: unknown field 'crown'"),
        ("where: y < 1", "where: noise(3) > 0", r"objects.row_trees.where: noise\(\) is allowed in fields and relief"),
        ("patch: noise(6, 3)", "patch: patch + 1", "fields.patch: follows from itself"),
        (
            "patch: noise(6, 3)",
            "patch: height + other\n  other: patch",
            "fields.other: follows from itself|fields.patch",
        ),
        ("patch: noise(6, 3)", "trail: 1", "fields.trail: the name is taken"),
        ("patch: noise(6, 3)", "ditch: 1", "fields.ditch: the name is taken"),
        ("patch: noise(6, 3)", "patch: noise(x)", r"noise\(\) takes a wavelength from 0.1 m, .* got noise\(x\)"),
        ("patch: noise(6, 3)", "patch: noise(6, 30)", r"got noise\(6, 30\)"),
        ("  grass: {group: grass, kind", "  stones: {group: grass, kind", "plants.stones: the name is taken"),
        ("  stones: {group: stone", "  size: {group: stone", "objects.size: the name is taken"),
        ("  stones: {group: stone", "  planter: {group: stone", "objects.planter: the name is taken"),
        (
            "litter_amount: 0",
            "beyond: {swarms: {grass: {group: grass, kind: high_grass}}}",
            "beyond.swarms.grass: the name",
        ),
        ("group: grass", "group: gras", "plants.grass: unknown group 'gras'; did you mean 'grass'"),
        ("line: ditch", "line: dich", "objects.posts.along: unknown line 'dich'"),
        ("line: ditch", "contours: dich", "objects.posts.along: unknown field 'dich'"),
        ("line: ditch", "line: ditch, contours: wet", "objects.posts.along: either line or contours is required"),
        ("count: 6,", "", "objects.stones: one of count, rows and along is required"),
        ("litter_amount: 0", "liter_amount: 0", "liter_amount"),
        ("litter_amount: 0", "seasonal: {winter: {grass: [wheet]}}", "seasonal.winter: grass: unknown species 'wheet'"),
        ("{oak: [3, 4]}", "{oak: [3, 4]}, count: 2 * few", "groups.tree.count: unknown field 'few'"),
        ("litter_amount: 0", "parameters: {few: {value: 1.5, integer: true}}", "parameters.few: .* must be integers"),
        ("slope: 0.05 * x", "slope: {erode: {repose_deg: x}}", "relief.slope.repose_deg: unknown field 'x'"),
        (
            "slope: 0.05 * x",
            "slope: {profile: {of: x, slopes_deg: [[0, 1], [0, 2]]}}",
            r"slopes_deg: each \[coordinate, slope\] must have a larger coordinate",
        ),
        (
            "litter_amount: 0",
            "surroundings: {far: {margin: 0, spacing: 1, relief: {}}}",
            "surroundings.far.margin must be a number above 0",
        ),
        (
            "litter_amount: 0",
            "surroundings: {far: {margin: 9, spacing: 1, relief: {a: wett}}}",
            "surroundings.far.relief.a: unknown field 'wett'; did you mean 'wet'",
        ),
        ("litter_amount: 0", "season: wintr", "unknown season 'wintr'; did you mean 'winter'"),
    ],
)
def test_a_mistake_in_a_file_is_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = TEXT.replace(old, new)
    assert text != TEXT
    path = tmp_path / "wrong.yaml"
    with pytest.raises(ConfigurationError, match=message) as report, environment(path, text):
        pass
    assert str(path) in str(report.value)
    assert "\n" not in str(report.value)


def test_a_season_may_have_species_of_its_own(tmp_path: Path) -> None:
    text = TEXT.replace("litter_amount: 0", "litter_amount: 0\nseasonal: {winter: {grass: [wheat_seedling]}}")
    with environment(tmp_path / "crops.yaml", text) as name:
        for season, species in (("summer", "meadow"), ("winter", "wheat_seedling")):
            world = build_world(name, 3, {"season": season, "size": [16, 12], "stones": 0})
            [swarm] = [each for each in world.swarms if each.name == "grass"]
            assert {each for mesh in swarm.meshes for each in world.meshes[mesh].species} == {species}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("oak: [3, 4]", "oak: [0.1, 0.2]", "environment wrong: groups.tree: height of oak must be between"),
        (
            "slope: 0.05 * x",
            "slope: log(x)",
            r"the rule 'log\(x\)' must be finite, got none at x -12.0 m, y -8.0 m",
        ),
        ("count: 6,", "count: 300, spacing: 4,", "objects of kind rock fit in the world; reduce the layout's count"),
    ],
)
def test_a_world_that_cannot_be_made_is_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    with environment(path, TEXT.replace(old, new)) as name, pytest.raises(FieldtruthError, match=message) as report:
        build_world(name, 3)
    assert "\n" not in str(report.value)


def test_lines_of_a_world_of_another_size_stay(tmp_path: Path) -> None:
    """They are cut at the edge of that world, not of the built-in ones, and a line wholly outside is left out."""
    text = TEXT.replace("size: [24, 16]", "size: [140, 16]").replace(
        "[[[-20, 4], [20, 4]]]", "[[[-65, 4], [69, 4]], [[0, 90], [9, 90]]]"
    )
    with environment(tmp_path / "long.yaml", text) as name:
        world = build_world(name, 3, {"grid": 0.2, "grass": 0.0})
    at = world.terrain.field.height_at(np.array([-60.0, 62.0]), np.full(2, 4.0)) - 0.05 * np.array([-60.0, 62.0])
    np.testing.assert_allclose(at, -0.8, atol=0.06)


def test_puddles_are_hollows_with_water_of_their_own(tmp_path: Path) -> None:
    text = TEXT.replace(
        "water: {level: -0.4}", "puddles: {count: 3, where: y < -1, radius: [0.6, 0.9], depth: [0.1, 0.1]}"
    )
    with environment(tmp_path / "wet.yaml", text) as name:
        world = build_world(name, 3)
    sheets = of_kind(world, "water")
    assert len(sheets) == 3
    for sheet in sheets:
        level = sheet.world_from_object[2, 3]
        mesh = world.meshes[sheet.mesh]
        centre, rim = mesh.vertices[0, :2].astype(float), mesh.vertices[1:, :2].astype(float)
        assert world.materials[mesh.materials[0]].label == Label.WATER
        assert centre[1] < -1
        assert world.water_at(*centre) == pytest.approx(level)
        # 10 cm deep, but for what the slope of 5 % takes; its edge is below the ground all round.
        assert level - world.terrain.field.height_at(*centre) == pytest.approx(0.1, abs=0.06)
        assert (world.terrain.field.height_at(*rim.T) > level).mean() > 0.9
    assert (world.water_at(*np.array([[11.0, 7.0], [0.0, 6.0]]).T) < -100).all()


@pytest.mark.slow
def test_a_file_in_a_users_folder_is_an_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example of the page on layers, in a process of its own, which reads FIELDTRUTH_PATH."""
    page = (Path(__file__).parents[2] / "docs" / "layers.md").read_text(encoding="utf-8")
    text, *_ = re.findall(r"```yaml\n(.*?)```", page, flags=re.S)
    (tmp_path / "environments").mkdir()
    (tmp_path / "environments" / "steppe.yaml").write_text(text)
    (tmp_path / "environments" / "plants_only.yaml").write_text("groups: {}\n")
    code = (
        "import fieldtruth as ft\n"
        "assert 'plants_only' not in ft.list_environments()\n"
        "print(ft.list_environments()['steppe'])\n"
        "world = ft.load_world('steppe', 1, {'size': [24, 16], 'stones': 3, 'grass': 1.0})\n"
        "print(world.name, sum(each.kind == 'rock' for each in world.instances))"
    )
    variables = {**os.environ, "FIELDTRUTH_PATH": str(tmp_path)}
    made = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=False)
    assert made.stdout.splitlines() == ["steppe: feather grass on low dunes, a sandy track", "steppe 3"], made.stderr


def test_the_page_on_layers_names_every_section_field_and_function() -> None:
    page = (Path(__file__).parents[2] / "docs" / "layers.md").read_text(encoding="utf-8")
    page = re.sub(r"```.*?```", "", page, flags=re.S)
    words = set(re.findall(r"\w+", " ".join(re.findall(r"`([^`]*)`", page))))
    assert {
        *Description.model_fields,
        *FLAT,
        *SHAPED,
        *LATE,
        *FUNCTIONS,
        *DRAWN,
        *STEPS,
        *PLACE,
        *Beyond.model_fields,
    } <= words


def test_groups_may_be_counted_by_an_integer_of_the_layout(tmp_path: Path) -> None:
    text = TEXT.replace("{oak: [3, 4]}", '{oak: [3, 4]}, count: "min(few + 1, 4)"').replace(
        "litter_amount: 0", "litter_amount: 0\nparameters: {few: {value: 2, low: 1, high: 9, integer: true}}"
    )
    with environment(tmp_path / "counted.yaml", text) as name:
        for layout, trees in (({}, 3), ({"few": 1}, 2), ({"few": 9}, 4)):
            world = build_world(name, 3, {"size": [24, 16], "stones": 0, "grass": 0, **layout})
            assert {each.mesh for each in of_kind(world, "row_trees")} == {f"tree_oak_{k}" for k in range(trees)}
        with pytest.raises(ConfigurationError, match=r"layout: few must be an integer between 1 and 9, got 1\.5"):
            build_world(name, 3, {"few": 1.5})


def test_bedded_rocks_have_their_whole_rim_in_a_steep_slope(tmp_path: Path) -> None:
    text = TEXT.replace("0.05 * x", "0.5 * x").replace("count: 6,", "count: 6, bedded: true,")
    with environment(tmp_path / "steep.yaml", text) as name:
        world = build_world(name, 3, {"grass": 0, "row_trees": 0})
    for rock in of_kind(world, "rock"):
        pose = rock.world_from_object
        rim = rim_vertices(world.meshes[rock.mesh]) @ pose[:3, :3].T + pose[:3, 3]
        assert (rim[:, 2] < world.terrain.field.height_at(rim[:, 0], rim[:, 1])).all()
        assert pose[2, 2] < 0.98 * np.linalg.norm(pose[:3, 2])
