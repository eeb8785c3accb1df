# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Flat ground around the robot that the cameras and LiDARs of a rig see, and where they are blind."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.rig import Rig, body_parts
from fieldtruth.experiment.sensor_families import ImagingConfig, ScanningConfig
from fieldtruth.sense.robot import meet, part_table

HALF: Final = 10.0
"""Distance [m] from base_link to the sides of the ground that is looked at."""
STEP: Final = 0.05  # [m] between its points
AZIMUTHS: Final = 720
"""Rays of a ring."""
_ROUNDING: Final = 1e-9  # [rad], so that a beam's own points count
_PIXELS: Final = 97  # rays along the longer side of an image, borders included


def ground_height(rig: Rig) -> float:
    """Height [m] of flat ground on which the robot stands."""
    return rig.robot.footprint.xyz[2]


@dataclass(frozen=True)
class SensorView:
    """A LiDAR or one view of a camera: its name, and its pose (4, 4), of a view that of the optical frame."""

    name: str
    config: ScanningConfig | ImagingConfig
    base_from_sensor: Array

    @property
    def position(self) -> Array:
        """In base_link, (3,) [m]."""
        return self.base_from_sensor[:3, 3]

    @property
    def nearest(self) -> float:
        """Range [m] from which it sees."""
        return self.config.min_range if isinstance(self.config, ScanningConfig) else 0.0

    @property
    def farthest(self) -> float:
        """Range [m] up to which it sees."""
        return self.config.max_range if isinstance(self.config, ScanningConfig) else self.config.far

    @property
    def is_lidar(self) -> bool:
        """Whether it is a LiDAR."""
        return isinstance(self.config, ScanningConfig)

    def sees(self, points_base: Array) -> Mask:
        """Which of the points (n, 3) [m] in base_link are in its field of view and range; nothing hides any.

        The field of view of a LiDAR has all elevations from its lowest to its highest beam.
        """
        points = transforms.transform(transforms.inverse(self.base_from_sensor), points_base)
        distance = np.linalg.norm(points, axis=1)
        near, config = (distance >= self.nearest) & (distance <= self.farthest), self.config
        if isinstance(config, ScanningConfig):
            elevation, beams = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1])), config.ring_elevations
            return np.asarray(near & (elevation >= beams.min() - _ROUNDING) & (elevation <= beams.max() + _ROUNDING))
        u, v = (lenses.project(config.projection, points) + 0.5).T  # 0: the outer border of the first pixel
        ahead = points[:, 2] > 0.0 if config.projection.model in lenses.FLAT else True
        inside = (u >= 0.0) & (u <= config.width) & (v >= 0.0) & (v <= config.height)
        return np.asarray(inside & ahead & near)

    def rays(self) -> Array:
        """Unit directions in base_link: all rings at ``AZIMUTHS`` (rings, azimuths, 3), or over the image (n, m, 3).

        The outermost ones of an image are at the borders of its pixels; NaN where a lens has no ray.
        """
        config = self.config
        if isinstance(config, ScanningConfig):
            elevation = config.ring_elevations[:, None]
            azimuth = np.linspace(-np.pi, np.pi, AZIMUTHS)[None]
            level, up = np.cos(elevation), np.broadcast_to(np.sin(elevation), (len(elevation), AZIMUTHS))
            rays = np.stack([np.cos(azimuth) * level, np.sin(azimuth) * level, up], axis=-1)
        else:
            longer = max(config.width, config.height)
            u, v = (
                np.linspace(-0.5, side - 0.5, max(3, _PIXELS * side // longer))
                for side in (config.width, config.height)
            )
            rays = lenses.directions(config.projection, u, v[:, None])
        return np.asarray(rays @ self.base_from_sensor[:3, :3].T)


def sensor_views(rig: Rig) -> tuple[SensorView, ...]:
    """Return the LiDARs and views of a rig that are enabled."""
    lidars = tuple(SensorView(each.name, each, each.mount.base_from_sensor) for each in rig.enabled(ScanningConfig))
    return (*lidars, *(SensorView(each.name, each.config, each.base_from_optical) for each in rig.imagers))


def ground_hits(view: SensorView, height: float) -> Array:
    """Points of its rays, shaped as these, on ground at ``height`` [m] in base_link; NaN above and out of range."""
    rays = view.rays()
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (height - view.position[2]) / rays[..., 2]
        reached = (distance > 0.0) & (distance >= view.nearest) & (distance <= view.farthest)
        points = view.position + rays * distance[..., None]
    return np.asarray(np.where(reached[..., None], points, np.nan))


def nearest_ground(view: SensorView, height: float) -> float:
    """Horizontal distance [m] from a view to the nearest ground that it sees; NaN if it sees none.

    Of an upright LiDAR this is the radius of its blind circle.
    """
    x, y, _ = np.moveaxis(ground_hits(view, height) - view.position, -1, 0)
    distance = np.hypot(x, y)
    return float(np.nanmin(distance)) if np.isfinite(distance).any() else float("nan")


@dataclass(frozen=True)
class Coverage:
    """Ground points at all pairs of ``axis`` (n,) [m], in x and y of base_link, and who sees them."""

    axis: Array
    views: tuple[SensorView, ...]
    in_view: Mask
    """(views, n, n), by view, y and x."""
    hidden: Mask
    """(views, n, n): the robot itself is between, which simulated sensors see with ``rig.visible`` only."""

    def seen(self, lidar: bool) -> Mask:
        """Points (n, n) that a LiDAR sees, or a camera."""
        chosen = [view.is_lidar == lidar for view in self.views]
        return np.asarray((self.in_view & ~self.hidden)[chosen].any(axis=0))


def ground_coverage(rig: Rig, half: float = HALF, step: float = STEP) -> Coverage:
    """Look at flat ground, ``half`` [m] to each side, from all views of a rig."""
    axis = np.linspace(-half, half, 2 * round(half / step) + 1)
    x, y = (each.ravel() for each in np.meshgrid(axis, axis))
    points = np.column_stack([x, y, np.full(x.shape, ground_height(rig))])
    table = part_table(body_parts(rig))
    views, shape = sensor_views(rig), (len(axis), len(axis))
    in_view, hidden = np.zeros((2, len(views), *shape), np.bool_)
    for k, view in enumerate(views):
        seen = view.sees(points)
        in_view[k] = seen.reshape(shape)
        away = points - view.position
        distance = np.linalg.norm(away, axis=1)
        hidden[k] = (seen & (meet(table, view.position, away / distance[:, None]).range_m < distance)).reshape(shape)
    return Coverage(axis, views, in_view, hidden)
