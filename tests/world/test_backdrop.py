# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The backdrop continues the terrain's height and slope, blends into the requested land, and carries swarms."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.world.backdrop import BEND, FINE_REPEAT, _laid_out, height_beyond, make_backdrop, scatter_beyond
from fieldtruth.world.environments.layered.trails_beyond import _band
from fieldtruth.world.grids import Line
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Mesh
from fieldtruth.world.placement import SwarmSpec
from fieldtruth.world.rocks import ROCK_TYPES, make_rock

F8 = NDArray[np.float64]
SIZE = (20.0, 10.0)


def hill(x: F8, y: F8) -> F8:
    return np.asarray(0.3 * y + 0.1 * x)


def bumpy() -> Heightfield:
    """0.3 m above the hill, modulated by a wave."""
    x, y = np.linspace(-10, 10, 101), np.linspace(-5, 5, 51)
    heights = hill(*np.meshgrid(x, y, indexing="ij")) + 0.3 + 0.4 * np.sin(x / 3)[:, None] * np.cos(y / 2)
    return Heightfield(heights=heights.astype(np.float32), spacing=0.2, x0=-10.0, y0=-5.0)


@pytest.fixture(scope="module")
def backdrop() -> Mesh:
    def cover(x: F8, y: F8, slope: F8) -> NDArray[np.intp]:
        return (y > 0).astype(np.intp)

    return make_backdrop(bumpy(), SIZE, ("heath", "scree"), np.random.default_rng(0), land=hill, cover=cover)


def test_height_and_slope_are_continuous_at_the_edge(backdrop: Mesh) -> None:
    field, height = bumpy(), height_beyond(bumpy(), SIZE, backdrop)
    y = np.linspace(-3, 3, 25)
    for x, out in ((10.0, 1.0), (-10.0, -1.0)):
        side = np.full(25, x)
        assert height(side * 1.00001, y) == pytest.approx(field.height_at(side, y), abs=2e-3)
        inside = (field.height_at(side, y) - field.height_at(side - 0.4 * out, y)) / 0.4
        outside = (height(side + 0.4 * out, y) - height(side * 1.00001, y)) / 0.4
        assert np.abs(outside - inside).max() < 0.08


def test_backdrop_blends_into_the_land(backdrop: Mesh) -> None:
    x, y, z = backdrop.vertices.astype(float).T
    far = np.maximum(np.abs(x) - 10, np.abs(y) - 5) > 45
    assert np.abs(z - hill(x, y))[far].max() < 2e-3
    assert np.abs(x[far]).max() > 900


def test_materials_have_their_triangles_and_uv_scale(backdrop: Mesh) -> None:
    middle = backdrop.vertices[backdrop.faces].astype(float).mean(axis=1)
    assert np.array_equal(backdrop.material == 1, middle[:, 1] > 0)
    for row, name in enumerate(backdrop.materials):
        used = np.unique(backdrop.faces[backdrop.material == row])
        expected = backdrop.vertices[used, :2] / MATERIALS[name].repeat
        bent = backdrop.uv[used] - expected
        if MATERIALS[name].repeat <= FINE_REPEAT:
            assert bent == pytest.approx(0.0 * bent, abs=1e-4)
        else:  # two waves of amplitudes 1 and 0.7
            assert 0.9 * BEND < np.abs(bent).max() <= 1.7 * BEND + 1e-4


def test_texture_is_not_stretched_on_a_wall_of_leaves() -> None:
    """On a plane at y = 30 a metre up is as long in uv as a metre along, bends aside; on land it is not counted."""
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-3.0, 3.0, 13), np.linspace(0.0, 12.0, 25)))
    wall = np.stack([x, np.full_like(x, 30.0), z], axis=-1)
    small = np.full(len(x), FINE_REPEAT)
    upright, land = (_laid_out(wall, small, np.full(len(x), leafy)) * FINE_REPEAT for leafy in (True, False))
    middle = np.abs(x) < 0.1
    np.testing.assert_allclose(upright[middle, 1], 30.0 + z[middle], rtol=1e-6)
    np.testing.assert_allclose(land, wall[:, :2], rtol=1e-6)


def test_height_beyond_matches_the_mesh(backdrop: Mesh) -> None:
    corners = backdrop.vertices[backdrop.faces].astype(float)
    middle = corners.mean(axis=1)
    near = (np.abs(middle[:, 0]) < 60) & (np.abs(middle[:, 1]) < 55)
    found = height_beyond(bumpy(), SIZE, backdrop)(middle[near, 0], middle[near, 1])
    assert found == pytest.approx(middle[near, 2], abs=0.06)


