# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses and tints of many objects at once."""

import numpy as np
from numpy.typing import ArrayLike

from fieldtruth.core.arrays import Array, Float32Array


def upright_pose(x: float, y: float, yaw: float, scale: float) -> Array:
    """Pose (4, 4) of an object at x, y [m] and height 0, turned by ``yaw`` [rad] and scaled."""
    pose: Array = upright_poses(np.array([[x, y]]), np.array([yaw]), np.array([scale]))[0]
    return pose


def upright_poses(xy: Array, yaw: Array, scale: Array) -> Array:
    """Poses (n, 4, 4) at positions (n, 2) and height 0, turned by ``yaw`` (n,) [rad] and scaled by ``scale`` (n,)."""
    poses = np.zeros((len(xy), 4, 4))
    poses[:, 0, 0] = poses[:, 1, 1] = scale * np.cos(yaw)
    poses[:, 1, 0], poses[:, 0, 1] = scale * np.sin(yaw), -scale * np.sin(yaw)
    poses[:, 2, 2], poses[:, 3, 3] = scale, 1.0
    poses[:, :2, 3] = xy
    return poses


def rotations_to(up: Array) -> Array:
    """Smallest rotations (n, 3, 3) that take z to directions ``up`` (n, 3), which need not be of unit length.

    Rodrigues' formula about z x up; ``up`` must not point straight down.
    """
    x, y, z = (up / np.linalg.norm(up, axis=1, keepdims=True)).T
    share = 1.0 / (1.0 + z)
    return np.stack(
        [
            np.stack([1.0 - share * x * x, -share * x * y, x], axis=-1),
            np.stack([-share * x * y, 1.0 - share * y * y, y], axis=-1),
            np.stack([-x, -y, z], axis=-1),
        ],
        axis=1,
    )


def tilted(poses: Array, slope_x: ArrayLike, slope_y: ArrayLike, tilt: float) -> Array:
    """Rotations (n, 3, 3) of upright poses (n, 4, 4) after leaning by a share ``tilt`` of the ground's slope.

    ``slope_x``, ``slope_y`` (n,) are the ground's slopes [rise over run] along x and y.
    """
    sx, sy = (-tilt * np.atleast_1d(np.asarray(s, np.float64)) for s in (slope_x, slope_y))
    return np.asarray(rotations_to(np.column_stack([sx, sy, np.ones(len(sx))])) @ poses[:, :3, :3])


def random_tint(rng: np.random.Generator, spread: float) -> tuple[float, float, float]:
    """Colour factors near 1: brightness varies by ``spread``, each channel by a third of it."""
    bright = rng.normal(0.0, spread)
    r, g, b = np.exp(np.clip(bright + rng.normal(0.0, spread / 3, 3), -0.5, 0.5))
    return float(r), float(g), float(b)


def random_tints(rng: np.random.Generator, spread: float, count: int) -> Float32Array:
    """Colour factors (count, 3) with the distribution of ``random_tint``."""
    bright = rng.normal(0.0, spread, (count, 1)) + rng.normal(0.0, spread / 3, (count, 3))
    return np.asarray(np.exp(bright.clip(-0.5, 0.5)), np.float32)
