# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps: aerial view of a world and its projection, arcs, fields of view, distances along a path.

The view is rendered with the camera model. North is right, west is up.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fieldtruth.core import transforms
from fieldtruth.core.arrays import Array
from fieldtruth.core.lenses import Lens
from fieldtruth.render.bake import BakedScene
from fieldtruth.report.drawing.images import downscaled
from fieldtruth.sensors.known import photograph
from fieldtruth.world.model import Heightfield

HEIGHT: Final = 300.0
"""Height [m] of the camera above the mean ground: a crown at 12 m, at the edge, is displaced by 2 m."""
MARGIN: Final = 1.0
"""Width [m] of the strip that is visible beyond the edge of the world."""
_SAMPLES: Final = 2  # per pixel and axis
_DARKEST, _BRIGHTEST = 0.2, 99.8  # percentiles that become black and white: 300 m of air are hazy
_LEAST_MEDIAN: Final = 0.36


@dataclass(frozen=True, kw_only=True)
class Aerial:
    """A photograph (h, w, 3) from above, its projection, and the ground that it shows."""

    photo: NDArray[np.uint8]
    world_from_optical: Array
    lens: Lens
    field: Heightfield

    def pixels(self, points_world: ArrayLike) -> Array:
        """Project points (n, 3) [m] to columns and rows (n, 2); (0, 0) is the centre of the first pixel."""
        x, y, z = transforms.transform(transforms.inverse(self.world_from_optical), points_world).T
        return np.column_stack([self.lens.fx * x / z + self.lens.cx, self.lens.fy * y / z + self.lens.cy])

    def ground_pixels(self, xy: Array) -> Array:
        """Project points x, y (n, 2) [m] on the ground to columns and rows (n, 2)."""
        return self.pixels(np.column_stack([xy, self.field.height_at(xy[:, 0], xy[:, 1])]))


def render_aerial(baked: BakedScene, width: int) -> Aerial:
    """Render the whole world from above, ``width`` pixels along x."""
    field = baked.scene.world.terrain.surface
    length, breadth = (side / 2 + MARGIN for side in baked.scene.world.size)
    wide = 8 * max(1, round(width * _SAMPLES / 8))
    high = 8 * max(1, round(wide * breadth / length / 8))
    world_from_optical = transforms.pose((0.0, 0.0, float(np.mean(field.heights)) + HEIGHT), (180.0, 0.0, 0.0))
    photo, lens = photograph(
        baked,
        world_from_optical,
        1.0,
        width=wide,
        height=high,
        horizontal_fov_deg=2.0 * float(np.degrees(np.arctan2(length, HEIGHT))),
        vertical_fov_deg=2.0 * float(np.degrees(np.arctan2(breadth, HEIGHT))),
        far=10.0 * HEIGHT,
    )
    photo = _stretched(downscaled(photo, _SAMPLES))
    half = {name: getattr(lens, name) / _SAMPLES for name in ("fx", "fy")}
    lens = lens._replace(**half, cx=(photo.shape[1] - 1) / 2.0, cy=(photo.shape[0] - 1) / 2.0)
    return Aerial(photo=photo, world_from_optical=world_from_optical, lens=lens, field=field)


def _stretched(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Remove haze and brighten shadow: from above, a forest is as dark as deep water."""
    dark = np.percentile(photo, _DARKEST, axis=(0, 1))
    clear = np.maximum(photo - dark, 0.0)
    clear /= max(float(np.percentile(clear, _BRIGHTEST)), 1.0)
    median = float(np.clip(np.median(clear), 0.01, 0.99))
    gamma = float(np.clip(np.log(_LEAST_MEDIAN) / np.log(median), 0.6, 1.0))
    return (255.0 * np.clip(clear, 0.0, 1.0) ** gamma).astype(np.uint8)


def arc(centre: Array, radius: float, start: float = 0.0, end: float = 2.0 * np.pi) -> Array:
    """Points (65, 2) [m] on an arc around a centre x, y from one angle [rad] to another, by default a full circle."""
    angle = np.linspace(start, end, 65)
    return centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def sector(viewpoint: Array, radius: float, fov: float) -> Array:
    """Outline (66, 2) [m] of a field of view [rad] around the heading of a viewpoint: x, y [m], heading [rad]."""
    xy, heading = viewpoint[:2], float(viewpoint[2])
    return np.vstack([xy, arc(xy, radius, heading - fov / 2, heading + fov / 2)])


def heading_of(base_from_optical: Array) -> float:
    """Angle [rad] about z from the robot's x axis to the direction in which an optical frame (4, 4) looks."""
    x, y, _ = base_from_optical[:3, 2]
    return float(np.arctan2(y, x))


def distance_along(path: Array) -> Array:
    """Distance (n,) [m] from the first point of a path (n, 2) or (n, 3) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
