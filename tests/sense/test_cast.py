# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""``Scene.cast`` and ``Scene.occluded`` against closed forms: ground, boxes, swarms, water, wires, and bad input."""

from dataclasses import replace

import numpy as np
import pytest
from sense_worlds import at, box, floating, make_mesh, make_world, quad

import fieldtruth as ft
from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import BLOCK, Scene, cast_rays
from fieldtruth.world.model import Raster, Swarm

HALF = np.array([6.0, 5.0, 4.0])
ROOM = floating((box("room", HALF.tolist()), at(0, 0, 0)))


def make_lake() -> Scene:
    surface = quad("lake", [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], "water")
    world = make_world([(surface, at(0, 0, 0))], height=-900.0)
    water = replace(world.materials["water"], mirror=0.02)
    return Scene(replace(world, materials={**world.materials, "water": water}))


LAKE = make_lake()


def unit(count: int, seed: int = 0) -> Array:
    ahead = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(ahead / np.linalg.norm(ahead, axis=1, keepdims=True))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_random_rays_meet_the_walls_of_a_room(dtype: type) -> None:
    count = 2 * BLOCK + 5  # threads, and a packet that is not full
    ahead: Array
    length: Array
    start: Array
    start = np.random.default_rng(1).uniform(-0.9 * HALF, 0.9 * HALF, (count, 3)).astype(dtype)
    ahead = unit(count).astype(dtype)
    per_axis = (np.sign(ahead) * HALF - start) / ahead
    axis = np.argmin(per_axis, axis=1)
    expected = per_axis[np.arange(count), axis]
    length = np.exp(np.random.default_rng(2).uniform(-9, 9, (count, 1))).astype(dtype)
    found = ROOM.cast(start, ahead * length, workers=2)
    np.testing.assert_allclose(found.range_m, expected, atol=1e-5)
    assert found.position.dtype == dtype
    np.testing.assert_allclose(found.position, start + expected[:, None] * ahead, atol=2e-5)
    inwards = np.zeros((count, 3))
    inwards[np.arange(count), axis] = -np.sign(ahead[np.arange(count), axis])
    np.testing.assert_allclose(found.normal, inwards, atol=1e-6)
    assert set(found.label) == {int(Label.ROCK)}
    assert set(found.instance) == {2}
    assert {ROOM.materials[row] for row in np.unique(found.material)} == {"stone"}


