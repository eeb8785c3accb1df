# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seasons: leaves by the table, wood and ground as in summer, colours that no label knows, snow by its law."""

import tracemalloc
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
from mesh_checks import assert_same_bytes, assert_valid
from park_worlds import digest
from sense_worlds import without_textures

import fieldtruth as ft
from fieldtruth.campaign.config import Campaign
from fieldtruth.campaign.draw import draw
from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.world.build import build_world, check_layout, read_world, save_world
from fieldtruth.world.environments import ENVIRONMENTS
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Instance, Mesh, Raster, Terrain, World, make_mesh
from fieldtruth.world.plants import BUSHES, GRASSES, TREES, grow_bush, grow_tree, grow_tuft
from fieldtruth.world.seasons import SEASONAL, changes, seasons
from fieldtruth.world.seasons.change import HOLDS, SLIDES, in_season, recoloured, snowed_in
from fieldtruth.world.seasons.leaves import in_season as mesh_in_season
from fieldtruth.world.seasons.leaves import variant

SMALL: Final = {"size": [24.0, 20.0], "grid": 0.2, "large_trees": 2, "small_trees": 2, "bushes": 2, "benches": 1,
                "lamp_posts": 1, "tables": 1, "trash_bins": 1, "individuals": 1, "beyond": False}  # fmt: skip
BROADLEAVES: Final = ("beech", "birch", "lime", "alder", "willow")


def tree(name: str, height: float = 9.0) -> Mesh:
    return grow_tree(TREES[name], name=name, height=height, rng=np.random.default_rng(3), detail=0.05)


def leaves(mesh: Mesh, material: str) -> int:
    """Triangles of all colours of a leaf's material."""
    names = {material, *(variant(material, k) for k in range(1, 6))}
    return int(np.isin(mesh.material, [k for k, name in enumerate(mesh.materials) if name in names]).sum())


def wood(mesh: Mesh, species: str) -> np.ndarray[Any, Any]:
    """Corners (f, 3, 3) of the wood's triangles, in their order."""
    rows = [k for k, name in enumerate(mesh.materials) if name in (TREES[species].wood, TREES[species].upper_wood)]
    return np.asarray(mesh.vertices[mesh.faces[np.isin(mesh.material, rows)]])


@cache
def summer() -> World:
    with without_textures():
        return build_world("park", 3, SMALL)


@cache
def changed(season: str, drought: float = 0.5) -> World:
    return in_season(summer(), season, drought)


@pytest.mark.parametrize("name", BROADLEAVES)
def test_a_bare_crown_has_no_leaf_and_the_wood_of_summer(name: str) -> None:
    before = tree(name)
    after = mesh_in_season(before, changes("winter"), 1)
    own, bare = wood(before, name), wood(after, name)
    assert leaves(after, TREES[name].foliage) == 0
    assert bare.tobytes() == own.tobytes()
    assert f"{TREES[name].wood}_twigs" in after.materials, "twigs that leaves hid show"
    assert_valid(after, least_area=0.0)


@pytest.mark.parametrize("season", ["spring", "autumn"])
@pytest.mark.parametrize("name", [*BROADLEAVES, "oak"])
def test_as_many_leaves_are_left_as_the_table_says(name: str, season: str) -> None:
    before, foliage = tree(name), TREES[name].foliage
    after = mesh_in_season(before, changes(season), 1)
    assert leaves(after, foliage) / leaves(before, foliage) == pytest.approx(SEASONAL[foliage][season].kept, abs=0.02)


def test_leaves_have_the_colours_in_their_shares() -> None:
    after = mesh_in_season(tree("birch"), changes("autumn"), 1)
    shares = [part[0] for part in SEASONAL["leaf_birch"]["autumn"].colours]
    rows = [after.materials.index(variant("leaf_birch", k)) for k in range(len(shares))]
    found = np.array([(after.material == row).sum() for row in rows], np.float64)
    np.testing.assert_allclose(found / found.sum(), np.array(shares) / sum(shares), atol=0.05)


