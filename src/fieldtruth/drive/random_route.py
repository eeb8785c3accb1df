# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Finds random free routes: towards one far, unseen place after the other, on cheap ways that keep off obstacles.

A way is Dijkstra's on a grid whose cost is random, high near obstacles, on ground that was driven and behind the robot.
Way-points are picked from it as far apart as the rehearsed robot gets along with: it cuts corners, so near obstacles
they come closer.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from fieldtruth.core.arrays import Array
from fieldtruth.drive.husky import OUTLINE
from fieldtruth.drive.kinematics import KinematicSimulator, Stage
from fieldtruth.drive.route_check import LINE_GAP, line_conflict, line_places, path_conflict, thinned
from fieldtruth.drive.traversability import CELL, ROBOT_RADIUS, Traversability

STRIDE: Final = 3
NODE: Final = STRIDE * CELL  # [m] between the places that ways are made of
WAY_CLEARANCE: Final = 0.1  # [m] of the nodes of a way
PATH_CLEARANCE: Final = 0.4  # [m] of the rehearsed robot, wherever there is so much room
PATH_GAP: Final = 0.2  # [m] of its outline at least
SPACINGS: Final = (16.0, 13.0, 10.5, 8.5, 7.0)  # [m] of way between way-points
CLOSE_SPACINGS: Final = (5.6, 4.5, 3.6, 2.8, 2.3)  # [m], where obstacles force it
TURN_GAP: Final = 0.3  # [m] more where it turns: on uneven ground it skids more on one side than on the other, ...
SHARP_TURN: Final = 1.2  # [rad], ... by up to 0.4 m in turns of this and more,
AFTER_TURN: Final = 1.5  # [m] and so far behind them
LEAST_SPACING: Final = 6.25  # [m] of way; eight tenths of it in a straight line
MOST_SPACING: Final = 20.0  # [m]
ATTEMPTS: Final = 10
PATIENCE: Final = 15  # ways in vain
ENDS: Final = 6  # of one walk


@dataclass
class _Walk:
    """Start and way-points, and the stage, path and length [m] at each of them."""

    corners: list[Array]
    stages: list[Stage]
    paths: list[Array] = field(default_factory=list)
    lengths: list[float] = field(default_factory=lambda: [0.0])

    def add(self, corner: Array, poses: Array, stage: Stage, length: float) -> None:
        self.corners.append(corner)
        self.stages.append(stage)
        self.paths.append(poses)
        self.lengths.append(self.lengths[-1] + length)

    def drop(self, count: int) -> None:
        for _ in range(min(count, len(self.paths))):
            for part in (self.corners, self.stages, self.paths, self.lengths):
                part.pop()


def wander(
    ground: Traversability, rehearsal: KinematicSimulator, length_m: float, rng: np.random.Generator
) -> Iterator[tuple[Array | None, float]]:
    """Try some random walks. Each gives start and way-points (1 + n, 2) [m], or None, and the length [m] it reached."""
    grid = _Grid(ground)
    if not len(grid.nodes):
        return
    for attempt in range(ATTEMPTS):
        walk = _begin(grid, rehearsal, rng, from_end=attempt % 2 == 1)
        longest = 0.0
        for _ in range(ENDS):
            _walk_on(walk, grid, rehearsal, length_m, rng)
            longest = max(longest, walk.lengths[-1])
            corners = _cut(walk, ground, rehearsal, length_m)
            if corners is not None or walk.lengths[-1] < length_m:
                break
            walk.drop(4)  # no room for the last way-point; try another end
        yield corners, min(length_m, longest)


