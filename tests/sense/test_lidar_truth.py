# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ranges in closed form: plane, box, sphere; tilted and spinning sensors; directions of rings and columns."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from sense_worlds import BOX_CORNERS, BOX_FACES, F8, Placed, at, box, floating, make_mesh, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.classes import Label
from fieldtruth.kernels.lidar import Scan
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, ray_directions

TOLERANCE = 1e-4  # [m]


def grid(scan: Scan, config: LidarConfig) -> F8:
    """Ranges (columns, rings), 0 for no return."""
    ranges = np.zeros((config.columns, config.rings))
    ranges[scan.column, scan.ring] = scan.range_m
    return ranges


def room(x: float, y: float, z: float) -> Scene:
    """A closed room about the origin with half edge lengths [m]."""
    return floating((box("room", (x, y, z)), at(0, 0, 0)))


def to_box(origin: F8, direction: F8, half: F8) -> F8:
    """Distance from inside a box to its wall along unit directions (..., 3)."""
    direction = np.where(np.abs(direction) < 1e-300, 1e-300, direction)
    return np.asarray(((np.sign(direction) * half - origin) / direction).min(axis=-1))


def rotation(roll: float, pitch: float, yaw: float) -> F8:
    """Rotation about fixed axes [deg], written out: first about x, then y, then z."""
    r, p, w = np.radians([roll, pitch, yaw])
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(w), -np.sin(w), 0], [np.sin(w), np.cos(w), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


@pytest.fixture(scope="module")
def plane() -> Scene:
    return Scene(make_world(side=80.0))


def test_ranges_above_a_plane_match_closed_form(plane: Scene) -> None:
    config, height = LidarConfig(max_range=30.0), 1.2
    scan = IdealLidar(config, plane).scan(at(3, -2, height))
    elevation = np.radians(22.5 - 45.0 * np.arange(64) / 63)
    with np.errstate(divide="ignore"):
        expected = np.where(elevation < 0, height / np.sin(-elevation), np.inf)
    expected = np.where(expected < 30.0, expected, 0.0)
    assert np.count_nonzero(expected) == 29
    assert grid(scan, config) == pytest.approx(np.tile(expected, (512, 1)), abs=TOLERANCE)
    assert scan.xyz[:, 2] == pytest.approx(-height, abs=TOLERANCE)
    assert set(scan.label) == {Label.GROUND}
    assert set(scan.instance) == {1}


@pytest.mark.parametrize(
    ("roll", "pitch", "yaw", "column"),
    [(0, 10, 0, 0), (0, -10, 0, 32), (10, 0, 0, 16), (-10, 0, 0, 48), (0, 10, 90, 0), (10, 0, -90, 16)],
)
def test_tilted_ring_hits_ground_on_its_low_side(
    plane: Scene, roll: float, pitch: float, yaw: float, column: int
) -> None:
    """Pitch > 0 lowers the front, roll > 0 the right side; yaw changes neither."""
    config = LidarConfig(columns=64, rings=1)
    scan = IdealLidar(config, plane).scan(transforms.pose((0, 0, 1), (roll, pitch, yaw)))
    ranges = grid(scan, config)[:, 0]
    assert ranges[column] == pytest.approx(1.0 / np.sin(np.radians(10)), abs=TOLERANCE)
    assert ranges[(column + 32) % 64] == 0.0
    assert np.argmin(np.where(ranges > 0, ranges, np.inf)) == column


def test_ranges_of_a_tilted_scanner_match_closed_form(plane: Scene) -> None:
    config = LidarConfig(columns=128, rings=32, max_range=25.0)
    scan = IdealLidar(config, plane).scan(transforms.pose((1, 2, 1.5), (7, -13, 40)))
    down = -(ray_directions(config) @ rotation(7, -13, 40).T)[..., 2]
    expected = np.where(down > 1e-9, 1.5 / np.maximum(down, 1e-9), np.inf)
    certain = np.abs(expected - 25.0) > 1e-3
    expected = np.where(expected < 25.0, expected, 0.0)
    assert np.count_nonzero(expected) > 1000
    assert grid(scan, config)[certain] == pytest.approx(expected[certain], abs=TOLERANCE)


def test_ranges_on_sloping_ground_match_closed_form() -> None:
    """Ground z = 0.1 x + 0.2 y, where both triangles of each cell are coplanar."""
    scene = Scene(make_world(height=lambda x, y: 0.1 * x + 0.2 * y, side=80.0))
    config, origin = LidarConfig(columns=128, rings=32, max_range=20.0), np.array([1.0, 2.0, 2.0])
    scan = IdealLidar(config, scene).scan(at(*origin))
    closing = ray_directions(config) @ [0.1, 0.2, -1.0]
    expected = np.where(closing > 1e-9, (2.0 - 0.1 - 0.4) / np.maximum(closing, 1e-9), np.inf)
    certain = np.abs(expected - 20.0) > 1e-3
    assert grid(scan, config)[certain] == pytest.approx(
        np.where(expected < 20.0, expected, 0.0)[certain], abs=TOLERANCE
    )


def test_cells_are_split_along_the_diagonal_from_the_low_corner() -> None:
    """One cell of 40 m with a raised corner: only the triangle with that corner is raised."""
    world = make_world(side=40.0, spacing=40.0)
    heights = np.array([[0.0, 3.0], [0.0, 0.0]], np.float32)  # only the node of least x and greatest y is raised
    terrain = replace(world.terrain, field=replace(world.terrain.field, heights=heights))
    scene = Scene(replace(world, terrain=terrain))
    config = LidarConfig(columns=8, rings=1)
    for x, y, height in ((-10.0, 10.0, 3.0 * 0.5), (10.0, -10.0, 0.0), (5.0, 5.001, 0.0), (-19.0, 19.0, 3.0 * 0.95)):
        scan = IdealLidar(config, scene).scan(transforms.pose((x, y, 10), (0, 90, 0)))
        assert scan.column[0] == 0
        assert scan.range_m[0] == pytest.approx(10.0 - height, abs=1e-3 if y == 5.001 else TOLERANCE)


def test_ranges_inside_a_box_match_closed_form() -> None:
    config, origin = LidarConfig(), np.array([1.0, -2.0, 0.5])
    for rpy in ((0.0, 0.0, 0.0), (12.0, 34.0, 56.0)):
        scan = IdealLidar(config, room(5, 4, 3)).scan(transforms.pose(origin.tolist(), rpy))
        directions = ray_directions(config) @ rotation(*rpy).T
        assert grid(scan, config) == pytest.approx(to_box(origin, directions, np.array([5.0, 4.0, 3.0])), abs=TOLERANCE)


def test_ranges_of_a_rotated_and_scaled_instance_match_closed_form() -> None:
    """A room scaled by 4 and rotated about all axes, with rays transformed to its frame by hand."""
    half, position, scale = np.array([1.5, 1.0, 0.7]), np.array([20.0, -7.0, 3.0]), 4.0
    turned = rotation(20, -35, 70)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = scale * turned, position
    config, origin = LidarConfig(columns=128, rings=32), np.array([21.0, -8.0, 3.5])
    scan = IdealLidar(config, floating((box("room", half.tolist()), pose))).scan(at(*origin))
    expected = to_box((origin - position) @ turned, ray_directions(config) @ turned, scale * half)
    assert grid(scan, config) == pytest.approx(expected, abs=TOLERANCE)
    assert set(scan.instance) == {2}


def test_ranges_of_a_sphere_are_between_those_of_its_inner_and_outer_radius() -> None:
    """A sphere of 20,480 facets is between the spheres through its facets' centres and its vertices, 1.3 mm apart."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=2.0)
    inner = float(np.abs(np.einsum("ij,ij->i", ball.face_normals, ball.triangles[:, 0])).min())
    assert 2.0 - inner < 1.3e-3
    centre = np.array([4.0, 3.0, 0.2])
    scene = floating((make_mesh("ball", ball.vertices, ball.faces), at(*centre)))
    config = LidarConfig(columns=512, rings=64)
    ranges = grid(IdealLidar(config, scene).scan(at(0, 0, 0)), config)
    along = ray_directions(config) @ centre
    passing = np.sqrt(centre @ centre - along**2)  # distance of each ray's line from the centre
    hit, miss = (along > 0) & (passing < inner - 1e-6), (along < 0) | (passing > 2.0 + 1e-6)
    assert np.count_nonzero(hit) > 1500
    assert np.all(ranges[hit] > 0)
    assert np.all(ranges[miss] == 0)
    nearest = along[hit] - np.sqrt(4.0 - passing[hit] ** 2)
    farthest = along[hit] - np.sqrt(inner**2 - passing[hit] ** 2)
    assert np.all(ranges[hit] > nearest - TOLERANCE)
    assert np.all(ranges[hit] < farthest + TOLERANCE)


def test_directions_of_rings_and_columns() -> None:
    config = LidarConfig()
    scan = IdealLidar(config, room(9, 9, 9)).scan(np.eye(4))
    assert len(scan.xyz) == 512 * 64
    x, y, z = scan.xyz.astype(np.float64).T
    elevation, azimuth = np.degrees(np.arctan2(z, np.hypot(x, y))), np.degrees(np.arctan2(y, x))
    assert elevation[scan.ring == 0] == pytest.approx(22.5, abs=1e-4)
    assert elevation[scan.ring == 63] == pytest.approx(-22.5, abs=1e-4)
    assert elevation[scan.ring == 1] == pytest.approx(22.5 - 45 / 63, abs=1e-4)
    assert azimuth[scan.column == 0] == pytest.approx(0.0, abs=1e-4)
    assert azimuth[scan.column == 1] == pytest.approx(-360 / 512, abs=1e-4)
    assert azimuth[scan.column == 128] == pytest.approx(-90.0, abs=1e-4)  # to the right
    assert azimuth[scan.column == 511] == pytest.approx(360 / 512, abs=1e-4)
    order = scan.column.astype(int) * 64 + scan.ring
    assert np.all(np.diff(order) > 0)


def test_sizes_that_no_packet_divides_have_no_gaps() -> None:
    """The last packets are only partly filled; a single ring is horizontal."""
    config = LidarConfig(columns=13, rings=7, vertical_fov_deg=30.0)
    scan = IdealLidar(config, room(3, 3, 3)).scan(np.eye(4))
    assert grid(scan, config) == pytest.approx(
        to_box(np.zeros(3), ray_directions(config), np.full(3, 3.0)), abs=TOLERANCE
    )
    assert ray_directions(LidarConfig(rings=1))[0, 0] == pytest.approx([1, 0, 0])


def test_points_are_directions_times_ranges() -> None:
    config = LidarConfig()
    scan = IdealLidar(config, room(7, 5, 3)).scan(transforms.pose((1, 1, 1), (5, 6, 7)))
    expected = ray_directions(config)[scan.column, scan.ring] * scan.range_m[:, None]
    assert scan.xyz == pytest.approx(expected, abs=1e-6)
    kinds = {"xyz": "f4", "range_m": "f4", "label": "u1", "instance": "u4", "ring": "u2", "column": "u2", "t_ns": "u4"}
    assert all(getattr(scan, name).dtype == np.dtype(kind) for name, kind in kinds.items())
    assert np.all(scan.t_ns == 0)


def test_spinning_scan_reports_points_in_the_frame_of_their_column() -> None:
    """The sensor moves 0.4 m and 20 deg in one revolution; with their column's pose, points are on the walls."""
    config, half = LidarConfig(spinning=True), np.array([5.0, 4.0, 3.0])
    poses = np.stack([transforms.pose((0.4 * k / 512, -0.1, 0.2), (0, 3, 20 * k / 512)) for k in range(513)])
    scan = IdealLidar(config, room(*half)).scan(poses)
    expected = np.stack(
        [to_box(p[:3, 3], d @ p[:3, :3].T, half) for p, d in zip(poses[:-1], ray_directions(config), strict=True)]
    )
    assert grid(scan, config) == pytest.approx(expected, abs=TOLERANCE)
    own = poses[scan.column]
    world = np.einsum("nij,nj->ni", own[:, :3, :3], scan.xyz.astype(np.float64)) + own[:, :3, 3]
    assert (half - np.abs(world)).min(axis=1) == pytest.approx(0.0, abs=TOLERANCE)
    assert np.array_equal(scan.t_ns, np.rint(scan.column * (1e8 / 512)).astype(np.uint32))
    assert scan.t_ns.max() == round(511 / 512 * 1e8)


def wall(x: float, material: str = "stone") -> Placed:
    """A piece of wall that only the ray straight ahead hits."""
    y = 0.4 * x
    return quad(f"{material}_{x}", [[x, -y, -y], [x, y, -y], [x, y, y], [x, -y, y]], material), at(0, 0, 0)


def ahead(scene: Scene, **limits: float) -> Scan:
    config = LidarConfig.model_validate({"columns": 8, "rings": 1, **limits})
    return IdealLidar(config, scene).scan(np.eye(4))


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"min_range": 0.0}, [0.2]),
        ({"min_range": 0.19}, [0.2]),
        ({"min_range": 0.3}, []),  # too near for a return, but it occludes the wall at 2 m
        ({"min_range": 0.0, "max_range": 0.19}, []),
    ],
)
def test_surface_nearer_than_min_range_occludes(limits: dict[str, float], expected: list[float]) -> None:
    scene = floating(wall(0.2), wall(2.0))
    assert ahead(scene, **limits).range_m == pytest.approx(expected, abs=1e-6)


def test_max_range() -> None:
    scene = floating(wall(2.0))
    assert len(ahead(scene, max_range=1.9999).range_m) == 0
    assert ahead(scene, max_range=2.0001).range_m == pytest.approx([2.0], abs=1e-6)


def test_water_returns_no_pulse_and_occludes() -> None:
    scene = floating(wall(1.0, "water"), wall(2.0))
    assert len(ahead(scene).range_m) == 0
    assert len(ahead(floating(wall(2.0))).range_m) == 1


def test_box_of_the_tests_is_closed() -> None:
    """Six sides of two triangles: a hole could hide an error."""
    assert len(BOX_FACES) == 12
    assert trimesh.Trimesh(BOX_CORNERS, BOX_FACES, process=False).volume == pytest.approx(8.0)
