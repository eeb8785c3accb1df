# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Traversability: what blocks the robot at any heading, and the clearance around it, on a grid.

Obstacles in plan view are convex outlines of colliders at the robot's height and of high stones.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.transforms import pose, transform
from fieldtruth.drive.ground import (
    WHOLE,
    HardSurface,
    WorldParts,
    bearing_field,
    bump_height_on_path,
    divided,
    hard_surfaces,
    highest_around,
    max_bump_height,
    mean_ground,
    slopes,
)
from fieldtruth.drive.physics import body_boxes
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.robot_config import RobotConfig
from fieldtruth.world.model import Collider, Heightfield, World

MAX_HEIGHT: Final = 1.2  # [m] above the ground; the mast of the paper's rig ends below
_HUSKY: Final = RobotConfig()
_CIRCLE_CORNERS: Final = 24
_SLICE: Final = 0.2  # [m] between the samples of a collider that lies or leans
CELL: Final = 0.1  # [m]
MAX_SLOPE_DEG: Final = 20.0
MIN_CHASSIS_CLEARANCE: Final = 0.025  # [m] that remains below the chassis
EDGE_MARGIN: Final = 1.5  # [m] from the robot's middle to the world's edge
CLEAR: Final = 13.0
"""[m]; what is farther away makes no difference to a route."""
_AROUND_NODE: Final = 0.3
"""[m] beyond the corners of a robot on the margin of a tile: the nodes around a node."""
_KEPT: Final = 16
"""Tiles in memory, 45 MB each."""
FREEBOARD: Final = 0.05  # [m]; ground less than this above the water level counts as water


def obstacle_height(rig: Rig) -> float:
    """Height [m] above the ground up to which objects stop the robot or its mast."""
    mast = body_boxes(rig).get("mast")
    top = 0.0 if mast is None else float(mast.centre[2] + mast.size[2] / 2) + rig.robot.ground_clearance
    return max(MAX_HEIGHT, top)


def max_step(robot: RobotConfig = _HUSKY) -> float:
    """Height [m] of a stone that the robot still drives over: half a wheel's radius, 8 cm of a Husky.

    No figure is published for a Husky; its data sheet has a ground clearance of 13 cm. By statics, a robot with all
    wheels driven and equal loads on its axles climbs a step of 2 mu^2 / (1 + mu^2) wheel radii with a friction mu: the
    contact on the step's edge is inclined by twice the angle of friction. Half a radius takes mu = 0.58. A caster
    climbs half its own radius when it is pushed by two wheels with as much friction.
    """
    radii = [robot.wheels.radius, *([robot.caster.radius] if robot.caster else [])]
    return min(radii) / 2


class Outline(NamedTuple):
    """Convex polygon (m, 2) [m], anticlockwise, of the part of an object that stops a robot, and its name."""

    name: str
    corners: Array

    @property
    def circle(self) -> tuple[float, float, float]:
        """Centre x, y and radius [m] of a circle around it."""
        middle = (self.corners.min(axis=0) + self.corners.max(axis=0)) / 2
        return float(middle[0]), float(middle[1]), float(np.linalg.norm(self.corners - middle, axis=1).max())


def obstacle_outlines(world: World, height: float = MAX_HEIGHT) -> list[Outline]:
    """One outline per collider that has parts above the ground and parts lower than ``height`` [m] above it."""
    names: list[str] = []
    solids: list[Array] = []
    for instance in world.instances:
        for collider in world.meshes[instance.mesh].colliders:
            names.append(instance.name)
            solids.append(transform(instance.world_from_object, _surface(collider, instance.world_from_object)))
    if not solids:
        return []
    points = np.concatenate(solids)
    above = points[:, 2] - world.terrain.field.height_at(points[:, 0], points[:, 1])
    pieces = np.split(above, np.cumsum([len(solid) for solid in solids])[:-1])
    return [
        Outline(name, _hull(solid[heights <= height, :2]))
        for name, solid, heights in zip(names, solids, pieces, strict=True)
        if (heights <= height).any() and (heights > 0).any()
    ]


