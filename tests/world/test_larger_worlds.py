# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Larger worlds: densities, trails and ids of the built-in ones; cost and memory grow with the area, not faster."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from sense_worlds import without_textures
from test_placement import anywhere, mesh

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.world.build import build_world, check_layout, layout_model, load_world
from fieldtruth.world.environments import ENVIRONMENTS
from fieldtruth.world.environments.layout import network
from fieldtruth.world.grids import Line, coarseness, make_trails
from fieldtruth.world.model import Heightfield
from fieldtruth.world.placement import ObjectGroup, WorldBuilder

SIZE = (150.0, 100.0)
FOREST: Any = layout_model("forest")
LAKE: Any = layout_model("lake")
TRAILS = FOREST().trails


@pytest.mark.parametrize("environment", ENVIRONMENTS)
def test_the_builtin_layouts_stay(environment: str) -> None:
    config = layout_model(environment)()
    assert config.for_size() == config  # type: ignore[attr-defined]


def test_counts_grow_with_the_area_unless_they_are_given() -> None:
    config = FOREST(size=(200.0, 100.0), rocks=7, grid=0.2).for_size()
    assert (config.old_trees, config.bushes, config.rocks, config.grid) == (820, 152, 7, 0.2)
    assert FOREST(size=(50.0, 25.0)).for_size().grown_trees == 25
    lake = LAKE(size=(200.0, 100.0)).for_size()
    assert (lake.waterside_trees, lake.meadow_trees) == (26, 120)  # alders stand along the shore


def test_more_than_800_of_a_kind_to_the_hectare_are_refused() -> None:
    check_layout("forest", {"size": [100, 100], "rocks": 800})
    check_layout("forest", {"size": [10, 10], "rocks": 400})
    with pytest.raises(
        ConfigurationError, match=r"^layout: rocks must be at most 800 in a world of this size, got 801$"
    ):
        check_layout("forest", {"size": [100, 100], "rocks": 801})


@pytest.mark.parametrize("side", [100.0, 200.0, 250.0, 1000.0, 5000.0])
def test_nodes_are_bounded(side: float) -> None:
    grid = LAKE(size=(side, side)).for_size().grid
    assert grid == pytest.approx(0.05 * coarseness((side, side)))
    assert (side / grid) ** 2 <= 16e6 * (1 + 1e-9)
    assert grid == 0.05 or (side / grid) ** 2 >= 16e6 / 4


def test_trails_go_on_beyond_the_builtin_size() -> None:
    assert network(TRAILS, (100.0, 50.0)) == TRAILS
    pieces = [Line.through(corners) for corners in network(TRAILS, (300.0, 150.0))]
    lines = np.concatenate([Line.through(corners).points for corners in TRAILS])
    middle = Line.joined(pieces).distance(lines[(np.abs(lines) < (50.0, 25.0)).all(axis=1)])
    assert middle.max() < 0.03
    ends = np.array([point for piece in pieces for point in piece.points[[0, -1]]])
    inside = ends[(np.abs(ends) < (149.0, 74.0)).all(axis=1)]
    apart = np.sort(np.linalg.norm(inside[:, None] - ends, axis=2), axis=1)[:, 1]
    assert len(inside) > 20
    assert apart.max() < 0.11  # lines end within 5 cm of the edge on either side of it


def test_many_lines_are_one_with_gaps() -> None:
    lines = [[(0.0, y), (40.0, y + 3.0), (80.0, y)] for y in range(0, 90, 10)]
    [trail] = make_trails(lines, 2.0)
    xy = np.random.default_rng(0).uniform(-20.0, 100.0, (500, 2))
    apart = np.min([Line.through(corners).distance(xy) for corners in lines], axis=0)
    assert np.abs(trail.line.distance(xy) - apart).max() < 1e-9
    assert [len(part.points) for part in trail.line.parts()] == [len(Line.through(corners).points) for corners in lines]


def test_placing_looks_at_no_more_objects_in_a_larger_world() -> None:
    """Visited circles for each object, at one density: those of the surroundings, however large the world is."""
    visits = []
    for side in (60.0, 120.0):
        level = Heightfield(heights=np.zeros((2, 2), np.float32), spacing=side, x0=-side / 2, y0=-side / 2)
        builder = WorldBuilder(level, (side, side), (), ())
        group = ObjectGroup(kind="box", meshes=[mesh()], count=round(side**2 / 50), spacing=2.0)
        builder.scatter(group, np.random.default_rng(0), anywhere)
        visits.append(builder.taken.visits / group.count)
    assert 0.1 < visits[0] < 10.0
    assert visits[1] == pytest.approx(visits[0], rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("environment", ["lake", "forest"])
def test_a_larger_world_has_the_densities_of_the_builtin_one(environment: str) -> None:
    """Kinds of named objects as their counts say; members of a swarm within a factor that its noise patches explain.

    The lake has kinds that grow with its shore, the forest the most objects.
    """
    with without_textures():
        world = build_world(environment, 0, {"size": list(SIZE), "grid": 0.5, "individuals": 1})
    ids = [i.object_id for i in world.instances] + [s.object_id for s in world.swarms]
    assert ids == list(range(2, len(world.object_names)))
    assert len(set(world.object_names)) == len(world.object_names)
    builtin = load_world(environment, 0)
    larger = SIZE[0] * SIZE[1] / np.prod(builtin.size)
    counts, expected = (Counter(i.kind for i in each.instances) for each in (world, builtin))
    fixed = {"water", "power_pole", "cable", "waterside_tree", "waterside_bush"}  # grow with the shore's length
    for kind in expected.keys() - fixed:
        assert counts[kind] == pytest.approx(larger * expected[kind], abs=3.0), kind
    inside = {s.name: _inside(s.world_from_object, SIZE) for s in world.swarms}
    for swarm in builtin.swarms:
        before = _inside(swarm.world_from_object, builtin.size)
        if before > 50 and environment == "forest":
            assert 0.5 * larger < inside[swarm.name] / before < 2.0 * larger, swarm.name


def _inside(poses: np.ndarray[tuple[int, ...], np.dtype[np.float64]], size: tuple[float, float]) -> int:
    return int((np.abs(poses[:, :2, 3]) <= np.array(size) / 2).all(axis=1).sum())
