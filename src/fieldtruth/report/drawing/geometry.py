# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Figures on maps: arcs, fields of view, and distances along a path."""

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_families import Imager


def arc(centre: Array, radius: float, start: float = 0.0, end: float = 2.0 * np.pi) -> Array:
    """Points (65, 2) [m] on an arc around a centre x, y from one angle [rad] to another, by default a full circle."""
    angle = np.linspace(start, end, 65)
    return centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def sector(viewpoint: Array, radius: float, fov: float) -> Array:
    """Outline (66, 2) [m] of a field of view [rad] around the heading of a viewpoint: x, y [m], heading [rad]."""
    xy, heading = viewpoint[:2], float(viewpoint[2])
    return np.vstack([xy, arc(xy, radius, heading - fov / 2, heading + fov / 2)])


def heading_of(imager: Imager) -> float:
    """Angle [rad] about z from the robot's x axis to the direction in which a camera looks."""
    x, y, _ = imager.base_from_optical[:3, 2]
    return float(np.arctan2(y, x))


def distance_along(path: Array) -> Array:
    """Distance (n,) [m] from the first point of a path (n, 2) or (n, 3) to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
