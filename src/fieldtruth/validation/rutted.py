# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The finer triangles of ground with ruts for the second ray tracer, made anew from heights and depths."""

from collections.abc import Iterator

import numpy as np

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.kernels.ruts import CELLS
from fieldtruth.sense.leaning import LEAN_KNOT_NS
from fieldtruth.sense.ruts import Ruts
from fieldtruth.validation.boxes import SKIN, blocks, meets, near_all


class RuttedCells:
    """Triangles in the blocks of ruts, which are where they are at the stamp of each ray."""

    def __init__(self, ruts: Ruts) -> None:
        self._ruts, field = ruts, ruts.field
        self._nodes = np.empty((len(ruts.blocks), CELLS + 1, CELLS + 1, 3))
        along = ruts.cell * np.arange(CELLS + 1)
        corner = (field.x0, field.y0) + ruts.cell * CELLS * ruts.blocks
        self._nodes[..., 0] = corner[:, 0, None, None] + along[:, None]
        self._nodes[..., 1] = corner[:, 1, None, None] + along
        self._nodes[..., 2] = field.height_at(self._nodes[..., 0], self._nodes[..., 1])
        self._least, self._most = self._nodes.min(axis=(1, 2)) - SKIN, self._nodes.max(axis=(1, 2)) + SKIN

    def replaces(self, corners: Array) -> Mask:
        """Return which triangles (n, 3, 3) of the ground these cells replace."""
        field, removed = self._ruts.field, self._ruts.removed
        at = (corners[..., :2].mean(axis=1) - (field.x0, field.y0)) / (self._ruts.cell * CELLS)
        i, j = np.floor(at).astype(np.intp).T
        inside = (i < removed.shape[0]) & (j < removed.shape[1])
        return np.asarray(inside & removed[np.where(inside, i, 0), np.where(inside, j, 0)])

    def near(self, start: Array, ahead: Array, limit: Array, stamps: Index) -> Iterator[tuple[Index, Array]]:
        """Rows of rays (n, 3) up to their limits (n,), and the corners (n, 3, 3) of triangles whose box they meet.

        Rays leave at stamps (n,) [ns].
        """
        low, rest = np.divmod(stamps, LEAN_KNOT_NS)
        knots, row = np.unique(np.concatenate([low, low + 1]), return_inverse=True)
        depths = self._ruts.depths(knots * LEAN_KNOT_NS)
        begin, end = np.split(row, 2)
        least, most = self._least - (0.0, 0.0, depths.max(initial=0.0)), self._most
        near = near_all(least, most, start, ahead, limit)
        ray, block = np.nonzero(meets(least[near], most[near], start[:, None], ahead[:, None], limit[:, None]))
        block = near[block]
        for part in blocks(len(ray), 4 * CELLS * CELLS):
            of, own = ray[part], block[part]
            before, after = depths[begin[of], own], depths[end[of], own]
            nodes = self._nodes[own]
            nodes[..., 2] -= before + (rest[of] / LEAN_KNOT_NS)[:, None, None] * (after - before)
            a, b, c, d = nodes[:, :-1, :-1], nodes[:, 1:, :-1], nodes[:, 1:, 1:], nodes[:, :-1, 1:]
            corners = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=3).reshape(-1, 3, 3)
            of = of.repeat(2 * CELLS * CELLS)
            met = meets(corners.min(axis=1) - SKIN, corners.max(axis=1) + SKIN, start[of], ahead[of], limit[of])
            yield of[met], corners[met]
