# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rules of placing on a small lawn: on the lowest ground, apart from each other, off corridors, and not too many."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.world.model import Heightfield, Instance, Mesh
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint
from fieldtruth.world.trails import Line, Trail

F8 = NDArray[np.float64]


def field(slope: float = 0.0) -> Heightfield:
    """40 x 20 m that rises along x."""
    x = -20 + 0.5 * np.arange(81)
    heights = np.repeat((slope * x)[:, None], 41, axis=1).astype(np.float32)
    return Heightfield(heights=heights, spacing=0.5, x0=-20.0, y0=-10.0)


def thing(name: str = "thing", footprint: float = 0.5) -> Mesh:
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


def site(slope: float = 0.0, corridor_width: float = 2.0) -> Site:
    """A trail of 2 m along y = 0, and a corridor along y = 6."""
    trail = Trail(Line.through([(-30, 0), (30, 0)]), 2.0)
    corridor = Line.through([(-18, 6), (18, 6)], smooth=False)
    return Site(field(slope), (40.0, 20.0), [trail], [corridor], corridor_width)


def anywhere(places: F8) -> NDArray[np.bool_]:
    return np.ones(len(places), np.bool_)


def spots(instances: list[Instance]) -> F8:
    return np.array([i.world_from_object[:2, 3] for i in instances])


def test_a_thing_stands_on_the_lowest_ground_of_its_footprint() -> None:
    """On a slope of 10 % it lies downhill by the footprint's radius, at most 0.9 m: a crown is wider than its foot."""
    lawn = site(slope=0.1)
    narrow = lawn.place("a", thing("a", 0.5), 3.0, -5.0, yaw=0.0)
    wide = lawn.place("b", thing("b", 3.0), 10.0, -5.0, yaw=0.0)
    assert narrow.world_from_object[:3, 3] == pytest.approx([3.0, -5.0, 0.1 * (3.0 - 0.5)], abs=1e-6)
    assert wide.world_from_object[2, 3] == pytest.approx(0.1 * (10.0 - 0.9), abs=1e-6)


def test_yaw_and_scale_make_the_pose() -> None:
    placed = site().place("a", thing(), 1.0, -5.0, yaw=np.pi / 2, scale=2.0)
    ahead = placed.world_from_object @ [1.0, 0.0, 0.0, 1.0]
    assert ahead == pytest.approx([1.0, -3.0, 0.0, 1.0])  # x forward turned to +y, twice as long
    assert np.linalg.det(placed.world_from_object[:3, :3]) == pytest.approx(8.0)


def test_names_and_ids_count_up() -> None:
    lawn = site()
    placed = [lawn.place(k, thing(k), x, -5.0, yaw=0.0) for k, x in (("oak", 0.0), ("elm", 3.0), ("oak", 6.0))]
    assert [(i.name, i.object_id) for i in placed] == [("oak_1", 2), ("elm_1", 3), ("oak_2", 4)]
    assert list(lawn.meshes) == ["oak", "elm"]


def test_free_means_inside_and_off_others_and_off_corridors() -> None:
    lawn = site()
    lawn.place("a", thing(), 0.0, -5.0, yaw=0.0, scale=2.0)  # keeps 1 m
    assert not lawn.is_free(1.4, -5.0, 0.5)
    assert lawn.is_free(1.6, -5.0, 0.5)
    assert not lawn.is_free(1.6, -5.0, 0.5, margin=0.2)
    assert not lawn.is_free(0.0, 6.0, 0.5)
    assert not lawn.is_free(0.0, 7.4, 0.5)  # the corridor's middle metre on either side
    assert lawn.is_free(0.0, 7.6, 0.5)
    assert lawn.is_free(18.9, -5.0, 0.5)
    assert not lawn.is_free(19.1, -5.0, 0.5)  # within 0.5 m of the world's edge
    assert not lawn.is_free(5.0, -9.1, 0.5)
    assert not site(corridor_width=4.0).is_free(0.0, 7.6, 0.5)


