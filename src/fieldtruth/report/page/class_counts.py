# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Counts of the classes in tag images and clouds."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import points, tag_image
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.kernels.counting import count_runs

_CODES: Final = (PALETTE.astype(np.int64) @ [1, 256, 65536]).astype(np.int64)


def count_pixels(tag: Any) -> Counts:
    """Count the pixels of a tag image message by class id (18,); row 0 counts colours that no class has.

    Raises:
        BagError: the image is not one in colour.
    """
    counts = np.zeros(len(CLASSES), np.int64)
    count_runs(np.ascontiguousarray(tag_image(tag)).reshape(-1, 3), _CODES, counts)
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