class _Grid:
    """Nodes of the largest connected free part of the ground, and what it costs to go from one to the next."""

    def __init__(self, ground: Traversability) -> None:
        self.ground = ground
        clearance = ground.clearance[::STRIDE, ::STRIDE]
        parts, count = label(clearance >= WAY_CLEARANCE)
        sizes = np.bincount(parts.ravel(), minlength=count + 1)
        sizes[0] = 0
        self._free: NDArray[np.bool_] = (parts == sizes.argmax()) & (parts > 0)
        self._cells = np.argwhere(self._free)
        self.nodes: Array = (self._cells * NODE + (ground.x0, ground.y0)).astype(np.float64)
        self.clearance = clearance[self._free].astype(np.float64)
        number = np.full(np.add(self._free.shape, 2), -1)
        number[1:-1, 1:-1][self._free] = np.arange(len(self.nodes))
        i, j = (self._cells + 1).T
        pairs, lengths = [], []
        for di, dj in ((1, 0), (0, 1), (1, 1), (1, -1)):
            there = number[i + di, j + dj]
            here = np.flatnonzero(there >= 0)
            pairs.append(np.stack([here, there[here]]))
            lengths.append(np.full(len(here), NODE * np.hypot(di, dj)))
        self._pairs, self._lengths = np.concatenate(pairs, axis=1), np.concatenate(lengths)

    def nearest(self, place: Array) -> int:
        return int(((self.nodes - place) ** 2).sum(axis=1).argmin())

    def away_from(self, driven: Array) -> Array:
        """Distance [m] of the nodes to driven places (n, 2)."""
        fresh = np.ones(self._free.shape, bool)
        cells = np.rint((driven - (self.ground.x0, self.ground.y0)) / NODE).astype(int)
        fresh[tuple(np.clip(cells, 0, np.subtract(fresh.shape, 1)).T)] = False
        return np.asarray(distance_transform_edt(fresh)[self._free] * NODE)

    def reach(self, place: Array) -> Array:
        """Length [m] of the shortest way from ``place`` to each node."""
        return self._dijkstra(self.nearest(place), np.ones(len(self.nodes)))[0]

    def way(self, stage: Stage, driven: Array, rng: np.random.Generator) -> Array:
        """A way (n, 2) [m] from ``stage`` to a random place, the rather the farther it is from all that was driven."""
        here = np.array([stage.x, stage.y])
        away = self.away_from(driven)
        source = self.nearest(here)
        cost, before = self._dijkstra(source, self._cost(stage, away, rng))
        far = np.flatnonzero((np.linalg.norm(self.nodes - here, axis=1) > 8.0) & np.isfinite(cost))
        far = far if len(far) else np.array([int(np.where(np.isfinite(cost), cost, -1).argmax())])
        some = rng.choice(far, 40)
        wish = np.minimum(away[some], 25.0) * (self.clearance[some] > PATH_CLEARANCE) + 0.01
        node = int(some[(wish * rng.uniform(0.3, 1.0, len(some))).argmax()])
        way = [node]
        while node != source:
            node = int(before[node])
            way.append(node)
        return self.nodes[way[::-1]]

    def _cost(self, stage: Stage, away: Array, rng: np.random.Generator) -> Array:
        noise = gaussian_filter(rng.standard_normal(self._free.shape), 3.0 / NODE)[self._free]
        offset = self.nodes - (stage.x, stage.y)
        distance = np.linalg.norm(offset, axis=1)
        ahead = offset @ (np.cos(stage.heading), np.sin(stage.heading)) / np.maximum(distance, 1e-9)
        return np.asarray(
            1.0
            + 1.5 * (noise - noise.min()) / max(float(np.ptp(noise)), 1e-9)
            + 10.0 * np.exp(-self.clearance / 0.3)
            + 2.0 * np.exp(-((away / 1.5) ** 2))
            + 4.0 * ((distance < 3.0) & (ahead < -0.2))
        )

    def _dijkstra(self, source: int, cost: Array) -> tuple[Array, NDArray[np.int32]]:
        weights = self._lengths * cost[self._pairs].mean(axis=0)
        graph = csr_matrix((weights, tuple(self._pairs)), shape=(len(cost), len(cost)))
        total, before = dijkstra(graph, directed=False, indices=[source], return_predecessors=True)
        return total[0], before[0]


def _begin(grid: _Grid, rehearsal: KinematicSimulator, rng: np.random.Generator, *, from_end: bool) -> _Walk:
    """Stand anywhere where there is room, or at an end of the free ground."""
    roomy = np.flatnonzero(grid.clearance >= min(0.6, float(grid.clearance.max())))
    start = grid.nodes[rng.choice(roomy)]
    if from_end:
        start = grid.nodes[roomy[grid.reach(start)[roomy].argmax()]]
    return _Walk([start], [rehearsal.start(start, start + rng.normal(size=2))])