def test_scattered_things_keep_their_distances_and_take_turns() -> None:
    lawn = site()
    meshes = [thing("a", 0.4), thing("b", 0.6)]
    places = lawn.scatter(
        "bush", meshes, 20, rng=np.random.default_rng(1), allowed=lambda p: lawn.trail_distance(p) > 1.0, spacing=2.5,
        scales=(0.5, 1.5), tint=0.1,
    )  # fmt: skip
    where = spots(places)
    apart = np.linalg.norm(where[:, None] - where, axis=-1) + 99 * np.eye(20)
    assert apart.min() >= 2.5
    assert np.abs(where[:, 1]).min() > 2.0  # a trail of 1 m to either side, and 1 m more
    assert np.abs(where[:, 1] - 6.0).min() > 1.0
    assert [i.mesh for i in places] == ["a", "b"] * 10
    scales = np.cbrt([np.linalg.det(i.world_from_object[:3, :3]) for i in places])
    assert scales.min() > 0.5
    assert scales.max() < 1.5
    assert np.ptp(scales) > 0.3
    assert len({i.tint for i in places}) == 20


def test_same_generator_same_places() -> None:
    first, again, other = (
        spots(site().scatter("a", [thing()], 9, rng=np.random.default_rng(seed), allowed=anywhere))
        for seed in (4, 4, 5)
    )
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_a_full_world_says_how_many_found_room() -> None:
    with pytest.raises(CrowdedWorldError, match=r"only \d+ of 900 tent find room in the world"):
        site().scatter("tent", [thing()], 900, rng=np.random.default_rng(0), allowed=anywhere)
    with pytest.raises(CrowdedWorldError, match=r"only \d+ of 99 lamp find room along the trails"):
        site().along_trails("lamp", [thing()], 99, rng=np.random.default_rng(0), offset=0.6, spacing=3.0)


def test_nothing_allowed_is_told_too() -> None:
    with pytest.raises(CrowdedWorldError, match="only 0 of 1 tent"):
        site().scatter("tent", [thing()], 1, rng=np.random.default_rng(0), allowed=lambda p: p[:, 0] > 99)


def test_things_along_a_trail_stand_at_their_offset_and_face_it() -> None:
    lawn = site()
    placed = lawn.along_trails("lamp", [thing()], 10, rng=np.random.default_rng(3), offset=0.6, spacing=4.0)
    where = spots(placed)
    assert np.abs(where[:, 1]) == pytest.approx(1.6)  # half the trail and the offset
    assert {-1.0, 1.0} == set(np.sign(where[:, 1]).tolist())
    for lamp in placed:
        facing = lamp.world_from_object[:3, 0]
        assert facing == pytest.approx([0, -np.sign(lamp.world_from_object[1, 3]), 0], abs=1e-6)
    apart = np.linalg.norm(where[:, None] - where, axis=-1) + 99 * np.eye(10)
    assert apart.min() >= 4.0


def test_spacing_eases_where_things_take_each_others_room() -> None:
    def nearest(count: int) -> float:
        lamps = site().along_trails("lamp", [thing()], count, rng=np.random.default_rng(3), offset=0.6, spacing=4.0)
        where = spots(lamps)
        return float((np.linalg.norm(where[:, None] - where, axis=-1) + 99 * np.eye(count)).min())

    count = 8
    while nearest(count) >= 4.0:
        count += 1
    assert count > 8
    assert 2.0 <= nearest(count) < 4.0


def test_distance_to_the_trails_edge() -> None:
    lawn = site()
    assert lawn.trail_distance(np.array([[0.0, 0.0], [5.0, 1.0], [5.0, -3.0]])) == pytest.approx([-1.0, 0.0, 2.0])


def test_tints_scatter_about_one() -> None:
    rng = np.random.default_rng(0)
    tints = np.array([random_tint(rng, 0.1) for _ in range(2000)])
    assert np.log(tints).mean() == pytest.approx(0.0, abs=0.01)
    assert np.log(tints).std() == pytest.approx(0.1 * np.sqrt(1 + 1 / 9), rel=0.1)
    assert tints.min() >= np.exp(-0.5)
    assert random_tint(rng, 0.0) == (1.0, 1.0, 1.0)
