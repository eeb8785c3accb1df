# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Costs of a grid tile by tile, in processes: a tile that is done is kept in the cache folder.

A tile knows nothing of others, so a map has equal bits for any number of processes, and goes on after it was stopped.
"""

import itertools
import math
from collections.abc import Container, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array, Float32Array, Index
from fieldtruth.core.cache import cache_folder, cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.processes import as_done
from fieldtruth.cost.stretch import Passage, SpotRobot
from fieldtruth.experiment.rig import Rig
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import Grid

TILE: Final = 16.0
"""Side [m] of a tile: its drives stay in the part of a large world that is made around its middle."""
_EVEN: Final = 1e-9
_LIBRARIES: Final = ("numpy", "scipy", "numba", "mujoco-core")


class Costs(NamedTuple):
    """Costs of the n x m cells of a tile at h headings."""

    cause: NDArray[np.uint8]  # (n, m, h)
    values: Float32Array  # (n, m, h, quantities), in the order of ``Passage``; NaN where it does not pass


class Line(NamedTuple):
    """A line of a heading through n cells of a tile, in the order in which they are driven over."""

    cells: tuple[Index, Index]  # along x and y, (n,) each, in the tile
    xy: Array  # (2,) [m], a point of it
    spots: Array  # (n,) [m] along the heading from it, where the cells' middles are beside the line


@dataclass(frozen=True)
class Order:
    """What is driven: the robot of a rig, over the cells of a grid, at headings that divide the circle evenly."""

    rig: Rig
    grid: Grid
    headings: int

    @property
    def side(self) -> int:
        """Cells along the side of a tile."""
        return max(1, round(TILE / self.grid.resolution))

    def tiles(self) -> list[tuple[int, int]]:
        """Return the numbers of the tiles along x and y."""
        n, m = (math.ceil(count / self.side) for count in self.grid.shape)
        return [*itertools.product(range(n), range(m))]

    def cells(self, tile: tuple[int, int]) -> tuple[slice, slice]:
        """Return the cells of a tile in the grid."""
        x, y = (slice(k * self.side, min((k + 1) * self.side, n)) for k, n in zip(tile, self.grid.shape, strict=True))
        return x, y

    def middles(self, tile: tuple[int, int]) -> tuple[Array, Array]:
        """Return x and y [m] of the middles of a tile's cells."""
        starts, cells = (self.grid.x0, self.grid.y0), self.cells(tile)
        x, y = (
            np.asarray(start + (np.arange(own.start, own.stop) + 0.5) * self.grid.resolution, np.float64)
            for start, own in zip(starts, cells, strict=True)
        )
        return x, y

    def angles(self) -> Array:
        """Return the headings [rad]: 0 is along x, positive to the left."""
        return np.asarray(np.arange(self.headings) * (math.tau / self.headings), np.float64)

    def lines(self, tile: tuple[int, int], angle: float) -> list[Line]:
        """Return the lines of a heading [rad] over a tile.

        They go through each cell once: at multiples of 45 deg through its middle, else at most half a cell beside it.
        """
        middles, ahead = self.middles(tile), np.array([math.cos(angle), math.sin(angle)])
        main = 0 if abs(ahead[0]) > abs(ahead[1]) - _EVEN else 1  # the axis along which a line takes a cell each
        slope = float(np.round(ahead[1 - main] / ahead[main], 9))
        cells = np.indices([len(axis) for axis in middles]).reshape(2, -1)
        shift = cells[1 - main] - np.floor(slope * cells[main] + 0.5).astype(np.int64)
        found = []
        for number in np.unique(shift):
            own = cells[:, shift == number]
            first = np.array([axis[0] for axis in middles])
            first[1 - main] += number * self.grid.resolution
            spots = (np.stack([axis[row] for axis, row in zip(middles, own, strict=True)], axis=-1) - first) @ ahead
            ascending = np.argsort(spots)
            found.append(Line((own[0][ascending], own[1][ascending]), first, spots[ascending]))
        return found


class TileDrives:
    """Drives over the tiles of an order in a world."""

    def __init__(self, world: World, order: Order) -> None:
        self._world, self._order = world, order

    def costs(self, tile: tuple[int, int], speed: float, lines: Container[tuple[int, int]] | None = None) -> Costs:
        """Return the costs of the cells of a tile; with ``lines``, numbers of heading and line, of those alone."""
        order, (x, y) = self._order, self._order.middles(tile)
        robot, shape = SpotRobot(self._world, order.rig, np.array([x.mean(), y.mean()])), (len(x), len(y))
        cause = np.zeros((*shape, order.headings), np.uint8)
        values = np.full((*cause.shape, len(Passage._fields)), np.nan, np.float32)
        for k, angle in enumerate(order.angles().tolist()):
            for n, line in enumerate(order.lines(tile, angle)):
                if lines is None or (k, n) in lines:
                    outcomes = robot.sweep(line.xy, line.spots, angle, speed)
                    cause[(*line.cells, k)], values[(*line.cells, k)] = zip(*outcomes, strict=True)
        return Costs(cause, values)


_entered: list[TileDrives] = []


def _enter(world: World, order: Order) -> None:
    _entered[:] = [TileDrives(world, order)]


def _make(path: Path, tile: tuple[int, int], speed: float) -> tuple[tuple[int, int], Costs]:
    """Return the costs of a tile, which are stored at ``path`` or made, in a process that has entered the world."""
    return tile, load_or_make(path, _load, lambda: _entered[0].costs(tile, speed), _save)


def _load(path: Path) -> Costs:
    with np.load(path, allow_pickle=False) as file:
        return Costs(**file)


def _save(path: Path, costs: Costs) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **costs._asdict())


def made_tiles(world: World, order: Order, speed: float, workers: int) -> Iterator[tuple[tuple[slice, slice], Costs]]:
    """Yield the cells of each tile and their costs at a speed [m/s], as each is done; with one worker in this process.

    Raises:
        OutputError: a process was ended.
    """
    key = cache_key([__name__], world, order.rig, order.grid, order.headings, speed, libraries=_LIBRARIES)
    name = f"passage-{world.name}-{key}"
    items = [(cache_folder() / f"{name}-{i}-{j}.npz", (i, j), speed) for i, j in order.tiles()]
    left = [item for item in items if not item[0].exists()]
    workers = min(workers, len(left))
    if workers > 1:
        found: Iterator[tuple[tuple[int, int], Costs]] = as_done(_make, items, workers, partial(_enter, world, order))
    else:
        _enter(world, order)
        found = (_make(*item) for item in items)
    for tile, costs in found:
        yield order.cells(tile), costs
