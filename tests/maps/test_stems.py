# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stems of known places and diameters in a scan from the ground, among bushes, branches and noise."""

from pathlib import Path

import numpy as np
import pytest

from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.maps.canopy import Canopy
from fieldtruth.maps.trees import Tree

pyproj = pytest.importorskip("pyproj")
laspy = pytest.importorskip("laspy")
pytest.importorskip("rasterio")

from fieldtruth.maps.stems import Circle, find_stems, is_dense, read_stems, through, with_stems  # noqa: E402
from fieldtruth.world.environments.site.config import Config  # noqa: E402
from fieldtruth.world.environments.site.inputs import read_trees  # noqa: E402

PLACE = Origin(47.6, 11.3, 600.0)
STEMS = np.array([(-6.0, -4.0, 0.05), (-3.0, 4.0, 0.12), (0.0, 0.0, 0.2), (0.5, 0.0, 0.2), (5.0, 3.0, 0.45)])
"""x, y and radius [m]; two touch nearly."""
BUSHES = np.array([(4.0, -4.0, 0.8), (-6.0, 3.0, 0.5)])


def scan(noise: float, turn_deg: float, rng: np.random.Generator) -> np.ndarray:
    """Points (n, 3) with heights above the ground: stems seen over a part of their turn, with a branch; bushes."""
    parts = []
    for k, (x, y, radius) in enumerate(STEMS):
        n = int(2500 * max(radius, 0.1) / 0.2)
        turn, away = np.radians(rng.uniform(40 * k, 40 * k + turn_deg, n)), radius + rng.normal(0.0, noise, n)
        parts.append(np.column_stack([x + away * np.cos(turn), y + away * np.sin(turn), rng.uniform(0.2, 4.0, n)]))
        along = rng.uniform(0.0, 0.8, 60)
        parts.append(np.column_stack([x + radius + along, y + 0.0 * along, 1.3 + along / 2]))
    for x, y, radius in BUSHES:
        ball = rng.normal(0.0, 1.0, (4000, 3))
        ball *= radius * rng.random((4000, 1)) ** (1 / 3) / np.linalg.norm(ball, axis=1, keepdims=True)
        parts.append(ball * [1, 1, 2] + [x, y, 1.5])
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("noise", "turn", "within"), [(0.003, 180, 0.06), pytest.param(0.015, 270, 0.2, marks=pytest.mark.slow)]
)
def test_stems_are_found_with_their_diameters_and_bushes_are_none(noise: float, turn: float, within: float) -> None:
    rng = np.random.default_rng(5)
    found = sorted(find_stems(scan(noise, turn, rng), rng))
    assert len(found) == len(STEMS)
    for circle, (x, y, radius) in zip(found, STEMS, strict=True):
        assert np.hypot(circle.x - x, circle.y - y) < 0.02
        assert circle.radius == pytest.approx(radius, rel=within)


def test_a_circle_passes_through_its_points() -> None:
    turn = np.radians([0.0, 100.0, 200.0])
    found = through(np.column_stack([1000.0 + 0.3 * np.cos(turn), -50.0 + 0.3 * np.sin(turn)]))
    assert found is not None
    assert found[:3] == pytest.approx((1000.0, -50.0, 0.3), abs=1e-9)
    assert through(np.array([(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)])) is None


def written(path: Path, points: np.ndarray, per_m2: float, rng: np.random.Generator) -> Path:
    """A LAZ file of points above a slope, with ground points and a crown over each stem."""
    bare = np.column_stack([rng.uniform(-9.0, 9.0, (int(per_m2 * 324), 2)), np.zeros(int(per_m2 * 324))])
    crowns = []
    for x, y, radius in STEMS[[0, 1, 2, 4]]:
        off = rng.uniform(-1.2, 1.2, (1500, 2))
        top = 6.0 + 30.0 * radius - 1.5 * (off**2).sum(axis=1)
        crowns.append(np.column_stack([off + np.array([x, y]), top]))
    points = np.concatenate([points, *crowns, bare])
    world = points + np.column_stack([np.zeros((len(points), 2)), 0.1 * points[:, 0]])
    latitude, longitude, height = geodetic_from_world(world, PLACE).T
    east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(longitude, latitude)
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = (east.min(), north.min(), 0.0), (0.001, 0.001, 0.001)
    header.add_crs(pyproj.CRS(32632))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = east, north, height
    cloud.return_number = np.ones(len(east), np.uint8)
    cloud.classification = np.where(np.arange(len(east)) >= len(east) - len(bare), 2, 1).astype(np.uint8)
    cloud.write(path)
    return path


