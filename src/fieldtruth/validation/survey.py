# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Looks at every pixel of a moment's tag, depth and object images in one pass: 1 ms for 1280 x 720."""

from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.validation.objects import N_CLASSES

NO_PIXEL: Final = -1
_SKY: Final = int(Label.SKY)


class Survey(NamedTuple):
    """What was found; places are numbers of pixels, row by row, NO_PIXEL for none."""

    counts: NDArray[np.int64]
    """(objects, classes) pixels of each pair; without object ids all count as object 0."""
    first: NDArray[np.int64]
    """(objects, classes) where each pair was met first."""
    colours: tuple[int, int]
    """Pixels whose colour no class has: how many, and the first."""
    beyond: tuple[int, int]
    """Pixels whose object id is that of no object."""
    depths: tuple[int, int]
    """Pixels whose depth is neither that of the sky on sky nor within the camera's reach elsewhere."""


def survey(
    rgb: NDArray[np.uint8],
    instance: NDArray[np.uint16] | None,
    depth: NDArray[np.float32] | None,
    objects: int,
    far: float,
) -> Survey:
    """Survey tags (h, w, 3), object ids (h, w), and depths (h, w) [m] up to ``far``."""
    objects = max(1, objects) if instance is not None else 1
    counts, first = np.zeros((objects, N_CLASSES), np.int64), np.full((objects, N_CLASSES), NO_PIXEL, np.int64)
    faults = np.zeros((3, 2), np.int64)
    _walk(
        np.ascontiguousarray(rgb).reshape(-1, 3),
        np.zeros(0, np.uint16) if instance is None else np.ascontiguousarray(instance).reshape(-1),
        np.zeros(0, np.float32) if depth is None else np.ascontiguousarray(depth).reshape(-1),
        _BY_COLOUR, _BLUES, np.float32(far * (1.0 + 1e-6)), counts, first, faults,
    )  # fmt: skip
    colours, beyond, depths = ((int(n), int(k)) for n, k in faults)
    return Survey(counts, first, colours, beyond, depths)


def _table() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Class by red, green and blue's highest bit, 0 for none, and the blue that it has to have."""
    by_colour, blues = np.zeros((256, 256, 2), np.uint8), np.zeros(N_CLASSES, np.uint8)
    for label in range(1, N_CLASSES):
        red, green, blue = PALETTE[label]
        assert by_colour[red, green, blue >> 7] == 0, "two classes share a cell of the table"
        by_colour[red, green, blue >> 7], blues[label] = label, blue
    return by_colour, blues


_BY_COLOUR, _BLUES = _table()


def _pass(
    rgb: Any, instance: Any, depth: Any, by_colour: Any, blues: Any, far: Any, counts: Any, first: Any, faults: Any
) -> None:
    for k in range(len(rgb)):
        label = by_colour[rgb[k, 0], rgb[k, 1], rgb[k, 2] >> 7]
        if label == 0 or blues[label] != rgb[k, 2]:
            if faults[0, 0] == 0:
                faults[0, 1] = k
            faults[0, 0] += 1
            continue
        thing = 0
        if len(instance) > 0:
            thing = int(instance[k])
            if thing >= len(counts):
                if faults[1, 0] == 0:
                    faults[1, 1] = k
                faults[1, 0] += 1
                continue
        if counts[thing, label] == 0:
            first[thing, label] = k
        counts[thing, label] += 1
        if len(depth) > 0:
            z = depth[k]
            right = z == np.inf if label == _SKY else (z > 0.0) & (z <= far)
            if not right:
                if faults[2, 0] == 0:
                    faults[2, 1] = k
                faults[2, 0] += 1


def _compiled() -> Any:
    try:
        return njit(nogil=True, cache=True)(_pass)
    except (RuntimeError, OSError):  # nowhere to keep it: it is compiled in each process
        return njit(nogil=True)(_pass)


_walk: Any = _compiled()