def _walk_on(
    walk: _Walk, grid: _Grid, rehearsal: KinematicSimulator, length_m: float, rng: np.random.Generator
) -> None:
    """Walk on until it is long enough, or nothing more is found."""
    longest, failures = walk.lengths[-1], 0
    while walk.lengths[-1] < length_m and failures < PATIENCE:
        driven = np.concatenate([walk.corners[0][None], *(poses[::10, :2] for poses in walk.paths)])
        way = grid.way(walk.stages[-1], driven, rng)
        if _follow(walk, way, grid.ground, rehearsal, length_m, rng):
            failures = 0 if walk.lengths[-1] > longest else failures + 1
            longest = max(longest, walk.lengths[-1])
        else:
            failures += 1
            walk.drop(failures // 3)


def _follow(
    walk: _Walk,
    way: Array,
    ground: Traversability,
    rehearsal: KinematicSimulator,
    length_m: float,
    rng: np.random.Generator,
) -> bool:
    """Add way-points on ``way``, each as far as it goes; take back what leads nowhere. True if any was added."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    # The robot turns this far before a way-point, and there the way begins.
    begun, at = len(walk.paths), [rehearsal.control.arrival_distance if walk.paths else 0.0]
    untried = [_choices(rng)]
    for _ in range(80):
        rest = SPACINGS[-1] if len(walk.paths) > begun else CLOSE_SPACINGS[-1]
        if not untried or walk.lengths[-1] >= length_m or at[-1] > arc[-1] - rest:
            break
        if not untried[-1]:  # a dead end
            untried.pop()
            if untried:
                walk.drop(1)
                at.pop()
            continue
        spacing, roomy = untried[-1].pop(0)
        there = at[-1] + spacing
        if there > arc[-1]:
            continue
        target = np.array([np.interp(there, arc, way[:, k]) for k in range(2)])
        found = _leg(walk, target, ground, rehearsal, roomy=roomy, least=min(spacing, LEAST_SPACING))
        if found is not None:
            walk.add(target, *found, ground.way_length(found[0]))
            at.append(there)
            untried.append(_choices(rng))
    return len(walk.paths) > begun


def _choices(rng: np.random.Generator) -> list[tuple[float, bool]]:
    """Spacings [m] in the order in which they are tried, a random one first; True: only with much room."""
    first = float(rng.uniform(6.5, 18.0))
    spacings = [first, *(s for s in SPACINGS if s < first)]
    return [*((s, True) for s in spacings), *((s, False) for s in (*spacings, *CLOSE_SPACINGS))]


def _leg(
    walk: _Walk, target: Array, ground: Traversability, rehearsal: KinematicSimulator, *, roomy: bool, least: float
) -> tuple[Array, Stage] | None:
    """Poses and stage of the leg from the walk's end to ``target``, if it is free, or has much room; None otherwise.

    ``least`` [m] of way, eight tenths of it in a straight line, lie between the way-points.
    """
    line = line_places(walk.corners[-1], target)
    if not 0.8 * least <= np.linalg.norm(line[-1] - line[0]) <= MOST_SPACING:
        return None
    clearance = ground.clearance_at(line).min()
    # The map knows most answers: it tells the room about the robot's corners, the line needs less.
    if clearance < (0.0 if roomy else LINE_GAP - ROBOT_RADIUS - CELL) or ground.ground_clearance_at(line).min() < 0:
        return None
    if clearance < 0 and line_conflict(ground, line) is not None:
        return None
    stage = walk.stages[-1] if walk.paths else rehearsal.start(walk.corners[0], target)
    poses, arrived = rehearsal.leg(stage, target)
    return (poses, arrived) if arrived is not None and _has_room(ground, thinned(poses), roomy) else None


def _has_room(ground: Traversability, poses: Array, roomy: bool) -> bool:
    """Whether the robot has room, also where it turns and may be beside the rehearsed path."""
    turn = np.cumsum(np.abs(np.diff(poses[:, 2], prepend=poses[0, 2])))
    wider = TURN_GAP * min(1.0, float(turn[-1]) / SHARP_TURN)
    apart = float(np.linalg.norm(poses[1, :2] - poses[0, :2])) if len(poses) > 1 else 1.0
    bend = poses[: int(np.searchsorted(turn, 0.95 * turn[-1])) + 1 + int(AFTER_TURN / apart)]
    for part, margin in ((bend, wider), (poses, 0.0)):
        clearance = ground.clearance_at(part[:, :2]).min()
        if clearance >= (PATH_CLEARANCE if roomy else PATH_GAP) + margin:
            continue
        on_ground = ground.ground_clearance_at(part[:, :2]).min()
        if roomy or clearance < OUTLINE[1] / 2 + PATH_GAP + margin - ROBOT_RADIUS - CELL:
            return False
        if on_ground < PATH_GAP / 2 + margin / 2 or path_conflict(ground, part, PATH_GAP + margin) is not None:
            return False
    return True


def _cut(walk: _Walk, ground: Traversability, rehearsal: KinematicSimulator, length_m: float) -> Array | None:
    """Start and way-points of a walk that ends after ``length_m``: its last way-point is set where that is so."""
    if walk.lengths[-1] < length_m:
        return None
    enough = int(np.searchsorted(walk.lengths, length_m))  # the first way-point beyond
    for last in range(enough - 1, max(-1, enough - 4), -1):
        rest = length_m - walk.lengths[last]
        if rest < 5.0 and last > 0 and last == enough - 1 and walk.lengths[last] > 15.0:
            continue  # rather one way-point less, and the last one farther out
        begun = _Walk(walk.corners[: last + 1], walk.stages[: last + 1], walk.paths[:last])
        towards = walk.corners[last + 1] - walk.corners[last]
        target = _end(begun, towards / np.linalg.norm(towards), ground, rehearsal, rest, 0.01 * length_m)
        if target is not None:
            return np.array([*begun.corners, target])
    return None


def _end(
    walk: _Walk, towards: Array, ground: Traversability, rehearsal: KinematicSimulator, rest: float, tolerance: float
) -> Array | None:
    """The last way-point, ``towards`` which the robot drives ``rest`` [m] until it has arrived."""
    spacing = rest
    for _ in range(8):
        target = walk.corners[-1] + spacing * towards
        found = _leg(walk, target, ground, rehearsal, roomy=False, least=min(rest, LEAST_SPACING))
        if found is None:
            return None
        missing = rest - ground.way_length(found[0])
        if abs(missing) <= tolerance:
            return np.asarray(target)
        spacing += missing
    return None
