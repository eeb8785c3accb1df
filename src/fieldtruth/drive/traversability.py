# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Traversability map: a grid of what blocks the robot at any heading, and of the clearance around it."""

import dataclasses
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.drive.bearing import bearing_field, divided
from fieldtruth.drive.ground import CHASSIS_CLEARANCE, highest_around, max_bump_height, mean_ground, slopes
from fieldtruth.drive.husky import OUTLINE
from fieldtruth.drive.outlines import MAX_STEP, Outline, distance_to, obstacle_outlines, stone_outlines
from fieldtruth.world.model import Heightfield, World

ROBOT_RADIUS: Final = float(np.hypot(*OUTLINE[:2])) / 2
"""[m] from its middle to its corners."""
CELL: Final = 0.1  # [m]
MAX_SLOPE_DEG: Final = 20.0
MIN_CHASSIS_CLEARANCE: Final = 0.025  # [m] that remains below the chassis
EDGE_MARGIN: Final = 1.5  # [m] from the robot's middle to the world's edge
FREEBOARD: Final = 0.05  # [m]; ground less than this above the water level counts as water


class Blockage(IntEnum):
    """What blocks a cell."""

    NONE = 0
    OBSTACLE = 1
    WATER = 2
    STEEP = 3
    ROUGH = 4
    EDGE = 5


BLOCKAGE_TEXTS: Final = {
    Blockage.OBSTACLE: "in an obstacle",
    Blockage.WATER: "in the water",
    Blockage.STEEP: f"on a slope of more than {MAX_SLOPE_DEG:.0f} deg",
    Blockage.ROUGH: "on ground so rough that the chassis would touch it",
    Blockage.EDGE: f"outside the world or less than {EDGE_MARGIN} m from its edge",
}


