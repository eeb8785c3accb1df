# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Circles on a plane, found by position: placing an object takes as long in a large world as in a small one."""

from collections.abc import Iterator


class Circles:
    """Circles (x, y, radius) [m] in the cells of a grid, so that a search visits near ones only."""

    def __init__(self, cell: float) -> None:
        self._cell = cell
        self._cells: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
        self._widest = 0.0
        self.visits = 0
        """Circles that all searches looked at."""

    def add(self, x: float, y: float, radius: float = 0.0) -> None:
        """Add a circle."""
        key = int(x // self._cell), int(y // self._cell)
        self._cells.setdefault(key, []).append((float(x), float(y), float(radius)))
        self._widest = max(self._widest, float(radius))

    def about(self, x: float, y: float, radius: float) -> Iterator[tuple[float, float, float]]:
        """Yield at least all circles that overlap one about x, y [m]."""
        reach, cell = radius + self._widest, self._cell
        for i in range(int((x - reach) // cell), int((x + reach) // cell) + 1):
            for j in range(int((y - reach) // cell), int((y + reach) // cell) + 1):
                found = self._cells.get((i, j), ())
                self.visits += len(found)
                yield from found
