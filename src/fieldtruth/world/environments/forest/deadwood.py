# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Dead wood of the forest: fallen trunks, snags and stumps."""

from collections.abc import Iterator

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.environments.forest.config import Config
from fieldtruth.world.model import Instance, Mesh
from fieldtruth.world.placement import ObjectGroup, WorldBuilder, place_until_count, random_tint, rotations_to
from fieldtruth.world.plants import TREES, clearance_circles, grow_log, grow_snag, grow_stump

LOG_TRIES = 400


def place_deadwood(builder: WorldBuilder, config: Config, rng: np.random.Generator) -> None:
    """Lay fallen trunks off the trails; stand snags and stumps between the trees."""

    def off_trails(xy: Array) -> Mask:
        return builder.trail_distance(xy) > 0.5

    trees = [TREES[name] for name in config.species]
    logs = [
        grow_log(
            trees[k % len(trees)],
            name=f"log_{k}",
            length=float(rng.uniform(3.0, 10.0)),
            radius=float(rng.uniform(0.1, 0.21)),
            rng=rng,
            detail=0.6,
        )
        for k in range(min(config.fallen_trunks, 8))
    ]
    for k in range(config.fallen_trunks):
        _lay_log(builder, logs[k % len(logs)], rng)
    snags = [
        grow_snag(trees[k % len(trees)], name=f"snag_{k}", height=float(rng.uniform(2.5, 13.0)), rng=rng, detail=0.5)
        for k in range(min(config.snags, 8))
    ]
    group = ObjectGroup(kind="snag", meshes=snags, count=config.snags, spacing=5.0, tint=0.1)
    builder.scatter(group, rng, off_trails)
    stumps = [
        grow_stump(trees[k % len(trees)], name=f"stump_{k}", radius=float(rng.uniform(0.1, 0.24)), rng=rng, detail=0.5)
        for k in range(min(config.stumps, 4))
    ]
    group = ObjectGroup(kind="stump", meshes=stumps, count=config.stumps, spacing=4.0, tint=0.1)
    builder.scatter(group, rng, off_trails)


def _lay_log(builder: WorldBuilder, log: Mesh, rng: np.random.Generator) -> None:
    """Lay one fallen trunk along the ground. Draws x, y and yaw per try, and a tint at the end.

    Raises:
        CrowdedWorldError: no space within ``LOG_TRIES`` tries.
    """
    clearance = np.array(clearance_circles(log))

    def candidates() -> Iterator[Array]:
        for _ in range(LOG_TRIES):
            yield np.array([*(rng.uniform(-0.5, 0.5, 2) * builder.size), rng.uniform(0.0, 2.0 * np.pi)])

    def attempt(candidate: Array, number: int, apart: bool) -> Instance | None:
        x, y, yaw = candidate
        along = clearance[:, 0]
        circles = np.column_stack([x + along * np.cos(yaw), y + along * np.sin(yaw), clearance[:, 2]])
        if not (builder.trail_distance(circles[:, :2]) > circles[:, 2] + 0.2).all():
            return None
        if not all(builder.is_free(circle[:2], circle[2]) for circle in circles):
            return None
        pose = _lying_pose(candidate, along, builder.field.height_at(circles[:, 0], circles[:, 1]))
        return builder.add("fallen_trunk", log, pose, [tuple(c) for c in circles.tolist()], tint=random_tint(rng, 0.1))

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
