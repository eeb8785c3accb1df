# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Obstacles in plan view: convex outlines of colliders at the robot's height and of high stones, and distances."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array
from fieldtruth.core.transforms import pose, transform
from fieldtruth.drive.bearing import HardSurface, hard_surfaces
from fieldtruth.drive.robot import body_boxes
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import Collider, Heightfield, World

MAX_HEIGHT: Final = 1.2  # [m] above the ground; the mast of the paper's rig ends below
_HUSKY: Final = RobotConfig()
_CIRCLE_CORNERS: Final = 24
_SLICE: Final = 0.2  # [m] between the samples of a collider that lies or leans


def obstacle_height(rig: Rig) -> float:
    """Height [m] above the ground up to which objects stop the robot or its mast."""
    mast = body_boxes(rig).get("mast")
    top = 0.0 if mast is None else float(mast.centre[2] + mast.size[2] / 2) + rig.robot.ground_clearance
    return max(MAX_HEIGHT, top)


def max_step(robot: RobotConfig = _HUSKY) -> float:
    """Height [m] of a stone that the robot still drives over: half a wheel's radius, 8 cm of a Husky.

    No figure is published for a Husky; its data sheet has a ground clearance of 13 cm. By statics, a robot with all
    wheels driven and equal loads on its axles climbs a step of 2 mu^2 / (1 + mu^2) wheel radii with a friction mu: the
    contact on the step's edge is inclined by twice the angle of friction. Half a radius takes mu = 0.58. A caster
    climbs half its own radius when it is pushed by two wheels with as much friction.
    """
    radii = [robot.wheels.radius, *([robot.caster.radius] if robot.caster else [])]
    return min(radii) / 2


class Outline(NamedTuple):
    """Convex polygon (m, 2) [m], anticlockwise, of the part of an object that stops a robot, and its name."""

    name: str
    corners: Array

    @property
    def circle(self) -> tuple[float, float, float]:
        """Centre x, y and radius [m] of a circle around it."""
        middle = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        return float(middle[0]), float(middle[1]), float(np.linalg.norm(self.corners - middle, axis=1).max())


def obstacle_outlines(world: World, height: float = MAX_HEIGHT) -> list[Outline]:
    """One outline per collider that has parts above the ground and parts lower than ``height`` [m] above it."""
    names: list[str] = []
    solids: list[Array] = []
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            names.append(instance.name)
            solids.append(transform(instance.world_from_object, _surface(collider, instance.world_from_object)))
    if not solids:
        return []
    points = np.concatenate(solids)
    above = points[:, 2] - world.terrain.field.height_at(points[:, 0], points[:, 1])
    pieces = np.split(above, np.cumsum([len(solid) for solid in solids])[:-1])
    return [
        Outline(name, _hull(solid[heights <= height, :2]))
        for name, solid, heights in zip(names, solids, pieces, strict=True)
        if (heights <= height).any() and (heights > 0).any()
    ]


def stone_outlines(world: World, step: float | None = None) -> list[Outline]:
    """One outline per hard object without a collider that is higher than ``step`` [m]: of its part above that height.

    By default the step is that of a Husky.
    """
    step = max_step() if step is None else step
    return [outline for surface in hard_surfaces(world) for outline in _high_parts(surface, world.terrain.field, step)]


def _high_parts(surface: HardSurface, soil: Heightfield, step: float) -> Iterator[Outline]:
    size = float(np.linalg.norm(surface.vertices[surface.faces], axis=-1).max())
    for name, pose_ in zip(surface.names, surface.poses, strict=True):
        if size * np.cbrt(np.linalg.det(pose_[:3, :3])) < step:
            continue
        corners = transform(pose_, surface.vertices[surface.faces].reshape(-1, 3))
        above = (corners[:, 2] - soil.height_at(corners[:, 0], corners[:, 1])).reshape(-1, 3) - step
        corners = corners[:, :2].reshape(-1, 3, 2)
        high = corners[(above > 0) & (above <= surface.reach - step)]
        for first, last in ((0, 1), (1, 2), (2, 0)):  # where the edges of the triangles cross that height
            a, b = above[:, first], above[:, last]
            cut = np.flatnonzero(a * b < 0)
            share = (a[cut] / (a[cut] - b[cut]))[:, None]
            high = np.concatenate([high, corners[cut, first] + share * (corners[cut, last] - corners[cut, first])])
        if len(high):
            yield Outline(name, _hull(high))