def stone_outlines(world: World, step: float | None = None) -> list[Outline]:
    """One outline per hard object without a collider that is higher than ``step`` [m]: of its part above that height.

    By default the step is that of a Husky.
    """
    step = max_step() if step is None else step
    return [outline for surface in hard_surfaces(world) for outline in _high_parts(surface, world.terrain.field, step)]


def _high_parts(surface: HardSurface, soil: Heightfield, step: float) -> Iterator[Outline]:
    size = float(np.linalg.norm(surface.vertices[surface.faces], axis=-1).max())
    for name, pose_ in zip(surface.names, surface.poses, strict=True):
        if size * np.cbrt(np.linalg.det(pose_[:3, :3])) < step:
            continue
        corners = transform(pose_, surface.vertices[surface.faces].reshape(-1, 3))
        above = (corners[:, 2] - soil.height_at(corners[:, 0], corners[:, 1])).reshape(-1, 3) - step
        corners = corners[:, :2].reshape(-1, 3, 2)
        high = corners[(above > 0) & (above <= surface.reach - step)]
        for first, last in ((0, 1), (1, 2), (2, 0)):  # where the edges of the triangles cross that height
            a, b = above[:, first], above[:, last]
            cut = np.flatnonzero(a * b < 0)
            share = (a[cut] / (a[cut] - b[cut]))[:, None]
            high = np.concatenate([high, corners[cut, first] + share * (corners[cut, last] - corners[cut, first])])
        if len(high):
            yield Outline(name, _hull(high))


def _surface(collider: Collider, world_from_object: Array) -> Array:
    """Points (n, 3) in the object's frame whose hull is the collider, dense enough to be cut at a height."""
    if collider.points:
        return _along_edges(collider.points)
    height = collider.size[-1]
    scale = float(np.cbrt(np.linalg.det(world_from_object[:3, :3])))
    upright = world_from_object[2, 2] > 0.9999 * scale
    levels = _samples(height * scale, upright) * height
    if collider.shape == "cylinder":
        angles = np.linspace(0.0, 2 * np.pi, _CIRCLE_CORNERS, endpoint=False)
        circumscribed = collider.size[0] / np.cos(np.pi / _CIRCLE_CORNERS)
        rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * circumscribed
    else:
        across = [(_samples(s * scale, upright) - 0.5) * s for s in collider.size[:2]]
        rim = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.concatenate([np.tile(rim, (len(levels), 1)), np.repeat(levels, len(rim))[:, None]], axis=1)
    return transform(pose(collider.position, (0.0, 0.0, collider.yaw_deg)), points)


@lru_cache(maxsize=4096)
def _along_edges(corners: tuple[tuple[float, float, float], ...]) -> Array:
    """Points along the edges of a convex body, dense enough to be cut at a height."""
    points = np.array(corners)
    triangles = ConvexHull(points).simplices
    pairs = np.unique(
        np.sort(np.concatenate([triangles[:, (0, 1)], triangles[:, (1, 2)], triangles[:, (2, 0)]])), axis=0
    )
    first, last = points[pairs[:, 0]], points[pairs[:, 1]]
    count = 2 + int(float(np.linalg.norm(last - first, axis=1).max()) / _SLICE)
    return np.asarray((first + np.linspace(0.0, 1.0, count)[:, None, None] * (last - first)).reshape(-1, 3))


def _samples(length: float, ends_only: bool) -> Array:
    return np.linspace(0.0, 1.0, 2 if ends_only else 2 + int(length / _SLICE))


def _hull(points: Array) -> Array:
    if np.linalg.matrix_rank(points - points[0], tol=1e-6) < 2:  # a line has no hull: widen it by 1 mm
        points = np.concatenate([points + np.array(offset) * 1e-3 for offset in ((1, 1), (-1, 1), (0, -1))])
    corners: Array = points[ConvexHull(points).vertices]
    return corners


def distance_to(outline: Outline, points: Array) -> Array:
    """Distance [m], (n,), of points (n, 2) to an outline; inside it 0 and below."""
    first = outline.corners
    edges = np.roll(first, -1, axis=0) - first
    lengths = np.linalg.norm(edges, axis=1)
    to_point = points[:, None, :] - first
    outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / lengths[:, None]
    depth = (to_point * outwards).sum(-1).max(axis=1)  # signed distance to the farthest edge line
    along = np.clip((to_point * edges).sum(-1) / lengths**2, 0.0, 1.0)
    outside = np.linalg.norm(to_point - along[..., None] * edges, axis=-1).min(axis=1)
    return np.asarray(np.where(depth > 0, outside, depth))


