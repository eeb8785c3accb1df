# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of placement on a small lawn: lowest ground, spacing, corridors, and errors when it is full."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.world.grids import Line, Trail
from fieldtruth.world.model import Heightfield, Instance, Mesh
from fieldtruth.world.placement import (
    CrowdedWorldError,
    ObjectGroup,
    WorldBuilder,
    outside,
    place_until_count,
    random_tint,
)

F8 = NDArray[np.float64]


def field(slope: float = 0.0) -> Heightfield:
    """40 x 20 m that rises along x."""
    x = -20 + 0.5 * np.arange(81)
    heights = np.repeat((slope * x)[:, None], 41, axis=1).astype(np.float32)
    return Heightfield(heights=heights, spacing=0.5, x0=-20.0, y0=-10.0)


def mesh(name: str = "box", footprint: float = 0.5) -> Mesh:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    return Mesh(
        name=name,
        vertices=corners,
        normals=np.tile(np.array([0, 0, 1], np.float32), (3, 1)),
        uv=corners[:, :2],
        faces=np.array([[0, 1, 2]], np.int32),
        material=np.zeros(1, np.int32),
        materials=("stone",),
        footprint=footprint,
    )


def lawn(slope: float = 0.0, corridor_width: float = 2.0) -> WorldBuilder:
    """A trail of 2 m along y = 0, and a corridor along y = 6."""
    trail = Trail(Line.through([(-30, 0), (30, 0)]), 2.0)
    corridor = Line.through([(-18, 6), (18, 6)], smooth=False)
    return WorldBuilder(field(slope), (40.0, 20.0), [trail], [corridor], corridor_width)


def anywhere(xy: F8) -> NDArray[np.bool_]:
    return np.ones(len(xy), np.bool_)


def positions(instances: list[Instance]) -> F8:
    return np.array([i.world_from_object[:2, 3] for i in instances])


def test_object_is_on_the_lowest_ground_of_its_footprint() -> None:
    """On a slope of 10 %, lower by 0.1 times the footprint's radius, at most 0.9 m: crowns are wider than stems."""
    builder = lawn(slope=0.1)
    narrow = builder.add_upright("a", mesh("a", 0.5), (3.0, -5.0), yaw=0.0)
    wide = builder.add_upright("b", mesh("b", 3.0), (10.0, -5.0), yaw=0.0)
    assert narrow.world_from_object[:3, 3] == pytest.approx([3.0, -5.0, 0.1 * (3.0 - 0.5)], abs=1e-6)
    assert wide.world_from_object[2, 3] == pytest.approx(0.1 * (10.0 - 0.9), abs=1e-6)


def test_pose_has_yaw_and_scale() -> None:
    placed = lawn().add_upright("a", mesh(), (1.0, -5.0), yaw=np.pi / 2, scale=2.0)
    ahead = placed.world_from_object @ [1.0, 0.0, 0.0, 1.0]
    assert ahead == pytest.approx([1.0, -3.0, 0.0, 1.0])  # x forward turned to +y, twice as long
    assert np.linalg.det(placed.world_from_object[:3, :3]) == pytest.approx(8.0)


def test_names_and_ids_count_up() -> None:
    builder = lawn()
    kinds = (("oak", 0.0), ("elm", 3.0), ("oak", 6.0))
    placed = [builder.add_upright(kind, mesh(kind), (x, -5.0), yaw=0.0) for kind, x in kinds]
    assert [(i.name, i.object_id) for i in placed] == [("oak_1", 2), ("elm_1", 3), ("oak_2", 4)]
    assert list(builder.meshes) == ["oak", "elm"]


def test_free_is_inside_and_outside_other_objects_and_corridors() -> None:
    builder = lawn()
    builder.add_upright("a", mesh(), (0.0, -5.0), yaw=0.0, scale=2.0)  # occupies a radius of 1 m
    assert not builder.is_free((1.4, -5.0), 0.5)
    assert builder.is_free((1.6, -5.0), 0.5)
    assert not builder.is_free((0.0, 6.0), 0.5)
    assert not builder.is_free((0.0, 7.4), 0.5)  # within 1 m of the corridor's centre line
    assert builder.is_free((0.0, 7.6), 0.5)
    assert builder.is_free((18.9, -5.0), 0.5)
    assert not builder.is_free((19.1, -5.0), 0.5)  # within 0.5 m of the world's edge
    assert not builder.is_free((5.0, -9.1), 0.5)
    assert not lawn(corridor_width=4.0).is_free((0.0, 7.6), 0.5)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_place_until_count_tries_all_candidates_per_spacing_and_stops_at_the_count(count: int) -> None:
    """Three candidates, of which the second is too near to the first at a spacing of 2 m but not at 1 m."""
    builder, candidates, calls = lawn(), [np.array([x, -5.0]) for x in (0.0, 1.5, 4.0)], list[tuple[float, int, bool]]()

    def attempt(xy: F8, number: int, apart: bool) -> Instance | None:
        calls.append((float(xy[0]), number, apart))
        if not apart or not builder.is_free(xy, 0.5):
            return None
        return builder.add_upright("a", mesh(), xy, yaw=0.0)

    placed = place_until_count(count, candidates, attempt, spacings=(2.0, 1.0))
    assert [i.world_from_object[0, 3] for i in placed] == [0.0, 4.0, 1.5][:count]
    everything = [(0.0, 0, True), (1.5, 1, False), (4.0, 1, True), (0.0, 2, False), (1.5, 2, True)]
    assert calls == everything[: {0: 0, 1: 1, 3: 5}[count]]


