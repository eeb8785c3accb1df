# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is above each cell of a map, against closed forms and against the second tracer."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import BOX_CORNERS, BOX_FACES, Placed, at, box, make_mesh, make_world, quad
from small_park import small_park

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.kernels.columns import FLEXIBLE, FOOT_HEIGHT, PASSABLE, SOLID
from fieldtruth.local_maps.rays import wrong_heights
from fieldtruth.world.build import load_world
from fieldtruth.world.model import Material, Mesh, Raster, Swarm, World
from fieldtruth.world.plants.growth import Stems, tubes
from fieldtruth.world_maps import grid_of
from fieldtruth.world_maps.bodies import faces_of
from fieldtruth.world_maps.layers import Grid, Layers, WorldColumns, names_of

CELL: Final = 0.05
Cell = tuple[int, int]
F8 = NDArray[np.float64]


def columns(world: World, resolution: float = CELL, area: Sequence[float] | None = None) -> tuple[Grid, Layers]:
    grid = grid_of(world, resolution, area)
    return grid, WorldColumns(world, grid).tile(slice(0, grid.shape[0]), slice(0, grid.shape[1]))


def cell(grid: Grid, x: float, y: float) -> Cell:
    return int((x - grid.x0) / grid.resolution), int((y - grid.y0) / grid.resolution)


def cells_of(values: NDArray[np.generic]) -> set[Cell]:
    return {(int(i), int(j)) for i, j in zip(*np.nonzero(values), strict=True)}


def test_a_plane_has_its_height_in_the_middle_of_each_cell_and_nothing_above() -> None:
    grid, made = columns(make_world(height=lambda x, y: 0.25 * x - 0.5 * y + 3.0, side=4.0))
    assert grid.shape == (80, 80)
    x, y = grid.middles(slice(0, 80), slice(0, 80))
    np.testing.assert_allclose(x[[0, -1]], [-1.975, 1.975])
    plane = 0.25 * x[:, None] - 0.5 * y + 3.0
    np.testing.assert_allclose(made["ground"], plane, atol=1e-6)
    np.testing.assert_allclose(made["hard_ground"], plane, atol=1e-6)
    assert (made["ground_class"] == Label.GROUND).all()
    assert (made["hard_ground_instance"] == 1).all()
    for name in ("overhang", "plant_top"):
        assert np.isnan(made[name]).all()
        assert not made[f"{name}_class"].any()
        assert not made[f"{name}_instance"].any()
    for name in ("solid_volume", "flexible_volume", "passable_volume", "obstacle", "water_depth", "ground_cover"):
        assert not made[name].any(), name


def test_a_stone_is_hard_ground_and_a_solid_body_of_its_volume() -> None:
    stone = box("stone", (0.1, 0.15, 0.1)), at(0.5, -0.25, 0.05)  # z from -0.05 to 0.15
    grid, made = columns(make_world([stone], side=4.0))
    own = {(i, j) for i in range(48, 52) for j in range(32, 38)}
    assert cells_of(made["hard_ground"] > 0) == own == cells_of(made["hard_ground_instance"] == 2)
    assert made["hard_ground"][50, 35] == pytest.approx(0.15)
    assert made["hard_ground_class"][50, 35] == Label.ROCK
    assert made["soil"][50, 35] == made["soil"].max() != made["soil"][0, 0]
    assert made["solid_volume"].sum() == pytest.approx(0.2 * 0.3 * 0.15)
    assert made["solid_volume"][50, 35] == pytest.approx(0.15 * CELL**2)
    assert own <= cells_of(made["obstacle"])  # its edges run between cells
    assert np.isnan(made["overhang"]).all()
    assert cell(grid, 0.5001, -0.2501) == (50, 34)


