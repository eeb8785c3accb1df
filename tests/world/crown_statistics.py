# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Readings of a LiDAR in a single crown: pulses that pass, range jumps between neighbours, leaf area by height."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.kernels.camera_rays import Intrinsics, View, new_batch, trace
from fieldtruth.kernels.packets import new_packet
from fieldtruth.sense.embree import Engine, RayScene
from fieldtruth.world.model import Mesh
from fieldtruth.world.plants.trees import FOLIAGE

SENSOR_HEIGHT = 0.85  # [m]
BETWEEN_COLUMNS = 2 * np.pi / 2048  # [rad]: the real scanner's finest
BETWEEN_RINGS = np.radians(45 / 63)
JUMP = 0.5  # [m]
FAR = 200.0  # [m]


@dataclass(frozen=True)
class CrownStatistics:
    """Statistics of the pulses towards a crown, that is, into the convex hull of its leaves."""

    passing: float  # share of the pulses that pass through
    jumps: float  # share of neighbouring returns in a ring whose ranges differ by more than JUMP
    median_jump: float  # [m]
    high_jump: float  # [m] 90th percentile
    height: float  # [m] mean of the returns


def leaf_corners(mesh: Mesh) -> Array:
    """Corners (m, 3, 3) [m] of the leaves' triangles."""
    return np.asarray(mesh.vertices[mesh.faces[mesh.material == FOLIAGE]].astype(np.float64))


def leaf_area(mesh: Mesh) -> Array:
    """Area (m,) [m2] of each of the leaves' triangles, one side."""
    corner = leaf_corners(mesh)
    return np.asarray(0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1))


def leaf_profile(mesh: Mesh, edges: Array) -> Array:
    """Leaf area [m2] between heights ``edges`` (k + 1,) [m]."""
    return np.asarray(np.histogram(leaf_corners(mesh)[..., 2].mean(1), edges, weights=leaf_area(mesh))[0])


def with_needles(mesh: Mesh, length: float, width: float, rng: np.random.Generator) -> Mesh:
    """The crown with each triangle of its sprays replaced by needles of the same area (`length`, `width` [m]).

    Needles stand all around the triangle's axis, 50 deg from it towards the tip; each is a triangle itself.
    """
    corner, area = leaf_corners(mesh), leaf_area(mesh)
    count = np.floor(area / (length * width) + rng.random(len(area))).astype(np.intp)
    row = np.repeat(np.arange(len(area)), count)
    foot = 0.5 * (corner[row, 0] + corner[row, 1])
    along = corner[row, 2] - foot
    base = foot + rng.random(len(row))[:, None] * along
    axis = along / np.linalg.norm(along, axis=1, keepdims=True)
    side = _across(axis, rng)
    needle = np.cos(np.radians(50)) * axis + np.sin(np.radians(50)) * side
    half = width * _across(needle, rng)
    points = np.stack([base + half, base - half, base + length * needle], 1).reshape(-1, 3)
    wood = mesh.material != FOLIAGE
    new = np.arange(len(points)).reshape(-1, 3) + len(mesh.vertices)
    return replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, points]).astype(np.float32),
        faces=np.concatenate([mesh.faces[wood], new]).astype(np.int32),
        material=np.concatenate([mesh.material[wood], np.full(len(new), FOLIAGE)]).astype(np.int32),
    )


def _across(axis: Array, rng: np.random.Generator) -> Array:
    """Random unit vectors (n, 3) at right angles to unit vectors (n, 3)."""
    free = np.cross(axis, rng.normal(size=axis.shape))
    return np.asarray(free / np.linalg.norm(free, axis=1, keepdims=True))


def crown_statistics(mesh: Mesh, hull_of: Mesh, distance: float, views: int = 4) -> CrownStatistics:
    """Statistics from ``distance`` [m] beside the trunk, from ``views`` sides, of pulses into another crown's hull."""
    engine = Engine()
    crown, hull = RayScene(engine), RayScene(engine)
    crown.add_mesh(mesh.vertices, mesh.faces)
    points = leaf_corners(hull_of).reshape(-1, 3)
    outside = ConvexHull(points)
    hull.add_mesh(points, outside.simplices)
    crown.commit()
    hull.commit()
    into, returns, ranges, heights = [], [], [], []
    for azimuth in 2 * np.pi * (np.arange(views) + 0.25) / views:
        pose, rays = _aimed(azimuth, distance, points[outside.vertices])
        _, inside = _ranges(hull, pose, rays)
        range_m, hit = _ranges(crown, pose, rays)
        into.append(inside)
        returns.append(inside & hit)
        both = returns[-1][:, 1:] & returns[-1][:, :-1]
        ranges.append(np.abs(np.diff(range_m, axis=1))[both])
        heights.append((pose[2, 3] + range_m * (rays @ pose[2, :3]))[returns[-1]])
    jump = np.concatenate(ranges)
    return CrownStatistics(
        passing=1 - sum(np.sum(r) for r in returns) / sum(np.sum(i) for i in into),
        jumps=float((jump > JUMP).mean()),
        median_jump=float(np.median(jump)),
        high_jump=float(np.quantile(jump, 0.9)),
        height=float(np.concatenate(heights).mean()),
    )


def _aimed(azimuth: float, distance: float, corners: Array) -> tuple[Array, Array]:
    """Pose (4, 4) that looks at the middle of the corners, and rays (rings, columns, 3) in it that cover them."""
    eye = np.array([distance * np.cos(azimuth), distance * np.sin(azimuth), SENSOR_HEIGHT])
    forward = corners.mean(0) - eye
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3] = np.stack([right, np.cross(forward, right), forward, eye], 1)
    to = corners - eye
    turn = np.arctan2(to @ right, to @ np.cross([0, 0, 1], right) * -1)
    rise = np.arctan2(to[:, 2], np.hypot(to[:, 0], to[:, 1]))
    columns = np.arange(turn.min(), turn.max(), BETWEEN_COLUMNS)
    rings = np.arange(rise.max(), rise.min(), -BETWEEN_RINGS)[:, None]
    ahead = np.array([-np.cos(azimuth), -np.sin(azimuth), 0.0])
    world = np.cos(rings)[..., None] * (np.cos(columns)[:, None] * ahead + np.sin(columns)[:, None] * right)
    world = world + np.sin(rings)[..., None] * np.array([0, 0, 1.0])
    return pose, world @ pose[:3, :3]


def _ranges(scene: RayScene, pose: Array, rays: Array) -> tuple[Array, Mask]:
    """Ranges [m] along rays (rings, columns, 3) of the pose's frame, and whether they hit."""
    count = rays.shape[0] * rays.shape[1]
    batch = new_batch(count)
    flat = rays.reshape(-1, 3)
    batch.image[:, :count] = (flat[:, :2] / flat[:, 2:]).T
    view = View(pose, Intrinsics(1.0, 1.0, 0.0, 0.0), FAR)
    trace(scene.alone, np.zeros(1, np.int32), new_packet(coherent=False), view, batch, count)
    distance = batch.distance[:count].astype(np.float64).reshape(rays.shape[:2])
    return distance, distance < 0.99 * FAR
