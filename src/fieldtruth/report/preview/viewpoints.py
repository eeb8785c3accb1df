# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Choice of viewpoints: the most informative ones of a sample, and random ones where no experiment drives."""

import math
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Counts
from fieldtruth.world.model import World

APART: Final = 12.0
"""Preferred distance [m] between two viewpoints."""
_CLEARANCE: Final = 1.5  # [m]
_INSET: Final = 0.16  # share of the world's sides


def most_informative(pixels: Counts, positions: Array, count: int) -> list[int]:
    """Rows of the ``count`` viewpoints whose images together show most, in ascending order.

    Greedy: each step takes the viewpoint that adds most to the sum, over the classes, of the square root of their
    accumulated share. So rare classes count, and a second similar image adds little.

    Args:
        pixels: (n, classes) pixel counts of each viewpoint's image.
        positions: (n, 2) [m]; the chosen ones are ``APART`` where possible.
        count: number of rows; fewer if there are fewer viewpoints.
    """
    share = pixels / np.maximum(pixels.sum(axis=1, keepdims=True), 1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(pixels)):
        gain = np.sqrt(share[chosen].sum(axis=0) + share).sum(axis=1)
        to_chosen = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(axis=1, initial=APART)
        gain += 10.0 * to_chosen / APART
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
    return sorted(chosen)


def free_viewpoints(world: World, count: int, rng: np.random.Generator) -> Array:
    """Random viewpoints (n, 3), x, y [m] and heading [rad], on dry ground, off obstacles, facing the middle.

    There are fewer than ``count`` if 200 draws for each are not enough.
    """
    sides = np.array(world.size)
    xy = rng.uniform(-0.5 + _INSET, 0.5 - _INSET, (200 * count, 2)) * sides
    free = np.ones(len(xy), np.bool_)
    for x, y, radius in obstacles(world):
        free &= np.hypot(xy[:, 0] - x, xy[:, 1] - y) - radius > _CLEARANCE
    if world.water_level is not None:
        free &= world.terrain.field.height_at(xy[:, 0], xy[:, 1]) > world.water_level
    xy = xy[free][:count]
    target = rng.uniform(-0.2, 0.2, (len(xy), 2)) * sides
    return np.column_stack([xy, np.arctan2(target[:, 1] - xy[:, 1], target[:, 0] - xy[:, 0])])


def obstacles(world: World) -> Array:
    """Circles (n, 3), x, y and radius [m], around all colliders."""
    circles = []
    for instance in world.instances:
        pose = instance.world_from_object
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        for collider in world.meshes[instance.mesh].colliders:
            x, y, _, _ = pose @ [*collider.position, 1.0]
            radius = collider.size[0] if collider.shape == "cylinder" else math.hypot(*collider.size[:2]) / 2
            circles.append((x, y, radius * scale))
    return np.array(circles).reshape(-1, 3)
