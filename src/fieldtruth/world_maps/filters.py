# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layers that follow from heights and obstacles around a cell, in closed form.

All take heights (n, m) [m] of cells ``spacing`` [m] apart, and return arrays (n, m). Beyond the edge, the heights go on
point-symmetric to it: a plane goes on as a plane.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import (
    correlate1d,
    distance_transform_edt,
    gaussian_filter,
    maximum_filter,
    minimum_filter,
    uniform_filter1d,
)

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.columns import find_drops

SLOPE_REACH: Final = 0.25
"""Distance [m] to either side over which a slope is fitted."""
STEP_REACH: Final = 0.1
"""Distance [m] to either side within which a step is found."""
WIDEST_DROP: Final = 2.0
"""Width [m] of the widest gap that is a negative obstacle."""
FARTHEST: Final = 10.0
"""Distance [m] to obstacles above which it is not measured."""
BANDS: Final = {"20_50cm": (0.2, 0.5), "50_150cm": (0.5, 1.5), "150_500cm": (1.5, 5.0)}
"""Shortest and longest wavelength [m] of each band of roughness."""
_PER_WAVE: Final = 4  # cells along the shortest wave of a band, at least
_ISO: Final = float(np.sqrt(np.log(2.0) / (2.0 * np.pi**2)))
"""Deviation over cutoff wavelength of the Gaussian filter of ISO 16610-21, which halves a wave of that length."""
_TRUNCATE: Final = 4.0  # deviations at which the filter ends


def _reach(distance: float, spacing: float) -> int:
    return max(1, round(distance / spacing))


def _beyond(heights: Array, cells: int) -> Array:
    return np.pad(heights, cells, mode="reflect", reflect_type="odd")


def slope(heights: Array, spacing: float) -> Array:
    """Slope [rad] of the plane that fits the heights around a cell best: atan |g|, g = sum(d h) / sum(d d).

    d is the distance of a cell along an axis, in a square of ``SLOPE_REACH`` to either side.
    """
    k = _reach(SLOPE_REACH, spacing)
    wide, offsets = _beyond(heights, k), np.arange(-k, k + 1.0)
    weights = offsets / (spacing * np.sum(offsets**2))
    along = [correlate1d(uniform_filter1d(wide, 2 * k + 1, 1 - axis), weights, axis)[k:-k, k:-k] for axis in (0, 1)]
    return np.asarray(np.arctan(np.hypot(*along)))


def step_height(heights: Array, spacing: float) -> Array:
    """Greatest absolute difference [m] to another height in a square of ``STEP_REACH`` to either side.

    On a plane that rises by (a, b) it is (|a| + |b|) times the reach.
    """
    k = _reach(STEP_REACH, spacing)
    wide, own = _beyond(heights, k), (slice(k, -k), slice(k, -k))
    above, below = maximum_filter(wide, 2 * k + 1)[own], minimum_filter(wide, 2 * k + 1)[own]
    return np.maximum(above - heights, heights - below)


def roughness(heights: Array, spacing: float, band: tuple[float, float]) -> Array:
    """Root mean square [m] of the waves in a band: sqrt(G_long * (G_short * h - G_long * h)^2).

    G is a Gaussian filter whose deviation is 0.187 of a wavelength, so that it halves a wave of this length (ISO
    16610-21): that of amplitude a and length w has a / sqrt(2) times 2^-(short / w)^2 - 2^-(long / w)^2.
    """
    short, long = (_ISO * wavelength / spacing for wavelength in band)
    k = 2 * int(_TRUNCATE * long + 1)
    wide = _beyond(heights, k)
    waves = gaussian_filter(wide, short, truncate=_TRUNCATE) - gaussian_filter(wide, long, truncate=_TRUNCATE)
    return np.asarray(np.sqrt(gaussian_filter(waves**2, long, truncate=_TRUNCATE)[k:-k, k:-k]))


def drops(heights: Array, spacing: float) -> tuple[Array, Array]:
    """Depth and width [m] of the gaps that a segment of ``WIDEST_DROP`` bridges, along rows, columns or diagonals.

    See ``kernels.columns.find_drops``. The width is NaN where no gap is. Lines end at the edge.
    """
    drop, width = np.zeros(heights.shape), np.full(heights.shape, np.nan)
    find_drops(np.ascontiguousarray(heights, np.float64), spacing, WIDEST_DROP, drop, width)
    return drop, width


def solid_distance(obstacle: NDArray[Any], spacing: float) -> Array:
    """Distance [m] between the middles of a cell and of the nearest obstacle, at most ``FARTHEST``."""
    if not obstacle.any():
        return np.full(obstacle.shape, FARTHEST)
    return np.minimum(distance_transform_edt(obstacle == 0) * spacing, FARTHEST)


class Filter(NamedTuple):
    """How some layers follow from another one."""

    source: str
    reach: float
    """[m]; what is farther away makes no difference."""
    make: Callable[[Array, float], tuple[Array, ...]]
    coarsest: float = np.inf
    """Resolution [m] above which there are too few cells."""


def _rough(band: tuple[float, float]) -> Filter:
    reach = _TRUNCATE * _ISO * 2 * band[1]
    return Filter("hard_ground", reach, lambda h, s: (roughness(h, s, band),), band[0] / _PER_WAVE)


FILTERS: Final[Mapping[tuple[str, ...], Filter]] = {
    ("slope",): Filter("hard_ground", SLOPE_REACH, lambda h, s: (slope(h, s),)),
    ("step_height",): Filter("hard_ground", STEP_REACH, lambda h, s: (step_height(h, s),)),
    **{(f"roughness_{name}",): _rough(band) for name, band in BANDS.items()},
    ("drop_height", "drop_width"): Filter("hard_ground", WIDEST_DROP, drops),
    ("solid_distance",): Filter("obstacle", FARTHEST, lambda o, s: (solid_distance(o, s),)),
}
"""By the layers that they make."""
