# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Poses of plants that lean, see ``sense.leaning`` and ``sense.wind``: of tens of thousands for each reading."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.kernels.compile import kernel

_BLOCK: Final = 1024


@kernel
def add_waves(table: Float32Array, waves: Float32Array, out: Float32Array) -> None:
    """Add the product of a table (w, n) and waves (w,) to ``out`` (n,), four at a time and always in their order.

    The number of waves is a multiple of four; one at a time took seven times as long.
    """
    count = len(out)
    for first in range(0, count, _BLOCK):
        part = out[first : min(first + _BLOCK, count)]
        last = first + len(part)
        for w in range(0, len(waves), 4):
            a, b, c, d = waves[w], waves[w + 1], waves[w + 2], waves[w + 3]
            own, second = table[w, first:last], table[w + 1, first:last]
            third, fourth = table[w + 2, first:last], table[w + 3, first:last]
            for k in range(len(part)):
                part[k] += own[k] * a + second[k] * b + third[k] * c + fourth[k] * d


@kernel
def pose_plants(vectors: Array, world_from_object: Array, foot: Array, out: Array) -> None:
    """Turn poses (n, 4, 4) about feet (n, 3) [m] by horizontal rotation vectors, and lower them: ``out`` (n, 3, 4).

    ``vectors`` (n, 3) are x and y [rad], and the depth [m].
    """
    for k in range(len(vectors)):
        a, b = vectors[k, 0], vectors[k, 1]
        angle = np.sqrt(a * a + b * b)
        sine, half = 1.0, 0.5  # sin(angle) / angle, (1 - cos(angle)) / angle^2
        if angle > 1e-8:
            sine, half = np.sin(angle) / angle, 2.0 * (np.sin(0.5 * angle) / angle) ** 2
        rows = (
            (1.0 - half * b * b, half * a * b, sine * b),
            (half * a * b, 1.0 - half * a * a, -sine * a),
            (-sine * b, sine * a, 1.0 - half * angle * angle),
        )
        own, at = world_from_object[k], foot[k]
        for i in range(3):
            x, y, z = rows[i]
            for j in range(3):
                out[k, i, j] = x * own[0, j] + y * own[1, j] + z * own[2, j]
            dx, dy, dz = own[0, 3] - at[0], own[1, 3] - at[1], own[2, 3] - at[2]
            out[k, i, 3] = at[i] + x * dx + y * dy + z * dz
        out[k, 2, 3] -= vectors[k, 2]


@kernel
def pose_limbs(vectors: Array, world_from_object: Array, foot: Array, out: Array) -> None:
    """Turn poses (n, 4, 4) about feet (n, 3) [m] by rotation vectors (n, 3) [rad]: ``out`` (n, 3, 4)."""
    for k in range(len(vectors)):
        a, b, c = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        angle = np.sqrt(a * a + b * b + c * c)
        sine, half = 1.0, 0.5  # as in ``pose_plants``
        if angle > 1e-8:
            sine, half = np.sin(angle) / angle, 2.0 * (np.sin(0.5 * angle) / angle) ** 2
        rows = (
            (1.0 - half * (b * b + c * c), half * a * b - sine * c, half * a * c + sine * b),
            (half * a * b + sine * c, 1.0 - half * (a * a + c * c), half * b * c - sine * a),
            (half * a * c - sine * b, half * b * c + sine * a, 1.0 - half * (a * a + b * b)),
        )
        own, at = world_from_object[k], foot[k]
        for i in range(3):
            x, y, z = rows[i]
            for j in range(3):
                out[k, i, j] = x * own[0, j] + y * own[1, j] + z * own[2, j]
            out[k, i, 3] = at[i] + x * (own[0, 3] - at[0]) + y * (own[1, 3] - at[1]) + z * (own[2, 3] - at[2])


@kernel
def place_geometries(
    poses: Array, world_from_object: Array, plant: NDArray[np.intp], columns: Float32Array, axes: Float32Array
) -> None:
    """Write poses (n, 3, 4) of the plants of geometries (g,) by columns, as Embree reads them: ``columns`` (g, 12).

    ``axes`` (g, 3, 3) is the turn in the object's own frame: the inverse of its ``world_from_object``, a rotation times
    a scale, times the pose.
    """
    for g in range(len(plant)):
        pose, own = poses[plant[g]], world_from_object[plant[g]]
        per = 1.0 / (own[0, 0] ** 2 + own[1, 0] ** 2 + own[2, 0] ** 2)
        for j in range(4):
            for i in range(3):
                columns[g, 3 * j + i] = pose[i, j]
        for i in range(3):
            for j in range(3):
                axes[g, i, j] = (own[0, i] * pose[0, j] + own[1, i] * pose[1, j] + own[2, i] * pose[2, j]) * per
