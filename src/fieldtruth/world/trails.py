# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trails as smooth lines with a width, and distances to them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask

_STEP = 0.05  # [m] between the points of a line
_FEW = 1000  # positions for which starting threads takes longer than the search
_LINES = 8  # more trails than these are searched together


@dataclass(frozen=True)
class Line:
    """A smooth line through points: ``points`` (n, 2) [m] about 5 cm apart and its unit ``tangents`` (n, 2)."""

    points: Array
    tangents: Array
    gaps: tuple[int, ...] = ()
    """Rows of ``points`` after which the line is interrupted."""

    @classmethod
    def joined(cls, lines: Sequence[Self]) -> Self:
        """Several lines as one with gaps, so that one search finds the nearest of all."""
        ends = np.cumsum([len(line.points) for line in lines]) - 1
        points, tangents = (np.concatenate([getattr(line, name) for line in lines]) for name in ("points", "tangents"))
        return cls(points, tangents, tuple(ends[:-1].tolist()))

    def parts(self) -> list[Self]:
        """The pieces between the gaps."""
        rows = np.array(self.gaps, np.intp) + 1
        return [
            type(self)(*each) for each in zip(np.split(self.points, rows), np.split(self.tangents, rows), strict=True)
        ]

    @classmethod
    def through(cls, corners: Sequence[tuple[float, float]], *, smooth: bool = True) -> Self:
        """Connect corners (m, 2) [m] by a cubic spline over the chord length, or by straight segments."""
        knots = np.asarray(corners, np.float64)
        chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
        s = np.linspace(0.0, chord[-1], max(2, int(chord[-1] / _STEP) + 1))
        if smooth and len(knots) > 2:
            points = CubicSpline(chord, knots)(s)
        else:
            points = np.stack([np.interp(s, chord, knots[:, k]) for k in range(2)], axis=-1)
        tangents = np.gradient(points, axis=0)
        return cls(points, tangents / np.linalg.norm(tangents, axis=1, keepdims=True))

    @property
    def length(self) -> float:
        """Length [m]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def distance(self, xy: ArrayLike) -> Array:
        """Distance [m], (n,), of positions (n, 2) to the line."""
        xy = np.asarray(xy, np.float64)
        _, nearest = self._tree.query(xy, workers=-1 if len(xy) > _FEW else 1)
        best = np.full(len(xy), np.inf)
        for step in (-1, 0):  # the two segments that meet in the nearest point
            first = np.clip(nearest + step, 0, len(self.points) - 2)
            a, b = self.points[first], self.points[first + 1]
            along = np.clip(((xy - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0.0, 1.0)
            away = np.linalg.norm(xy - a - along[:, None] * (b - a), axis=1)
            if self.gaps:
                away[self._gap[first]] = np.inf
            best = np.minimum(best, away)
        return best

    def may_be_within(self, reach: float, x: float, y: float) -> bool:
        """Whether a position is within ``reach`` [m] of the rectangle around the line."""
        (low_x, low_y), (high_x, high_y) = self._corners
        return low_x - reach <= x <= high_x + reach and low_y - reach <= y <= high_y + reach

    @cached_property
    def _corners(self) -> tuple[tuple[float, float], tuple[float, float]]:
        (low_x, low_y), (high_x, high_y) = self.points.min(axis=0).tolist(), self.points.max(axis=0).tolist()
        return (low_x, low_y), (high_x, high_y)

    @cached_property
    def _gap(self) -> Mask:
        gap = np.zeros(len(self.points), np.bool_)
        gap[list(self.gaps)] = True
        return gap

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.points)


@dataclass(frozen=True)
class Trail:
    """A trail: its centre line and its width [m]."""

    line: Line
    width: float


def make_trails(lines: Sequence[Sequence[tuple[float, float]]], width: float) -> list[Trail]:
    """Trails of a width [m] through the corners [m] of each line; many lines become one trail with gaps."""
    smooth = [Line.through(corners) for corners in lines]
    return [Trail(line, width) for line in (smooth if len(smooth) <= _LINES else [Line.joined(smooth)])]


def signed_distance(trails: Sequence[Trail], x: Array, y: Array) -> NDArray[np.float32]:
    """Distance [m], (len(x), len(y)), of grid nodes to the nearest trail's edge, below 0 inside a trail."""
    nodes = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    nearest = np.full(len(nodes), np.inf)
    for trail in trails:
        nearest = np.minimum(nearest, trail.line.distance(nodes) - trail.width / 2.0)
    return nearest.reshape(len(x), len(y)).astype(np.float32)
