# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of rocks: inclined with the slope, and so deep that no gap below the rim is visible."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Heightfield, Instance, Mesh
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, eased, place_until_count
from fieldtruth.world.poses import random_tint, rotations_to, upright_pose
from fieldtruth.world.swarms import Density

LEAN: Final = 0.75
"""Slope of a rock relative to that of the ground."""
BED: Final = 0.03
"""Least depth of a rock's rim in the ground [m], per square root of its radius [m]."""


def lay_rock(
    builder: WorldBuilder,
    kind: str,
    mesh: Mesh,
    xy: Sequence[float] | Array,
    *,
    yaw: float,
    scale: float = 1.0,
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Instance:
    """Add a rock that is sunk into the ground at xy [m], turned by ``yaw`` [rad]; its footprint stays free."""
    x, y = xy
    pose = rock_pose(builder.field, mesh, x, y, yaw, scale)
    return builder.add(kind, mesh, pose, [(x, y, mesh.footprint * scale)], tint=tint)


def rock_pose(field: Heightfield, mesh: Mesh, x: float, y: float, yaw: float, scale: float) -> Array:
    """Pose (4, 4) of a rock, inclined with the mean slope below it and sunk until its whole rim is in the ground."""
    radius = mesh.footprint * scale
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = field.height_at(x + 0.8 * radius * np.cos(angles), y + 0.8 * radius * np.sin(angles))
    slope = 2 * np.array([around @ np.cos(angles), around @ np.sin(angles)]) / (len(angles) * 0.8 * radius)
    pose = upright_pose(x, y, yaw, scale)
    pose[:3, :3] = rotations_to(np.array([[-LEAN * slope[0], -LEAN * slope[1], 1.0]]))[0] @ pose[:3, :3]
    rim = rim_vertices(mesh) @ pose[:3, :3].T + pose[:3, 3]
    gap = rim[:, 2] - field.height_at(rim[:, 0], rim[:, 1])
    pose[2, 3] = min(float(around.mean()), -float(gap.max()) - BED * np.sqrt(radius))
    return pose


def rim_vertices(mesh: Mesh, sectors: int = 16) -> Array:
    """The lowest vertex (k, 3) in the outer part of each sector around the rock; it must be below the ground."""
    points = mesh.vertices.astype(np.float64)
    away, turn = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    number = np.floor((turn / (2 * np.pi) + 0.5) * sectors).astype(int) % sectors
    found = []
    for k in range(sectors):
        rows = np.flatnonzero(number == k)
        if len(rows):
            outer = rows[away[rows] > 0.55 * away[rows].max()]
            found.append(points[outer[np.argmin(points[outer, 2])]])
    return np.array(found)


def scatter_rocks(
    builder: WorldBuilder, group: ObjectGroup, rng: np.random.Generator, density: Density, *, tries: int = 6000
) -> list[Instance]:
    """Scatter rocks where ``density`` (share in [0, 1] at positions (n, 2)) allows them.

    Draws ``tries`` positions and a number for each at first; then for each candidate that keeps the spacing a scale,
    whose logarithm is uniform, and for a placed rock yaw and tint.

    Raises:
        CrowdedWorldError: too few candidates are free even at a fifth of the spacing.
    """
    darts = builder.random_positions(builder.tries(tries), rng)
    hits = darts[rng.random(len(darts)) < density(darts)]

    def attempt(xy: Array, number: int, apart: bool) -> Instance | None:
        if not apart:
            return None
        mesh, scale = group.mesh(number), float(np.exp(rng.uniform(*np.log(group.scales))))
        if not builder.is_free(xy, mesh.footprint * scale):
            return None
        yaw = float(rng.uniform(0, 2 * np.pi))
        return lay_rock(builder, group.kind, mesh, xy, yaw=yaw, scale=scale, tint=random_tint(rng, group.tint))

    spacings = eased(group.spacing, (1.0, 0.8, 0.6, 0.4, 0.2))
    return group.check_complete(place_until_count(group.count, hits, attempt, spacings=spacings))
