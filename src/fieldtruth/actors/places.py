# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Places of actors: free ground and free air around the robot's way, what is in the way, and ways through.

Clearance is the distance to what blocks: outlines of objects (exact within a metre), water, ground that is too steep,
and the edge of the region. It is never more than the true distance. Ways are shortest paths between nodes half a metre
apart or more (Dijkstra); off the trails they can cost more.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import distance_transform_edt, gaussian_filter, label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Index, Mask
from fieldtruth.core.transforms import transform
from fieldtruth.drive.ground import WorldParts
from fieldtruth.drive.traversability import FREEBOARD, distance_to, obstacle_outlines, stone_outlines
from fieldtruth.world.model import Raster, World

AROUND: Final = 40.0
"""[m] around the robot's way that actors move in, within the world."""
_STEEPEST: Final = math.tan(math.radians(30.0))
_STEP: Final = 0.15  # [m] height of the stones that actors walk around
_EXACT: Final = 1.0  # [m] from objects within which their distance is exact
_FAR: Final = 10.0  # [m] of clearance at most
_CELL: Final = 0.1  # [m]
_CELLS: Final = 2e6  # of the clearance, at most; a larger region has larger ones
_NODE: Final = 0.5  # [m] between the nodes of ways
_NODES: Final = 6e4
_AIR: Final = 1.2  # [m] above and below a flying actor that is free of objects
_SAMPLED: Final = 3000  # vertices of an object that are looked at for it,
_APART: Final = 0.4  # [m] and points of its larger triangles, so far apart
_OFF_TRAIL: Final = 8.0
"""Cost of a metre off the trails for those who keep to them; it is 1 on a trail, and up to 2 near its edge."""


class Ways(NamedTuple):
    """Shortest paths from one node: cost [m] (nodes,), infinite without one, and the node before (nodes,)."""

    cost: Array
    before: Index