@dataclass(frozen=True, kw_only=True)
class Traversability:
    """``blockage[i, j]`` (nx, ny), values of ``Blockage``, is at x = x0 + i * CELL, y = y0 + j * CELL [m].

    ``clearance`` (nx, ny) [m]: free distance around a robot at that cell, over all headings; negative where its outline
    would touch an obstacle or water at some heading, or where the ground is too steep, too rough or too close to the
    edge. ``terrain_clearance`` is the same without obstacles. ``bearing`` is the ground that bears the robot, stones
    included, ``highest`` the highest of it around each node (see ``highest_around``), ``floor`` the soil's mean height
    under the robot.
    """

    blockage: NDArray[np.uint8]
    clearance: NDArray[np.float32]
    terrain_clearance: NDArray[np.float32]
    bearing: Heightfield
    highest: Heightfield
    floor: Heightfield
    x0: float
    y0: float
    outlines: tuple[Outline, ...]

    def clearance_at(self, points: ArrayLike) -> Array:
        """Clearance [m], (n,), in the cells of points (n, 2); outside the grid -inf."""
        return np.asarray(self._look_up(self.clearance, points, -np.inf))

    def terrain_clearance_at(self, points: ArrayLike) -> Array:
        """Clearance [m], (n,), without obstacles, in the cells of points (n, 2); outside the grid -inf."""
        return np.asarray(self._look_up(self.terrain_clearance, points, -np.inf))

    def blockage_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Blockage, (n,), in the cells of points (n, 2); outside the grid EDGE."""
        return self._look_up(self.blockage, points, Blockage.EDGE).astype(np.uint8)

    def path_length(self, poses: Array) -> float:
        """Length [m], slopes included, of a path through poses (n, 2 or 3)."""
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1))])
        rows = np.unique(np.searchsorted(arc, np.arange(0.0, arc[-1] + 0.25, 0.25)).clip(max=len(arc) - 1))
        heights = self.floor.height_at(poses[rows, 0], poses[rows, 1])
        return float(np.hypot(np.diff(arc[rows]), np.diff(heights)).sum())

    def _look_up(self, grid: NDArray[Any], points: ArrayLike, outside: float) -> NDArray[Any]:
        points = np.asarray(points, np.float64).reshape(-1, 2)
        cells = np.rint((points - (self.x0, self.y0)) / CELL).astype(np.intp)
        inside = ((cells >= 0) & (cells < grid.shape)).all(axis=1)
        i, j = np.clip(cells, 0, np.subtract(grid.shape, 1)).T
        return np.where(inside, grid[i, j], outside)

    @cached_property
    def circles(self) -> Array:
        """Circles (n, 3) around the outlines: x, y, radius [m]."""
        return np.array([outline.circle for outline in self.outlines]).reshape(-1, 3)


def traversability(world: World) -> Traversability:
    """Map a world: colliders, high stones, water, slope over the robot's length, bumps, the world's edge."""
    x, y = (np.linspace(-s / 2, s / 2, round(s / CELL) + 1) for s in world.size)
    outlines = [*obstacle_outlines(world), *stone_outlines(world)]
    bearing, soil = divided(bearing_field(world)), divided(world.terrain.field)
    highest = highest_around(soil, (bearing.heights - soil.heights).astype(np.float32), MAX_STEP)
    blockage = _terrain_blockage(world, x, y)
    blockage[_rough(bearing, highest, x, y) & (blockage == Blockage.NONE)] = Blockage.ROUGH
    blockage[_near_edge(x, y, world.size)] = Blockage.EDGE
    on_terrain = np.minimum(
        _distance_from(blockage != Blockage.NONE), _distance_from(blockage == Blockage.WATER) - ROBOT_RADIUS
    )
    solid = _outline_cells(outlines, x, y)
    blockage[solid] = Blockage.OBSTACLE
    return Traversability(
        blockage=blockage,
        clearance=np.minimum(on_terrain, _distance_from(solid) - ROBOT_RADIUS).astype(np.float32),
        terrain_clearance=on_terrain.astype(np.float32),
        bearing=bearing,
        highest=highest,
        floor=dataclasses.replace(soil, heights=mean_ground(soil, OUTLINE[0]).astype(np.float32)),
        x0=float(x[0]),
        y0=float(y[0]),
        outlines=tuple(outlines),
    )


def _distance_from(cells: Mask) -> Array:
    """Distance [m] to the nearest of ``cells``, less half a cell, since positions are rounded to cells."""
    if not cells.any():
        return np.full(cells.shape, np.inf)
    return np.asarray(distance_transform_edt(~cells) * CELL - CELL / 2)


def _near_edge(x: Array, y: Array, size: tuple[float, float]) -> Mask:
    along, across = (np.abs(axis) > s / 2 - EDGE_MARGIN + 1e-9 for axis, s in zip((x, y), size, strict=True))
    return np.asarray(along[:, None] | across[None, :])


def _rough(bearing: Heightfield, highest: Heightfield, x: Array, y: Array) -> Mask:
    return np.asarray(max_bump_height(bearing, highest, x, y) > CHASSIS_CLEARANCE - MIN_CHASSIS_CLEARANCE)


def _terrain_blockage(world: World, x: Array, y: Array) -> NDArray[np.uint8]:
    field = world.terrain.field
    slope = np.hypot(*slopes(field, OUTLINE[0]))
    i, j = (
        np.clip(np.rint((axis - start) / field.spacing).astype(int), 0, count - 1)
        for axis, start, count in zip((x, y), (field.x0, field.y0), field.heights.shape, strict=True)
    )
    cells = np.ix_(i, j)
    blockage = np.zeros((len(x), len(y)), np.uint8)
    blockage[(slope > np.tan(np.radians(MAX_SLOPE_DEG)))[cells]] = Blockage.STEEP
    if world.water_level is not None:
        blockage[(field.heights < world.water_level + FREEBOARD)[cells]] = Blockage.WATER
    return blockage


def _outline_cells(outlines: list[Outline], x: Array, y: Array) -> Mask:
    """Cells (nx, ny) that an outline touches."""
    solid = np.zeros((len(x), len(y)), bool)
    for outline in outlines:
        (low_x, low_y), (high_x, high_y) = outline.corners.min(axis=0) - CELL, outline.corners.max(axis=0) + CELL
        rows = slice(*np.searchsorted(x, (low_x, high_x)))
        columns = slice(*np.searchsorted(y, (low_y, high_y)))
        points = np.stack(np.meshgrid(x[rows], y[columns], indexing="ij"), axis=-1)
        distance = distance_to(outline, points.reshape(-1, 2)).reshape(points.shape[:2])
        solid[rows, columns] |= distance <= CELL / np.sqrt(2)
    return solid