def test_leaves_of_winter_are_some_of_those_of_autumn() -> None:
    before = tree("oak", 4.0)  # young: it keeps dead leaves
    autumn, winter = (
        {corners.tobytes() for corners in mesh.vertices[mesh.faces[_leafy(mesh)]]}
        for mesh in (mesh_in_season(before, changes(season), 1) for season in ("autumn", "winter"))
    )
    assert 0 < len(winter) < len(autumn)
    assert winter < autumn


def _leafy(mesh: Mesh) -> np.ndarray[Any, Any]:
    return np.array(["leaf" in mesh.materials[row] for row in mesh.material])


def test_young_beeches_and_oaks_keep_dead_leaves_in_winter_but_old_ones_do_not() -> None:
    for name in ("beech", "oak"):
        young, old = (mesh_in_season(tree(name, height), changes("winter"), 1) for height in (4.0, 9.0))
        share = SEASONAL[TREES[name].foliage]["winter"].kept_young
        assert leaves(young, TREES[name].foliage) / leaves(tree(name, 4.0), TREES[name].foliage) == pytest.approx(
            share, abs=0.02
        )
        assert leaves(old, TREES[name].foliage) <= 0.03 * leaves(tree(name), TREES[name].foliage)


@pytest.mark.parametrize("season", ["spring", "autumn", "winter"])
@pytest.mark.parametrize("name", ["spruce", "pine"])
def test_conifers_stay_as_they_are(name: str, season: str) -> None:
    assert_same_bytes(tree(name), mesh_in_season(tree(name), changes(season), 1))


def test_herbs_wither_in_winter() -> None:
    fern = grow_tuft(GRASSES["fern"], name="fern", height=0.8, rng=np.random.default_rng(1))
    withered = mesh_in_season(fern, changes("winter"), 1)
    low = SEASONAL["frond_fern"]["winter"].low
    assert withered.vertices[:, 2].max() == pytest.approx(low * fern.vertices[:, 2].max(), rel=0.1)
    assert withered.vertices[:, 2].min() == fern.vertices[:, 2].min(), "roots stay in the soil"


def test_flowers_of_grey_willow_open_in_spring() -> None:
    bush = grow_bush(BUSHES["grey_willow"], name="b", height=2.0, rng=np.random.default_rng(1), detail=0.3)
    spring = mesh_in_season(bush, changes("spring"), 1)
    red, _, blue = max((part[1:] for part in SEASONAL["leaf_willow_grey"]["spring"].colours), key=lambda c: c[0])
    assert red > 4 * blue, "yellow catkins"
    assert variant("leaf_willow_grey", 2) in spring.materials


def test_summer_is_the_default_byte_for_byte() -> None:
    assert in_season(summer()) is summer()
    with without_textures():
        named = build_world("park", 3, {**SMALL, "season": "summer", "drought": 0.5, "snow_depth": 0.0})
    assert digest(replace(named, layout={})) == digest(replace(summer(), layout={}))


@pytest.mark.parametrize("season", [pytest.param("spring", marks=pytest.mark.slow), "autumn", "winter"])
def test_a_season_is_deterministic_and_keeps_ground_objects_and_names(season: str) -> None:
    before, after = summer(), changed(season)
    assert digest(after) == digest(in_season(before, season))
    assert digest(after) != digest(before)
    assert after.terrain.field is before.terrain.field
    assert after.terrain.layer is before.terrain.layer
    assert [i.name for i in after.instances] == [i.name for i in before.instances]
    assert after.object_names[: len(before.object_names)] == before.object_names
    assert [s.object_id for s in after.swarms] == [after.object_names.index(s.name) for s in after.swarms]
    assert {n for mesh in after.meshes.values() for n in mesh.materials} <= set(after.materials)


def test_colours_alone_change_neither_images_of_labels_nor_clouds() -> None:
    """Spring without its thinning, and grass after a drought: same triangles, so the same labels, ids and depths."""
    tints = {
        name: replace(change, kept=1.0, kept_young=None, low=1.0, translucency=None)
        for name, change in changes("spring").items()
    }
    worlds = [summer(), recoloured(summer(), tints), changed("summer", 1.0)]
    images = [_label_image(world) for world in worlds]
    tint = [world.materials["lawn"].tint for world in worlds]
    assert len(set(tint)) == 3
    for other in images[1:]:
        assert other == images[0]


