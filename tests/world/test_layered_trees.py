# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layers of a forest: species by share, crowns, roots, random points, densities that remain, pits, gentle slopes."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from mesh_checks import scale_of
from sense_worlds import without_textures
from test_layered import environment, of_kind, positions

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.build import build_world
from fieldtruth.world.environments.layered.trees import divided
from fieldtruth.world.model import World
from fieldtruth.world.rocks import rim_vertices

TEXT = """
description: "a wood"
size: [48, 32]
parameters: {tufts: 8}
mixtures: {woods: {spruce: 0.6, beech: 0.3, oak: 0.1}}
fields:
  group: 0.5 * (x > 0)
  near: points(60)
relief:
  steep: 0.9 * x * (x > -4)
  gentle: {limit_slope: {along: abs(y), within: 9, beyond: 30, near: 2, far: 6}}
roots: [trees]
ground:
  needles: 1
  litter: crown_leaves * (1 - crown_needles)
  moss: near < 3
groups:
  tree: {form: tree, name: "{species}_{k}", mixture: woods, heights: [4, 6], count: 2, detail: 0.1}
  stone: {form: rock, name: "stone_{k}", species: {granite: [0.4, 0.9]}, count: 3, triangles: 80}
  grass: {form: tuft, name: "{species}_{k}", species: {meadow: [0.2, 0.3]}, detail: 0.3}
objects:
  trees: {group: tree, kind: "{species}", count: 30, spacing: 2}
  shrubs: {group: tree, kind: shrub, count: 10, scales: [0.3, 0.4]}
  rocks: {group: stone, kind: rock, count: 12, bedded: true, where: near < 3}
plants:
  grass: {group: grass, kind: high_grass, per_m2: tufts / 16, where: group}
  herbs: {group: grass, kind: herb, per_m2: 0.5, mean: true, where: group}
litter_amount: 0
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return built(tmp_path_factory.mktemp("wood"), TEXT)


def built(folder: Path, text: str, layout: Mapping[str, object] | None = None) -> World:
    with environment(folder / "wood.yaml", text) as name, without_textures():
        return build_world(name, 4, layout)


def test_species_are_as_frequent_as_their_mixture_says(world: World, tmp_path: Path) -> None:
    kinds = Counter(each.kind for each in world.instances)
    assert kinds == {"spruce": 18, "beech": 9, "oak": 3, "shrub": 10, "rock": 12}
    shrubs = Counter(world.meshes[each.mesh].species[0] for each in of_kind(world, "shrub"))
    assert shrubs == {"spruce": 6, "beech": 3, "oak": 1}
    other = built(tmp_path, TEXT, {"woods": {"birch": 1.0, "spruce": 0.0}, "shrubs": 4})
    assert Counter(each.kind for each in other.instances) == {"birch": 30, "shrub": 4, "rock": 12}
    assert divided(5, {"a": 1.0, "b": 1.0, "c": 1.0}) == {"a": 2, "b": 2, "c": 1}
    with (
        environment(tmp_path / "wood.yaml", TEXT) as name,
        pytest.raises(ConfigurationError, match=r"layout: woods: unknown species 'palm'.*Available: alder"),
    ):
        build_world(name, 4, {"woods": {"palm": 1.0}})


def test_the_ground_swells_about_trunks_of_the_layers_with_roots(world: World, tmp_path: Path) -> None:
    flat = built(tmp_path, TEXT.replace("roots: [trees]", "roots: []"))
    raised = world.terrain.field.heights - flat.terrain.field.heights
    field = world.terrain.field
    for kind, least, most in (("spruce", 0.25, 0.7), ("shrub", -0.01, 0.2)):
        for each in of_kind(flat, kind):
            x, y = each.world_from_object[:2, 3]
            radius = scale_of(each) * flat.meshes[each.mesh].colliders[0].size[0]
            i, j = round((x - field.x0) / field.spacing), round((y - field.y0) / field.spacing)
            assert least * radius - 1e-4 <= raised[i, j], kind
            if kind == "spruce":
                assert raised[i, j] <= most * radius + 0.02, kind
    assert raised.max() < 0.2
    trunks = positions([each for each in flat.instances if each.kind in ("spruce", "beech", "oak")])
    rows, columns = np.nonzero(raised > 1e-3)
    xy = np.column_stack([field.x0 + field.spacing * rows, field.y0 + field.spacing * columns])
    assert np.linalg.norm(xy[:, None] - trunks, axis=2).min(axis=1).max() < 3.5
    for each in of_kind(world, "rock"):  # a layer after: on the raised ground
        vertices = rim_vertices(world.meshes[each.mesh]) @ each.world_from_object[:3, :3].T
        vertices += each.world_from_object[:3, 3]
        assert (vertices[:, 2] < field.height_at(*vertices[:, :2].T)).all()


def test_leaves_lie_below_broadleaved_crowns_and_needles_below_the_others(world: World) -> None:
    field, cover = world.terrain.cover, world.terrain.cover.values
    materials = world.terrain.ground_materials
    spruces = positions(of_kind(world, "spruce"))

    def shares(xy: np.ndarray) -> dict[str, float]:
        i, j = np.round((xy - (field.x0, field.y0)) / field.spacing).astype(int)
        return dict(zip(materials, cover[i, j].tolist(), strict=True))

    assert max(shares(xy)["litter"] for xy in spruces) < 0.02
    broad = positions([*of_kind(world, "beech"), *of_kind(world, "oak")])
    alone = [xy for xy in broad if np.linalg.norm(spruces - xy, axis=1).min() > 4.0]
    assert len(alone) > 3
    assert min(shares(xy)["litter"] + shares(xy)["moss"] for xy in alone) > 0.95


def test_rocks_lie_about_random_points(world: World) -> None:
    moss = world.terrain.cover.values[..., 2]
    assert 0.06 < (moss > 0.5).mean() < 9 * np.pi * 9 / (48 * 32)  # discs of 3 m, which overlap or are cut by the edge
    xy = positions(of_kind(world, "rock"))
    i, j = np.round((xy + np.array((24, 16))) / world.terrain.cover.spacing).astype(int).T
    assert (moss[i, j] > 0.3).all()


def test_a_mean_density_is_what_remains_and_others_are_thinned(world: World, tmp_path: Path) -> None:
    swarms = {each.name: each.world_from_object[:, :2, 3] for each in world.swarms}
    area = 48 * 32
    assert len(swarms["herbs"]) == pytest.approx(0.5 * area, rel=0.12)
    assert len(swarms["grass"]) == pytest.approx(8 / 16 * 0.5 * area / 2, rel=0.15)
    assert (swarms["herbs"][:, 0] > -0.2).all()
    few = built(tmp_path, TEXT, {"tufts": 2, "herbs": 0.1})
    counts = {each.name: len(each.mesh) for each in few.swarms}
    assert counts["grass"] == pytest.approx(len(swarms["grass"]) / 4, rel=0.3)
    assert counts["herbs"] == pytest.approx(0.1 * area, rel=0.25)
    with (
        environment(tmp_path / "wood.yaml", TEXT) as name,
        pytest.raises(ConfigurationError, match="unknown key 'grass'"),
    ):
        build_world(name, 4, {"grass": 1})


def test_slopes_are_limited_by_the_distance_from_a_line(tmp_path: Path) -> None:
    """Below the microrelief; 42 deg before. The limit is for the steepest sides at a node."""
    text = TEXT.replace("roots: [trees]", "roots: []").replace("needles: 1", "path: 1")
    field = built(tmp_path, text, {"trees": 0, "shrubs": 0, "rocks": 0}).terrain.field
    x, y = np.linspace(-20, 20, 200), np.linspace(-1.5, 1.5, 20)
    step = 0.6
    for middle, limit in ((0.0, 9.0), (-12.0, 30.0)):
        xy = np.stack(np.meshgrid(x, y + middle, indexing="ij"), axis=-1).reshape(-1, 2)
        rise = field.height_at(xy[:, 0] + step, xy[:, 1]) - field.height_at(xy[:, 0] - step, xy[:, 1])
        slope = np.degrees(np.arctan(np.abs(rise) / (2 * step)))
        assert np.percentile(slope, 97) < limit + 2.0
        assert slope.max() > 0.6 * limit


def test_pits_and_mounds_are_as_many_as_said_where_they_may_be(tmp_path: Path) -> None:
    bare = TEXT.replace("  gentle: {limit_slope: {along: abs(y), within: 9, beyond: 30, near: 2, far: 6}}\n", "")
    bare = bare.replace("0.9 * x * (x > -4)", "0").replace("roots: [trees]", "roots: []")
    text = bare.replace("relief:", "relief:\n  uprooted: {pits_and_mounds: {per_ha: 100, where: x < -6}}")
    nothing = {"trees": 0, "shrubs": 0, "rocks": 0}
    raised, level = (built(tmp_path, each, nothing).terrain.field.heights for each in (text, bare))
    added = (raised - level).astype(np.float64)
    half = len(added) // 2
    assert np.abs(added[half:]).max() < 1e-3
    assert 0.1 < added.max() < 0.8
    assert added.sum() * 0.05**2 == pytest.approx(0.0, abs=0.3)  # [m3] as much is up as down, but at the edge


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("mixture: woods", "mixture: wood", "groups.tree.mixture: unknown mixture 'wood'; did you mean 'woods'"),
        ("oak: 0.1", "palm: 0.1", "mixtures.woods: unknown species 'palm'"),
        ("{spruce: 0.6, beech: 0.3, oak: 0.1}", "{oak: 0}", "mixtures.woods: at least one share must be above 0"),
        ("count: 2, detail: 0.1", "count: few, detail: 0.1", "groups.tree.*: unknown .* 'few'"),
        ("roots: [trees]", "roots: [shrub]", "roots: unknown layer of objects 'shrub'; did you mean 'shrubs'"),
        ("per_m2: tufts / 16", "per_m2: x / 16", "plants.grass.per_m2: unknown field 'x'"),
        ("per_m2: 0.5", "per_m2: 21", "plants.herbs.per_m2: must be a number between 0 and 20, or a rule of"),
        ("count: 30, spacing: 2", "rows: {spacing: 4, every: 4}", r"objects.trees: kind may have \{species\} where"),
        ("near: 2, far: 6", "near: 2, far: 2", "relief.gentle.limit_slope.*far must be above near"),
        ("litter: crown_leaves", "litter: crown_leafs", "did you mean 'crown_leaves'"),
        ("moss: near < 3", "moss: points(3)", r"ground.moss: points\(\) is allowed in fields and relief only"),
    ],
)
def test_mistakes_are_said(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = TEXT.replace(old, new)
    assert text != TEXT
    with pytest.raises(ConfigurationError, match=message) as report, environment(tmp_path / "wood.yaml", text):
        pass
    assert "\n" not in str(report.value)