def test_a_bridge_is_an_overhang_and_its_deck_the_ground_where_it_is_of_that_class() -> None:
    deck = (1.0, 0.5, 0.1)
    for material, label in (("wood", Label.BENCH), ("gravel", Label.TRAIL)):
        _, made = columns(make_world([(box("deck", deck, material), at(0.0, 0.0, 1.1))], side=4.0))
        under = {(i, j) for i in range(20, 60) for j in range(30, 50)}
        assert made["ground"][40, 40] == 0.0
        assert made["solid_volume"].sum() == pytest.approx(2.0 * 1.0 * 0.2)
        if label == Label.BENCH:
            assert cells_of(~np.isnan(made["overhang"])) == under
            assert made["overhang"][40, 40] == pytest.approx(1.0)
            assert (made["overhang_class"][40, 40], made["overhang_instance"][40, 40]) == (label, 2)
            assert made["hard_ground"][40, 40] == 0.0
        else:
            assert np.isnan(made["overhang"]).all()
            assert cells_of(made["hard_ground"] > 1.0) == under
            assert made["hard_ground"][40, 40] == pytest.approx(1.2)
            assert made["hard_ground_class"][40, 40] == label


def test_inside_a_wall_the_overhang_begins_at_the_ground_and_a_thin_wall_is_an_obstacle() -> None:
    wall, thin = box("wall", (0.1, 1.0, 1.5), "wood"), box("thin", (0.001, 1.0, 1.5), "wood")
    _, made = columns(make_world([(wall, at(0.0, 0.0, 1.0)), (thin, at(1.012, 0.0, 1.0))], side=4.0))
    inside = {(i, j) for i in range(38, 42) for j in range(20, 60)}
    assert cells_of(made["overhang"] == 0.0) == inside
    assert (made["overhang_class"][40, 40], made["overhang_instance"][40, 40]) == (Label.BENCH, 2)
    assert made["solid_volume"].sum() == pytest.approx(0.2 * 2.0 * 2.0)  # up to 2 m
    assert {(60, j) for j in range(20, 60)} <= cells_of(made["obstacle"])
    rows = {i for i, _ in cells_of(made["obstacle"])}
    assert {38, 39, 40, 41, 60} <= rows <= {37, 38, 39, 40, 41, 42, 60}  # its sides run between cells


def test_pebbles_and_high_branches_are_no_obstacles() -> None:
    pebble, high = box("pebble", (0.2, 0.2, 0.05)), box("high", (0.2, 0.2, 0.05), "bark")
    _, made = columns(make_world([(pebble, at(0.0, 0.0, 0.03)), (high, at(1.0, 1.0, 2.2))], side=4.0))
    assert not made["obstacle"].any()
    assert made["plant_top"][60, 60] == pytest.approx(2.25)
    assert made["overhang"][60, 60] == pytest.approx(2.15)
    assert made["solid_volume"][60, 60] == 0.0


def stem(radius: float, length: float, height: float, material: str = "bark", *, lean: float = 0.0) -> Mesh:
    """A round stem along x, or leaning up by an angle [rad], open at its base as those of trees are."""
    path = np.linspace([0.0, 0.0, height], [length * np.cos(lean), 0.0, height + length * np.sin(lean)], 3)
    bar = Stems.alone(path[None], np.full((1, 3), radius), np.array([length]))
    vertices, _, _, faces = tubes(bar, 24)
    return make_mesh(f"stem_{radius}", vertices, faces, material)


def test_stems_are_closed_where_they_sprout_and_bend_if_they_are_thin() -> None:
    for radius, kind, name in ((0.03, SOLID, "solid_volume"), (0.005, FLEXIBLE, "flexible_volume")):
        mesh = stem(radius, 1.0, 0.4, lean=0.7)
        world = make_world([(mesh, np.eye(4))], side=4.0)
        flags = faces_of(world).flags
        assert (flags & kind).all()
        _, made = columns(world, radius / 8, [-0.1, -0.1, 1.0, 0.1])
        cone = 24 / 2 * np.sin(2 * np.pi / 24) * radius**2  # polygon of 24 corners; half of the stem ends in a point
        assert made[name].sum() == pytest.approx(cone * (0.5 + 0.5 / 3), rel=0.02)
        others = {"solid_volume", "flexible_volume", "passable_volume"} - {name}
        assert not any(made[each].any() for each in others)
        below = made["overhang"][~np.isnan(made["overhang"])]
        assert below.min() > 0.4 - 2 * radius  # no column from an opening down to the ground


