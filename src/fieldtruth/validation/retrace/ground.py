# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The ground of the second tracer: boxes about squares of cells, then about cells; triangles are made as they are met.

A terrain of 5 cm has four million triangles, of which a ray meets the boxes of a few dozen.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.world.model import Heightfield

SKIN: Final = 0.001  # [m] by which boxes are larger
_SIDE: Final = 16  # cells on the side of a square
_PAIRS: Final = 200_000  # of rays and boxes at once
_OFFSETS: Final = np.stack(np.meshgrid(np.arange(_SIDE), np.arange(_SIDE), indexing="ij"), axis=-1).reshape(-1, 2)


class Ground:
    """The triangles of a heightfield as its docstring defines them; it does not use those of the sensors' scene."""

    def __init__(self, field: Heightfield) -> None:
        self._field = field
        self._cells = np.array(field.heights.shape) - 1
        starts = [np.arange(0, n, _SIDE) for n in self._cells]
        self._first = np.stack(np.meshgrid(*starts, indexing="ij"), axis=-1).reshape(-1, 2)
        end = np.minimum(self._first + _SIDE, self._cells)
        low, high = self._squares(np.minimum), self._squares(np.maximum)
        origin, step = np.array([field.x0, field.y0]), field.spacing
        self._low = np.column_stack([origin + step * self._first, low]) - SKIN
        self._high = np.column_stack([origin + step * end, high]) + SKIN

    @property
    def triangles(self) -> int:
        """Number of triangles in all cells."""
        return 2 * int(np.prod(self._cells))

    def near(self, start: Array, ahead: Array, limit: Array) -> Iterator[tuple[Index, Array]]:
        """Rows of rays (n, 3) up to their limits (n,), and the corners (n, 3, 3) of triangles whose box they meet."""
        near = near_all(self._low, self._high, start, ahead, limit)
        for rays in blocks(len(start), len(near)):
            ray, square = np.nonzero(
                meets(self._low[near], self._high[near], start[rays, None], ahead[rays, None], limit[rays, None])
            )
            square = near[square]
            for part in blocks(len(ray), _SIDE * _SIDE):
                row = np.repeat(ray[part] + rays.start, _SIDE * _SIDE)
                cell = (self._first[square[part], None] + _OFFSETS).reshape(-1, 2)
                inside = (cell < self._cells).all(axis=1)
                row, nodes = row[inside], self._nodes(cell[inside])
                met = meets(nodes.min(axis=1) - SKIN, nodes.max(axis=1) + SKIN, start[row], ahead[row], limit[row])
                row, nodes = row[met], nodes[met]
                yield np.concatenate([row, row]), np.concatenate([nodes[:, [0, 1, 2]], nodes[:, [0, 2, 3]]])

    def _squares(self, extreme: np.ufunc) -> Array:
        """Least or greatest height (n,) of each square's nodes, those of its far sides included."""
        h = self._field.heights
        cells = extreme(extreme(h[:-1, :-1], h[1:, :-1]), extreme(h[:-1, 1:], h[1:, 1:]))
        for axis, count in enumerate(self._cells):
            cells = extreme.reduceat(cells, np.arange(0, count, _SIDE), axis=axis)
        return np.asarray(cells.ravel(), np.float64)

    def _nodes(self, cell: NDArray[np.int64]) -> Array:
        """Corners (n, 4, 3) of cells (n, 2), anticlockwise from (i, j); a cell is divided from it to (i + 1, j + 1)."""
        ij, field = cell[:, None] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), self._field
        nodes = np.empty((len(cell), 4, 3))
        nodes[..., :2] = (field.x0, field.y0) + field.spacing * ij
        nodes[..., 2] = field.heights[ij[..., 0], ij[..., 1]]
        return nodes


def meets(low: Array, high: Array, start: Array, ahead: Array, limit: Array) -> Mask:
    """Whether rays up to their limits meet boxes."""
    near, far = np.zeros(()), limit
    for axis in range(3):
        along = ahead[..., axis]
        along = np.where(np.abs(along) < 1e-12, 1e-12, along)
        first, second = (low[..., axis] - start[..., axis]) / along, (high[..., axis] - start[..., axis]) / along
        near, far = np.maximum(near, np.minimum(first, second)), np.minimum(far, np.maximum(first, second))
    return np.asarray(near <= far)


def near_all(low: Array, high: Array, start: Array, ahead: Array, limit: Array) -> Index:
    """Rows of boxes (n, 3) that meet the one box around all rays (..., 3): in a large world few boxes are near."""
    ends = np.stack([start, start + ahead * limit[..., None]]).reshape(-1, 3)
    return np.flatnonzero(((low <= ends.max(axis=0)) & (high >= ends.min(axis=0))).all(axis=1))


def blocks(count: int, each: int) -> list[slice]:
    """Slices of ``count`` items that hold at most 200,000 pairs of ``each``."""
    step = max(1, _PAIRS // max(1, each))
    return [slice(first, min(first + step, count)) for first in range(0, count, step)]