def test_trees_of_a_scan_from_the_ground_stand_at_their_stems(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    path = written(tmp_path / "tls.laz", scan(0.003, 360, rng), 30.0, rng)
    config = Config.model_validate({"centre": PLACE[:2], "size": (18, 18), "trees": {"file": str(path)}})
    mapped = read_trees(config, PLACE)
    assert "5 stems seen from the ground" in mapped.notes[0]
    thick = {round(tree.diameter, 2): tree for tree in mapped.trees if tree.diameter is not None}
    found = sorted((tree.x, tree.y, tree.diameter / 2) for tree in mapped.trees if tree.diameter is not None)
    np.testing.assert_allclose(found, STEMS, atol=0.012)
    others = np.array([tree[:2] for tree in mapped.trees if tree.diameter is None]).reshape(-1, 2)
    assert (np.linalg.norm(others[:, None] - STEMS[:, :2], axis=2) > 0.5).all()  # bushes
    assert thick[0.9].height == pytest.approx(6.0 + 30 * 0.45, abs=0.4)
    assert (thick[0.9].x, thick[0.9].y) == pytest.approx((5.0, 3.0), abs=0.02)


def test_a_scan_from_the_air_shows_no_stems(tmp_path: Path) -> None:
    """Neither thinned nor where its canopy is coarse, although the points that are left would show some."""
    rng = np.random.default_rng(5)
    points = scan(0.003, 360, rng)
    few = points[rng.random(len(points)) < 0.09]
    assert find_stems(few, rng)
    assert is_dense(points)
    assert not is_dense(few)
    assert read_stems(written(tmp_path / "als.laz", few, 4.0, rng), PLACE, (18.0, 18.0)) == []
    path = written(tmp_path / "tls.laz", points, 4.0, rng)
    coarse = Canopy(path, np.zeros((9, 9), np.float32), np.array([(2.0, 0, -9), (0, 2.0, -9)]), (18, 18))
    assert read_stems(path, PLACE, (18.0, 18.0), canopy=coarse) == []


@pytest.mark.slow
def test_stems_are_found_in_undergrowth() -> None:
    """All of a plot is one cluster then, of which three points at random are hardly ever of one stem."""
    rng = np.random.default_rng(2)
    at = np.stack(np.meshgrid([-1.25, 1.25], [-1.25, 1.25]), axis=-1).reshape(-1, 2)
    turn, height = rng.uniform(0, 2 * np.pi, (4, 600)), rng.uniform(1.0, 2.2, (4, 600))
    stems = np.stack([at[:, :1] + 0.12 * np.cos(turn), at[:, 1:] + 0.12 * np.sin(turn), height], axis=-1)
    low = np.column_stack([rng.uniform(-2.5, 2.5, (300 * 25, 2)), rng.uniform(1.0, 1.6, 300 * 25)])
    low = low[np.linalg.norm(low[:, None, :2] - at, axis=2).min(axis=1) > 0.15]  # stems hide it
    found = find_stems(np.concatenate([stems.reshape(-1, 3), low]), rng)
    away = np.linalg.norm(np.array([circle[:2] for circle in found])[:, None] - at, axis=2)
    assert (away.min(axis=0) < 0.03).all()
    assert (away.min(axis=1) < 0.03).all()


def test_half_a_ring_in_one_slice_is_no_stem() -> None:
    rng = np.random.default_rng(3)
    turn, height = rng.uniform(0.0, np.pi, 400), rng.uniform(1.0, 2.2, 400)
    half = np.column_stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), height])
    assert len(find_stems(half, rng)) == 1
    assert find_stems(half[half[:, 2] < 1.6], rng) == []


def test_each_stem_has_one_tree() -> None:
    """Of two below a crown the nearer one that is thick enough bears it; others are as high as the canopy there."""
    heights = np.full((40, 60), 7.0, np.float32)
    heights[22, 27] = 9.0  # at x = 2, y = -3
    canopy = Canopy(Path("a.tif"), heights, np.array([(1.0, 0, -20), (0, 1.0, -30)]), (40, 60))
    tops = [Tree(1.0, -3.0, 15.0, 2.0, None, None), Tree(10.0, 0.0, 12.0, 2.0, None, None)]
    made = with_stems(tops, [Circle(2.1, -2.9, 0.1), Circle(0.5, -2.8, 0.2), Circle(0.9, -3.0, 0.03)], canopy)
    assert made[:2] == [Tree(0.5, -2.8, 15.0, 2.0, 0.4, None), tops[1]]
    assert [tree[:3] for tree in made[2:]] == [(2.1, -2.9, 9.0), (0.9, -3.0, 7.0)]
    assert made[2].crown_radius == pytest.approx(0.11 * 9.0)
