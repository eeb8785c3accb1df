# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Costs of a grid tile by tile, in processes: a tile that is done is kept in the cache folder.

A tile knows nothing of others, so a map has equal bits for any number of processes, and goes on after it was stopped.
"""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.cache import cache_folder, cache_key
from fieldtruth.core.cache_folder import load_or_make
from fieldtruth.core.processes import as_done
from fieldtruth.cost.scheme import Costs, found_costs
from fieldtruth.cost.stretch import LENGTH, Cause, Passage, SpotRobot, run_up
from fieldtruth.drive.traversability import Traversability
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import GRAVITY, RobotConfig
from fieldtruth.world.model import World
from fieldtruth.world_maps.layers import Grid

TILE: Final = 16.0
"""Side [m] of a tile: its drives stay in the part of a large world that is made around its middle."""
NEAR: Final = 0.25
"""Clearance [m] on the planner's map, on the way over a spot, below which the spot is driven."""
_LIBRARIES: Final = ("numpy", "scipy", "numba", "mujoco-core")


@dataclass(frozen=True)
class Order:
    """What is driven: the robot of a rig, over the cells of a grid, at headings that divide the circle evenly.

    ``first`` is the distance, in cells, of those that are driven first, a power of two.
    """

    rig: Rig
    grid: Grid
    headings: int
    first: int

    @property
    def side(self) -> int:
        """Cells along the side of a tile."""
        return max(1, round(TILE / self.grid.resolution) // self.first) * self.first

    def tiles(self) -> list[tuple[int, int]]:
        """Return the numbers of the tiles along x and y."""
        n, m = (math.ceil(count / self.side) for count in self.grid.shape)
        return [*itertools.product(range(n), range(m))]

    def cells(self, tile: tuple[int, int]) -> tuple[slice, slice]:
        """Return the cells of a tile in the grid."""
        x, y = (slice(k * self.side, min((k + 1) * self.side, n)) for k, n in zip(tile, self.grid.shape, strict=True))
        return x, y

    def nodes(self, tile: tuple[int, int]) -> tuple[Array, Array]:
        """Return x and y [m] of a tile's cells, and of those beyond it up to the next that is driven first."""
        x, y = self.cells(tile)
        return self._nodes_along(self.grid.x0, x), self._nodes_along(self.grid.y0, y)

    def _nodes_along(self, start: float, cells: slice) -> Array:
        count = math.ceil((cells.stop - cells.start - 1) / self.first) * self.first + 1
        if self.first > 1:  # the tile beside begins with a cell that is driven first
            count = max(count, self.first + 1)
        nodes: Array = start + (cells.start + np.arange(count) + 0.5) * self.grid.resolution
        return nodes

    def angles(self) -> Array:
        """Return the headings [rad]: 0 is along x, positive to the left."""
        return np.asarray(np.arange(self.headings) * (math.tau / self.headings), np.float64)


def tolerances(robot: RobotConfig, speed: float) -> Array:
    """Differences of the costs up to which spots are alike, in the order of ``Passage``."""
    weight = robot.mass * GRAVITY
    return np.array(Passage(slip=0.1, tilt=0.1, peak=np.inf, rms=1.0, energy=0.06 * weight, time=0.2 / speed))


class TileDrives:
    """Drives over the tiles of an order in a world."""

    def __init__(self, world: World, order: Order) -> None:
        self._world, self._order = world, order
        self._ground = Traversability(world, order.rig)

    def costs(self, tile: tuple[int, int], speed: float) -> Costs:
        """Return the costs of the cells of a tile."""
        order, (x, y), angles = self._order, self._order.nodes(tile), self._order.angles()
        robot = SpotRobot(self._world, order.rig, np.array([x.mean(), y.mean()]))

        def drive(i: int, j: int, k: int) -> tuple[Cause, Passage]:
            return robot.over(np.array([x[i], y[j]]), float(angles[k]), speed)

        shape, alike = (len(x), len(y), len(angles)), tolerances(order.rig.robot, speed)
        all_ = found_costs(shape, drive, self.hazard(x, y, speed), order.first, alike)
        own = tuple(slice(s.stop - s.start) for s in order.cells(tile))
        return Costs(all_.cause[own], all_.values[own], all_.driven[own])

    def hazard(self, x: Array, y: Array, speed: float) -> Mask:
        """Return whether a hazard of the planner's map is near the way over each node at each heading."""
        points, angles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1), self._order.angles()
        ahead = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        near = np.zeros((len(x), len(y), len(angles)), bool)
        for along in (-run_up(speed, self._order.rig.robot) - LENGTH / 2, -LENGTH / 2, 0.0, LENGTH / 2):
            at = points[:, :, None] + along * ahead
            near |= (self._ground.clearance_at(at.reshape(-1, 2)) < NEAR).reshape(near.shape)
        return near


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
    key = cache_key([__name__], world, order.rig, order.grid, order.headings, order.first, speed, libraries=_LIBRARIES)
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
