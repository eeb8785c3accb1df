# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels at the edges of objects, which need more than one ray for a smooth photograph."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Float32Array, Mask
from fieldtruth.kernels.compile import inlined, kernel
from fieldtruth.sense.hits import LabelBuffers
from fieldtruth.sense.packets import IntArray

EDGE_CONTRAST: Final = 0.27
"""Difference of the square roots of neighbours' luminance above which a pixel at an edge is refined."""
EDGE_STEP: Final = 0.01
"""Relative step in depth that makes an edge."""

_CONTRAST, _STEP, _TILE = np.float32(EDGE_CONTRAST), np.float32(EDGE_STEP), 4


class EdgeBuffers(NamedTuple):
    """Memory for the edges of one image. Threads must not share it."""

    marked: Mask  # (h, w)
    pixels: IntArray  # (h * w, 2) row and column


def new_edge_buffers(height: int, width: int) -> EdgeBuffers:
    """Allocate memory for images of a size [pixel]."""
    return EdgeBuffers(np.zeros((height, width), np.bool_), np.zeros((height * width, 2), np.int32))


@kernel
def find_edges(linear: Float32Array, labels: LabelBuffers, out: EdgeBuffers) -> int:
    """List pixels that differ in brightness from a neighbour on another surface; returns their number.

    Another surface is another instance, or a step in depth of more than EDGE_STEP: the contrast of a texture is no
    edge. The list is in tiles, so that rays that are traced together remain neighbours.
    """
    _mark_edges(linear, labels, out.marked)
    marked, pixels = out
    height, width = marked.shape
    count = 0
    for upper in range(0, height, _TILE):
        for left in range(0, width, _TILE):
            for v in range(upper, min(upper + _TILE, height)):
                for u in range(left, min(left + _TILE, width)):
                    if marked[v, u]:
                        pixels[count, 0], pixels[count, 1] = v, u
                        count += 1
    return count


@inlined
def _apart(instance: NDArray[np.uint32], depth: Float32Array, v: int, u: int, row: int, column: int) -> bool:
    """Whether pixel (v, u) shows another surface than its neighbour."""
    here = depth[v, u]
    return instance[v, u] != instance[row, column] or abs(here - depth[row, column]) > _STEP * here  # type: ignore[no-any-return]


@kernel(allocates=True)
def _mark_edges(linear: Float32Array, labels: LabelBuffers, marked: Mask) -> None:
    instance, depth = labels.instance, labels.depth
    height, width = instance.shape
    bright, white = np.empty((2, width), np.float32), np.float32(1.0)
    marked[:] = False
    for v in range(height):
        row, above = v & 1, (v + 1) & 1
        for u in range(width):
            r, g, b = linear[v, u, 0], linear[v, u, 1], linear[v, u, 2]
            bright[row, u] = np.sqrt(min(np.float32(0.2) * r + np.float32(0.7) * g + np.float32(0.1) * b, white))
        for u in range(1, width):  # contrast is the rarer of the two conditions
            if abs(bright[row, u] - bright[row, u - 1]) > _CONTRAST and _apart(instance, depth, v, u, v, u - 1):
                marked[v, u], marked[v, u - 1] = True, True
        for u in range(width if v > 0 else 0):
            if abs(bright[row, u] - bright[above, u]) > _CONTRAST and _apart(instance, depth, v, u, v - 1, u):
                marked[v, u], marked[v - 1, u] = True, True
