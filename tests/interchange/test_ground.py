# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The cut ground: areas, classes and heights in closed form, and against the real worlds' own terrain."""

from dataclasses import replace

import numpy as np
import pytest
from interchange_worlds import F8, RADIUS, SIDE, WIDTH, across, corners_of, hills, ring_trail, small_world

from fieldtruth.core.classes import Label
from fieldtruth.interchange.ground import GroundTile, ground_tiles
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World

GRIDS = {"as in the park": (0.1, -10.0), "as fine as the terrain": (0.2, -10.0), "oblique": (0.13, -10.37)}


def ring_world(grid: str = "as in the park") -> World:
    world = small_world()
    return replace(world, terrain=replace(world.terrain, trail_distance=ring_trail(*GRIDS[grid])))


def areas_from_above(corners: F8) -> F8:
    return np.asarray(across(corners)[:, 2] / 2)


def triangles(tiles: list[GroundTile], label: Label) -> F8:
    return np.concatenate([corners_of(s) for tile in tiles for s in tile.surfaces if s.label == label])


@pytest.mark.parametrize("grid", GRIDS)
def test_areas_are_those_of_the_ring_and_of_the_rest(grid: str) -> None:
    tiles = list(ground_tiles(ring_world(grid), 5.0))
    assert len(tiles) == 16
    trail = areas_from_above(triangles(tiles, Label.TRAIL)).sum()
    ground = areas_from_above(triangles(tiles, Label.GROUND)).sum()
    assert trail == pytest.approx(2 * np.pi * RADIUS * WIDTH, rel=1e-3)
    assert trail + ground == pytest.approx(SIDE**2, rel=1e-7)


@pytest.mark.parametrize("grid", GRIDS)
def test_every_triangle_has_the_class_of_the_terrain_below_its_middle(grid: str) -> None:
    world = ring_world(grid)
    for tile in ground_tiles(world, 5.0):
        for surface in tile.surfaces:
            middle = corners_of(surface).mean(axis=1)
            wrong = world.terrain.label_at(middle[:, 0], middle[:, 1]) != surface.label
            assert np.abs(world.terrain.trail_distance.at(*middle[wrong, :2].T)).max(initial=0.0) < 2e-3
            assert wrong.mean() < 5e-3  # the middles of slivers


def test_vertices_and_middles_lie_on_the_heightfield_facing_up() -> None:
    world = ring_world()
    for tile in ground_tiles(world, 5.0):
        for surface in tile.surfaces:
            corners = corners_of(surface)
            for x, y, z in (surface.vertices.astype(np.float64).T, corners.mean(axis=1).T):
                np.testing.assert_allclose(z, world.terrain.field.height_at(x, y), atol=1e-6)
            assert areas_from_above(corners).min() > 0
            slope_x, slope_y = (
                0.12 * np.cos(0.4 * surface.vertices[:, 0]) + 0.05,
                -0.1 * np.sin(0.5 * surface.vertices[:, 1]),
            )
            expected = np.column_stack([-slope_x, -slope_y, np.ones(len(slope_x))])
            expected /= np.linalg.norm(expected, axis=1, keepdims=True)
            np.testing.assert_allclose(surface.normals, expected, atol=0.005)


def test_vertices_are_shared_and_uncrossed_cells_stay_whole() -> None:
    world = ring_world()
    far = replace(
        world,
        terrain=replace(world.terrain, trail_distance=replace(ring_trail(0.1), values=np.ones((2, 2), np.float32))),
    )
    (tile,) = ground_tiles(far, 50.0)
    (surface,) = tile.surfaces
    assert (len(surface.vertices), len(surface.faces)) == (101 * 101, 2 * 100 * 100)
    cut = next(iter(ground_tiles(world, 50.0)))
    assert sum(len(s.faces) for s in cut.surfaces) < 1.5 * 2 * 100 * 100  # neighbours of crossed cells are divided, too


@pytest.mark.parametrize("grid", GRIDS)
def test_every_edge_belongs_to_two_triangles_so_that_nothing_is_seen_through_a_gap(grid: str) -> None:
    tiles = list(ground_tiles(ring_world(grid), 5.0))
    corners = np.concatenate([corners_of(surface) for tile in tiles for surface in tile.surfaces])
    nodes = np.rint(corners[..., :2] / 1e-5).astype(np.int64)
    edges = np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    lexical = (edges[:, 0, 0] > edges[:, 1, 0]) | (
        (edges[:, 0] == edges[:, 1])[:, 0] & (edges[:, 0, 1] > edges[:, 1, 1])
    )
    edges[lexical] = edges[lexical, ::-1]
    found, count = np.unique(edges.reshape(-1, 4), axis=0, return_counts=True)
    border = np.abs(found) == round(SIDE / 2 / 1e-5)
    on_border = (border[:, 0] & border[:, 2]) | (border[:, 1] & border[:, 3])
    np.testing.assert_array_equal(count, np.where(on_border, 1, 2))


def test_texture_coordinates_run_over_the_tile() -> None:
    world = ring_world()
    tiles = list(ground_tiles(world, 7.0))
    assert {tile.name for tile in tiles} == {f"terrain_{i}_{j}" for i in range(3) for j in range(3)}
    for tile in tiles:
        for surface in tile.surfaces:
            np.testing.assert_allclose(tile.x0 + tile.size * surface.uv[:, 0], surface.vertices[:, 0], atol=1e-5)
            np.testing.assert_allclose(tile.y0 + tile.size * surface.uv[:, 1], surface.vertices[:, 1], atol=1e-5)
            assert surface.uv.min() >= 0
            assert surface.uv.max() <= 1


def wrong_area(world: World) -> tuple[float, float]:
    """Share of the area with another class than the terrain's, and how far [m] it reaches from the trail's edge."""
    rng, wrong, total, far = np.random.default_rng(0), 0.0, 0.0, 0.0
    for tile in ground_tiles(world):
        for surface in tile.surfaces:
            corners = corners_of(surface)
            weights = rng.dirichlet((1, 1, 1), (len(corners), 4))
            x, y, _ = np.moveaxis(weights @ corners, -1, 0)
            other = world.terrain.label_at(x, y) != surface.label
            area = areas_from_above(corners)
            wrong, total = wrong + float((other.mean(axis=1) * area).sum()), total + float(area.sum())
            far = max(far, float(np.abs(world.terrain.trail_distance.at(x[other], y[other])).max(initial=0.0)))
    assert total == pytest.approx(world.size[0] * world.size[1], rel=1e-6)
    return wrong / total, far


@pytest.mark.slow
def test_the_parks_ground_has_the_class_of_its_terrain() -> None:
    share, far = wrong_area(load_world("park"))
    assert share < 1e-6
    assert far < 2e-3


@pytest.mark.slow
def test_the_ground_of_the_forest_has_the_class_of_its_terrain() -> None:
    """Its paths are the most ragged."""
    share, far = wrong_area(load_world("forest"))
    assert share < 1e-4  # 4e-5
    assert far < 0.05


def test_hills_are_those_of_the_world() -> None:
    """The closed form of the normals above is that of the world that is cut."""
    field = small_world().terrain.field
    assert field.height_at(1.0, 2.0) == pytest.approx(float(hills(np.float64(1.0), np.float64(2.0))), abs=1e-6)  # type: ignore[arg-type]
