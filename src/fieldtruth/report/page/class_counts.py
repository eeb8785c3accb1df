# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of the classes in tag images and clouds."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import image, points
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.kernels.compile import kernel

_CODES: Final = (PALETTE.astype(np.int64) @ [1, 256, 65536]).astype(np.int64)


def count_pixels(tag: Any) -> Counts:
    """Count the pixels of a tag image message by class id (18,); row 0 counts colours that no class has.

    Raises:
        BagError: the image does not have three bytes per pixel.
    """
    counts = np.zeros(len(CLASSES), np.int64)
    _count_runs(np.ascontiguousarray(image(tag)).reshape(-1, 3), _CODES, counts)
    return counts


def count_points(cloud: Any) -> Counts:
    """Count the points of a cloud message by class id (18,); row 0 counts points without a class."""
    return np.bincount(class_ids(points(cloud)), minlength=len(CLASSES)).astype(np.int64)


def class_ids(cloud: NDArray[np.void]) -> NDArray[np.uint8]:
    """Class id of each point (n,) from ``label`` or, as in the paper, intensity; 0 if it is not a class id."""
    names = cloud.dtype.names or ()
    name = next((name for name in ("label", "intensity") if name in names), None)
    if name is None or cloud[name].ndim != 1:
        return np.zeros(len(cloud), np.uint8)
    value = cloud[name]
    known = (value >= 1) & (value < len(CLASSES)) & (value == np.floor(value))
    ids: NDArray[np.uint8] = np.where(known, value, 0).astype(np.uint8)
    return ids


@kernel
def _count_runs(colours: NDArray[np.uint8], codes: Counts, counts: Counts) -> None:
    """Add pixels (n, 3) to the counts of their classes. A colour is looked up only where it changes, which is rare."""
    last, row, run = -1, 0, 0
    for k in range(colours.shape[0]):
        code = colours[k, 0] + 256 * np.int64(colours[k, 1]) + 65536 * np.int64(colours[k, 2])
        if code != last:
            counts[row] += run
            last, row, run = code, 0, 0
            for candidate in range(1, codes.shape[0]):
                if codes[candidate] == code:
                    row = candidate
        run += 1
    counts[row] += run
