# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What lies on the forest's floor and stands dead in it: fallen trunks, snags, stumps, stones."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import Mesh
from fieldtruth.world.placement import CrowdedWorldError, Site, random_tint, rotations_to
from fieldtruth.world.plants import TREES
from fieldtruth.world.plants.deadwood import clearance_circles, grow_log, grow_snag, grow_stump
from fieldtruth.world.rocks import ROCK_TYPES, make_rock, scatter_rocks

if TYPE_CHECKING:
    from fieldtruth.world.environments.forest import ForestConfig


def lay_trunks(site: Site, config: "ForestConfig", rng: np.random.Generator) -> None:
    """Fallen trunks lie where they fell, off the trails; snags and stumps stand between the trees."""

    def off_trails(places: Array) -> NDArray[np.bool_]:
        return site.trail_distance(places) > 0.5

    names = list(config.species)
    logs = [
        grow_log(
            TREES[names[k % len(names)]], name=f"log_{k}", length=float(rng.uniform(3.0, 10.0)),
            radius=float(rng.uniform(0.11, 0.27)), rng=rng, detail=0.6,
        )
        for k in range(min(config.fallen_trunks, 8))
    ]  # fmt: skip
    for k in range(config.fallen_trunks):
        _lay_log(site, logs[k % len(logs)], rng)
    snags = [
        grow_snag(
            TREES[names[k % len(names)]], name=f"snag_{k}", height=float(rng.uniform(2.5, 13.0)), rng=rng, detail=0.5
        )
        for k in range(min(config.snags, 8))
    ]
    site.scatter("snag", snags, config.snags, rng=rng, allowed=off_trails, spacing=5.0, tint=0.1)
    stumps = [
        grow_stump(
            TREES[names[k % len(names)]], name=f"stump_{k}", radius=float(rng.uniform(0.12, 0.3)), rng=rng, detail=0.5
        )
        for k in range(min(config.stumps, 4))
    ]
    site.scatter("stump", stumps, config.stumps, rng=rng, allowed=off_trails, spacing=4.0, tint=0.1)


def _lay_log(site: Site, log: Mesh, rng: np.random.Generator, tries: int = 400) -> None:
    """Lay one fallen trunk along the ground where it finds room; bridges over hollows of 5 cm, and no higher."""
    room = np.array(clearance_circles(log))
    for _ in range(tries):
        (x, y), yaw = rng.uniform(-0.5, 0.5, 2) * site.size, float(rng.uniform(0.0, 2.0 * np.pi))
        ahead = np.array([np.cos(yaw), np.sin(yaw)])
        along = room[:, 0]
        circles = np.column_stack([x + along * ahead[0], y + along * ahead[1], room[:, 2]])
        clear = (site.trail_distance(circles[:, :2]) > circles[:, 2] + 0.2).all()
        if not clear or not all(site.is_free(*circle) for circle in circles):
            continue
        ground = site.field.height_at(circles[:, 0], circles[:, 1])
        slope, middle = np.polyfit(along, ground, 1)
        gap = float((middle + slope * along - ground).max())
        pose = np.eye(4)
        turn = np.array([[ahead[0], -ahead[1], 0.0], [ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
        pose[:3, :3] = rotations_to(np.array([[-slope * ahead[0], -slope * ahead[1], 1.0]]))[0] @ turn
        pose[:3, 3] = x, y, middle - max(gap - 0.05, 0.0)
        site.stand("fallen_trunk", log, pose, [tuple(c) for c in circles.tolist()], tint=random_tint(rng, 0.1))
        return
    raise CrowdedWorldError(f"no room for {log.name} in the forest; ask for fewer fallen trunks")


def lay_rocks(site: Site, config: "ForestConfig", rng: np.random.Generator) -> None:
    """Field stones, in groups; small stones lie about."""
    groups = rng.uniform(-0.5, 0.5, (14, 2)) * site.size

    def near_groups(places: Array) -> Array:
        away = np.min(np.linalg.norm(places[:, None] - groups, axis=2), axis=1)
        return np.asarray((0.12 + 0.88 * np.exp(-((away / 2.6) ** 2))) * (site.trail_distance(places) > 0.3))

    rocks = [
        make_rock(ROCK_TYPES["fieldstone"], name=f"rock_{k}", size=float(size), rng=rng, triangles=700)
        for k, size in enumerate(np.geomspace(0.35, 1.5, 8))
    ]
    scatter_rocks(site, "rock", rocks, config.rocks, rng=rng, density=near_groups, spacing=0.6)
    stones = [
        make_rock(ROCK_TYPES["fieldstone"], name=f"stone_{k}", size=float(size), rng=rng, triangles=80, solid=False)
        for k, size in enumerate(np.geomspace(0.06, 0.22, 8))
    ]
    site.strew(
        "small_stones", "stone", stones, per_m2=config.stones_per_m2 * 3, rng=rng, scales=(0.7, 1.3), tint=0.12,
        density=lambda p: np.clip(1.4 * near_groups(p), 0.0, 1.0), tilt=1.0, clear=0.45,
    )  # fmt: skip
