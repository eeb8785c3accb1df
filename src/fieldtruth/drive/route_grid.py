# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grid of free ground, and random paths on it: Dijkstra with random costs that are high near obstacles."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.drive.kinematics import KinematicState
from fieldtruth.drive.traversability import CELL, Traversability

STRIDE: Final = 3  # cells of the traversability map per node
NODE: Final = STRIDE * CELL  # [m] between nodes
NODE_CLEARANCE: Final = 0.1  # [m] of every node; the map, in cells, may promise 0.09 m too much
START_CLEARANCE: Final = 0.6  # [m]
PATH_CLEARANCE: Final = 0.4  # [m] of the simulated robot, wherever there is that much
MIN_DISTANCE: Final = 8.0  # [m] from the robot to the end of a path
NEW_GROUND: Final = 25.0  # [m]; no node is preferred for being farther from driven ground
REACH: Final = 50.0  # [m] from the robot along x and y to the end of a path, in worlds of several parts


class RouteGrid:
    """Nodes of the free ground, every STRIDE cells of the map, part by part."""

    def __init__(self, ground: Traversability) -> None:
        self._ground = ground
        self._shape = np.array([len(range(0, count, STRIDE)) for count in ground.shape])
        self._reach = int(self._shape.max()) if ground.parts.is_one else round(REACH / NODE)
        self._all: RoutePart | None = None

    def anywhere(self, rng: np.random.Generator) -> "RoutePart":
        """Return the largest connected free part around a random point; in a world of one part that of the world."""
        share = 0.5 if self._ground.parts.is_one else rng.uniform(size=2)
        return self._part(self._ground.corner + share * (self._shape - 1) * NODE, largest=True)

    def around(self, point: Array) -> "RoutePart":
        """Return the free nodes within ``REACH`` of a point (2,) [m] along x and y that connect to the nearest one."""
        return self._part(point, largest=False)

    def _part(self, point: Array, *, largest: bool) -> "RoutePart":
        middle = np.rint((point - self._ground.corner) / NODE).astype(int)
        low, high = np.clip([middle - self._reach, middle + self._reach + 1], 0, self._shape)
        is_all = bool((high - low == self._shape).all())
        if is_all and self._all is not None:
            return self._all
        rows, columns = (range(a * STRIDE, b * STRIDE, STRIDE) for a, b in zip(low, high, strict=True))
        clearance, corner = self._ground.clearance_of(rows, columns), self._ground.corner + low * NODE
        parts, count = label(clearance >= NODE_CLEARANCE)
        if largest or is_all:
            sizes = np.bincount(parts.ravel(), minlength=count + 1)
            sizes[0] = 0
            number = int(sizes.argmax())
        else:
            cells = np.argwhere(parts)
            distance = ((cells * NODE + corner - point) ** 2).sum(axis=1)
            number = int(parts[tuple(cells[distance.argmin()])]) if len(cells) else 0
        part = RoutePart((parts == number) & (parts > 0), clearance, corner)
        self._all = part if is_all else None
        return part


class RoutePart:
    """Connected free nodes of a part of the ground, and the cost of moving between neighbours.

    ``nodes`` (n, 2) and ``clearance`` (n,) there are in m.
    Searching all nodes of a world for each path takes time and memory that grow with its area.
    """

    def __init__(self, free: Mask, clearance: NDArray[np.float32], corner: Array) -> None:
        self._free, self._corner = free, corner
        cells = np.argwhere(free)
        self.nodes: Array = (cells * NODE + corner).astype(np.float64)
        self.clearance = clearance[free].astype(np.float64)
        number = np.full(np.add(free.shape, 2), -1)
        number[1:-1, 1:-1][free] = np.arange(len(self.nodes))
        i, j = (cells + 1).T
        pairs, lengths = [], []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            neighbour = number[i + di, j + dj]
            node = np.flatnonzero(neighbour >= 0)
            pairs.append(np.stack([node, neighbour[node]]))
            lengths.append(np.full(len(node), NODE * np.hypot(di, dj)))
        self._pairs, self._lengths = np.concatenate(pairs, axis=1), np.concatenate(lengths)

    @property
    def is_clear(self) -> Mask:
        """Nodes (n,) with enough clearance to start at, if there are any."""
        return np.asarray(self.clearance >= min(START_CLEARANCE, float(self.clearance.max())))

    def distances_from(self, point: Array) -> Array:
        """Length [m] of the shortest path from ``point`` to each node; infinite where none is within this part."""
        return self._dijkstra(self._nearest(point), np.ones(len(self.nodes)))[0]

    def random_path(self, state: KinematicState, driven: Array, rng: np.random.Generator) -> Array:
        """Path (n, 2) [m] from ``state`` to a random node, preferably far from the ``driven`` points (m, 2)."""
        position = np.array([state.x, state.y])
        to_driven = self._distance_from(driven)
        source = self._nearest(position)
        cost, before = self._dijkstra(source, self._cost(state, to_driven, rng))
        far = np.flatnonzero((np.linalg.norm(self.nodes - position, axis=1) > MIN_DISTANCE) & np.isfinite(cost))
        far = far if len(far) else np.array([int(np.where(np.isfinite(cost), cost, -1).argmax())])
        candidates = rng.choice(far, 40)
        weight = np.minimum(to_driven[candidates], NEW_GROUND) * (self.clearance[candidates] > PATH_CLEARANCE) + 0.01
        node = int(candidates[(weight * rng.uniform(0.3, 1.0, len(candidates))).argmax()])
        path = [node]
        while node != source:
            node = int(before[node])
            path.append(node)
        return self.nodes[path[::-1]]

    def _nearest(self, point: Array) -> int:
        return int(((self.nodes - point) ** 2).sum(axis=1).argmin())

    def _distance_from(self, driven: Array) -> Array:
        fresh = np.ones(self._free.shape, bool)
        cells = np.rint((driven - self._corner) / NODE).astype(int)
        inside = ((cells >= 0) & (cells < fresh.shape)).all(axis=1)
        fresh[tuple(cells[inside].T)] = False
        return np.asarray(distance_transform_edt(fresh)[self._free] * NODE)

    def _cost(self, state: KinematicState, to_driven: Array, rng: np.random.Generator) -> Array:
        """Cost per metre at each node: random, and high near obstacles, on driven ground and behind the robot."""
        noise = gaussian_filter(rng.standard_normal(self._free.shape), 3.0 / NODE)[self._free]
        offset = self.nodes - (state.x, state.y)
        distance = np.linalg.norm(offset, axis=1)
        ahead = offset @ (np.cos(state.heading), np.sin(state.heading)) / np.maximum(distance, 1e-9)
        return np.asarray(
            1.0
            + 1.5 * (noise - noise.min()) / max(float(np.ptp(noise)), 1e-9)
            + 10.0 * np.exp(-self.clearance / 0.3)
            + 2.0 * np.exp(-((to_driven / 1.5) ** 2))
            + 4.0 * ((distance < 3.0) & (ahead < -0.2))
        )

    def _dijkstra(self, source: int, cost: Array) -> tuple[Array, NDArray[np.int32]]:
        weights = self._lengths * cost[self._pairs].mean(axis=0)
        graph = csr_matrix((weights, tuple(self._pairs)), shape=(len(cost), len(cost)))
        total, before = dijkstra(graph, directed=False, indices=[source], return_predecessors=True)
        return total[0], before[0]