def _surface(collider: Collider, world_from_object: Array) -> Array:
    """Points (n, 3) in the object's frame whose hull is the collider, dense enough to be cut at a height."""
    height = collider.size[-1]
    scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
    upright = world_from_object[2, 2] > 0.9999 * scale
    levels = _samples(height * scale, upright) * height
    if collider.shape == "cylinder":
        angles = np.linspace(0.0, 2 * np.pi, _CIRCLE_CORNERS, endpoint=False)
        circumscribed = collider.size[0] / np.cos(np.pi / _CIRCLE_CORNERS)
        rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * circumscribed
    else:
        across = [(_samples(s * scale, upright) - 0.5) * s for s in collider.size[:2]]
        rim = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.concatenate([np.tile(rim, (len(levels), 1)), np.repeat(levels, len(rim))[:, None]], axis=1)
    return transform(pose(collider.position, (0.0, 0.0, collider.yaw_deg)), points)


def _samples(length: float, ends_only: bool) -> Array:
    return np.linspace(0.0, 1.0, 2 if ends_only else 2 + int(length / _SLICE))


def _hull(points: Array) -> Array:
    if np.linalg.matrix_rank(points - points[0], tol=1e-6) < 2:  # a line has no hull: widen it by 1 mm
        points = np.concatenate([points + np.array(offset) * 1e-3 for offset in ((1, 1), (-1, 1), (0, -1))])
    corners: Array = points[ConvexHull(points).vertices]
    return corners


def distance_to(outline: Outline, points: Array) -> Array:
    """Distance [m], (n,), of points (n, 2) to an outline; inside it 0 and below."""
    first = outline.corners
    edges = np.roll(first, -1, axis=0) - first
    lengths = np.linalg.norm(edges, axis=1)
    to_point = points[:, None, :] - first
    outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / lengths[:, None]
    depth = (to_point * outwards).sum(-1).max(axis=1)  # signed distance to the farthest edge line
    along = np.clip((to_point * edges).sum(-1) / lengths**2, 0.0, 1.0)
    outside = np.linalg.norm(to_point - along[..., None] * edges, axis=-1).min(axis=1)
    return np.asarray(np.where(depth > 0, outside, depth))


def gap_to(outline: Outline, poses: Array, robot: RobotConfig = _HUSKY) -> Array:
    """Gap [m], (n,), between an outline and the robot's outline at poses (n, 3) of x, y [m] and heading [rad].

    Separating axis theorem: the largest gap of the projections on the normals of all edges. Corner to corner it is a
    little less than the distance; where the two overlap it is negative.
    """
    half = np.array(robot.outline[:2]) / 2
    forward = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    left = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
    to_corner = outline.corners[None] - poses[:, None, :2]
    gaps = []
    for axis, extent in ((forward, half[0]), (left, half[1])):
        projection = np.einsum("nmk,nk->nm", to_corner, axis)
        gaps += [projection.min(axis=1) - extent, -extent - projection.max(axis=1)]
    edges = np.roll(outline.corners, -1, axis=0) - outline.corners
    outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    extent = np.abs(forward @ outwards.T) * half[0] + np.abs(left @ outwards.T) * half[1]
    gaps.append((-np.einsum("nmk,mk->nm", to_corner, outwards) - extent).max(axis=1))
    return np.asarray(np.max(gaps, axis=0))
