# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lenses: image points of directions in the optical frame, and directions of image points.

The models and the order of their coefficients are those of ROS's CameraInfo and OpenCV: ``plumb_bob`` (Conrady 1919;
Brown, "Decentering distortion of lenses", 1966), ``rational_polynomial`` (OpenCV's calib3d), ``equidistant`` (Kannala
and Brandt 2006, OpenCV's fisheye). ``equirectangular`` is a panorama: columns are longitudes and rows latitudes.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array

COEFFICIENTS: Final[dict[str, str]] = {
    "pinhole": "",
    "plumb_bob": "k1 k2 p1 p2 k3",
    "rational_polynomial": "k1 k2 p1 p2 k3 k4 k5 k6",
    "equidistant": "k1 k2 k3 k4",
    "equirectangular": "",
}
"""Names of each model's coefficients in their order."""
FLAT: Final = ("pinhole", "plumb_bob", "rational_polynomial")
"""Models that see less than 180 deg; their depth is measured along the optical axis."""

_NODES: Final = 20_000
_STEEPEST: Final = np.radians(89.5)
_STEPS: Final = 60
_CLOSED: Final = 1e-11
"""Residual of the inverse, in focal lengths: 1e-8 pixel at a focal length of 1000 pixels."""


class Lens(NamedTuple):
    """A lens of a model; image points count from the centre of the upper left pixel, as in ROS."""

    model: str
    fx: float  # [pixel]; of a panorama [pixel / rad]
    fy: float
    cx: float
    cy: float
    coefficients: tuple[float, ...] = ()
    circle: float = np.pi  # [rad] greatest angle between a ray and the optical axis


def image_height(model: str, coefficients: tuple[float, ...], angle: ArrayLike) -> Array:
    """Distance from the principal point, in focal lengths, of a ray at an ``angle`` [rad] from the optical axis.

    Tangential distortion is left out. It is the longitude itself in a panorama.
    """
    theta = np.asarray(angle, np.float64)
    if model == "equirectangular":
        return theta
    if model == "equidistant":
        k1, k2, k3, k4 = coefficients
        s = theta * theta
        return np.asarray(theta * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))))
    r = np.tan(theta)
    if model == "pinhole":
        return np.asarray(r)
    return np.asarray(r * _radial(coefficients, r * r)[0])


def greatest_angle(model: str, coefficients: tuple[float, ...]) -> float:
    """Angle [rad] from the optical axis up to which the image height rises, so that the lens can be inverted."""
    return float(_rising(model, coefficients)[0][-1])


def project(lens: Lens, points: Array) -> Array:
    """Image points (n, 2) [pixel] of points or directions (n, 3) in the optical frame; NaN beyond the image circle."""
    x, y, z = np.moveaxis(np.asarray(points, np.float64), -1, 0)
    angle = np.arctan2(np.hypot(x, y), z)
    if lens.model == "equirectangular":
        a, b = np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))
    elif lens.model == "equidistant":
        height, across = image_height(lens.model, lens.coefficients, angle), np.hypot(x, y)
        scale = np.divide(height, across, out=np.zeros_like(height), where=across > 0.0)
        a, b = x * scale, y * scale
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = _distorted(lens.coefficients, x / z, y / z)
    seen = angle <= lens.circle
    if lens.model != "equirectangular":
        seen &= angle <= greatest_angle(lens.model, lens.coefficients)
    image = np.stack([lens.fx * a + lens.cx, lens.fy * b + lens.cy], axis=-1)
    return np.asarray(np.where(seen[..., None], image, np.nan))


def directions(lens: Lens, u: ArrayLike, v: ArrayLike) -> Array:
    """Unit directions (..., 3) in the optical frame through image points [pixel]; NaN where the lens has no ray."""
    a, b = np.broadcast_arrays(
        (np.asarray(u, np.float64) - lens.cx) / lens.fx, (np.asarray(v, np.float64) - lens.cy) / lens.fy
    )
    if lens.model == "equirectangular":
        rays = np.stack([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)], axis=-1)
        return np.asarray(np.where(((np.abs(a) <= np.pi) & (np.abs(b) <= np.pi / 2))[..., None], rays, np.nan))
    if lens.model == "equidistant":
        rays = _fisheye_rays(lens.coefficients, a, b)
    else:
        x, y = (a, b) if not any(lens.coefficients) else _undistorted(lens, a, b)
        rays = np.stack([x, y, np.ones_like(x)], axis=-1)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    if lens.circle < np.pi:
        rays[np.arctan2(np.hypot(rays[..., 0], rays[..., 1]), rays[..., 2]) > lens.circle] = np.nan
    return rays


def fields_of_view(lens: Lens, width: int, height: int) -> tuple[float, float]:
    """Angles [deg] between the borders of the image on its middle row and on its middle column; NaN without a ray."""
    if lens.model == "equirectangular":
        return float(np.degrees(width / lens.fx)), float(np.degrees(height / lens.fy))
    u, v = np.array([-0.5, width - 0.5]), np.array([-0.5, height - 0.5])
    across, down = directions(lens, u, lens.cy), directions(lens, lens.cx, v)
    right, lower = np.arctan2(across[:, 0], across[:, 2]), np.arctan2(down[:, 1], down[:, 2])
    return float(np.degrees(right[1] - right[0])), float(np.degrees(lower[1] - lower[0]))


