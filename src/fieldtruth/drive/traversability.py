# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Where the robot can be, whatever its heading: a grid of what is in its way, and of the room around it."""

import dataclasses
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from fieldtruth.core.arrays import Array
from fieldtruth.drive.ground import BELLY, greatest_belly_rise, mean_ground, slopes
from fieldtruth.drive.husky import OUTLINE
from fieldtruth.drive.outlines import Outline, distance_to, obstacle_outlines
from fieldtruth.world.model import Heightfield, World

ROBOT_RADIUS: Final = float(np.hypot(*OUTLINE[:2])) / 2
"""[m] from its middle to its corners."""
CELL: Final = 0.1  # [m]
MAX_SLOPE_DEG: Final = 20.0
BELLY_ROOM: Final = 0.025  # [m] that remains below its belly
EDGE: Final = 1.5  # [m] from the world's edge that its middle keeps
FREEBOARD: Final = 0.05  # [m]; ground that is lower above the water counts as water


class Bar(IntEnum):
    """What is in the way at a place."""

    NOTHING = 0
    OBSTACLE = 1
    WATER = 2
    STEEP = 3
    ROUGH = 4
    EDGE = 5


BAR_TEXTS: Final = {
    Bar.OBSTACLE: "in an obstacle",
    Bar.WATER: "in the water",
    Bar.STEEP: f"on a slope of more than {MAX_SLOPE_DEG:.0f} deg",
    Bar.ROUGH: "on ground so rough that its belly would sit on it",
    Bar.EDGE: f"outside the world or nearer than {EDGE} m to its edge",
}


@dataclass(frozen=True, kw_only=True)
class Traversability:
    """``bars[i, j]`` (nx, ny), values of ``Bar``, stands at x = x0 + i * CELL, y = y0 + j * CELL [m].

    ``clearance`` (nx, ny) [m]: room that remains around the robot's middle there, over all headings; below 0 where its
    outline would touch an obstacle or water in some heading, or where it would stand too steep, too rough, too far out.
    ``ground_clearance`` is the same without obstacles. ``field`` is the
    ground, ``floor`` its mean under the robot.
    """

    bars: NDArray[np.uint8]
    clearance: NDArray[np.float32]
    ground_clearance: NDArray[np.float32]
    field: Heightfield
    floor: Heightfield
    x0: float
    y0: float
    outlines: tuple[Outline, ...]

    def clearance_at(self, places: ArrayLike) -> Array:
        """Clearance [m], (n,), in the cells of places (n, 2); beyond the grid -inf."""
        i, j, inside = self._cells(places)
        return np.where(inside, self.clearance[i, j], -np.inf)

    def ground_clearance_at(self, places: ArrayLike) -> Array:
        """The same without obstacles."""
        i, j, inside = self._cells(places)
        return np.where(inside, self.ground_clearance[i, j], -np.inf)

    def bar_at(self, places: ArrayLike) -> NDArray[np.uint8]:
        """What is in the way, (n,), in the cells of places (n, 2); beyond the grid it is the edge."""
        i, j, inside = self._cells(places)
        return np.where(inside, self.bars[i, j], np.uint8(Bar.EDGE)).astype(np.uint8)

    def way_length(self, poses: Array) -> float:
        """Length [m], slopes included, of a path through poses (n, 2 or 3)."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1))])
        rows = np.unique(np.searchsorted(way, np.arange(0.0, way[-1] + 0.25, 0.25)).clip(max=len(way) - 1))
        heights = self.floor.height_at(poses[rows, 0], poses[rows, 1])
        return float(np.hypot(np.diff(way[rows]), np.diff(heights)).sum())

    def _cells(self, places: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        nx, ny = self.bars.shape
        places = np.asarray(places, np.float64).reshape(-1, 2)
        i = np.rint((places[:, 0] - self.x0) / CELL).astype(np.int64)
        j = np.rint((places[:, 1] - self.y0) / CELL).astype(np.int64)
        inside = (i >= 0) & (i < nx) & (j >= 0) & (j < ny)
        return np.clip(i, 0, nx - 1), np.clip(j, 0, ny - 1), inside

    @cached_property
    def circles(self) -> Array:
        """Circles (n, 3) about the outlines: x, y, radius [m]."""
        return np.array([outline.circle for outline in self.outlines]).reshape(-1, 3)


def traversability(world: World) -> Traversability:
    """Look over a world: colliders, water, slope over the robot's length, bumps, the world's edge."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / CELL) + 1) for s in world.size)
    outlines = obstacle_outlines(world)
    bars = np.zeros((len(x), len(y)), np.uint8)
    field = world.terrain.field
    floor = dataclasses.replace(field, heights=mean_ground(field, OUTLINE[0]).astype(np.float32))
    _bar_ground(bars, world, x, y)
    bars[_near_edge(x, y, world.size)] = Bar.EDGE
    on_ground = np.minimum(_away(bars != Bar.NOTHING), _away(bars == Bar.WATER) - ROBOT_RADIUS)
    solid = np.zeros(bars.shape, bool)
    for outline in outlines:
        _bar_outline(bars, solid, outline, x, y)
    return Traversability(
        bars=bars,
        clearance=np.minimum(on_ground, _away(solid) - ROBOT_RADIUS).astype(np.float32),
        ground_clearance=on_ground.astype(np.float32),
        field=field,
        floor=floor,
        x0=float(x[0]),
        y0=float(y[0]),
        outlines=tuple(outlines),
    )


def _away(cells: NDArray[np.bool_]) -> Array:
    """Distance [m] to the nearest of ``cells``, less half a cell since places are known to the nearest one only."""
    if not cells.any():
        return np.full(cells.shape, np.inf)
    return np.asarray(distance_transform_edt(~cells) * CELL - CELL / 2)


def _near_edge(x: Array, y: Array, size: tuple[float, float]) -> NDArray[np.bool_]:
    along, across = (np.abs(axis) > s / 2 - EDGE + 1e-9 for axis, s in zip((x, y), size, strict=True))
    return np.asarray(along[:, None] | across[None, :])


def _bar_ground(bars: NDArray[np.uint8], world: World, x: Array, y: Array) -> None:
    field = world.terrain.field
    slope = np.hypot(*slopes(field, OUTLINE[0]))
    rise = greatest_belly_rise(field)
    i, j = (
        np.clip(np.rint((axis - start) / field.spacing).astype(int), 0, count - 1)
        for axis, start, count in zip((x, y), (field.x0, field.y0), field.heights.shape, strict=True)
    )
    cells = np.ix_(i, j)
    bars[(rise > BELLY - BELLY_ROOM)[cells]] = Bar.ROUGH
    bars[(slope > np.tan(np.radians(MAX_SLOPE_DEG)))[cells]] = Bar.STEEP
    if world.water_level is not None:
        bars[(field.heights < world.water_level + FREEBOARD)[cells]] = Bar.WATER


def _bar_outline(bars: NDArray[np.uint8], solid: NDArray[np.bool_], outline: Outline, x: Array, y: Array) -> None:
    (low_x, low_y), (high_x, high_y) = outline.corners.min(axis=0) - CELL, outline.corners.max(axis=0) + CELL
    rows = slice(*np.searchsorted(x, (low_x, high_x)))
    columns = slice(*np.searchsorted(y, (low_y, high_y)))
    places = np.stack(np.meshgrid(x[rows], y[columns], indexing="ij"), axis=-1)
    inside = distance_to(outline, places.reshape(-1, 2)).reshape(places.shape[:2]) <= CELL / np.sqrt(2)
    bars[rows, columns][inside] = Bar.OBSTACLE
    solid[rows, columns] |= inside
