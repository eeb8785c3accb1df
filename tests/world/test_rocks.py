# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks are closed bodies of the requested size and triangles, lie in the ground, and fill their colliders."""

import numpy as np
import pytest

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.model import Heightfield, Mesh
from fieldtruth.world.placement import CrowdedWorldError, ObjectGroup, WorldBuilder
from fieldtruth.world.rocks import (
    ROCK_TYPES,
    TEXTURE_LENGTH,
    broken,
    corner_normals,
    geodesic,
    make_rock,
    rim_vertices,
    rock_pose,
    scatter_rocks,
    worn_radius,
)


@pytest.fixture(params=ROCK_TYPES)
def rock(request: pytest.FixtureRequest) -> Mesh:
    return make_rock(ROCK_TYPES[request.param], name="rock", size=1.4, rng=np.random.default_rng(4), triangles=720)


def test_a_piece_that_breaks_off_a_ball_leaves_a_flat_face_on_one_side_of_a_ledge() -> None:
    directions, _ = geodesic(40)
    seen = 0
    for seed in range(12):
        radius = broken(directions, np.ones(len(directions)), 1, np.random.default_rng(seed))
        normal, along = (v / np.linalg.norm(v) for v in np.random.default_rng(seed).normal(0, 1, (2, 3)))
        if normal @ along < 0.2:
            continue  # the ledge may be beyond the face
        seen += 1
        heights = radius * (directions @ normal)
        face = heights[(radius < 1.0) & (directions @ along > 0.4)]
        assert len(face) > 50
        assert np.ptp(face) < 1e-9
        assert 0.62 <= face[0] <= 0.88
        assert (radius[directions @ along < -0.25] == 1.0).all()
        assert radius.max() == 1.0
    assert seen >= 3


def inclined(slope_deg: float) -> Heightfield:
    """A plane of 10 x 10 m that rises along y."""
    y = np.linspace(-5, 5, 51)
    heights = np.broadcast_to(np.tan(np.radians(slope_deg)) * y, (51, 51)).astype(np.float32)
    return Heightfield(heights=heights, spacing=0.2, x0=-5.0, y0=-5.0)


def test_geodesic_vertices_are_on_the_unit_sphere() -> None:
    for frequency in (1, 2, 5):
        directions, faces = geodesic(frequency)
        assert len(faces) == 20 * frequency**2
        assert len(directions) == 10 * frequency**2 + 2  # Euler
        assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
        assert np.all(np.linalg.det(directions[faces]) > 0)  # all face outwards


def test_six_planes_cut_a_cube_whose_corners_wear_off() -> None:
    """Planes at distance 1: radius 1 along the axes, root of 3 to the corners, less for a smaller p of the norm."""
    planes = np.concatenate([np.eye(3), -np.eye(3)])
    directions = np.array([[1.0, 0, 0], [0, -1, 0], np.ones(3) / np.sqrt(3)])
    assert worn_radius(directions, planes, 200.0) == pytest.approx([1, 1, np.sqrt(3)], rel=0.01)
    assert worn_radius(directions, planes, 2.0) == pytest.approx([1, 1, 1])  # the Euclidean norm is a ball


def test_size_triangles_and_class_are_as_requested(rock: Mesh) -> None:
    assert np.ptp(rock.vertices[:, :2], axis=0).max() == pytest.approx(1.4, abs=1e-5)
    assert len(rock.faces) == 720
    assert [MATERIALS[n].label for n in rock.materials] == [Label.ROCK]
    assert np.linalg.norm(rock.normals, axis=1) == pytest.approx(1.0, abs=1e-5)


def test_mesh_is_closed(rock: Mesh) -> None:
    """Every edge belongs to two triangles that traverse it in opposite directions, and the volume is positive."""
    _, joined = np.unique(np.round(rock.vertices, 5), axis=0, return_inverse=True)
    faces = joined.ravel()[rock.faces]
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    forth, back = ({tuple(e) for e in pairs.tolist()} for pairs in (edges, edges[:, ::-1]))
    assert len(forth) == len(edges)
    assert forth == back
    corners = rock.vertices[rock.faces].astype(float)
    assert 0.2 < np.linalg.det(corners).sum() / 6 / np.prod(np.ptp(rock.vertices, axis=0)) < 1.0


def test_part_of_the_rock_is_in_the_ground(rock: Mesh) -> None:
    low, high = float(rock.vertices[:, 2].min()), float(rock.vertices[:, 2].max())
    assert 0.2 - 1e-4 < -low / (high - low) < 0.4 + 1e-4