def test_swarm_beyond_the_edge_is_on_the_backdrop_within_its_bounds(backdrop: Mesh) -> None:
    rock = make_rock(ROCK_TYPES["scree"], name="r", size=0.5, rng=np.random.default_rng(0), triangles=80, solid=False)

    def north(xy: F8) -> F8:
        return (xy[:, 0] > 0).astype(float)

    ground = height_beyond(bumpy(), SIZE, backdrop)
    spec = SwarmSpec(name="far", kind="rock", meshes=[rock], per_m2=0.2, tilt=1.0)
    swarm, meshes = scatter_beyond(SIZE, ground, spec, np.random.default_rng(1), within=30.0, density=north)
    assert swarm.meshes == tuple(m.name for m in meshes) == ("r",)
    x, y, z = swarm.world_from_object[:, :3, 3].T
    area = 30 * (2 * 10 + 10) + np.pi * 30**2 / 2
    assert len(x) == pytest.approx(0.2 * area, rel=0.1)
    assert x.min() > 0
    outside = np.hypot(np.maximum(np.abs(x) - 10, 0), np.maximum(np.abs(y) - 5, 0))
    assert 1.5 < outside.min() < outside.max() < 30.0
    assert z == pytest.approx(ground(x, y), abs=1e-9)
    up = swarm.world_from_object[:, :3, 2] / np.linalg.norm(swarm.world_from_object[:, :3, 2], axis=1, keepdims=True)
    far = outside > 25  # the land is a plane there
    slope = np.array([-0.1, -0.3, 1]) / np.hypot(1, np.hypot(0.1, 0.3))
    assert up[far] == pytest.approx(np.tile(slope, (far.sum(), 1)), abs=0.01)


def test_fine_ground_meets_the_backdrop_at_every_node_of_the_edge() -> None:
    """Rings further out have a vertex every 0.2 m only; the first has those of the 5 cm grid, with its relief."""
    rng = np.random.default_rng(3)
    heights = (0.01 * rng.standard_normal((401, 201))).astype(np.float32)
    field = Heightfield(heights=heights, spacing=0.05, x0=-10.0, y0=-5.0)
    mesh = make_backdrop(field, SIZE, "meadow", rng, land=hill)
    count = 2 * (400 + 200)
    x, y, z = mesh.vertices[:count].astype(float).T
    assert z == pytest.approx(field.height_at(x, y), abs=1e-6)
    near = np.hypot(*np.diff(mesh.vertices[count : count + 101, :2], axis=0).T)
    assert near.min() > 0.19
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert np.count_nonzero(uses == 1) == count + count // 16  # the terrain's edge and the horizon
    assert uses.max() == 2
    on_edge = height_beyond(field, SIZE, mesh)(np.full(count, 10.0) + 1e-6, np.linspace(-4.9, 4.9, count))
    assert on_edge == pytest.approx(field.height_at(10.0, np.linspace(-4.9, 4.9, count)), abs=2e-3)


def test_a_wide_road_through_a_corner_lies_on_the_land_beyond(backdrop: Mesh) -> None:
    """No triangle spans a hollow, or the corner by more than its size: points are up to 5 cm above the land."""
    ground = height_beyond(bumpy(), SIZE, backdrop)
    line = Line.through([(0.0, 0.5), (10.0, 4.4), (24.0, 9.9)])
    band = _band(line, np.linspace(-3, 3, 16), "gravel", SIZE, ground)
    shares = np.random.default_rng(0).dirichlet([1, 1, 1], 20)
    x, y, z = np.einsum("kc,fcd->dfk", shares, band.vertices[band.faces].astype(float)).reshape(3, -1)
    outside = np.maximum(np.abs(x) - 10, np.abs(y) - 5)
    at_corner = (np.abs(x) > 9.6) & (np.abs(y) > 4.6)
    assert outside[~at_corner].min() > -1e-5
    assert outside.min() > -0.2
    assert (np.abs(x) < 10).any()
    assert (np.abs(y) < 5).any()
    high = z - ground(x, y)
    assert high.min() > -0.05
    assert high.max() < 0.05
    covered = np.zeros(0)
    for px, py in ((10.3, 4.6), (9.0, 5.3), (10.5, 2.4)):  # just outside of both sides
        covered = np.append(covered, np.hypot(x - px, y - py).min())
    assert covered.max() < 0.2