def gap_to(outline: Outline, poses: Array, robot: RobotConfig = _HUSKY) -> Array:
    """Gap [m], (n,), between an outline and the robot's outline at poses (n, 3) of x, y [m] and heading [rad].

    Separating axis theorem: the largest gap of the projections on the normals of all edges. Corner to corner it is a
    little less than the distance; where the two overlap it is negative.
    """
    half = np.array(robot.outline[:2]) / 2
    forward = np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], axis=-1)
    left = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
    to_corner = outline.corners[None] - poses[:, None, :2]
    gaps = []
    for axis, extent in ((forward, half[0]), (left, half[1])):
        projection = np.einsum("nmk,nk->nm", to_corner, axis)
        gaps += [projection.min(axis=1) - extent, -extent - projection.max(axis=1)]
    edges = np.roll(outline.corners, -1, axis=0) - outline.corners
    outwards = np.stack([edges[:, 1], -edges[:, 0]], axis=-1) / np.linalg.norm(edges, axis=1, keepdims=True)
    extent = np.abs(forward @ outwards.T) * half[0] + np.abs(left @ outwards.T) * half[1]
    gaps.append((-np.einsum("nmk,mk->nm", to_corner, outwards) - extent).max(axis=1))
    return np.asarray(np.max(gaps, axis=0))


def robot_radius(robot: RobotConfig) -> float:
    """Distance [m] from a robot's middle to the corners of its outline."""
    return float(np.hypot(*robot.outline[:2])) / 2


class Blockage(IntEnum):
    """Reason why a cell is blocked."""

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
class _Tile:
    """Map of a rectangle; ``blockage[i, j]`` is that of its cell (i, j).

    ``bearing`` is the ground that bears the robot, stones included, ``highest`` the highest of it around each node (see
    ``highest_around``). Both reach beyond the tile by its greatest clearance, as do the ``outlines``; ``circles``
    (n, 3) around these are x, y and radius [m].
    """

    blockage: NDArray[np.uint8]
    clearance: NDArray[np.float32]
    terrain_clearance: NDArray[np.float32]
    bearing: Heightfield
    highest: Heightfield
    outlines: tuple[Outline, ...]
    circles: Array