def test_texture_is_not_stretched(rock: Mesh) -> None:
    """Texture area is at least cos 60 deg of the area on the rock, and at most equal."""
    corners, uv = rock.vertices[rock.faces].astype(float), rock.uv[rock.faces].astype(float) * TEXTURE_LENGTH
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    s, t = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    share = np.abs(s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]) / area
    assert share.max() < 1.01
    assert np.average(share > 0.5, weights=area) > 0.95


def test_collider_encloses_the_visible_part_tightly(rock: Mesh) -> None:
    (collider,) = rock.colliders
    visible = rock.vertices[rock.vertices[:, 2] > 0.0].astype(float) - collider.position
    turn = np.radians(collider.yaw_deg)
    across = visible[:, :2] @ [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    if collider.shape == "box":
        share = np.abs(across) / (np.array(collider.size[:2]) / 2)
    else:
        share = np.linalg.norm(across, axis=1, keepdims=True) / collider.size[0]
    assert 0.75 < share.max() < 1 + 1e-5
    assert visible[:, 2].max() == pytest.approx(collider.size[-1], abs=1e-5)
    assert np.hypot(*rock.vertices[rock.vertices[:, 2] > 0, :2].T).max() <= rock.footprint + 1e-5


def test_normals_are_shared_below_the_crease_angle_only() -> None:
    """Two triangles at 40 deg share a normal for a crease of 50 deg and have their own for one of 30 deg."""
    bend = np.radians(40)
    vertices = np.array([(0, 0, 0), (0, 1, 0), (1, 0, 0), (-np.cos(bend), 0, -np.sin(bend))])
    faces = np.array([(0, 2, 1), (0, 1, 3)])
    for crease, apart in ((50.0, 0.0), (30.0, 40.0)):
        normals = corner_normals(vertices, faces, crease)
        angle = np.degrees(np.arccos(np.clip(normals[0, 0] @ normals[1, 0], -1, 1)))
        assert angle == pytest.approx(apart, abs=1e-4)


@pytest.mark.parametrize("slope_deg", [0.0, 20.0, 35.0])
def test_rim_of_a_rock_on_a_slope_is_in_the_ground(rock: Mesh, slope_deg: float) -> None:
    """The rim is in the ground, the top is not, and the rock is inclined with the slope."""
    field = inclined(slope_deg)
    pose = rock_pose(field, rock, 0.3, -0.4, 1.0, 1.2)
    rim = rim_vertices(rock) @ pose[:3, :3].T + pose[:3, 3]
    assert np.all(rim[:, 2] < field.height_at(rim[:, 0], rim[:, 1]) - 0.02)
    whole = rock.vertices.astype(float) @ pose[:3, :3].T + pose[:3, 3]
    assert (whole[:, 2] - field.height_at(whole[:, 0], whole[:, 1])).max() > 0.15
    lean = np.degrees(np.arccos(pose[2, 2] / 1.2))
    assert lean == pytest.approx(np.degrees(np.arctan(0.75 * np.tan(np.radians(slope_deg)))), abs=0.5)


def test_scattered_rocks_keep_their_distance_and_follow_the_density() -> None:
    builder = WorldBuilder(inclined(10.0), (10.0, 10.0), (), ())
    mesh = make_rock(ROCK_TYPES["scree"], name="r", size=0.4, rng=np.random.default_rng(0), triangles=80)

    def north(positions: Array) -> Array:
        return (positions[:, 0] > 0).astype(float)

    def group(count: int) -> ObjectGroup:
        return ObjectGroup(kind="rock", meshes=[mesh], count=count, scales=(0.85, 1.2), tint=0.08)

    placed = scatter_rocks(builder, group(20), np.random.default_rng(1), north)
    positions = np.array([i.world_from_object[:2, 3] for i in placed])
    assert len(placed) == 20
    assert positions[:, 0].min() > 0
    apart = np.linalg.norm(positions[:, None] - positions, axis=-1) + 9 * np.eye(20)
    assert apart.min() > 2 * 0.85 * mesh.footprint
    with pytest.raises(CrowdedWorldError, match="of 2000 objects of kind rock fit"):
        scatter_rocks(builder, group(2000), np.random.default_rng(1), north)


def test_same_seed_gives_same_rock_and_sizes_out_of_range_are_rejected() -> None:
    first, again, other = (
        make_rock(ROCK_TYPES["granite"], name="r", size=1.0, rng=np.random.default_rng(k)) for k in (1, 1, 2)
    )
    assert np.array_equal(first.vertices, again.vertices)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)
    with pytest.raises(ValueError, match="triangles must be between 80 and 3000, got 79"):
        make_rock(ROCK_TYPES["granite"], name="r", size=1.0, rng=np.random.default_rng(0), triangles=79)
    with pytest.raises(ValueError, match="size must be above 0 m, got 0"):
        make_rock(ROCK_TYPES["granite"], name="r", size=0, rng=np.random.default_rng(0))
