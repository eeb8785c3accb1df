# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks against exact truth: elevation below plants, and diameters of stems, in worlds of known measures."""

import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import elevation
import numpy as np
import places
import pytest
import stems
import trimesh
from drives import Drive, Scan, score
from elevation import COVERS, grid_around, lowest, mean, truth_of, within_reach
from stems import METHODS, Stem, seen_in, seen_share, stems_of, wood_of

import fieldtruth as ft
from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.interchange.inventory import BREAST_HEIGHT, Section, moved, trunk_section
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import Grid

HIGH = 0.4
"""Height [m] of the high grass."""
DIAMETER = 0.36
SIDES = 256


def scanned(world: World, *places: tuple[float, float, float], columns: int = 256) -> Drive:
    """Scans of an ideal LiDAR at places [m]."""
    poses = np.array([transforms.pose(place) for place in places])
    lidar = ft.Lidar(ft.LidarConfig(columns=columns, parts=True), ft.Scene(world))
    scans = []
    for pose in poses:
        scan = lidar.scan(pose)
        scans.append(Scan(transforms.transform(pose, scan.xyz), scan.label, scan.instance, scan.part))
    return Drive(world, scans, poses)


def meadow() -> World:
    """Flat ground with a block of high grass, 4 m x 2 m."""
    block = trimesh.creation.box((4.0, 2.0, HIGH), transforms.pose((3.0, 2.0, HIGH / 2)))
    return World.from_meshes([ft.MeshPart((block.vertices, block.faces), label="high grass")], ground=0.0)


def trunk(world_from_trunk: Array) -> World:
    """Trunk of known diameter, 3 m high, on flat ground."""
    mesh = trimesh.creation.cylinder(DIAMETER / 2, 3.0, SIDES, transform=world_from_trunk)
    return World.from_meshes([ft.MeshPart((mesh.vertices, mesh.faces), label="trunk and branch")], ground=0.0)


def test_elevation_above_a_block_of_grass_is_too_high_by_its_height() -> None:
    drive = scanned(meadow(), (0.0, 0.0, 1.5), (3.0, 0.5, 1.5))
    grid = grid_around(drive)
    truth, scored = truth_of(drive.world, grid), within_reach(drive, grid)
    block, bare = (scored & (truth.cover == COVERS.index(name)) for name in ("high grass", "bare"))
    assert block.sum() == pytest.approx(4 * 2 / 0.2**2, abs=30)
    assert np.median(truth.height[block]) == pytest.approx(HIGH, abs=1e-6)
    x, y = grid.middles(slice(0, grid.shape[0]), slice(0, grid.shape[1]))
    inner = block & (np.abs(x - 3.0) < 1.7)[:, None] & (np.abs(y - 2.0) < 0.7)
    away = bare & ~((np.abs(x - 3.0) < 2.3)[:, None] & (np.abs(y - 2.0) < 1.3))
    clouds = [scan.points for scan in drive.scans]
    for method in (lowest, mean):
        error = method(clouds, drive.poses, grid) - truth.ground
        assert score(error[inner]).bias == pytest.approx(HIGH, abs=1e-4)
        assert score(error[away]).p95 < 1e-4
    assert 0 < score(error[scored]).share < 100  # the block hides ground behind it


def test_sparse_grass_lifts_the_mean_by_its_share_and_the_lowest_point_not_at_all() -> None:
    """A quarter of the points of each cell is 0.8 m high; crowns above the ceiling do not count in the mean."""
    grid = Grid(0.0, 0.0, 0.2, (10, 5))
    x, y = (part.ravel() for part in np.meshgrid(np.arange(0.025, 2, 0.05), np.arange(0.025, 1, 0.05), indexing="ij"))
    z = np.where((np.arange(len(x)) % 4) == 0, 0.8, 0.0)
    crown = np.column_stack([x, y, np.full_like(x, 6.0)])
    points = np.concatenate([np.column_stack([x, y, z]), crown])
    poses = transforms.pose((1.0, 0.5, 1.0))[None]
    np.testing.assert_allclose(mean([points], poses, grid), 0.2, atol=1e-9)
    np.testing.assert_array_equal(lowest([points], poses, grid), 0.0)
    nothing = lowest([points[points[:, 0] > 1.0]], poses, grid)
    assert np.isnan(nothing[:5]).all()
    assert np.isfinite(nothing[5:]).all()


def test_figures_of_errors() -> None:
    assert score(np.array([0.3, -0.1, 0.1, np.nan])) == pytest.approx((75.0, 0.1, 0.1, np.sqrt(0.11 / 3), 0.28))
    assert score(np.array([np.nan, np.nan])).share == 0.0


