# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Vectors of three numbers as tuples in compiled code, where an array of three would cost an allocation."""

from fieldtruth.kernels.compile import kernel

Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]
"""Columns of a rotation matrix: the axes of a frame, seen from another one."""


@kernel
def axes_of(w: float, x: float, y: float, z: float) -> Axes:
    """Return the columns of the rotation matrix of a unit quaternion."""
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@kernel
def turned(axes: Axes, v: Vector) -> Vector:
    """Return the rotation of ``axes`` times ``v``."""
    along_x = (axes[0][0] * v[0], axes[0][1] * v[0], axes[0][2] * v[0])
    return plus(plus(along_x, v[1], axes[1]), v[2], axes[2])


@kernel
def plus(a: Vector, share: float, b: Vector) -> Vector:
    """Return a + share * b."""
    return a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
