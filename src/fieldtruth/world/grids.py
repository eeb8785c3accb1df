# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grids over a world, the distance from its edge, fractal noise on grids and in space, and trails as smooth lines.

Noise is a sum of smooth random fields of halving wavelength.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.world.model import Heightfield, Raster

BUILT_IN: Final = (100.0, 50.0)
"""Length and width [m] of the built-in worlds, for which the default counts are."""
FINE_AREA: Final = 40_000.0
"""Area [m^2] up to which grids have their full resolution: 16 million nodes of the terrain."""
SOFT: Final = 0.3
"""Standard deviation [m] by which the shade of crowns is smoothed."""
COVER: Final = 0.1
"""Spacing [m] of the grid of a world's cover at full resolution."""


def coarseness(size: tuple[float, float]) -> int:
    """Factor on the spacing of grids over a world of a size [m], so that their nodes stay about as many."""
    return max(1, int(np.ceil(np.sqrt(size[0] * size[1] / FINE_AREA))))


def grid_axes(size: tuple[float, float], spacing: float) -> tuple[Array, Array]:
    """Coordinates [m] along x and along y of a grid's nodes, from edge to edge of the world."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / spacing) + 1) for s in size)
    return x, y


def distance_beyond(size: tuple[float, float], x: Array, y: Array) -> Array:
    """Distance [m] of positions to the world's edge, 0 inside."""
    return np.asarray(np.hypot(np.maximum(np.abs(x) - size[0] / 2, 0.0), np.maximum(np.abs(y) - size[1] / 2, 0.0)))


def make_heightfield(heights: Array, spacing: float, x: Array, y: Array) -> Heightfield:
    """Heightfield of heights (nx, ny) [m] on nodes x (nx,), y (ny,), which are ``spacing`` [m] apart."""
    return Heightfield(heights=heights.astype(np.float32), spacing=spacing, x0=float(x[0]), y0=float(y[0]))


def make_raster(values: ArrayLike, spacing: float, x: Array, y: Array) -> Raster:
    """Raster of values (nx, ny) or (nx, ny, channels) on nodes x (nx,), y (ny,), which are ``spacing`` [m] apart."""
    return Raster(values=np.asarray(values, np.float32), spacing=spacing, x0=float(x[0]), y0=float(y[0]))


def under_circles(circles: Iterable[tuple[float, float, float]], axes: tuple[Array, Array], fade: float) -> Array:
    """Share (nx, ny) to which nodes are below circles (x, y, radius) [m]; it falls to 0 over ``fade`` [m] outside."""
    x, y = axes
    clear = np.ones((len(x), len(y)), np.float32)
    for cx, cy, radius in circles:
        reach = radius + fade
        i, j = (slice(*np.searchsorted(axis, (c - reach, c + reach))) for axis, c in ((x, cx), (y, cy)))
        away = np.hypot(x[i, None] - cx, y[j] - cy)
        clear[i, j] *= np.clip((away - radius) / fade, 0.0, 1.0)
    return np.asarray(gaussian_filter(1.0 - clear, SOFT / float(x[1] - x[0])))


def fractal_noise(
    x: Array, y: Array, *, wavelength: float, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> Array:
    """Noise (len(x), len(y)) of about unit deviation; the longest ``wavelength`` [m] halves ``octaves`` - 1 times.

    Each octave interpolates independent normal numbers, half a wavelength apart, with cubic splines; its weight is
    ``gain`` times that of the octave before (the turbulence of Perlin 1985 without the absolute value).
    """
    total, energy = np.zeros((len(x), len(y))), 0.0
    for octave in range(octaves):
        step, weight = wavelength / 2 ** (octave + 1), gain**octave
        nodes = rng.standard_normal((int(np.ptp(x) / step) + 5, int(np.ptp(y) / step) + 5))
        u, v = np.meshgrid((x - x[0]) / step + 2.0, (y - y[0]) / step + 2.0, indexing="ij")
        total += weight * map_coordinates(nodes, [u, v], order=3, mode="nearest")
        energy += weight**2
    return np.asarray(total / np.sqrt(0.756 * energy))  # cubic splines keep about 0.756 of the nodes' variance


def solid_noise(
    points: Array, *, wavelength: float, octaves: int, rng: np.random.Generator, gain: float = 0.5
) -> Array:
    """Noise (n,) of about unit deviation at ``points`` (n, d), in d dimensions; see ``fractal_noise``."""
    total, energy = np.zeros(len(points)), 0.0
    low, extent = points.min(axis=0), np.ptp(points, axis=0)
    for octave in range(octaves):
        step, weight = wavelength / 2 ** (octave + 1), gain**octave
        nodes = rng.standard_normal(tuple((extent / step).astype(int) + 5))
        total += weight * map_coordinates(nodes, ((points - low) / step + 2.0).T, order=3, mode="nearest")
        energy += weight**2
    return np.asarray(total / np.sqrt(0.87 ** points.shape[1] * energy))  # splines keep 0.87 per dimension


def noise_map(
    size: tuple[float, float], wavelength: float, rng: np.random.Generator, *, nodes: int = 16
) -> Callable[[Array], Array]:
    """Noise of three octaves and about unit deviation over an area (x, y) [m], as a function of positions (n, 2).

    ``nodes`` is the resolution: nodes per wavelength.
    """
    x, y = grid_axes(size, wavelength / nodes)
    values = fractal_noise(x, y, wavelength=wavelength, octaves=3, rng=rng)
    raster = make_raster(values, float(x[1] - x[0]), x, y)
    return lambda xy: raster.at(*xy.T)


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

    def left(self, xy: ArrayLike) -> Array:
        """Distance [m], (n,), of positions (n, 2) to the line, below 0 to its right."""
        xy = np.asarray(xy, np.float64)
        _, nearest = self._tree.query(xy, workers=-1 if len(xy) > _FEW else 1)
        (tx, ty), (dx, dy) = self.tangents[nearest].T, (xy - self.points[nearest]).T
        return np.where(tx * dy >= ty * dx, 1.0, -1.0) * self.distance(xy)

    def may_be_within(self, reach: float, x: float, y: float) -> bool:
        """Return True if a position is within ``reach`` [m] of the rectangle around the line."""
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
