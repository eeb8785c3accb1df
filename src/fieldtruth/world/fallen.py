# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Laying fallen trunks along the ground, where nothing stands."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Instance, Mesh
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, place_until_count, random_tint, rotations_to
from fieldtruth.world.plants.deadwood import clearance_circles

TRIES: Final = 400
"""Positions that are tried for a trunk."""


def lay_log(
    builder: WorldBuilder,
    log: Mesh,
    rng: np.random.Generator,
    allowed: Callable[[Array], Mask],
    *,
    kind: str = "fallen_trunk",
    tint: float = 0.1,
) -> None:
    """Lay one fallen trunk where all circles (n, 3) of x, y and radius [m] that cover it are ``allowed``.

    Draws x, y and yaw per try, and a tint at the end.

    Raises:
        CrowdedWorldError: no space within ``TRIES`` tries.
    """
    clearance = np.array(clearance_circles(log))

    def candidates() -> Iterator[Array]:
        for _ in range(TRIES):
            yield np.array([*(rng.uniform(-0.5, 0.5, 2) * builder.size), rng.uniform(0.0, 2.0 * np.pi)])

    def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
        x, y, yaw = candidate
        along = clearance[:, 0]
        circles = np.column_stack([x + along * np.cos(yaw), y + along * np.sin(yaw), clearance[:, 2]])
        if not allowed(circles).all():
            return None
        if not all(builder.is_free(circle[:2], circle[2]) for circle in circles):
            return None
        pose = _lying_pose(candidate, along, builder.field.height_at(circles[:, 0], circles[:, 1]))
        return builder.add(kind, log, pose, [tuple(c) for c in circles.tolist()], tint=random_tint(rng, tint))

    group = ObjectGroup(kind=f"fallen trunk {log.name}", meshes=[log], count=1)
    group.check_complete(place_until_count(1, candidates(), attempt))


def _lying_pose(candidate: Array, along: Array, ground: Array) -> Array:
    """Pose (4, 4) at (x, y, yaw) on the mean slope of ``ground`` heights [m], ``along`` [m] from the trunk's centre.

    The trunk spans hollows of up to 5 cm.
    """
    x, y, yaw = candidate
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    slope, middle = np.polyfit(along, ground, 1)
    gap = float((middle + slope * along - ground).max())
    pose = np.eye(4)
    turn = np.array([[ahead[0], -ahead[1], 0.0], [ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
    pose[:3, :3] = rotations_to(np.array([[-slope * ahead[0], -slope * ahead[1], 1.0]]))[0] @ turn
    pose[:3, 3] = x, y, middle - max(gap - 0.05, 0.0)
    return pose