def test_leaves_are_passable_and_counted_by_layers() -> None:
    leaf = quad("leaf", [(-0.2, -0.2, 0.0), (0.2, -0.2, 0.0), (0.2, 0.2, 0.0), (-0.2, 0.2, 0.0)], "leaf")
    heights = (0.31, 0.33, 0.52, 2.4)
    world = make_world([(leaf, at(0.0, 0.0, z)) for z in heights], side=4.0)
    assert (faces_of(world).flags & PASSABLE).all()
    _, made = columns(world)
    own = {(i, j) for i in range(36, 44) for j in range(36, 44)}
    assert cells_of(made["passable_volume"]) == own
    assert made["passable_volume"][40, 40] == pytest.approx(2 * 0.05 * CELL**2)
    assert made["plant_top"][40, 40] == pytest.approx(2.4)
    assert (made["plant_top_class"][40, 40], made["plant_top_instance"][40, 40]) == (Label.TREETOP, 5)
    assert np.isnan(made["overhang"]).all()
    assert not made["obstacle"].any()


def test_a_root_is_ground_up_to_the_axle_of_a_wheel() -> None:
    low, high = box("low", (0.2, 0.2, 0.05), "bark"), box("high", (0.2, 0.2, 0.3), "bark")
    _, made = columns(make_world([(low, at(0.0, 0.0, 0.1)), (high, at(1.0, 0.0, 0.2))], side=4.0))
    assert FOOT_HEIGHT > made["hard_ground"][40, 40] == pytest.approx(0.15)
    assert made["hard_ground_class"][40, 40] == Label.TRUNK
    assert made["hard_ground"][60, 40] == 0.0
    assert made["overhang"][60, 40] == 0.0


def test_water_and_cover_lie_on_the_bare_ground() -> None:
    world = make_world(height=lambda x, y: np.where(x < 0, -0.5, 0.5) + 0 * y, side=4.0)
    layer = np.full(world.terrain.field.heights.shape, 0.03, np.float32)
    world = replace(world, water_level=-0.2, terrain=replace(world.terrain, layer=layer))
    _, made = columns(world)
    assert made["water_depth"][10, 10] == pytest.approx(0.3)
    assert made["water_depth"][70, 10] == 0.0
    np.testing.assert_allclose(made["ground_cover"], 0.03, atol=1e-6)
    assert made["ground"][10, 10] == pytest.approx(-0.5)


def test_surface_and_soil_are_those_of_the_trail_its_border_and_the_cover() -> None:
    side = 4.0
    edge = Raster(values=np.array([[-2.0, -2.0], [2.0, 2.0]], np.float32), spacing=side, x0=-side / 2, y0=-side / 2)
    world = make_world(side=side, trail=edge)  # trail where x < 0
    cover = np.zeros((2, 2, 2), np.float32)
    cover[:, 0, 0], cover[:, 1, 1] = 1.0, 1.0  # soil for y < 0, clay for y > 0
    materials = {
        **world.materials,
        "soil": Material(name="soil", label=Label.GROUND, texture="grey", ground_type="lawn"),
        "clay": Material(name="clay", label=Label.GROUND, texture="grey", ground_type="mud"),
    }
    terrain = replace(
        world.terrain,
        cover=Raster(values=cover, spacing=side, x0=-side / 2, y0=-side / 2),
        ground_materials=("soil", "clay"), border_material="stone", border_width=0.5,
    )  # fmt: skip
    world = replace(world, terrain=terrain, materials=materials)
    grid, made = columns(world, 0.1)
    names = names_of(world)
    for x, y, surface, soil in (
        (-1.0, 1.0, "gravel", "trodden_earth"),
        (-0.2, 1.0, "stone", "trodden_earth"),
        (1.0, -1.0, "soil", "lawn"),
        (1.0, 1.0, "clay", "mud"),
    ):
        row = cell(grid, x + 0.01, y + 0.01)
        assert (names["surfaces"][made["surface"][row]], names["soils"][made["soil"][row]]) == (surface, soil)
        assert made["ground_class"][row] == (Label.TRAIL if x < 0 else Label.GROUND)


