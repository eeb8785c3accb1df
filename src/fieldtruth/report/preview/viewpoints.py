# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where to look from: the four places of a sample that together show most; and free places where nobody drives."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.world.model import World

APART: Final = 12.0  # [m] between two views, where there is room for it
_ROOM: Final = 1.5  # [m] of free ground around a free place
_INSET: Final = 0.16  # share of the place's sides that free places keep from the edge


def most_telling(pixels: NDArray[np.int64], places: Array, count: int) -> list[int]:
    """Rows of the ``count`` poses whose images show most, in the order of the poses.

    One after the other, that one is taken which adds most to the sum over classes of the root of their share: rare
    classes count, and a second look at the same adds little.

    Args:
        pixels: (n, classes) counts of each pose's image.
        places: (n, 2) [m] where the poses stand; those chosen keep ``APART`` where they can.
        count: how many; fewer if there are fewer poses.
    """
    share = pixels / np.maximum(pixels.sum(axis=1, keepdims=True), 1)
    chosen: list[int] = []
    while len(chosen) < min(count, len(pixels)):
        seen = share[chosen].sum(axis=0)
        gain = np.sqrt(seen + share).sum(axis=1)
        near = np.array([min((float(np.linalg.norm(p - places[c])) for c in chosen), default=APART) for p in places])
        gain += 10.0 * np.minimum(near / APART, 1.0)
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
    return sorted(chosen)


def free_stations(world: World, count: int, rng: np.random.Generator) -> Array:
    """Places (n, 3) x, y [m] and heading [rad], towards the middle, where a robot stands free and dry.

    There are fewer than ``count`` where 200 draws for each find no more.
    """
    sides = np.array(world.size)
    xy = rng.uniform(-0.5 + _INSET, 0.5 - _INSET, (200 * count, 2)) * sides
    free = _clearance(xy, obstacles(world)) > _ROOM
    if world.water_level is not None:
        free &= world.terrain.field.height_at(xy[:, 0], xy[:, 1]) > world.water_level
    xy = xy[free][:count]
    aim = rng.uniform(-0.2, 0.2, (len(xy), 2)) * sides
    return np.column_stack([xy, np.arctan2(aim[:, 1] - xy[:, 1], aim[:, 0] - xy[:, 0])])


def obstacles(world: World) -> Array:
    """Circles (n, 3) x, y and radius [m] around all colliders."""
    circles = [np.zeros((0, 3))]
    for instance in world.instances:
        pose = instance.world_from_object
        scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
        for collider in world.meshes[instance.mesh].colliders:
            x, y, _, _ = pose @ [*collider.position, 1.0]
            reach = collider.size[0] if collider.shape == "cylinder" else math.hypot(*collider.size[:2]) / 2
            circles.append(np.array([[x, y, reach * scale]]))
    return np.concatenate(circles)


def _clearance(xy: Array, circles: Array) -> Array:
    """Distance [m] of each point (n, 2) from the nearest circle's edge."""
    nearest = np.full(len(xy), np.inf)
    for x, y, radius in circles:
        nearest = np.minimum(nearest, np.hypot(xy[:, 0] - x, xy[:, 1] - y) - radius)
    return nearest