class Places:
    """Free places within ``AROUND`` of the robot's ``way`` (n, 2) [m] and of other ``points`` (m, 2) [m]."""

    def __init__(self, world: World, way: Array, points: Array) -> None:
        half = np.array(world.size) / 2
        around = np.concatenate([way, points])
        self.low, self.high = (np.clip(e, -half, half) for e in (around.min(0) - AROUND, around.max(0) + AROUND))
        self.world, self.part = world, WorldParts(world).within(self.low, self.high)
        self.outlines = [*obstacle_outlines(self.part), *stone_outlines(self.part, _STEP)]
        side = self.high - self.low
        self._cell = max(_CELL, math.sqrt(float(side[0] * side[1]) / _CELLS))
        x, y = (
            start + self._cell * np.arange(math.ceil(s / self._cell) + 1)
            for start, s in zip(self.low, side, strict=True)
        )
        self._solid = self._raster(self._to_objects(x, y))
        self._wet, self._steep = (self._raster(self._away_from(blocked)) for blocked in self._bad_ground(x, y))
        edge = np.minimum(
            np.minimum(x - self.low[0], self.high[0] - x)[:, None], np.minimum(y - self.low[1], self.high[1] - y)
        )
        layers = (self._solid, self._wet, self._steep)
        self._clearance = self._raster(np.minimum.reduce([edge, *(layer.values for layer in layers)]))
        self._set_nodes(way)
        self._graph = lru_cache(maxsize=16)(self._make_graph)
        self.air = lru_cache(maxsize=16)(self._make_air)
        self._surface = lru_cache(maxsize=None)(self._make_surface)

    def clearance(self, points: Array) -> Array:
        """Free radius [m] (...) around points (..., 2) [m]; 0 and below where they are blocked."""
        return self._clearance.at(points[..., 0], points[..., 1])

    def ground(self, points: Array) -> Array:
        """Height [m] (...) of the ground at points (..., 2) [m]."""
        return self.part.terrain.field.height_at(points[..., 0], points[..., 1])

    def uphill(self, points: Array) -> Array:
        """Direction (n, 2) in which the clearance at points (n, 2) grows; 0 where it is the same all around."""
        step = self._cell * np.array([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)])
        east, west, north, south = self.clearance(points + step[:, None])
        slope = np.stack([east - west, north - south], axis=-1)
        length = np.hypot(slope[:, 0], slope[:, 1])[:, None]
        return np.asarray(np.where(length > 1e-6, slope / np.maximum(length, 1e-6), 0.0))

    def is_clear(self, start: Array, end: Array, radius: float) -> bool:
        """Return whether a circle passes along a straight line (2,) to (2,) [m]."""
        count = 2 + int(math.dist(start, end) / 0.2)
        points = start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)
        return bool((self.clearance(points) >= radius).all())

    def hindrance(self, points: Array, radius: float, *, steep: bool = True) -> tuple[int, str] | None:
        """Return the first of points (n, 2) where a circle does not fit, and why, in words; None if all are free."""
        half = np.array(self.world.size) / 2
        outside = np.asarray((np.abs(points) + radius > half).any(axis=1))
        layers = {"in the water": self._wet} | ({"on a slope of more than 30 deg": self._steep} if steep else {})
        texts = {text: layer.at(points[:, 0], points[:, 1]) < radius for text, layer in layers.items()}
        solid = self._solid.at(points[:, 0], points[:, 1]) < radius
        blocked = np.asarray(np.any([outside, solid, *texts.values()], axis=0))
        if not blocked.any():
            return None
        row = int(np.argmax(blocked))
        if outside[row]:
            return row, "outside the world or at its edge"
        if solid[row]:
            gaps = [float(distance_to(outline, points[row : row + 1])[0]) for outline in self.outlines]
            return row, f"in {self.outlines[int(np.argmin(gaps))].name}"
        return row, next(text for text, there in texts.items() if there[row])

    # Nodes and ways.

    def free_nodes(self, radius: float) -> Mask:
        """Nodes (nodes,) of the largest part of the ground on which a circle can move about."""
        free = self.clearance(self.nodes).reshape(self._shape) >= radius + 0.1
        parts, count = label(free, np.ones((3, 3)))
        if not count:
            return np.zeros(len(self.nodes), bool)
        return np.asarray(parts.ravel() == 1 + int(np.argmax(np.bincount(parts.ravel())[1:])))

    def node_at(self, point: Array, radius: float) -> int:
        """Return the node nearest to a point (2,) that a circle can be at."""
        free = self._graph(math.ceil(radius * 10), trails=False)[1]
        return int(np.argmin(np.where(free, ((self.nodes - point) ** 2).sum(axis=1), np.inf)))

    def ways_from(self, node: int, radius: float, limit: float, *, trails: bool = False) -> Ways:
        """Return the ways of a circle from a node, up to a cost of ``limit``; ``trails``: rather along trails."""
        graph, _ = self._graph(math.ceil(radius * 10), trails=trails)
        cost, before = dijkstra(graph, True, np.array([node]), True, limit=limit)
        return Ways(cost[0], before[0].astype(np.intp))

    def path_to(self, ways: Ways, node: int) -> Array:
        """Return the points (n, 2) from the first node of ``ways`` to a node."""
        rows = [node]
        while (before := int(ways.before[rows[-1]])) >= 0:
            rows.append(before)
        return self.nodes[rows[::-1]]

    def straight(self, path: Array, radius: float) -> Array:
        """Return a path (n, 2) in straight lines as far as they are free for a circle, points as close as before."""
        corners, row = [path[0]], 0
        while row < len(path) - 1:
            ahead = range(len(path) - 1, row + 1, -3)
            row = next((k for k in ahead if self.is_clear(path[row], path[k], radius + 0.2)), row + 1)
            corners.append(path[row])
        pieces = [
            a + np.linspace(0.0, 1.0, max(1, round(math.dist(a, b) / self.spacing)), endpoint=False)[:, None] * (b - a)
            for a, b in pairwise(corners)
        ]
        return np.concatenate([*pieces, path[-1:]])

    def _set_nodes(self, way: Array) -> None:
        side = self.high - self.low
        spacing = max(_NODE, math.sqrt(float(side[0] * side[1]) / _NODES))
        counts = np.maximum(np.floor(side / spacing).astype(int), 1)
        start = self.low + (side - spacing * (counts - 1)) / 2
        axes = [first + spacing * np.arange(count) for first, count in zip(start, counts, strict=True)]
        self.spacing, self._shape = spacing, (int(counts[0]), int(counts[1]))
        self.nodes: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        self.off_trail = self.world.terrain.trail_distance.at(self.nodes[:, 0], self.nodes[:, 1])
        self.off_way = np.asarray(cKDTree(way).query(self.nodes)[0])
        heights = self.part.terrain.field.height_at(self.nodes[:, 0], self.nodes[:, 1]).reshape(self._shape)
        smooth = gaussian_filter(heights, 3.0 / spacing, mode="nearest").astype(np.float32)
        self.smooth_ground = Raster(values=smooth, spacing=spacing, x0=float(start[0]), y0=float(start[1]))

    def _make_graph(self, tenths: int, *, trails: bool) -> tuple[Any, Mask]:
        """Edges between free neighbours for a circle with a radius of ``tenths`` [0.1 m], and which nodes are free."""
        radius = tenths / 10
        free = self.clearance(self.nodes) >= radius + 0.05
        price = np.ones(len(self.nodes))
        if trails:
            price = np.where(
                self.off_trail > 0, _OFF_TRAIL, 1.0 + np.clip(1.0 + self.off_trail / (radius + 0.2), 0.0, 1.0)
            )
        rows = np.arange(len(self.nodes)).reshape(self._shape)
        first, second, length = list[Index](), list[Index](), list[Array]()
        for one, other in (
            (rows[:-1], rows[1:]), (rows[:, :-1], rows[:, 1:]),
            (rows[:-1, :-1], rows[1:, 1:]), (rows[:-1, 1:], rows[1:, :-1]),
        ):  # fmt: skip
            a, b = one.ravel(), other.ravel()
            both = free[a] & free[b]
            a, b = a[both], b[both]
            passes = self.clearance((self.nodes[a] + self.nodes[b]) / 2) >= radius + 0.03
            a, b = a[passes], b[passes]
            first, second = [*first, a], [*second, b]
            distance = np.hypot(*(self.nodes[a] - self.nodes[b]).T)
            length.append(distance * (price[a] + price[b]) / 2)
        edges = (np.concatenate(first), np.concatenate(second))
        size = (len(self.nodes), len(self.nodes))
        half = csr_matrix((np.concatenate(length), edges), shape=size)
        return half + half.T, free

    # Distances.

    def _raster(self, values: Array) -> Raster:
        return Raster(
            values=values.astype(np.float32), spacing=self._cell, x0=float(self.low[0]), y0=float(self.low[1])
        )

    def _to_objects(self, x: Array, y: Array) -> Array:
        """Distance [m] (nx, ny) of nodes to the nearest outline, less what is lost between nodes."""
        distance = np.full((len(x), len(y)), np.inf)
        for outline in self.outlines:
            low, high = outline.corners.min(axis=0) - _EXACT, outline.corners.max(axis=0) + _EXACT
            rows, columns = slice(*np.searchsorted(x, (low[0], high[0]))), slice(*np.searchsorted(y, (low[1], high[1])))
            points = np.stack(np.meshgrid(x[rows], y[columns], indexing="ij"), axis=-1)
            if points.size:
                near = distance_to(outline, points.reshape(-1, 2)).reshape(points.shape[:2])
                distance[rows, columns] = np.minimum(distance[rows, columns], near)
        # Between nodes the distance to a convex outline is convex: at a distance d, interpolation adds cell^2 / (8 d).
        exact = distance - self._cell**2 / 0.8
        beyond = _EXACT + self._away_from(distance <= _EXACT)
        return np.asarray(
            np.where(distance <= _EXACT, exact, np.minimum(np.maximum(beyond, _EXACT - self._cell), _FAR))
        )

    def _away_from(self, blocked: Mask) -> Array:
        """Distance [m] to blocked nodes, less one and a half cells, as their edge is between nodes."""
        if not blocked.any():
            return np.full(blocked.shape, _FAR)
        return np.asarray(np.minimum((distance_transform_edt(~blocked) - 1.5) * self._cell, _FAR))

    def _bad_ground(self, x: Array, y: Array) -> tuple[Mask, Mask]:
        """Nodes (nx, ny) that are under water, and those on steep ground."""
        field, shape = self.part.terrain.field, (len(x), len(y))
        wet, steep = np.zeros(shape, bool), np.zeros(shape, bool)
        for row, at in enumerate(x):
            if self.world.water_level is not None:
                wet[row] = field.height_at(at, y) < self.world.water_at(at, y) + FREEBOARD
            steep[row] = np.hypot(*field.slope_at(at, y, 0.5)) > _STEEPEST
        return wet, steep

    def _make_surface(self, mesh: str) -> Array:
        """Points (n, 3) [m] of a mesh's surface, in its frame."""
        made = self.part.meshes[mesh]
        corners = made.vertices[made.faces].astype(np.float64)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        counts = np.where(longest > _APART, np.ceil(longest / _APART), 0).astype(int)
        found = [made.vertices[:: 1 + len(made.vertices) // _SAMPLED].astype(np.float64)]
        for count in np.unique(counts[counts > 0]).tolist():
            i, j = (each.ravel() for each in np.meshgrid(*2 * [np.arange(count + 1)]))
            shares = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
            found.append(np.einsum("ps,fsk->fpk", shares, corners[counts == count]).reshape(-1, 3))
        return np.concatenate(found)

    def _make_air(self, height: float) -> Raster:
        """Free radius [m] at the nodes around an actor that flies at a height [m] above the ground."""
        field, taken = self.part.terrain.field, np.zeros(self._shape, bool)
        start = self.nodes[0]
        for instance in self.part.instances:
            points = transform(instance.world_from_object, self._surface(instance.mesh))
            if not len(points) or points[:, 2].max() < self.smooth_ground.at(*points[0, :2]) + height - 2 * _AIR:
                continue
            above = points[:, 2] - field.height_at(points[:, 0], points[:, 1])
            cells = np.rint((points[np.abs(above - height) < _AIR, :2] - start) / self.spacing).astype(int)
            cells = cells[((cells >= 0) & (cells < self._shape)).all(axis=1)]
            taken[cells[:, 0], cells[:, 1]] = True
        far = np.hypot(*self._shape) * self.spacing
        free = (distance_transform_edt(~taken) - 1.0) * self.spacing if taken.any() else np.full(self._shape, far)
        edge = np.minimum(self.nodes - self.low, self.high - self.nodes).min(axis=1).reshape(self._shape)
        grid = self.smooth_ground
        return Raster(values=np.minimum(free, edge).astype(np.float32), spacing=grid.spacing, x0=grid.x0, y0=grid.y0)


def one_of(ways: Sequence[Array], near: ArrayLike | None, rng: np.random.Generator) -> Array:
    """Return one of the robots' ways (n, 2): the nearest to a point (2,), or one at random."""
    if len(ways) == 1:
        return ways[0]
    if near is None:
        return ways[int(rng.integers(len(ways)))]
    return min(ways, key=lambda way: float(np.hypot(*(way - np.asarray(near)).T).min()))