def _label_image(world: World) -> bytes:
    camera = LabelCamera(
        ft.Rig().enabled(ft.CameraConfig)[0].model_copy(update={"width": 160, "height": 96}), Scene(world)
    )
    pose = np.eye(4)
    pose[2, 3] = float(world.terrain.surface.height_at(0.0, 0.0)) + 0.6
    image = camera.label(pose @ ft.OPTICAL)
    return b"".join(np.asarray(part).tobytes() for part in (image.label, image.instance, image.depth))


def test_dry_grass_is_redder_and_brighter_than_lush_grass() -> None:
    def colour(drought: float) -> tuple[float, ...]:
        return changed("summer", drought).materials["lawn"].tint

    lush, usual, dry = colour(0.0), MATERIALS["lawn"].tint, colour(1.0)
    assert lush[0] < usual[0] < dry[0]
    assert dry[0] / dry[1] > usual[0] / usual[1] > lush[0] / lush[1]
    half = np.mean([usual, dry], axis=0)
    np.testing.assert_allclose(colour(0.75), half, rtol=1e-6)


def test_fallen_leaves_have_the_class_of_the_ground_below_them() -> None:
    world = changed("autumn")
    swarm = next(s for s in world.swarms if s.kind == "fallen_leaves")
    classes = set()
    for name in swarm.meshes:
        mesh = world.meshes[name]
        middle = mesh.vertices.reshape(-1, 4, 3)[:, [0, 2]].mean(axis=1).astype(np.float64)
        own = np.array([world.materials[n].label for n in mesh.materials])[mesh.material[::2]]
        near_edge = np.abs(world.terrain.trail_distance.at(middle[:, 0], middle[:, 1])) < 0.001
        below = world.terrain.label_at(middle[:, 0], middle[:, 1])
        assert ((own == below) | near_edge).all()
        classes |= set(own.tolist())
        above = middle[:, 2] - world.terrain.surface.height_at(middle[:, 0], middle[:, 1])
        assert np.abs(above).max() < 0.06
    assert classes == {Label.GROUND, Label.TRAIL}


def test_leaves_in_the_cover_keep_the_kinds_of_ground_that_wheels_feel() -> None:
    def kinds(world: World) -> dict[str, np.ndarray[Any, Any]]:
        found: dict[str, Any] = {}
        for name, weight in zip(
            world.terrain.ground_materials, np.moveaxis(world.terrain.cover.values, -1, 0), strict=True
        ):
            kind = world.materials[name].ground_type
            found[kind] = found.get(kind, 0) + weight.astype(np.float64)
        return found

    before, after = kinds(summer()), kinds(changed("autumn"))
    assert before.keys() == after.keys()
    for kind, weight in before.items():
        np.testing.assert_allclose(after[kind], weight, atol=1e-6)


