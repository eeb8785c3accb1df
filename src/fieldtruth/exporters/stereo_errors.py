# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Errors of disparities, by true depth, over any number of images with bounded memory."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Counts

EDGES: Final = (0.0, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)
"""Ranges of true depth [m], each without its end."""
BAD: Final = 3.0
"""Error [pixel] of a disparity from which a match is wrong, as in KITTI's stereo benchmark (2012)."""

_STEPS: Final = 4000
_LEAST: Final = 1e-5
_PER_DECADE: Final = 500
"""Relative errors are counted in a histogram of even steps of their logarithm, each 0.46 %, from 1e-5 to 1e3."""


class Errors(NamedTuple):
    """Counts by range of true depth (n,), and the histogram (n, steps) of relative errors of the matched."""

    pixels: Counts
    matched: Counts
    bad: Counts
    histogram: Counts


def errors_of(found: NDArray[np.float32], expected: Array, depth: NDArray[np.float32]) -> Errors:
    """Compare the found disparities (h, w) [pixel], NaN without a match, with those of the true depth (h, w) [m].

    Pixels of the sky, whose depth is infinite, are left out.
    """
    real = np.isfinite(depth) & (depth > 0.0)
    band = np.searchsorted(EDGES, depth[real], side="right") - 1
    found, expected = found[real].astype(np.float64), expected[real]
    has = np.isfinite(found)
    count = len(EDGES) - 1
    wrong = np.abs(found[has] - expected[has]) > BAD
    relative = np.abs(expected[has] / found[has] - 1.0)  # depth is inverse to disparity
    with np.errstate(divide="ignore"):
        step = np.floor(_PER_DECADE * np.log10(relative / _LEAST))
    step = np.clip(step, 0, _STEPS - 1).astype(np.int64)
    histogram = np.bincount(band[has] * _STEPS + step, minlength=count * _STEPS).reshape(count, _STEPS)
    return Errors(
        np.bincount(band, minlength=count),
        np.bincount(band[has], minlength=count),
        np.bincount(band[has][wrong], minlength=count),
        histogram,
    )


def errors_csv(errors: Sequence[Errors]) -> str:
    """Table of the errors of all images: a row per range of true depth, and one of all."""
    total = Errors(*(np.sum([getattr(each, name) for each in errors], axis=0) for name in Errors._fields))
    lines = ["depth_from_m,depth_to_m,pixels,matched_share,bad_3px_share,median_relative_error"]
    return "\n".join([*lines, *_rows(total)]) + "\n"


def _rows(total: Errors) -> Iterator[str]:
    for k, (start, end) in enumerate(pairwise(EDGES)):
        yield _row(start, end, Errors(*(values[k] for values in total)))
    yield _row(EDGES[0], EDGES[-1], Errors(*(values.sum(axis=0) for values in total)))


def _row(start: float, end: float, row: Errors) -> str:
    pixels, matched, bad = int(row.pixels), int(row.matched), int(row.bad)
    shares = f"{matched / pixels:.4f}" if pixels else "", f"{bad / matched:.4f}" if matched else ""
    return ",".join([f"{start:g}", f"{end:g}", str(pixels), *shares, _median(row.histogram)])


def _median(histogram: Counts) -> str:
    total = np.cumsum(histogram)
    if not total[-1]:
        return ""
    step = int(np.searchsorted(total, (total[-1] + 1) // 2))
    return f"{_LEAST * 10 ** ((step + 0.5) / _PER_DECADE):.4g}"
