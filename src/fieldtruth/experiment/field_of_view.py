# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Fields of view: which points a sensor that scans, or a view of a camera, sees where nothing hides them."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from fieldtruth.core import lenses, transforms
from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.imaging_config import ImagingConfig
from fieldtruth.experiment.scanning_config import ScanningConfig

AZIMUTHS: Final = 720
"""Rays of a ring."""


_ROUNDING: Final = 1e-9  # [rad], so that a beam's own points count


_PIXELS: Final = 97  # rays along the longer side of an image, borders included


@dataclass(frozen=True)
class SensorView:
    """A sensor that scans, or one view of a camera: name, and pose (4, 4), of a view that of the optical frame."""

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
    def scans(self) -> bool:
        """True if it gives clouds, not images."""
        return isinstance(self.config, ScanningConfig)

    def sees(self, points_base: Array) -> Mask:
        """Mask (n,) of the points (n, 3) [m] in base_link in its field of view and range; nothing hides any.

        The field of view of one that scans has all elevations from its lowest to its highest beam.
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
