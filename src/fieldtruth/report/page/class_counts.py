# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How many pixels of a tag image, and how many points of a cloud, belong to each class."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.bag.decode import image, points
from fieldtruth.core.arrays import Counts
from fieldtruth.core.classes import CLASSES, PALETTE
from fieldtruth.sense.kernel import kernel

_CODES: Final = (PALETTE.astype(np.int64) @ [1, 256, 65536]).astype(np.int64)


def count_pixels(tag: Any) -> Counts:
    """Pixels by class id (16,) of a tag image's message; in row 0 those with a colour that no class has.

    Raises:
        BagError: no image of three bytes a pixel.
    """
    counts = np.zeros(len(CLASSES), np.int64)
    _count_runs(np.ascontiguousarray(image(tag)).reshape(-1, 3), _CODES, counts)
    return counts


def count_points(cloud: Any) -> Counts:
    """Points by class id (16,) of a cloud's message; in row 0 those without a class."""
    return np.bincount(class_ids(points(cloud)), minlength=len(CLASSES)).astype(np.int64)


def class_ids(cloud: NDArray[np.void]) -> NDArray[np.uint8]:
    """Class id of each point (n,): its ``label``, or else its intensity, as in the paper; 0 if that is no class."""
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
    """Add the pixels of colours (n, 3) to their classes. Colours are looked up where they change, which is seldom."""
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