def test_circles_of_a_trunk_that_one_scan_sees_have_its_diameter() -> None:
    """Ranges are exact, so that only the sides of the polygon are left."""
    world = trunk(transforms.pose((4.0, 1.0, 1.5)))
    drive = scanned(world, (0.0, 0.0, 1.3), columns=2048)
    (mesh,), (instance,) = world.meshes.values(), world.instances
    wood = moved(instance.world_from_object, wood_of(world, mesh))
    section = trunk_section(wood, BREAST_HEIGHT, np.array([4.0, 1.0]))
    assert section is not None
    assert section == pytest.approx((4.0, 1.0, DIAMETER), abs=1e-4)
    stem = Stem(instance.object_id, 0.0, section)
    (found,) = seen_in([stem], drive.scans[0], drive.poses, METHODS, branches=True)  # own objects have no parts
    assert found.distance == pytest.approx(np.hypot(4.0, 1.0))
    half = np.arccos(DIAMETER / 2 / found.distance) / np.pi
    assert half - 0.12 < found.share <= half  # columns are 13 mm apart, so that the last ones miss up to 22 deg
    assert found.points > 100
    for method, error in found.errors.items():
        assert abs(error) < 1e-3, method
    assert not list(stems_of(drive))  # it is no tree of the library


def test_a_diameter_that_is_too_large_is_a_positive_error() -> None:
    stem = Stem(2, 0.0, Section(0.0, 0.0, 0.30))
    angle = np.linspace(0.0, np.pi, 60)
    points = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), np.full(60, BREAST_HEIGHT)])
    scan = Scan(points, np.full(60, ft.Label.TRUNK), np.full(60, 2), np.full(60, ft.PlantPart.STEM))
    (found,) = seen_in([stem], scan, transforms.pose((0.0, 3.0, 1.0))[None], METHODS)
    assert found.errors == pytest.approx({"algebraic": 0.1, "geometric": 0.1, "consensus": 0.1}, abs=1e-6)
    with_branch = Scan(*(np.concatenate([part, part]) for part in scan))
    with_branch.points[60:, :2] *= 3.0
    with_branch.part[60:] = ft.PlantPart.BRANCH
    (same,) = seen_in([stem], with_branch, transforms.pose((0.0, 3.0, 1.0))[None], METHODS)
    assert same == found
    (with_branches,) = seen_in([stem], with_branch, transforms.pose((0.0, 3.0, 1.0))[None], METHODS, branches=True)
    assert with_branches.points == 120
    (hidden,) = seen_in([stem], scan._replace(instance=np.full(60, 3)), transforms.pose((0.0, 3.0, 1.0))[None], METHODS)
    assert (hidden.points, hidden.share) == (0, 0.0)
    assert np.isnan(list(hidden.errors.values())).all()