def test_members_of_swarms_have_its_instance_and_loose_ones_are_left_out() -> None:
    stone = box("stone", (0.1, 0.1, 0.1))
    for kind, found in (("stones", 2), ("litter", 0)):
        world = make_world(side=4.0)
        swarm = Swarm(
            name="stones", kind=kind, object_id=9, meshes=("stone",), mesh=np.zeros(2, np.int32),
            world_from_object=np.stack([at(-1.0, 0.0, 0.0), at(1.0, 0.0, 0.0)]), tint=np.ones((2, 3), np.float32),
        )  # fmt: skip
        _, made = columns(replace(world, meshes={"stone": stone}, swarms=(swarm,)))
        assert len(cells_of(made["hard_ground_instance"] == 9)) == found * 16


def test_tiles_are_parts_of_the_whole() -> None:
    rng = np.random.default_rng(5)
    placed: list[Placed] = []
    for k in range(40):
        pose = transforms.pose(rng.uniform([-2, -2, 0.0], [2, 2, 1.5]).tolist(), rng.uniform(0, 360, 3).tolist())
        material = ("stone", "bark", "leaf", "wood")[k % 4]
        placed.append((make_mesh(f"m{k}", BOX_CORNERS * rng.uniform(0.02, 0.4, 3), BOX_FACES, material), pose))
    grid = grid_of(world := make_world(placed, side=4.0), CELL)
    made = WorldColumns(world, grid)
    whole = made.tile(slice(0, 80), slice(0, 80))
    for rows, cols in ((slice(0, 33), slice(0, 47)), (slice(33, 80), slice(47, 80))):
        for name, values in made.tile(rows, cols).items():
            np.testing.assert_array_equal(values, whole[name][rows, cols], name)
    assert len(set(whole["overhang_instance"].ravel().tolist())) > 10


def compare(world: World, grid: Grid, made: Layers, count: int, seed: int) -> dict[str, tuple[int, int, int]]:
    """Heights of cells against rays: numbers of rays, of those that hit, and of those that differ by more than 1 mm."""
    rng = np.random.default_rng(seed)
    cells = np.stack(np.unravel_index(rng.choice(made["ground"].size, count, replace=False), made["ground"].shape), 1)
    return {
        name: (count, int(np.isfinite(rays.height).sum()), int(wrong.sum()))
        for name, (rays, wrong) in wrong_heights(world, grid, made, cells).items()
    }


def test_heights_of_a_park_are_those_of_rays_of_the_second_tracer() -> None:
    world = small_park()
    grid, made = columns(world)
    result = compare(world, grid, made, 1500, 1)
    assert {name: wrong for name, (_, _, wrong) in result.items()} == dict.fromkeys(result, 0)
    assert result["plant_top"][1] > 100
    assert result["overhang"][1] > 15
    made["ground"][:, ::2] += 0.002
    assert compare(world, grid, made, 200, 1)["ground"][2] > 80


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["forest", "hillside"])
def test_heights_of_a_world_are_those_of_100_000_rays(environment: str) -> None:
    """Rays for each of four layers, in 25,000 cells: 5000 in every second part of 20 m by 25 m, as on a chessboard."""
    world = load_world(environment)
    total: Counter[str] = Counter()
    for k, x in enumerate(range(-50, 50, 20)):
        y = -25 if k % 2 else 0
        grid, made = columns(world, CELL, [x, y, x + 20, y + 25])
        for name, figures in compare(world, grid, made, 5000, k).items():
            total.update({f"{name} {key}": n for key, n in zip(("rays", "hits", "wrong"), figures, strict=True)})
    print(environment, dict(total))
    assert total["ground rays"] == total["ground hits"] == 25_000
    assert not any(total[name] for name in total if name.endswith("wrong"))
