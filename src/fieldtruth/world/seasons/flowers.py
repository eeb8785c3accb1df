# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Flowers of early spring: anemones where herbs, ferns and seedlings of a wood grow, before the leaves shade them."""

from typing import Final

import numpy as np

from fieldtruth.world.model import Mesh, Swarm, World
from fieldtruth.world.plants import GRASSES, grow_clump
from fieldtruth.world.poses import upright_poses
from fieldtruth.world.swarms import make_swarm, random_scales

WHERE: Final = ("fern", "herb", "seedling")
"""Kinds of swarms beside whose members they grow."""
NEAR: Final = 0.7
"""Standard deviation [m] of the distance along x and along y."""
OFF_TRAIL: Final = 0.3  # [m]


def spring_flowers(world: World) -> tuple[Swarm, list[Mesh]] | None:
    """Clumps of anemones; None where nothing grows that they grow beside."""
    poses = [swarm.world_from_object for swarm in world.swarms if swarm.kind in WHERE]
    if not poses:
        return None
    rng = np.random.default_rng([world.seed, 43])
    xy = np.concatenate(poses)[:, :2, 3]
    xy = xy + rng.normal(0, NEAR, xy.shape)
    inside = (np.abs(xy) < np.array(world.size) / 2 - 0.5).all(axis=1)
    xy = xy[inside & (world.terrain.trail_distance.at(*xy.T) > OFF_TRAIL)]
    meshes = [
        grow_clump({GRASSES["anemone"]: 1.0}, name=f"anemones_{k}", radius=0.35, per_m2=16.0, rng=rng, size=0.5)
        for k in range(4)
    ]
    poses_here = upright_poses(xy, rng.uniform(0, 2 * np.pi, len(xy)), random_scales(rng, (0.8, 1.2), len(xy)))
    poses_here[:, 2, 3] = world.terrain.field.height_at(*xy.T)
    return make_swarm("anemones", "flower", meshes, poses_here, rng), meshes
