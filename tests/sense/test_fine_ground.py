# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays meet the ground's surface exactly: field and layer, at any number of nodes, without gaps between tiles."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from oracle import expected_hits
from sense_worlds import F8, make_world, trace_rays

from fieldtruth.core.classes import Label
from fieldtruth.sense.scene import Scene
from fieldtruth.validation.tracer import ReferenceTracer
from fieldtruth.world.model import Heightfield, World

SPACING = 0.05


def rough_world(nx: int, ny: int) -> World:
    """Ground of nx x ny nodes with a relief of 8 mm and a slope, and a layer of up to 3 cm."""
    rng = np.random.default_rng([nx, ny])
    x, y = np.meshgrid(SPACING * np.arange(nx), SPACING * np.arange(ny), indexing="ij")
    heights = rng.normal(0.0, 0.008, (nx, ny)) + 0.2 * x - 0.1 * y
    field = Heightfield(heights=heights.astype(np.float32), spacing=SPACING, x0=-1.0, y0=-1.5)
    layer = rng.uniform(0.0, 0.03, (nx, ny)).astype(np.float32)
    world = make_world()
    return replace(world, terrain=replace(world.terrain, field=field, layer=layer))


def straight_down(world: World, x: NDArray[np.floating], y: NDArray[np.floating]) -> F8:
    """Heights [m] that rays from 10 m above see, NaN where they meet nothing."""
    seen = trace_rays(Scene(world), np.column_stack([x, y, np.full(len(x), 10.0)]), np.tile([0.0, 0, -1], (len(x), 1)))
    return np.where(seen.range_m > 0, 10.0 - seen.range_m, np.nan)


@pytest.mark.parametrize(("nx", "ny"), [(2, 2), (2, 5), (17, 17), (18, 16), (19, 40), (34, 33), (50, 83)])
def test_every_triangle_of_any_number_of_nodes_is_met_at_its_height(nx: int, ny: int) -> None:
    world = rough_world(nx, ny)
    surface = world.terrain.surface
    i, j = np.meshgrid(np.arange(nx - 1), np.arange(ny - 1), indexing="ij")
    for du, dv in ((0.7, 0.2), (0.2, 0.7), (0.97, 0.9), (0.05, 0.9)):  # on both sides of the diagonal
        x, y = np.ravel(surface.x0 + SPACING * (i + du)), np.ravel(surface.y0 + SPACING * (j + dv))
        assert straight_down(world, x, y) == pytest.approx(surface.height_at(x, y), abs=1e-5)
        assert np.abs(surface.height_at(x, y) - world.terrain.field.height_at(x, y)).max() > 1e-3, "the layer counts"


def test_no_ray_passes_between_cells_or_tiles() -> None:
    """Rays at points of edges and diagonals, which single precision puts on either side; no slope is as steep."""
    world = rough_world(70, 50)
    surface, rng, count = world.terrain.surface, np.random.default_rng(4), 100_000
    kind, along = rng.integers(0, 3, count), rng.uniform(0.0, 1.0, count)
    u, v = rng.integers(15, 55, count) + along * (kind != 1), rng.integers(15, 35, count) + along * (kind != 0)
    target = np.column_stack([surface.x0 + SPACING * u, surface.y0 + SPACING * v, np.zeros(count)])
    target[:, 2] = surface.height_at(target[:, 0], target[:, 1])
    for lean in (0.0, 0.5):
        angle = rng.uniform(0, 2 * np.pi, count)
        towards = np.column_stack([lean * np.cos(angle), lean * np.sin(angle), -np.ones(count)])
        seen = trace_rays(Scene(world), target - towards, towards)
        assert seen.range_m == pytest.approx(np.hypot(1.0, lean), abs=1e-4)


def test_rays_at_all_angles_agree_with_the_second_tracer() -> None:
    world = rough_world(120, 90)
    rng = np.random.default_rng(6)
    count = 3000
    origins = np.column_stack([rng.uniform(-1, 4.9, count), rng.uniform(-1.5, 2.9, count), np.zeros(count)])
    origins[:, 2] = world.terrain.surface.height_at(origins[:, 0], origins[:, 1]) + rng.uniform(0.05, 0.9, count)
    azimuth, elevation = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(-60, 5, count))
    flat = np.cos(elevation)
    directions = np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])
    seen, expected = (
        trace_rays(Scene(world), origins, directions),
        expected_hits(ReferenceTracer(world), origins, directions),
    )
    sure = ~expected.doubtful
    assert np.count_nonzero(sure) > 0.98 * count
    assert 500 < np.count_nonzero(seen.range_m[sure]) < count
    assert seen.range_m[sure] == pytest.approx(expected.range_m[sure], abs=1e-4)
    assert set(seen.label[sure & (seen.range_m > 0)]) == {Label.GROUND}
