# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Objects of layers beside others and along trails, beds, and what goes on beyond the edge, in a small garden."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import without_textures
from test_layered import environment, of_kind, positions

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.build import build_world
from fieldtruth.world.model import Swarm, World

F8 = NDArray[np.float64]
TEXT = """
description: "a garden with a trail"
size: [40, 30]
parameters: {individuals: {value: 3, low: 1, integer: true}}
fields:
  patch: noise(6, 3)
trails: [[[-30, -4], [30, -4]]]
trail_width: 2
trail: {ragged: 0}
ground: {lawn: 1, soil: 1 - foot, mulch: -10 * beds}
groups:
  tree: {form: tree, name: "tree_{species}_{k}", species: {oak: [3, 4], lime: [3, 4]}, detail: 0.1, in_turn: true,
    count: individuals}
  rare: {form: tree, name: "rare_{species}", species: {birch: [3, 4]}, detail: 0.1}
  bush: {form: bush, name: "bush_{species}_{k}", species: {box: [0.7, 1], heather: [0.8, 1.1]}, relative: true,
    count: 3, detail: 0.2}
  flower: {form: tuft, name: "{species}_{k}", species: {daisy: 0.3, yarrow: 0.3}, count: 2, detail: 0.4}
objects:
  benches: {furniture: [bench_0], kind: bench, count: 4, spacing: 5, aligned: true,
    along: {line: trail, every: 0.8, offset: 0.95, facing: true}}
  bins: {furniture: [trash_bin_0], kind: trash_bin, count: 6, spacing: 3, beside: {layer: benches, aside: 1.45},
    along: {line: trail, every: 1, offset: 0.6}}
  trees: {group: [tree, rare], kind: tree, count: 9, spacing: 3, differ: 9, where: trail > 1.5}
  beds:
    type: beds
    group: bush
    kind: bush
    count: 8
    edging: {name: edges}
    border: {group: flower, name: "flowers_{species}", kind: flower, per_m2: 20, where: beds < -0.1}
litter_amount: 0
beyond:
  planted: 0.5
  hills: 0
  trails: 40
  fields: {wood: "min(y - 45, 1)"}
  roof: 6 * (wood > 0)
  materials: {canopy: wood > 0 or (wood > -9 and slope > 17)}
  swarms:
    avenue: {group: tree, kind: tree, along: {line: trail, every: 4, offset: 2}, within: 30, margin: 2, tint: 0}
    far_flowers: {group: flower, kind: flower, per_m2: 1, within: 20, where: trail > 3}
    wood: {group: rare, kind: tree, per_m2: 0.01, within: 110, margin: 40, where: wood > 0}
corridors: [[[-15, 6], [15, 6]]]
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    with environment(tmp_path_factory.mktemp("layers") / "garden.yaml", TEXT) as name, without_textures():
        return build_world(name, 3)


def swarm(world: World, name: str) -> F8:
    """Positions (n, 3) of a swarm."""
    [found] = [each for each in world.swarms if each.name == name]
    return found.world_from_object[:, :3, 3]


def off_edge(xy: F8) -> F8:
    return np.asarray(np.hypot(*np.maximum(np.abs(xy) - [20.0, 15.0], 0.0).T))


def test_objects_along_a_trail_are_as_many_as_the_count_and_face_it(world: World) -> None:
    benches = of_kind(world, "bench")
    xy = positions(benches)
    assert len(xy) == 4
    np.testing.assert_allclose(np.abs(xy[:, 1] + 4), 1.95, atol=1e-9)
    ahead = np.array([each.world_from_object[:2, 0] for each in benches])
    np.testing.assert_allclose(ahead, np.column_stack([np.zeros(4), -np.sign(xy[:, 1] + 4)]), atol=1e-9)
    away = np.hypot(*(xy[:, None] - xy).transpose(2, 0, 1)) + 99 * np.eye(4)
    assert away.min() >= 2.5  # half of the spacing


def test_at_most_one_object_is_beside_each_other_and_the_rest_is_along_the_trail(world: World) -> None:
    bins, benches = positions(of_kind(world, "trash_bin")), positions(of_kind(world, "bench"))
    away = np.hypot(*(bins[:, None] - benches).transpose(2, 0, 1))
    beside = np.abs(away - 1.45) < 1e-9
    assert len(bins) == 6
    assert 2 <= beside.sum() <= 4
    assert (beside.sum(axis=0) <= 1).all()
    np.testing.assert_allclose(np.abs(bins[~beside.any(axis=1), 1] + 4), 1.6, atol=1e-9)


def test_neighbours_are_different_individuals_of_several_groups(world: World) -> None:
    trees = of_kind(world, "tree")
    names = [each.mesh for each in trees]
    assert set(names) == {"rare_birch", *(f"tree_{name}_{k}" for name in ("oak", "lime") for k in range(3))}
    away = np.hypot(*(positions(trees)[:, None] - positions(trees)).transpose(2, 0, 1))
    same = np.array(names)[:, None] == np.array(names)
    assert away[same & ~np.eye(9, dtype=bool)].min() > 5.0


def test_ground_knows_the_feet_of_objects_and_the_outlines_of_beds(world: World) -> None:
    cover, names = world.terrain.cover, world.terrain.ground_materials
    soil, mulch = (cover.values[..., names.index(name)] for name in ("soil", "mulch"))
    shares = {}
    for kind in ("tree", "bush"):
        i, j = np.round((positions(of_kind(world, kind)) - (cover.x0, cover.y0)) / cover.spacing).astype(int).T
        shares[kind] = soil[i, j], mulch[i, j]
    assert shares["tree"][0].min() > 0.7
    assert shares["bush"][0].max() < 0.5
    assert shares["bush"][1].min() == 1.0
    assert len(of_kind(world, "bush")) == 8
    assert 0.005 < mulch.mean() < 0.05


def test_each_bed_has_flowers_of_one_species_inside_its_edge(world: World) -> None:
    edges = swarm(world, "edges")[:, :2]
    flowers = {name: swarm(world, f"flowers_{name}")[:, :2] for name in ("daisy", "yarrow")}
    nearest = {k: np.hypot(*(xy[:, None] - edges).transpose(2, 0, 1)).min(axis=1) for k, xy in flowers.items()}
    assert all(len(each) > 5 and each.min() > 0.05 for each in nearest.values())
    apart = np.hypot(*(flowers["daisy"][:, None] - flowers["yarrow"]).transpose(2, 0, 1)).min()
    assert apart > 0.8  # that of beds


def test_trails_and_what_is_beside_them_go_on_beyond_the_edge(world: World) -> None:
    land = world.backdrop
    assert land is not None
    rows = [land.materials.index(name) for name in ("path", "path_edge")]
    ribbon = land.vertices[np.unique(land.faces[np.isin(land.material, rows)])].astype(float)
    off = off_edge(ribbon[:, :2])
    assert 38 < off.max() < 50  # 30 m of the trail are the world's
    assert np.abs(np.abs(ribbon[off < 1e-3, 1] + 4)).max() < 1.05
    trees = swarm(world, "avenue")
    assert 4 <= len(trees) <= 14  # half of 7 on each side at both ends
    away = np.hypot(*(trees[:, None, :2] - ribbon[:, :2]).transpose(2, 0, 1)).min(axis=1)
    np.testing.assert_allclose(away, 2.0, atol=0.12)
    flowers = swarm(world, "far_flowers")
    assert np.hypot(*(flowers[:, None, :2] - ribbon[:, :2]).transpose(2, 0, 1)).min() > 2.8


def test_a_roof_is_above_the_land_and_trees_stand_below_it(world: World) -> None:
    land = world.backdrop
    assert land is not None
    x, y, z = land.vertices.astype(float).T
    wood, meadow = (y > 46) & (y < 150), (y < 40) & (np.hypot(x, y) < 150)
    assert z[meadow].max() < 2.0
    assert z[wood].min() > 5.5
    trees = swarm(world, "wood")
    assert len(trees) > 20
    assert trees[:, 1].min() > 45
    assert trees[:, 2].max() < 2.0


def test_the_share_that_is_planted_beyond_is_a_key_of_the_layout(tmp_path: Path) -> None:
    counts = {}
    with environment(tmp_path / "share.yaml", TEXT) as name, without_textures():
        for share in (0, 0.25, 1):
            few = {"trees": 0, "beds": 0, "bins": 0, "grid": 0.2, "beyond": share}
            far: list[Swarm] = build_world(name, 3, few).swarms  # type: ignore[assignment]
            counts[share] = sum(len(each.mesh) for each in far)
    assert counts[0] == 0
    assert 0.15 < counts[0.25] / counts[1] < 0.35


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("layer: benches", "layer: bench", "objects.bins.beside: unknown layer before it: 'bench'"),
        ("type: beds", "type: bed", "objects.beds: unknown type 'bed'; did you mean 'beds'"),
        ("group: bush\n", "group: busch\n", "objects.beds: unknown group 'busch'; did you mean 'bush'"),
        ("group: [tree, rare]", "group: [tree, rar]", "objects.trees: unknown group 'rar'"),
        ("roof: 6 * (wood > 0)", "roof: trail", "beyond.roof: unknown field 'trail'"),
        ("along: {line: trail, every: 4", "along: {line: road, every: 4", "avenue.along: unknown line 'road'"),
        ("count: 6, spacing: 3, beside", "beside", "objects.bins: beside: a count is required"),
        ("beds < -0.1", "beds < -depth", "objects.beds.border.where: unknown field 'depth'"),
    ],
)
def test_a_mistake_is_one_line(old: str, new: str, message: str, tmp_path: Path) -> None:
    text = TEXT.replace(old, new)
    assert text != TEXT
    with (
        pytest.raises(ConfigurationError, match=message) as report,
        environment(tmp_path / "wrong.yaml", text),
    ):
        pass
    assert "\n" not in str(report.value)


def test_a_world_of_another_order_has_the_same_trees(world: World, tmp_path: Path) -> None:
    """Each layer draws from its own seed, and bushes come after trees."""
    with environment(tmp_path / "fewer.yaml", TEXT) as name, without_textures():
        other = build_world(name, 3, {"beds": 3})
    for a, b in pairwise([of_kind(world, "tree"), of_kind(other, "tree")]):
        np.testing.assert_array_equal(positions(a), positions(b))
    assert len(of_kind(other, "bush")) == 3