class Traversability:
    """Map of a world: colliders, high stones, water, slope over the robot's length, bumps, the world's edge.

    Cell (i, j) of ``shape`` is at ``corner`` + (i, j) * CELL [m]. The map is made of tiles when they are looked up; a
    world up to ``WHOLE`` is one.

    Clearance [m] is the free distance around a robot at a cell, over all headings, up to a limit; negative where
    its outline would touch an obstacle or water at some heading, or where the ground is too steep, too rough or too
    close to the edge; outside the world -inf. Terrain clearance is the same without obstacles.
    """

    def __init__(self, world: World, rig: Rig | None = None, *, side: float = WHOLE, clear: float = CLEAR) -> None:
        """Prepare the map of ``world`` for the robot of ``rig``, by default the paper's.

        Its tiles have a ``side`` [m], and no clearance is above ``clear`` [m].
        """
        rig = rig or Rig()
        self.robot, self._height, self._clear = rig.robot, obstacle_height(rig), clear
        self.robot_radius = robot_radius(rig.robot)
        self._size = world.size
        self._x, self._y = (np.linspace(-s / 2, s / 2, round(s / CELL) + 1) for s in world.size)
        self.corner: Array = np.array([self._x[0], self._y[0]])
        self.shape = (len(self._x), len(self._y))
        self.parts = WorldParts(world)
        self._side = max(self.shape) if self.parts.is_one else round(side / CELL)
        self._tiles: dict[tuple[int, int], _Tile] = {}
        length = self.robot.outline[0]
        self._terrain = _terrain_blockage(world, self._x, self._y, length)
        field = world.terrain.field
        self._floor = replace(field, heights=mean_ground(field, length).astype(np.float32))

    def clearance_at(self, points: ArrayLike) -> Array:
        """Clearance [m], (n,), in the cells of points (n, 2)."""
        return self._look_up(lambda tile: tile.clearance, points, -np.inf)

    def terrain_clearance_at(self, points: ArrayLike) -> Array:
        """Clearance [m], (n,), without obstacles, in the cells of points (n, 2)."""
        return self._look_up(lambda tile: tile.terrain_clearance, points, -np.inf)

    def blockage_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Blockage, (n,), in the cells of points (n, 2); outside the world EDGE."""
        return self._look_up(lambda tile: tile.blockage, points, Blockage.EDGE).astype(np.uint8)

    def bumps_at(self, poses: Array) -> Array:
        """Bump height [m], (n,), at poses (n, 3) of x, y [m] and heading [rad]; see ``bump_height_on_path``."""
        bumps = np.empty(len(poses))
        for tile, rows, _ in self._tiles_at(self._cells(poses[:, :2])[0]):
            bumps[rows] = bump_height_on_path(tile.bearing, tile.highest, poses[rows], self.robot)
        return bumps

    def path_length(self, poses: Array) -> float:
        """Length [m] of a path through poses (n, 2 or 3), slopes of the mean ground under the robot included."""
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1))])
        rows = np.unique(np.searchsorted(arc, np.arange(0.0, arc[-1] + 0.25, 0.25)).clip(max=len(arc) - 1))
        heights = self._floor.height_at(poses[rows, 0], poses[rows, 1])
        return float(np.hypot(np.diff(arc[rows]), np.diff(heights)).sum())

    def outlines_near(self, points: Array, distance: float) -> list[Outline]:
        """Outlines whose circle comes within ``distance``, CLEAR at most, of the bounding box of points (n, 2) [m].

        At the edges of tiles some are found twice.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        found: list[Outline] = []
        for key in _between(self._cells(np.stack([low, high]))[0] // self._side):
            tile = self._tile(*key)
            x, y, radius = tile.circles.T
            gap = np.hypot(x - np.clip(x, low[0], high[0]), y - np.clip(y, low[1], high[1]))
            found += [tile.outlines[number] for number in np.flatnonzero(gap <= radius + distance)]
        return found

    def clearance_of(self, rows: range, columns: range) -> NDArray[np.float32]:
        """Clearance [m] (n, m) of the cells in rows (n) and columns (m)."""
        cells = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
        clearance = np.empty(len(cells), np.float32)
        for tile, own, (i, j) in self._tiles_at(cells):
            clearance[own] = tile.clearance[i, j]
        return clearance.reshape(len(rows), len(columns))

    def _look_up(self, layer: Callable[[_Tile], NDArray[Any]], points: ArrayLike, outside: float) -> Array:
        cells, inside = self._cells(np.asarray(points, np.float64).reshape(-1, 2))
        values = np.full(len(cells), outside, np.float64)
        for tile, rows, (i, j) in self._tiles_at(cells[inside]):
            values[np.flatnonzero(inside)[rows]] = layer(tile)[i, j]
        return values

    def _cells(self, points: Array) -> tuple[NDArray[np.intp], Mask]:
        """Cells (n, 2) of points (n, 2), those outside moved to the edge, and which are inside."""
        cells = np.rint((points - self.corner) / CELL).astype(np.intp)
        inside = np.asarray(((cells >= 0) & (cells < self.shape)).all(axis=1))
        return np.clip(cells, 0, np.subtract(self.shape, 1)), inside

    def _tiles_at(self, cells: NDArray[np.intp]) -> Iterator[tuple[_Tile, NDArray[np.intp], NDArray[np.intp]]]:
        """Yield each tile of cells (n, 2) with their rows (m,) and their indices (2, m) in it."""
        tiles = cells // self._side
        for key in _between(tiles):
            rows = np.flatnonzero((tiles == key).all(axis=1))
            if len(rows):
                yield self._tile(*key), rows, (cells[rows] - np.multiply(key, self._side)).T

    def _tile(self, i: int, j: int) -> _Tile:
        tile = self._tiles.pop((i, j), None) or self._make(i, j)
        self._tiles[i, j] = tile  # the one that was looked up last is the last
        if len(self._tiles) > _KEPT:
            del self._tiles[next(iter(self._tiles))]
        return tile

    def _make(self, i: int, j: int) -> _Tile:
        """Map a rectangle with a margin, beyond which nothing has an effect, and keep what is inside."""
        margin = round(self._clear / CELL) + 1
        own = [slice(k * self._side, min((k + 1) * self._side, n)) for k, n in zip((i, j), self.shape, strict=True)]
        wide = [slice(max(0, s.start - margin), min(n, s.stop + margin)) for s, n in zip(own, self.shape, strict=True)]
        cut = tuple(slice(s.start - w.start, s.stop - w.start) for s, w in zip(own, wide, strict=True))
        x, y = self._x[wide[0]], self._y[wide[1]]
        beyond, step = max(1.0, self.robot_radius + _AROUND_NODE), max_step(self.robot)
        part = self.parts.within(np.array([x[0], y[0]]) - beyond, np.array([x[-1], y[-1]]) + beyond)
        outlines = [*obstacle_outlines(part, self._height), *stone_outlines(part, step)]
        bearing, soil = divided(bearing_field(part)), divided(part.terrain.field)
        highest = highest_around(soil, (bearing.heights - soil.heights).astype(np.float32), step)
        blockage = self._terrain[tuple(wide)].copy()
        blockage[_rough(bearing, highest, x, y, self.robot) & (blockage == Blockage.NONE)] = Blockage.ROUGH
        blockage[_near_edge(x, y, self._size)] = Blockage.EDGE
        on_terrain = np.minimum(
            self._distance_from(blockage != Blockage.NONE),
            self._distance_from(blockage == Blockage.WATER) - self.robot_radius,
        )
        solid = _outline_cells(outlines, x, y)
        blockage[solid] = Blockage.OBSTACLE
        return _Tile(
            blockage=np.ascontiguousarray(blockage[cut]),
            clearance=np.minimum(on_terrain, self._distance_from(solid) - self.robot_radius)[cut].astype(np.float32),
            terrain_clearance=on_terrain[cut].astype(np.float32),
            bearing=bearing,
            highest=highest,
            outlines=tuple(outlines),
            circles=np.array([outline.circle for outline in outlines]).reshape(-1, 3),
        )

    def _distance_from(self, cells: Mask) -> Array:
        """Distance [m] to the nearest of ``cells``, less half a cell, as positions are rounded to cells."""
        if not cells.any():
            return np.full(cells.shape, self._clear)
        return np.minimum(distance_transform_edt(~cells) * CELL - CELL / 2, self._clear)


def _between(tiles: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Tiles between the lowest and the highest of (n, 2), n >= 0."""
    if not len(tiles):
        return []
    (first_i, first_j), (last_i, last_j) = tiles.min(axis=0).tolist(), tiles.max(axis=0).tolist()
    return list(itertools.product(range(first_i, last_i + 1), range(first_j, last_j + 1)))


def _near_edge(x: Array, y: Array, size: tuple[float, float]) -> Mask:
    along, across = (np.abs(axis) > s / 2 - EDGE_MARGIN + 1e-9 for axis, s in zip((x, y), size, strict=True))
    return np.asarray(along[:, None] | across[None, :])


def _rough(bearing: Heightfield, highest: Heightfield, x: Array, y: Array, robot: RobotConfig) -> Mask:
    limit = robot.ground_clearance - MIN_CHASSIS_CLEARANCE
    return np.asarray(max_bump_height(bearing, highest, x, y, robot) > limit)


def _terrain_blockage(world: World, x: Array, y: Array, length: float) -> NDArray[np.uint8]:
    field = world.terrain.field
    slope = np.hypot(*slopes(field, length))
    i, j = (
        np.clip(np.rint((axis - start) / field.spacing).astype(int), 0, count - 1)
        for axis, start, count in zip((x, y), (field.x0, field.y0), field.heights.shape, strict=True)
    )
    cells = np.ix_(i, j)
    blockage = np.zeros((len(x), len(y)), np.uint8)
    blockage[(slope > np.tan(np.radians(MAX_SLOPE_DEG)))[cells]] = Blockage.STEEP
    if world.water_level is not None:
        level = (world.water_at(x[:, None], y) + FREEBOARD).astype(np.float32)  # as heights are
        blockage[field.heights[cells] < level] = Blockage.WATER
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