def test_a_normal_is_on_the_side_of_the_ray() -> None:
    outside = ROOM.cast([[20.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    np.testing.assert_allclose(outside.normal, [[1, 0, 0], [-1, 0, 0]], atol=1e-6)


def test_tilted_ground_has_its_plane_trail_border_and_cover() -> None:
    slope = np.array([0.3, -0.2])
    trail = Raster(values=np.array([[-5.0, -5.0], [35.0, 35.0]], np.float32), spacing=40.0, x0=-20.0, y0=-20.0)
    world = make_world(height=lambda x, y: slope[0] * x + slope[1] * y, trail=trail)  # the trail ends at x = -15
    cover = Raster(values=np.array([[[1, 0]] * 2, [[0, 1]] * 2], np.float32), spacing=40.0, x0=-20.0, y0=-20.0)
    materials = {**world.materials, "edge": replace(world.materials["gravel"], name="edge")}
    terrain = replace(
        world.terrain, cover=cover, ground_materials=("soil", "bark"), border_material="edge", border_width=2.0
    )
    scene = Scene(replace(world, terrain=terrain, materials=materials))
    x = np.array([-19.0, -16.0, -14.0, -1.0, 1.0, 15.0])
    start = np.stack([x, np.full(6, 3.0), np.full(6, 20.0)], axis=1)
    found = scene.cast(start, (0.0, 0.0, -2.0))
    np.testing.assert_allclose(found.range_m, 20.0 - slope[0] * x - slope[1] * 3.0, atol=1e-5)
    normal = np.array([-slope[0], -slope[1], 1.0])
    np.testing.assert_allclose(found.normal, np.tile(normal / np.linalg.norm(normal), (6, 1)), atol=1e-5)
    assert [scene.materials[row] for row in found.material] == ["gravel", "edge", "soil", "soil", "bark", "bark"]
    assert found.label.tolist() == [Label.TRAIL] * 2 + [Label.GROUND] * 4
    assert set(found.instance) == {1}


def test_a_turned_and_scaled_swarm_has_its_planes() -> None:
    roof = make_mesh(
        "roof", [[-1, -1, 0], [1, -1, 0], [0, 0, 1], [-1, 1, 0], [1, 1, 0]], [[0, 1, 2], [3, 2, 4]], "leaf"
    )
    turn = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    turn[:3, :3] *= 3.0
    swarm = Swarm(
        name="roofs", kind="roof", object_id=7, meshes=("roof",), mesh=np.zeros(1, np.int32),
        world_from_object=turn[None], tint=np.ones((1, 3), np.float32),
    )  # fmt: skip
    world = replace(make_world(height=-900.0), meshes={"roof": roof}, swarms=(swarm,))
    scene = Scene(world)
    found = scene.cast([5.0 + 1.5, 1.0, 9.0], (0.0, 0.0, -1.0))  # object's y = -0.5: halfway up
    assert found.range_m == pytest.approx([9.0 - 1.5], abs=1e-5)
    np.testing.assert_allclose(found.normal, [[0.5**0.5, 0.0, 0.5**0.5]], atol=1e-6)
    assert (found.label.tolist(), found.instance.tolist()) == ([Label.TREETOP], [7])
    assert scene.materials[found.material[0]] == "leaf"


def test_water_is_hit_unless_rays_go_through_it() -> None:
    down = (0.0, 0.0, 2.0), (0.0, 0.0, -1.0)
    found = LAKE.cast(*down)
    assert (found.range_m.tolist(), found.label.tolist()) == ([2.0], [Label.WATER])
    assert LAKE.materials[found.material[0]] == "water"
    np.testing.assert_allclose(found.normal, [[0, 0, 1]])
    assert LAKE.cast(*down, water=False).range_m == pytest.approx([902.0])
    assert LAKE.occluded(*down, 10.0).tolist() == [True]
    assert LAKE.occluded(*down, 10.0, water=False).tolist() == [False]


def test_a_wire_is_hit() -> None:
    wire = replace(
        box("wire", (5.0, 0.01, 0.01), "bark"), axis=np.array([[-5, 0, 0, 0.01], [5, 0, 0, 0.01]], np.float32)
    )
    scene = floating((wire, at(0, 0, 7)))
    found = scene.cast((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert found.range_m == pytest.approx([6.99], abs=1e-5)
    np.testing.assert_allclose(found.normal, [[0, 0, -1]])
    assert scene.materials[found.material[0]] == "bark"


def test_a_miss_has_no_values() -> None:
    found = ROOM.cast((0.0, 0.0, 50.0), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], max_range=40.0)
    assert np.isinf(found.range_m).all()
    assert np.isnan(found.position).all()
    assert not found.normal.any()
    assert found.material.tolist() == [-1, -1]
    assert not found.label.any()
    assert not found.instance.any()


def test_limits_of_range_are_metres() -> None:
    along = (0.0, 0.0, 0.0), (0.0, 0.0, 0.001)
    assert ROOM.cast(*along, 4.1).range_m == pytest.approx([4.0])
    assert np.isinf(ROOM.cast(*along, 3.9).range_m).all()
    assert np.isinf(ROOM.cast(*along, 900.0, min_range=4.1).range_m).all()


def test_targets_are_seen_unless_something_is_before_them() -> None:
    wall = floating((box("wall", (0.1, 3.0, 3.0)), at(5, 0, 0)))
    targets = np.array([[4.9, 0, 0], [5.1, 0, 0], [9.0, 0, 0], [9.0, 20.0, 0], [0.0, 0.0, 0.0]])
    assert wall.occluded((0.0, 0.0, 0.0), targets=targets).tolist() == [False, True, True, False, False]
    starts = targets[:3]
    assert wall.occluded(starts, targets=(0.0, 0.0, 0.0), min_range=0.01).tolist() == [False, True, True]


def test_occlusion_agrees_with_casting() -> None:
    start, ahead = np.random.default_rng(3).uniform(-9, 9, (5000, 3)), unit(5000)
    found = ROOM.cast(start, ahead, 9.0)
    hidden = ROOM.occluded(start, ahead, 9.0)
    assert 1000 < hidden.sum() < 4000
    assert np.array_equal(hidden, np.isfinite(found.range_m))


def test_a_scene_needs_a_world() -> None:
    with pytest.raises(ft.FieldtruthError, match=r"^world must be a World, got 'park'; see load_world$"):
        Scene("park")  # type: ignore[arg-type]


def test_no_rays_have_no_hits() -> None:
    assert len(ROOM.cast(np.zeros((0, 3)), np.zeros((0, 3))).range_m) == 0
    assert len(ROOM.occluded((0.0, 0.0, 0.0), targets=np.zeros((0, 3)))) == 0


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf])
def test_a_bad_direction_is_named(bad: float) -> None:
    ahead = np.ones((BLOCK + 50, 3))
    ahead[BLOCK + 7] = bad
    text = rf"^directions must be finite and longer than 0; row {BLOCK + 7} is \[{bad}, {bad}, {bad}\]$"
    with pytest.raises(ValueError, match=text):
        ROOM.cast((0.0, 0.0, 0.0), ahead)
    with pytest.raises(ValueError, match=text):
        ROOM.occluded((0.0, 0.0, 0.0), ahead)


@pytest.mark.parametrize(
    ("origins", "directions", "text"),
    [
        ((np.nan, 0, 0), (1, 0, 0), r"origins must be finite, got \[nan, 0.0, 0.0\]"),
        ((1e300, 0, 0), (1, 0, 0), r"origins must be finite, got \[1e\+300, 0.0, 0.0\]"),
        ((0, 0), (1, 0, 0), r"origins must have the shape \(n, 3\) or \(3,\), got \(2,\)"),
        ((0, 0, 0), np.ones((2, 2, 3)), r"directions must have the shape \(n, 3\) or \(3,\), got \(2, 2, 3\)"),
        (np.zeros((2, 3)), np.ones((3, 3)), "origins and directions must be equally many, got 2 and 3"),
    ],
)
def test_bad_rays_are_refused(origins: Array, directions: Array, text: str) -> None:
    with pytest.raises(ValueError, match=f"^{text}$"):
        ROOM.cast(origins, directions)


def test_bad_limits_and_questions_are_refused() -> None:
    with pytest.raises(ValueError, match=r"^min_range must be at least 0 and at most max_range, got 3\.0 and 2\.0$"):
        ROOM.cast((0, 0, 0), (1, 0, 0), 2.0, min_range=3.0)
    with pytest.raises(ValueError, match=r"^occluded needs directions or targets, one of the two$"):
        ROOM.occluded((0, 0, 0))
    with pytest.raises(ValueError, match=r"^targets must be finite, got \[nan, 0.0, 0.0\]$"):
        ROOM.occluded((0, 0, 0), targets=(np.nan, 0, 0))


def test_extreme_lengths_change_nothing() -> None:
    found = ROOM.cast((0.0, 0.0, 0.0), [[1e-300, 0, 0], [0, 1e300, 0], [1e-200, 1e-200, 0]])
    np.testing.assert_allclose(found.range_m, [6.0, 5.0, 5.0 * 2**0.5], rtol=1e-6)


def test_the_former_function_warns() -> None:
    with pytest.warns(DeprecationWarning, match=r"scene\.cast"):
        found = cast_rays(ROOM, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    assert found.range_m == pytest.approx([6.0])