@pytest.mark.parametrize("environment", sorted(ENVIRONMENTS))
def test_an_unknown_season_is_refused_in_one_line(environment: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        check_layout(environment, {"season": "fall"})
    assert str(error.value).count("\n") == 0
    assert all(name in str(error.value) for name in ("layout", "season", "'fall'", *seasons()))
    nan = float("nan")
    for values in ({"drought": 1.5}, {"snow_depth": 0.5}, {"snow_depth": nan}, {"season": 3}, {"litter": -1}):
        with pytest.raises(ConfigurationError, match=next(iter(values))):
            check_layout(environment, values)
    for season in seasons():
        check_layout(environment, {"season": season, "snow_depth": 0.1, "drought": 0})


def test_a_campaign_draws_seasons() -> None:
    layouts = {"park": {"season": {"choice": list(seasons())}, "drought": {"uniform": [0, 1]}}}
    campaign = Campaign.model_validate(
        {"name": "c", "runs": 60, "environments": ["park"], "seeds": {"integers": [0, 40]}, "layouts": layouts}
    )
    drawn = {str(run.experiment.layout["season"]) for run in draw(campaign)}
    assert drawn == set(seasons())


def _slopes(angle_deg: float) -> World:
    """A plane that rises along x, with a table on it if it is level."""
    x = 0.1 * np.arange(121)
    heights = np.tile(np.tan(np.radians(angle_deg)) * x[:, None], (1, 121)).astype(np.float32)
    ground = Heightfield(heights=heights, spacing=0.1, x0=-6.0, y0=-6.0)
    flat = Raster(values=np.full((13, 13), 1000.0, np.float32), spacing=1.0, x0=-6.0, y0=-6.0)
    terrain = Terrain(
        field=ground, trail_distance=flat, cover=replace(flat, values=np.ones((13, 13, 1), np.float32)),
        ground_materials=("lawn",), trail_material="gravel", border_material="gravel",
    )  # fmt: skip
    return World(
        name="slope", seed=5, size=(12.0, 12.0), terrain=terrain, meshes={}, instances=(),
        materials={name: MATERIALS[name] for name in ("lawn", "gravel")}, textures={},
    )  # fmt: skip


@pytest.mark.parametrize("depth", [0.02, 0.1, 0.3])
def test_level_open_ground_has_the_stated_depth_of_snow(depth: float) -> None:
    world = snowed_in(_slopes(0.0), depth)
    snow = world.terrain.snow
    assert snow is not None
    assert snow.mean() == pytest.approx(depth, rel=0.15)
    assert 0.05 < snow.std() / depth < 0.4, "drifts"
    risen = world.terrain.surface.heights - world.terrain.field.heights
    np.testing.assert_allclose(risen, snow, atol=1e-6)


@pytest.mark.parametrize(("angle", "share"), [(HOLDS - 1, 1.0), ((HOLDS + SLIDES) / 2, 0.5), (SLIDES + 1, 0.0)])
def test_snow_slides_off_steep_ground(angle: float, share: float) -> None:
    snow = snowed_in(_slopes(angle), 0.1).terrain.snow
    level = snowed_in(_slopes(0.0), 0.1).terrain.snow
    assert snow is not None
    assert level is not None
    inner = np.s_[10:-10, 10:-10]
    assert snow[inner].mean() == pytest.approx(share * level[inner].mean(), abs=0.003)


def test_snow_beside_a_lake_takes_no_memory_for_its_surface() -> None:
    corners = np.array([(x, y, -1.0) for x in (-300.0, 300.0) for y in (-300.0, 300.0)])
    sheet = make_mesh("lake", corners, np.tile((0, 0, 1), (4, 1)), corners[:, :2], [[0, 2, 3], [0, 3, 1]], ("lawn",))
    water = Instance(name="lake_1", kind="water", mesh="lake", object_id=2, world_from_object=np.eye(4))
    plane = _slopes(0.0)
    tracemalloc.start()
    world = snowed_in(replace(plane, meshes={"lake": sheet}, instances=(water,)), 0.1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e8
    np.testing.assert_array_equal(world.terrain.snow, snowed_in(plane, 0.1).terrain.snow)


def test_no_snow_lies_below_a_table() -> None:
    world = snowed_in(summer(), 0.1)
    assert world.terrain.snow is not None
    field = world.terrain.field
    snow = Raster(values=world.terrain.snow, spacing=field.spacing, x0=field.x0, y0=field.y0)
    table = next(i for i in world.instances if i.kind == "table")
    x, y = table.world_from_object[:2, 3]
    assert snow.at(x, y) < 0.01
    assert np.median(world.terrain.snow) > 0.07


def test_snow_hides_the_fallen_leaves_below_it() -> None:
    before = changed("autumn")
    after = snowed_in(before, 0.1)
    names = next(s for s in before.swarms if s.kind == "fallen_leaves").meshes
    seen, all_leaves = (sum(len(world.meshes[name].faces) for name in names) for world in (after, before))
    assert 0 < seen < 0.2 * all_leaves


def test_snow_changes_no_label_but_by_its_height_and_is_stored(tmp_path: Path) -> None:
    world = snowed_in(summer(), 0.1)
    assert all(world.meshes[name] is mesh for name, mesh in summer().meshes.items())
    assert world.terrain.field is summer().terrain.field, "wheels feel the soil"
    assert world.terrain.trail_distance is summer().terrain.trail_distance
    save_world(tmp_path / "world.npz", world)
    stored = read_world(tmp_path / "world.npz").terrain
    assert stored.snow is not None
    assert stored.snow.tobytes() == world.terrain.snow.tobytes()  # type: ignore[union-attr]
    assert stored.surface.heights.tobytes() == world.terrain.surface.heights.tobytes()
