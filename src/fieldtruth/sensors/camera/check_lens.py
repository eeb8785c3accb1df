# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rays of single pixels, found without the tables and the code by which the cameras find theirs.

A direction is searched whose image point is the pixel's centre: a search in one or two dimensions, with the formulas
of the models written out a second time (ROS's CameraInfo; OpenCV's calib3d and fisheye).
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, root

from fieldtruth.core.arrays import Array
from fieldtruth.core.lenses import Lens


class PixelRay(NamedTuple):
    """Direction of a pixel's ray in the optical frame, and its length where the image's depth is 1."""

    direction: Array
    """(3,) of unit length."""
    length: float


def pixel_ray(lens: Lens, u: float, v: float) -> PixelRay | None:
    """Ray through an image point [pixel]; None where the lens has none."""
    a, b = (u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy
    if lens.model == "equirectangular":
        if abs(a) > math.pi or abs(b) > math.pi / 2:
            return None
        return PixelRay(np.array([math.cos(b) * math.sin(a), math.sin(b), math.cos(b) * math.cos(a)]), 1.0)
    if lens.model == "equidistant":
        ray = _fisheye(lens, a, b)
        length = 1.0
    else:
        ray = _plane(lens, a, b) if lens.coefficients else np.array([a, b, 1.0])
        length = float(np.linalg.norm(ray))
    ray = ray / np.linalg.norm(ray)
    angle = float(np.arctan2(np.hypot(ray[0], ray[1]), ray[2]))  # NaN where the search found nothing
    return PixelRay(ray, length) if angle <= lens.circle else None


def _fisheye(lens: Lens, a: float, b: float) -> Array:
    height = math.hypot(a, b)
    if height == 0.0:
        return np.array([0.0, 0.0, 1.0])
    powers = (1.0, *lens.coefficients)

    def too_far(angle: float) -> float:
        return sum(factor * angle ** (2 * n + 1) for n, factor in enumerate(powers)) - height

    last = min(lens.circle + 0.01, math.pi)
    if too_far(last) < 0.0:
        return np.full(3, np.nan)
    angle = float(brentq(too_far, 0.0, last, xtol=1e-15))
    return np.array([a / height * math.sin(angle), b / height * math.sin(angle), math.cos(angle)])


def _plane(lens: Lens, a: float, b: float) -> Array:
    k1, k2, p1, p2, k3, k4, k5, k6 = (*lens.coefficients, *[0.0] * (8 - len(lens.coefficients)))

    def apart(point: Array) -> Array:
        x, y = float(point[0]), float(point[1])
        r2 = x**2 + y**2
        stretch = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
        across = x * stretch + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        down = y * stretch + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
        return np.array([across - a, down - b])

    def nearer(rest: Array, point: Array) -> Array:
        return apart(point) + rest

    point = np.zeros(2)  # followed from the middle outwards, so that the search stays on the branch of the lens
    for share in np.linspace(0.05, 1.0, 20):
        rest = (1.0 - share) * np.array([a, b])
        point = root(partial(nearer, rest), point).x
    found = root(apart, point, tol=1e-13)
    return np.array([*found.x, 1.0]) if np.hypot(*apart(found.x)) < 1e-9 else np.full(3, np.nan)
