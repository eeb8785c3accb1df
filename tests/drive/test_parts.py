# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of tiles equal those of the whole world bit for bit, and a drive over parts equals one in the whole world."""

from typing import Any

import numpy as np
import pytest
from drive_worlds import hills, make_experiment, make_world, obstacle, with_stones
from sense_worlds import at, box

from fieldtruth.core.arrays import Array
from fieldtruth.drive import surroundings, traversability
from fieldtruth.drive.ground import WorldParts, bearing_field
from fieldtruth.drive.plan import plan_and_drive
from fieldtruth.drive.simulate import drive
from fieldtruth.drive.traversability import CELL, Outline, Traversability, distance_to
from fieldtruth.experiment.config import random_route
from fieldtruth.experiment.files import load_experiment
from fieldtruth.world.build import load_world
from fieldtruth.world.model import World


def crowded() -> World:
    """Hills, water, trunks, a long log that lies, and stones, high and low."""
    rng = np.random.default_rng(4)
    xy = rng.uniform((-16, -9), (16, 9), (12, 2))
    trunks = [obstacle(f"tree_{k}", "cylinder", (0.3, 5.0), float(x), float(y)) for k, (x, y) in enumerate(xy)]
    name, log, pose = obstacle("log", "cylinder", (0.2, 14.0), 1.0, 2.0)
    pose[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    world = make_world(hills, size=(34.0, 20.0), obstacles=[*trunks, (name, log, pose)], water_level=-0.15)
    stones = [box("high", [0.2, 0.2, 0.2], "rock_granite"), box("low", [0.1, 0.1, 0.05], "rock_granite")]
    xy = rng.uniform((-16, -9), (16, 9), (100, 2))
    poses = np.array([at(x, y, float(world.terrain.field.height_at(x, y))) for x, y in xy])
    return with_stones(world, stones, [k % 2 for k in range(100)], poses)


def equal_maps(whole: Traversability, tiled: Traversability) -> None:
    """Compare every cell, and what is looked up near a tile's edge."""
    rows, columns = (range(count) for count in whole.shape)
    np.testing.assert_array_equal(tiled.clearance_of(rows, columns), whole.clearance_of(rows, columns))
    cells = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
    points = whole.corner + cells * CELL
    np.testing.assert_array_equal(tiled.blockage_at(points), whole.blockage_at(points))
    np.testing.assert_array_equal(tiled.terrain_clearance_at(points), whole.terrain_clearance_at(points))
    edge = points[np.abs(points[:, 0] - points[points[:, 0] > 0, 0].min()) < 40.0][::997]
    poses = np.column_stack([edge, np.linspace(0.0, 6.0, len(edge))])
    np.testing.assert_allclose(tiled.bumps_at(poses), whole.bumps_at(poses), atol=1e-6)  # [m], heights of 32 bits
    for point in edge[:, None]:
        found, expected = (near(ground.outlines_near(point, 2.0), point) for ground in (tiled, whole))
        assert found == expected


def near(outlines: list[Outline], point: Array) -> set[tuple[str, bytes]]:
    """Corners to 1 um: heights are read in cells from the tile's own corner, which changes last bits."""
    return {(o.name, (o.corners.round(6) + 0.0).tobytes()) for o in outlines if distance_to(o, point)[0] <= 2.0}


@pytest.fixture
def many_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fieldtruth.drive.ground.WHOLE", 15.0)


def test_a_map_of_tiles_equals_that_of_the_whole_world(request: pytest.FixtureRequest) -> None:
    world = crowded()
    whole = Traversability(world)
    assert whole.parts.is_one
    request.getfixturevalue("many_tiles")
    tiled = Traversability(world, side=10.0)
    assert not tiled.parts.is_one
    equal_maps(whole, tiled)


def test_tiles_are_made_where_they_are_looked_up_and_few_are_kept(
    many_tiles: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(traversability, "_KEPT", 2)
    made = []
    make = Traversability._make

    def note(self: Traversability, i: int, j: int) -> object:
        made.append((i, j))
        return make(self, i, j)

    monkeypatch.setattr(Traversability, "_make", note)
    ground = Traversability(make_world(size=(80.0, 40.0)), side=15.0)
    assert made == []
    for x in (-39.0, -38.0, -20.0, -39.0, 10.0, -39.0, -20.0):
        ground.clearance_at([(x, -19.0)])
    assert made == [(0, 0), (1, 0), (3, 0), (1, 0)]


def test_a_part_has_what_reaches_into_it(many_tiles: None) -> None:
    world = crowded()
    part = WorldParts(world).around(np.array([12.0, 2.0]), 2.0)  # the log is from x = 1 m to 15 m
    assert "log" in {instance.name for instance in part.instances}
    assert len(part.instances) < 5
    assert part.terrain.field.heights.shape == (21, 21)
    xy = np.random.default_rng(1).uniform((10.0, 0.0), (14.0, 4.0), (500, 2))
    np.testing.assert_allclose(
        bearing_field(part).height_at(*xy.T), bearing_field(world).height_at(*xy.T), rtol=0.0, atol=1e-6
    )


def test_a_drive_over_parts_equals_one_in_the_whole_world(monkeypatch: pytest.MonkeyPatch) -> None:
    """To rounding, of positions relative to another corner, which contacts let grow."""
    world = make_world(hills)
    experiment = make_experiment([(9.0, 0.0)], start=(-9.0, 0.0), seconds=12.0)
    whole = drive(world, experiment).motion
    monkeypatch.setattr("fieldtruth.drive.ground.WHOLE", 15.0)
    monkeypatch.setattr(surroundings, "REACH", 3.0)
    monkeypatch.setattr(surroundings, "EDGE", 1.6)
    over_parts = drive(world, experiment).motion
    assert np.ptp(whole.position[:, 0]) > 3.0  # two parts begin
    np.testing.assert_allclose(over_parts.position, whole.position, atol=1e-3)
    assert not np.array_equal(over_parts.position, whole.position)


@pytest.mark.slow
def test_a_map_of_tiles_equals_that_of_the_whole_forest(request: pytest.FixtureRequest) -> None:
    """As dense as the built-in one, on a quarter of its area, which is six tiles."""
    world = load_world("forest", 1, {"size": (44.0, 27.0), "individuals": 1, "beyond": False})
    whole = Traversability(world)
    request.getfixturevalue("many_tiles")
    equal_maps(whole, Traversability(world, side=15.0))


@pytest.mark.slow
def test_a_random_route_is_driven_in_a_forest_over_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    laid = []
    build = surroundings.Surroundings.__init__

    def note(self: surroundings.Surroundings, part: World, *others: Any) -> None:
        laid.append(len(part.instances))
        build(self, part, *others)

    monkeypatch.setattr(surroundings.Surroundings, "__init__", note)
    swarms = ("grass", "ferns", "seedlings", "saplings", "bilberries", "brambles", "twigs")  # which no wheel feels
    plain = {"grid": 0.2, "individuals": 1, "beyond": False, **{f"{name}_per_m2": 0.0 for name in swarms}}
    world = load_world("forest", 0, {"size": (120.0, 120.0), **plain})
    experiment = load_experiment("forest_1").model_copy(update={"route": random_route(30.0, 1)})
    track = plan_and_drive(world, experiment)
    assert track.length_m == pytest.approx(30.0, rel=0.02)
    assert len(laid) >= 2
    assert max(laid) < len(world.instances) / 4
