# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How a rock lies: leaning with the slope, and so deep that the ground closes around it on every side."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Heightfield, Instance, Mesh
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint, rotations_to, upright_poses

LEAN: Final = 0.75
"""Share of the ground's slope that a lying rock takes on."""
BED: Final = 0.03
"""Least depth [m] times the square root of the size at which a rock's rim lies below the ground around it."""


def lay_rock(
    site: Site, kind: str, mesh: Mesh, x: float, y: float, *, yaw: float, scale: float = 1.0,
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> Instance:  # fmt: skip
    """Lay a rock into the ground of a site at x, y [m], turned by ``yaw`` [rad]; it keeps its footprint to itself."""
    pose = rock_pose(site.field, mesh, x, y, yaw, scale)
    return site.stand(kind, mesh, pose, [(x, y, mesh.footprint * scale)], tint=tint)


def rock_pose(field: Heightfield, mesh: Mesh, x: float, y: float, yaw: float, scale: float) -> Array:
    """Pose (4, 4) in which the rock leans with the mean slope below it, sunk until its whole rim is in the ground."""
    radius = mesh.footprint * scale
    angles = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    around = field.height_at(x + 0.8 * radius * np.cos(angles), y + 0.8 * radius * np.sin(angles))
    slope = 2 * np.array([around @ np.cos(angles), around @ np.sin(angles)]) / (len(angles) * 0.8 * radius)
    pose: Array = upright_poses(np.array([[x, y]]), np.array([yaw]), np.array([scale]))[0]
    pose[:3, :3] = rotations_to(np.array([[-LEAN * slope[0], -LEAN * slope[1], 1.0]]))[0] @ pose[:3, :3]
    rim = rim_vertices(mesh) @ pose[:3, :3].T + pose[:3, 3]
    gap = rim[:, 2] - field.height_at(rim[:, 0], rim[:, 1])
    pose[2, 3] = min(float(around.mean()), -float(gap.max()) - BED * np.sqrt(radius))
    return pose


def rim_vertices(mesh: Mesh, sectors: int = 16) -> Array:
    """Of each sector around the rock the lowest vertex (k, 3) in its outer part: what must not show daylight below."""
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
    site: Site, kind: str, meshes: Sequence[Mesh], count: int, *, rng: np.random.Generator,
    density: Callable[[Array], Array], spacing: float = 0.0, scales: tuple[float, float] = (0.85, 1.2),
    tint: float = 0.08, tries: int = 6000,
) -> list[Instance]:  # fmt: skip
    """Lay ``count`` rocks where ``density`` (share in [0, 1] for places (n, 2)) lets them; meshes are taken in turn.

    Like ``Site.scatter``: dart throwing, ``spacing`` [m] eases when room gets scarce. Raises CrowdedWorldError.
    """
    length, width = site.size
    darts = rng.uniform(-0.5, 0.5, (tries, 2)) * [length, width]
    hits = darts[rng.random(tries) < density(darts)]
    placed: list[Instance] = []
    taken = np.zeros((0, 2))
    for apart, (x, y) in ((ease * spacing, dart) for ease in (1.0, 0.8, 0.6, 0.4, 0.2) for dart in hits):
        if len(placed) == count:
            break
        if len(taken) and np.hypot(*(taken - (x, y)).T).min() < apart:
            continue
        mesh, scale = meshes[len(placed) % len(meshes)], float(np.exp(rng.uniform(*np.log(scales))))
        if site.is_free(x, y, mesh.footprint * scale):
            yaw = float(rng.uniform(0, 2 * np.pi))
            placed.append(lay_rock(site, kind, mesh, x, y, yaw=yaw, scale=scale, tint=random_tint(rng, tint)))
            taken = np.concatenate([taken, [[x, y]]])
    if len(placed) < count:
        raise CrowdedWorldError(f"only {len(placed)} of {count} {kind} find room in the world; ask for fewer")
    return placed
