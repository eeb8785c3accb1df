# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Position by weighted least squares: how errors of ranges become errors of a position, and how far they reach.

With H the rows (-u, 1) of the unit vectors u to the satellites, and W the inverse variances of their ranges, the errors
e of the ranges move the solution of position and clock by (H' W H)^-1 H' W e, whose covariance is (H' W H)^-1 (Misra
and Enge, Global Positioning System, 2nd ed., chapter 6).
"""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array, Counts, Mask

UNKNOWNS: Final = 4
_ENU: Final = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # east, north, up from north, west, up


class Solution(NamedTuple):
    """Solutions at t times; rows without one are NaN."""

    error: Array
    """(t, 3) of the position, in the world frame (north, west, up) [m]."""
    covariance: Array
    """(t, 3, 3) of it in east, north, up [m^2]."""
    dop: Array
    """(t, 3): position, horizontal and vertical dilution of precision."""
    satellites: Counts
    """(t,) satellites in use."""


def solve(directions: Array, used: Mask, sigma: Array, errors: Array) -> Solution:
    """Solve for position and clock.

    Args:
        directions: unit vectors (t, n, 3) to the satellites in the world frame (north, west, up).
        used: (t, n) satellites in use; with fewer than four there is no solution.
        sigma: (t, n) standard deviations of the ranges [m]; 0 counts as one that is small and the same for all.
        errors: (t, n) of the ranges [m].
    """
    count = used.sum(axis=1)
    solved = count >= UNKNOWNS
    rows = np.concatenate([-directions, np.ones((*used.shape, 1))], axis=-1)[solved]
    inverse = np.where(used, 1.0 / np.maximum(sigma, 1e-9) ** 2, 0.0)[solved]
    cofactor = _inverse(np.einsum("tn,tni,tnj->tij", used[solved] * 1.0, rows, rows))
    covariance = _inverse(np.einsum("tn,tni,tnj->tij", inverse, rows, rows))
    moved = np.einsum("tij,tnj,tn,tn->ti", covariance, rows, inverse, np.where(used, errors, 0.0)[solved])
    axes = np.diagonal(cofactor, axis1=1, axis2=2)
    dop = np.sqrt(np.stack([axes[:, :3].sum(axis=1), axes[:, :2].sum(axis=1), axes[:, 2]], axis=-1))
    local = _ENU @ covariance[:, :3, :3] @ _ENU.T
    return Solution(_spread(moved[:, :3], solved), _spread(local, solved), _spread(dop, solved), count)


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
