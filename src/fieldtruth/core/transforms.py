# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rigid transforms, and the only conversion of quaternion order.

A transform is a 4 x 4 float64 matrix named ``a_from_b``: it takes points of frame b to frame a, so that products read
like a chain, ``world_from_lidar = world_from_base @ base_from_lidar``. Frames follow REP-103 (x forward, y left, z up;
optical frames: x right, y down, z forward). Quaternions are (w, x, y, z) inside the package; in ROS's messages they are
(x, y, z, w).
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from fieldtruth.core.arrays import Array


def pose(xyz: ArrayLike, rpy_deg: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Make ``parent_from_child``, (4, 4) or (n, 4, 4), from positions [m] and roll, pitch, yaw about fixed axes [deg].

    The order is the one of URDF and REP-103: first roll about x, then pitch about y, then yaw about z, all axes fixed.
    """
    return _matrix(xyz, Rotation.from_euler("xyz", np.asarray(rpy_deg, np.float64), degrees=True).as_matrix())


def pose_from_quaternion_wxyz(xyz: ArrayLike, quaternion_wxyz: ArrayLike) -> Array:
    """Make ``parent_from_child``, (..., 4, 4), from positions (..., 3) [m] and unit quaternions (..., 4)."""
    return _matrix(xyz, rotation_from_quaternion_wxyz(quaternion_wxyz))


def _matrix(xyz: ArrayLike, rotation: Array) -> Array:
    matrix = np.zeros((*rotation.shape[:-2], 4, 4))
    matrix[..., :3, :3] = rotation
    matrix[..., :3, 3] = xyz
    matrix[..., 3, 3] = 1.0
    return matrix


def inverse(a_from_b: Array) -> Array:
    """Return ``b_from_a`` of one or many rigid transforms (..., 4, 4)."""
    rotation = np.swapaxes(a_from_b[..., :3, :3], -1, -2)
    result = np.zeros_like(a_from_b)
    result[..., :3, :3] = rotation
    result[..., :3, 3] = -np.einsum("...ij,...j->...i", rotation, a_from_b[..., :3, 3])
    result[..., 3, 3] = 1.0
    return result


def transform(a_from_b: Array, points_b: ArrayLike) -> Array:
    """Take points (n, 3) [m] of frame b to frame a."""
    return np.asarray(points_b, np.float64) @ a_from_b[:3, :3].T + a_from_b[:3, 3]


def rotation_from_quaternion_wxyz(quaternion_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4) in (w, x, y, z)."""
    matrix: Array = Rotation.from_quat(xyzw_from_wxyz(quaternion_wxyz)).as_matrix()
    return matrix


def quaternion_wxyz_from_rotation(rotation: ArrayLike) -> Array:
    """Unit quaternions (..., 4) in (w, x, y, z), w >= 0, of rotation matrices (..., 3, 3)."""
    xyzw: Array = Rotation.from_matrix(np.asarray(rotation)).as_quat(canonical=True)
    return wxyz_from_xyzw(xyzw)


def rpy_deg_from_rotation(rotation: Array) -> Array:
    """Roll, pitch, yaw (3,) [deg] about fixed axes, as ``pose`` takes them; with a pitch of 90 deg yaw is 0."""
    across = np.hypot(rotation[0, 0], rotation[1, 0])
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0]) if across > 1e-12 else 0.0
    # From the row that yaw leaves to roll alone: near 90 deg an error of yaw and one of roll then cancel.
    row = np.cos(yaw) * rotation[1] - np.sin(yaw) * rotation[0]
    return np.degrees([np.arctan2(-row[2], row[1]), np.arctan2(-rotation[2, 0], across), yaw])


def xyzw_from_wxyz(quaternion_wxyz: ArrayLike) -> Array:
    """Reorder quaternions (..., 4) for ROS and SciPy."""
    return np.roll(np.asarray(quaternion_wxyz, np.float64), -1, axis=-1)


def wxyz_from_xyzw(quaternion_xyzw: ArrayLike) -> Array:
    """Reorder quaternions (..., 4) from ROS and SciPy."""
    return np.roll(np.asarray(quaternion_xyzw, np.float64), 1, axis=-1)


def yaw_from_rotation(rotation: Array) -> Array:
    """Heading [rad] of rotation matrices (..., 3, 3): the angle of the x axis about z, 0 along the parent's x."""
    return np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