def test_place_until_count_takes_no_candidate_after_the_last_object() -> None:
    """Candidates may draw random numbers when they are taken."""
    builder, candidates = lawn(), iter([np.array([x, -5.0]) for x in (0.0, 3.0, 6.0)])
    place_until_count(2, candidates, lambda xy, *_: builder.add_upright("a", mesh(), xy, yaw=0.0))
    assert next(candidates)[0] == 6.0


def test_place_until_count_returns_fewer_when_candidates_are_exhausted() -> None:
    assert place_until_count(2, [np.zeros(2)], lambda *_: None, spacings=(1.0, 0.5)) == []


def test_scattered_objects_keep_their_distances_and_use_meshes_in_turn() -> None:
    builder = lawn()
    meshes = [mesh("a", 0.4), mesh("b", 0.6)]
    group = ObjectGroup(kind="bush", meshes=meshes, count=20, spacing=2.5, scales=(0.5, 1.5), tint=0.1)
    placed = builder.scatter(group, np.random.default_rng(1), lambda xy: builder.trail_distance(xy) > 1.0)
    xy = positions(placed)
    apart = np.linalg.norm(xy[:, None] - xy, axis=-1) + 99 * np.eye(20)
    assert apart.min() >= 2.5
    assert np.abs(xy[:, 1]).min() > 2.0  # a trail of 1 m to either side, and 1 m more
    assert np.abs(xy[:, 1] - 6.0).min() > 1.0
    assert [i.mesh for i in placed] == ["a", "b"] * 10
    scales = np.cbrt([np.linalg.det(i.world_from_object[:3, :3]) for i in placed])
    assert scales.min() > 0.5
    assert scales.max() < 1.5
    assert np.ptp(scales) > 0.3
    assert len({i.tint for i in placed}) == 20


def test_same_generator_same_positions() -> None:
    group = ObjectGroup(kind="a", meshes=[mesh()], count=9)
    first, again, other = (
        positions(lawn().scatter(group, np.random.default_rng(seed), anywhere)) for seed in (4, 4, 5)
    )
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_full_world_reports_how_many_objects_fit() -> None:
    tents = ObjectGroup(kind="tent", meshes=[mesh()], count=900)
    with pytest.raises(CrowdedWorldError, match=r"only \d+ of 900 objects of kind tent fit in the world"):
        lawn().scatter(tents, np.random.default_rng(0), anywhere)


def test_no_allowed_position_is_reported() -> None:
    tent = ObjectGroup(kind="tent", meshes=[mesh()], count=1)
    with pytest.raises(CrowdedWorldError, match="only 0 of 1 objects of kind tent"):
        lawn().scatter(tent, np.random.default_rng(0), lambda xy: xy[:, 0] > 99)


def row(rng: np.random.Generator) -> np.ndarray:
    """Candidates (n, 3) along y = 1.6 m that face the trail, in random order."""
    x = np.arange(-9.0, 9.0, 0.4)
    return rng.permutation(np.column_stack([x, np.full(len(x), 1.6), np.full(len(x), -np.pi / 2)]))


def test_objects_have_the_heading_of_their_candidates() -> None:
    lamps, rng = ObjectGroup(kind="lamp", meshes=[mesh()], count=4, spacing=3.0), np.random.default_rng(3)
    for lamp in lawn().place(lamps, rng, row(rng)):
        assert lamp.world_from_object[:3, 0] == pytest.approx([0, -1, 0], abs=1e-9)


def test_spacing_eases_where_space_is_scarce() -> None:
    def nearest(count: int) -> float:
        rng = np.random.default_rng(3)
        lamps = ObjectGroup(kind="lamp", meshes=[mesh()], count=count, spacing=4.0)
        xy = positions(lawn().place(lamps, rng, row(rng)))
        return float((np.linalg.norm(xy[:, None] - xy, axis=-1) + 99 * np.eye(count)).min())

    count = 2
    while nearest(count) >= 4.0:
        count += 1
    assert count > 3
    assert 2.0 <= nearest(count) < 4.0


def test_neighbours_are_different_meshes_and_all_are_used() -> None:
    tents = [mesh(f"tent_{k}") for k in range(3)]
    group = ObjectGroup(kind="tent", meshes=tents, count=9, differ=3.0)
    placed = lawn().place(
        group, np.random.default_rng(1), np.column_stack([np.arange(-8.0, 10.0, 2.0), np.full(9, 3.0)])
    )
    names = [each.mesh for each in placed]
    assert all(a != b for a, b in pairwise(names))
    assert sorted(names.count(each.name) for each in tents) == [3, 3, 3]


@pytest.mark.parametrize(("members", "circles"), [(300, 40), (300, 0), (0, 40), (0, 0)])
def test_what_is_outside_of_circles(members: int, circles: int) -> None:
    rng = np.random.default_rng(members + circles)
    xy = rng.uniform(-10, 10, (members, 2))
    discs = np.column_stack([rng.uniform(-10, 10, (circles, 2)), rng.uniform(0, 3, circles)])
    gaps = np.linalg.norm(xy[:, None] - discs[:, :2], axis=2) - discs[:, 2]
    np.testing.assert_array_equal(outside(xy, discs), (gaps > 0).all(axis=1))


def test_distance_to_the_edge_of_a_trail() -> None:
    assert lawn().trail_distance(np.array([[0.0, 0.0], [5.0, 1.0], [5.0, -3.0]])) == pytest.approx([-1.0, 0.0, 2.0])


def test_tints_vary_around_one() -> None:
    rng = np.random.default_rng(0)
    tints = np.array([random_tint(rng, 0.1) for _ in range(2000)])
    assert np.log(tints).mean() == pytest.approx(0.0, abs=0.01)
    assert np.log(tints).std() == pytest.approx(0.1 * np.sqrt(1 + 1 / 9), rel=0.1)
    assert tints.min() >= np.exp(-0.5)
    assert random_tint(rng, 0.0) == (1.0, 1.0, 1.0)