def test_noise_makes_algebraic_circles_of_short_arcs_too_small() -> None:
    """As known of Kåsa's fit; that of least distances is right in the median."""
    rng = np.random.default_rng(3)
    found: dict[str, list[float]] = {name: [] for name in METHODS}
    for _ in range(40):
        angle, range_ = rng.uniform(0.0, np.radians(100.0), 80), DIAMETER / 2 + rng.normal(0.0, 0.01, 80)
        points = range_[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        for name, method in METHODS.items():
            circle = method(points)
            assert circle is not None
            found[name].append(2 * circle[2] - DIAMETER)
    assert np.median(found["algebraic"]) < -0.02
    assert abs(np.median(found["geometric"])) < 0.01


def test_a_branch_pulls_circles_of_all_points_and_not_that_of_the_most() -> None:
    angle = np.linspace(0.0, np.pi, 60)
    stem = DIAMETER / 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    branch = np.column_stack([np.linspace(0.2, 1.2, 20), np.full(20, 0.1)])
    errors = {
        name: 2 * circle[2] - DIAMETER
        for name, method in METHODS.items()
        if (circle := method(np.concatenate([stem, branch]))) is not None
    }
    assert abs(errors["consensus"]) < 0.005
    assert errors["algebraic"] > 0.05


@pytest.mark.parametrize(("degrees", "share"), [([0.0, 20.0, 40.0], 1 / 9), ([0.0, 90.0], 0.0), (range(0, 360, 15), 1)])
def test_share_of_the_turn_that_was_seen(degrees: Sequence[float], share: float) -> None:
    angle = np.radians(np.array(degrees, np.float64))
    points = np.column_stack([2.0 + np.cos(angle), 1.0 + np.sin(angle)])
    assert seen_share(points, (2.0, 1.0)) == pytest.approx(share)


@pytest.mark.parametrize("benchmark", [elevation, stems, places])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--method", "nowhere:fit"], "method nowhere:fit: ModuleNotFoundError: No module named"),
        (["--method", "math:fit"], "method math:fit: AttributeError: module 'math' has no"),
        (["--signal", "some"], "argument --signal: invalid choice: 'some'"),
        (["--envs", "nowhere"], "unknown environment 'nowhere'"),
    ],
)
def test_a_mistake_is_one_line(
    benchmark: ModuleType,
    arguments: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmark", *arguments])
    with pytest.raises(SystemExit) as ended:
        benchmark.main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("benchmark", "arguments", "message"),
    [
        (stems, ["--seconds", "1"], "argument --seconds: must be 2 to 3600, got 1"),
        (places, ["--count", "0"], "argument --count: must be 1 to 10000, got 0"),
        (places, ["--aside", "0"], "argument --aside: must be 0.1 to 1000, got 0"),
    ],
)
def test_numbers_that_are_not_allowed(
    benchmark: ModuleType,
    arguments: list[str],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    test_a_mistake_is_one_line(benchmark, arguments, message, monkeypatch, capsys)


def test_scan_context_finds_a_turned_scan_and_not_another_place() -> None:
    """Towers at random places: a scan that is turned by 18 deg, three sectors, is the same; others are not."""
    rng = np.random.default_rng(5)

    def towers() -> Array:
        turn, distance, height = rng.uniform(0, 2 * np.pi, 300), rng.uniform(1, 39, 300), rng.uniform(-1, 8, 300)
        return np.column_stack([distance * np.cos(turn), distance * np.sin(turn), height])

    database = [towers() for _ in range(5)]
    turned = [transforms.transform(transforms.pose((0, 0, 0), (0, 0, 18.0)), cloud) for cloud in database]
    found = places.scan_context(turned, database)
    np.testing.assert_allclose(np.diag(found), 0.0, atol=1e-9)
    assert (found + np.eye(5)).min() > 0.2


def test_recall_counts_queries_with_a_near_frame() -> None:
    """The first match is 2.9 m away, the second 3.1 m where another is nearer, the third query has no near frame."""
    distance = np.array([[2.9, 50.0], [1.0, 3.1], [9.0, 9.0]])
    dissimilarity = np.array([[0.1, 0.5], [0.6, 0.2], [0.1, 0.2]])
    assert places.recall(dissimilarity, distance) == (2, 50.0, 50.0)


def test_recall_is_split_by_the_nearest_frame() -> None:
    distance = np.array([[0.5, 9.0, 9.0], [8.0, 1.5, 9.0], [9.0, 2.5, 9.0], [9.0, 9.0, 9.0]])
    dissimilarity = np.array([[0.1, 0.2, 0.3], [0.1, 0.2, 0.3], [0.3, 0.1, 0.2], [0.2, 0.3, 0.1]])
    found = places.by_nearest(dissimilarity, distance)
    assert {name: each.recall for name, each in found.items()} == pytest.approx(
        {"0 to 1": 100.0, "1 to 2": 0.0, "2 to 3": 100.0, "all": 200 / 3}
    )
    assert found["all"] == pytest.approx((3, 200 / 3, 100 / 3))


def test_heights_of_another_shape_are_refused_with_the_method() -> None:
    grid = Grid(0.0, 0.0, 0.2, (3, 4))
    with pytest.raises(
        ConfigurationError, match=r"method mine\.py:f must return heights of shape \(3, 4\), got \(4,\)"
    ):
        elevation.heights_of("mine.py:f", np.zeros(4), grid)
    np.testing.assert_array_equal(elevation.heights_of("mine.py:f", [[1] * 4] * 3, grid), np.ones((3, 4)))


def test_places_of_runs_are_scored_by_season_and_direction() -> None:
    def place(season: str, *x: float) -> places.Place:
        return places.Place(season, np.array([transforms.pose((each, 0, 0)) for each in x]), [np.full((1, 3), x[0])])

    there, autumn, back = place("summer", 0, 10, 20), place("autumn", 0, 10, 20), place("summer", 20, 10, 0)

    def method(queries: Sequence[Array], database: Sequence[Array]) -> Array:
        return 1.0 - np.eye(3)  # the match is the frame of the same number

    found = places.between_runs([there, autumn, back], method)
    assert found["other season", "there"] == pytest.approx((6, 100.0, 100 / 3))
    assert found["same season", "back"] == pytest.approx((6, 100 / 3, 100 / 3))  # the middle one only
    assert found["other season", "back"] == pytest.approx((6, 100 / 3, 100 / 3))


def test_runs_of_places_must_be_an_export(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="must be an export --to wild-places: No such file"):
        places.places_of(tmp_path)
    (tmp_path / "runs.csv").write_text("run,split,environment,seed,season,frames\n")
    with pytest.raises(ConfigurationError, match="two runs at least, got 0"):
        places.places_of(tmp_path)
