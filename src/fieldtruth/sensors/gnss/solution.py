# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Position by weighted least squares: how errors of ranges move it, and what the geometry of the satellites adds.

With H the rows (-u, 1) of the unit vectors u to the satellites, and W the inverse variances of their ranges, the errors
e of the ranges move the solution of position and clock by (H' W H)^-1 H' W e, whose covariance is (H' W H)^-1 (Misra
and Enge, Global Positioning System, 2nd ed., chapter 6).
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Counts, Mask

UNKNOWNS: Final = 4


class Solution(NamedTuple):
    """Solutions at t times with n satellites; rows without one are NaN."""

    gain: Array
    """(t, 3, n): by how much the position moves in the world frame (north, west, up) with the error of a range."""
    dop: Array
    """(t, 3): position, horizontal and vertical dilution of precision."""
    satellites: Counts
    """(t,) satellites in use."""


def solve(directions: Array, used: Mask, sigma: Array) -> Solution:
    """Solve for position and clock.

    Args:
        directions: unit vectors (t, n, 3) to the satellites in the world frame.
        used: (t, n) satellites in use; with fewer than four there is no solution.
        sigma: (t, n) standard deviations of the ranges [m]; 0 counts as one that is small and the same for all.
    """
    count = used.sum(axis=1)
    solved = count >= UNKNOWNS
    rows = np.concatenate([-directions, np.ones((*used.shape, 1))], axis=-1)[solved]
    inverse = np.where(used, 1.0 / np.maximum(sigma, 1e-9) ** 2, 0.0)[solved]
    cofactor = _inverse(np.einsum("tn,tni,tnj->tij", np.where(used, 1.0, 0.0)[solved], rows, rows))
    covariance = _inverse(np.einsum("tn,tni,tnj->tij", inverse, rows, rows))
    gain = np.einsum("tij,tnj,tn->tin", covariance, rows, inverse)
    axes = np.diagonal(cofactor, axis1=1, axis2=2)
    dop = np.sqrt(np.stack([axes[:, :3].sum(axis=1), axes[:, :2].sum(axis=1), axes[:, 2]], axis=-1))
    return Solution(_spread(gain[:, :3], solved), _spread(dop, solved), count)


def _inverse(matrices: Array) -> Array:
    """Inverse of symmetric matrices (t, 4, 4); NaN where satellites lie in one plane with the clock."""
    regular = np.linalg.cond(matrices) < 1e12
    result = np.full_like(matrices, np.nan)
    result[regular] = np.linalg.inv(matrices[regular])
    return result


def _spread(values: Array, rows: Mask) -> Array:
    result = np.full((len(rows), *values.shape[1:]), np.nan)
    result[rows] = values
    return result