def _radial(coefficients: tuple[float, ...], s: Array) -> tuple[Array, Array]:
    """Radial factor at squared radius s, and its derivative by s."""
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, *(0.0,) * (8 - len(coefficients)))
    upper, lower = 1.0 + s * (k1 + s * (k2 + s * k3)), 1.0 + s * (k4 + s * (k5 + s * k6))
    d_upper, d_lower = k1 + s * (2.0 * k2 + s * 3.0 * k3), k4 + s * (2.0 * k5 + s * 3.0 * k6)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = np.where(lower > 0.0, upper / lower, np.nan)
        return factor, (d_upper - factor * d_lower) / lower


def _distorted(coefficients: tuple[float, ...], x: Array, y: Array) -> tuple[Array, Array]:
    """Distort points of the plane z = 1 (OpenCV's calib3d, projectPoints)."""
    _, _, p1, p2, *_ = (*coefficients, *(0.0,) * (8 - len(coefficients)))
    s = x * x + y * y
    factor, _ = _radial(coefficients, s)
    return (
        x * factor + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * factor + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


def _rising(model: str, coefficients: tuple[float, ...]) -> tuple[Array, Array]:
    """Angles [rad] and their image heights, from the optical axis to where the height stops rising."""
    angle = np.linspace(0.0, np.pi if model == "equidistant" else _STEEPEST, _NODES)
    height = image_height(model, coefficients, angle)
    falls = np.flatnonzero(~(np.diff(height) > 0.0))
    end = int(falls[0]) + 1 if len(falls) else _NODES
    return angle[:end], height[:end]


def _start(model: str, coefficients: tuple[float, ...], height: Array) -> Array:
    """Angles [rad] of image heights between the nodes of a table; NaN beyond it."""
    angles, heights = _rising(model, coefficients)
    return np.asarray(np.interp(height, heights, angles, right=np.nan))


def _fisheye_rays(coefficients: tuple[float, ...], a: Array, b: Array) -> Array:
    k1, k2, k3, k4 = coefficients
    height = np.hypot(a, b)
    theta = _start("equidistant", coefficients, height)
    for _ in range(_STEPS):
        s = theta * theta
        slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)))
        step = (image_height("equidistant", coefficients, theta) - height) / np.maximum(slope, 1e-9)
        theta = np.clip(theta - step, 0.0, np.pi)
        if not (np.abs(step) > 1e-14).any():
            break
    residual = np.abs(image_height("equidistant", coefficients, theta) - height)
    theta = np.where(residual < _CLOSED, theta, np.nan)
    scale = np.divide(np.sin(theta), height, out=np.ones_like(height), where=height > 0.0)
    return np.stack([a * scale, b * scale, np.cos(theta)], axis=-1)


def _undistorted(lens: Lens, a: Array, b: Array) -> tuple[Array, Array]:
    """Points of the plane z = 1 by Newton's method in two dimensions, from the inverse of the radial part."""
    _, _, p1, p2, *_ = lens.coefficients
    height = np.hypot(a, b)
    first = np.tan(_start(lens.model, lens.coefficients, height))
    most = np.tan(greatest_angle(lens.model, lens.coefficients))
    first = np.where(np.isnan(first), most, first)  # tangential distortion may bring it back
    scale = np.divide(first, height, out=np.ones_like(height), where=height > 0.0)
    x, y = a * scale, b * scale
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        for _ in range(_STEPS):
            (da, db), (xx, xy, yy) = _distorted(lens.coefficients, x, y), _jacobian(lens.coefficients, x, y, p1, p2)
            da, db, area = da - a, db - b, xx * yy - xy * xy
            step_x, step_y = (yy * da - xy * db) / area, (xx * db - xy * da) / area
            x, y = x - step_x, y - step_y
            if not (np.abs(step_x) + np.abs(step_y) > 1e-14 * (1.0 + np.abs(x) + np.abs(y))).any():
                break
        da, db = _distorted(lens.coefficients, x, y)
        xx, xy, yy = _jacobian(lens.coefficients, x, y, p1, p2)
        right = (np.hypot(da - a, db - b) < _CLOSED) & (np.hypot(x, y) <= most) & (xx * yy > xy * xy)
    return np.where(right, x, np.nan), np.where(right, y, np.nan)


def _jacobian(coefficients: tuple[float, ...], x: Array, y: Array, p1: float, p2: float) -> tuple[Array, Array, Array]:
    """Derivatives of the distorted point: a by x, a by y (which is b by x), b by y."""
    factor, slope = _radial(coefficients, x * x + y * y)
    return (
        factor + 2.0 * slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        2.0 * (slope * x * y + p1 * x + p2 * y),
        factor + 2.0 * slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )
