# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Check of a route against a world, and random routes: paths on a grid of free ground, with waypoints along them.

Checked are each waypoint, each straight leg, and the path of the follower, which cuts corners. Random paths lead to
distant ground that was not driven yet, by Dijkstra's algorithm with random costs that are high near obstacles.
Waypoints are set as far apart as the simulated robot can follow: it cuts corners, so near obstacles they are closer
together.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, gaussian_filter, label
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import RouteError
from fieldtruth.drive.controller import KinematicSimulator, KinematicState
from fieldtruth.drive.traversability import BLOCKAGE_TEXTS, CELL, Blockage, Outline, Traversability, distance_to, gap_to
from fieldtruth.experiment.robot_config import RobotConfig

SPACING: Final = (1.0, 25.0)  # [m] between waypoints; the paper has 5 to 20, and less near obstacles
LINE_MARGIN: Final = 0.065  # [m] from the robot's side on the straight legs to an obstacle
PATH_GAP: Final = 0.05  # [m] from the robot's outline to an obstacle; simulated path and drive differ by as much
_ROUNDING: Final = 0.001  # [m], of geodetic coordinates
_TERRAIN: Final = (Blockage.WATER, Blockage.STEEP, Blockage.EDGE)  # whether ground is too rough depends on the heading
_STEP: Final = 0.1  # [m] between the points of a line that are checked
STRIDE: Final = 3  # cells of the traversability map per node
NODE: Final = STRIDE * CELL  # [m] between nodes
NODE_CLEARANCE: Final = 0.1  # [m] of every node; the map, in cells, may promise 0.09 m too much
START_CLEARANCE: Final = 0.6  # [m]
PATH_CLEARANCE: Final = 0.4  # [m] of the simulated robot, wherever there is that much
MIN_DISTANCE: Final = 8.0  # [m] from the robot to the end of a path
NEW_GROUND: Final = 25.0  # [m]; no node is preferred for being farther from driven ground
REACH: Final = 50.0  # [m] from the robot along x and y to the end of a path, in worlds of several parts
PLANNED_GAP: Final = 0.2  # [m] from the robot's outline to an obstacle; more than route_check requires
SPACINGS: Final = (16.0, 13.0, 10.5, 8.5, 7.0)  # [m] of path between waypoints
CLOSE_SPACINGS: Final = (5.6, 4.5, 3.6, 2.8, 2.3)  # [m], where obstacles require it
TURN_GAP: Final = 0.3  # [m] added in turns, where skidding on uneven ground displaces the robot by up to 0.4 m
SHARP_TURN: Final = 1.2  # [rad] of turning from which the whole TURN_GAP is added
AFTER_TURN: Final = 1.5  # [m] of path after a turn for which TURN_GAP is kept
MIN_SPACING: Final = 6.25  # [m] of path; eight tenths of it in a straight line
MAX_SPACING: Final = 20.0  # [m]
ATTEMPTS: Final = 30
MAX_FAILURES: Final = 15  # random paths in a row on which no waypoint can be set, on a route without waypoints
TRIES_PER_WAYPOINT: Final = 0.5  # such paths more for each waypoint: a long route is worth more of them
ENDS: Final = 20  # last waypoints tried per attempt, each farther back


class Conflict(NamedTuple):
    """An obstacle that is too near: its name, the gap to it [m], and the point (x, y, ...) [m] of the path."""

    name: str
    gap: float
    point: Array


def line_gap(robot: RobotConfig) -> float:
    """Distance [m] that the straight legs keep from obstacles: 0.4 m of a Husky, which is 0.67 m wide."""
    return robot.outline[1] / 2 + LINE_MARGIN


def line_conflict(ground: Traversability, points: Array) -> Conflict | None:
    """Return the first obstacle that is nearer than ``line_gap`` to points (n, 2) [m] of a straight line."""
    return _first_conflict(ground, points, line_gap(ground.robot), distance_to, margin=0.0)


def path_conflict(ground: Traversability, poses: Array, min_gap: float = PATH_GAP) -> Conflict | None:
    """Return the first obstacle that is nearer than ``min_gap`` [m] to the robot's outline at poses (n, 3)."""
    gap_of = partial(gap_to, robot=ground.robot)
    return _first_conflict(ground, poses, min_gap, gap_of, margin=ground.robot_radius)


def _first_conflict(
    ground: Traversability, path: Array, min_gap: float, gap_of: Callable[[Outline, Array], Array], *, margin: float
) -> Conflict | None:
    for outline in ground.outlines_near(path[:, :2], margin + min_gap):
        gap = gap_of(outline, path)
        nearest = int(gap.argmin())
        if gap[nearest] < min_gap:
            return Conflict(outline.name, max(0.0, float(gap[nearest])), path[nearest])
    return None


def line_points(first: Array, last: Array) -> Array:
    """Points (n, 2), 10 cm apart, on a straight line."""
    return np.linspace(first, last, 2 + int(np.linalg.norm(last - first) / _STEP))


def thinned(poses: Array) -> Array:
    """Poses of a simulated leg at most 6 cm apart, including its last."""
    step = float(np.linalg.norm(poses[-1, :2] - poses[-2, :2])) if len(poses) > 1 else 1.0
    return poses[:: -max(1, int(0.06 / max(1e-6, step)))][::-1]


def check_route(ground: Traversability, simulator: KinematicSimulator, corners: Array) -> None:
    """Raise ``RouteError`` if the robot cannot drive the route of start and waypoints (1 + n, 2) [m]."""
    for row in range(len(corners)):
        _check_waypoint(ground, corners, row)
    for row in range(len(corners) - 1):
        _check_line(ground, corners, row)
    legs, endless = simulator.drive_route(corners)
    if endless is not None:
        raise RouteError(
            f"the robot cannot reach {_waypoint(corners, endless + 1)}, it circles it; "
            "drive slower, turn faster or increase control.arrival_distance"
        )
    for row, poses in enumerate(legs):
        _check_path(ground, row, thinned(poses))


def _waypoint(corners: Array, row: int) -> str:
    name = f"waypoint {row} of {len(corners) - 1}" if row else "the start"
    return f"{name} at {_xy(corners[row])}"


def _xy(point: Array) -> str:
    x, y = np.round(point[:2], 1) + 0.0
    return f"x {x:.1f} m, y {y:.1f} m"


def _leg(row: int) -> str:
    return f"the leg from waypoint {row} to {row + 1}" if row else "the leg from the start to waypoint 1"


def check_point(ground: Traversability, point: Array, what: str) -> None:
    """Raise ``RouteError`` if a point (2,) [m], ``what`` in words, is in an obstacle or on ground that blocks."""
    for outline in ground.outlines_near(point[None], 0.0):
        if distance_to(outline, point[None])[0] <= 0:
            raise RouteError(f"{what} is in {outline.name}; move it to free ground")
    blockage = Blockage(ground.blockage_at(point)[0])
    if blockage in _TERRAIN:
        raise RouteError(f"{what} is {BLOCKAGE_TEXTS[blockage]}")


def _check_waypoint(ground: Traversability, corners: Array, row: int) -> None:
    check_point(ground, corners[row], _waypoint(corners, row))
    if row:
        spacing = float(np.linalg.norm(corners[row] - corners[row - 1]))
        if not SPACING[0] - _ROUNDING <= spacing <= SPACING[1] + _ROUNDING:
            raise RouteError(
                f"{_waypoint(corners, row)} must be between {SPACING[0]:g} and {SPACING[1]:g} m from "
                f"{'the previous one' if row > 1 else 'the start'}, got {spacing:.2f} m"
            )


def _check_line(ground: Traversability, corners: Array, row: int) -> None:
    points = line_points(corners[row], corners[row + 1])
    conflict = line_conflict(ground, points)
    if conflict is not None:
        raise RouteError(
            f"{_leg(row)} passes {conflict.name} at a distance of {conflict.gap:.2f} m, at {_xy(conflict.point)}; "
            f"the robot needs {line_gap(ground.robot):.2f} m"
        )
    _check_terrain(ground, row, points)


def _check_path(ground: Traversability, row: int, poses: Array) -> None:
    """Check the path of the follower, which turns to the next waypoint before it reaches one and so cuts the corner."""
    conflict = path_conflict(ground, poses)
    if conflict is not None:
        raise RouteError(
            f"on {_leg(row)} the robot cuts the corner and comes within {conflict.gap:.2f} m of {conflict.name}, "
            f"at {_xy(conflict.point)}; it needs {PATH_GAP} m: set the waypoints closer together"
        )
    _check_terrain(ground, row, poses[:, :2])
    rough = np.flatnonzero(ground.bumps_at(poses) > ground.robot.ground_clearance)
    if len(rough):
        raise RouteError(f"{_leg(row)} is {BLOCKAGE_TEXTS[Blockage.ROUGH]}, at {_xy(poses[rough[0]])}")


def _check_terrain(ground: Traversability, row: int, points: Array) -> None:
    blockage = ground.blockage_at(points)
    blocked = np.flatnonzero(np.isin(blockage, _TERRAIN))
    if len(blocked):
        text = BLOCKAGE_TEXTS[Blockage(blockage[blocked[0]])]
        raise RouteError(f"{_leg(row)} is {text}, at {_xy(points[blocked[0]])}")


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

    ``nodes`` (n, 2) and ``clearance`` (n,) there are in m. They are the ``free`` (nx, ny) ones of a grid, row by row,
    whose first one is at ``corner`` (2,) [m].
    Searching all nodes of a world for each path takes time and memory that grow with its area.
    """

    def __init__(self, free: Mask, clearance: NDArray[np.float32], corner: Array) -> None:
        self.free, self.corner = free, corner
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
        return self._dijkstra(self.nearest(point), np.ones(len(self.nodes)))[0]

    def paths_to(self, node: int) -> tuple[Array, NDArray[np.int32]]:
        """Length [m] of the shortest path from each node to one, and the next node on it; -1 at its end.

        Without a path the length is infinite.
        """
        return self._dijkstra(node, np.ones(len(self.nodes)))

    def random_path(self, state: KinematicState, driven: Array, rng: np.random.Generator) -> Array:
        """Path (n, 2) [m] from ``state`` to a random node, preferably far from the ``driven`` points (m, 2)."""
        position = np.array([state.x, state.y])
        to_driven = self._distance_from(driven)
        source = self.nearest(position)
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

    def nearest(self, point: Array) -> int:
        """Return the node that is nearest to a point (2,) [m]."""
        return int(((self.nodes - point) ** 2).sum(axis=1).argmin())

    def _distance_from(self, driven: Array) -> Array:
        fresh = np.ones(self.free.shape, bool)
        cells = np.rint((driven - self.corner) / NODE).astype(int)
        inside = ((cells >= 0) & (cells < fresh.shape)).all(axis=1)
        fresh[tuple(cells[inside].T)] = False
        return np.asarray(distance_transform_edt(fresh)[self.free] * NODE)

    def _cost(self, state: KinematicState, to_driven: Array, rng: np.random.Generator) -> Array:
        """Cost per metre at each node: random, and high near obstacles, on driven ground and behind the robot."""
        noise = gaussian_filter(rng.standard_normal(self.free.shape), 3.0 / NODE)[self.free]
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


@dataclass
class _Draft:
    """Start and waypoints so far, with the state at each, the path to it and the length [m] up to it."""

    corners: list[Array]
    states: list[KinematicState]
    paths: list[Array] = field(default_factory=list)
    lengths: list[float] = field(default_factory=lambda: [0.0])

    @property
    def length(self) -> float:
        return self.lengths[-1]

    def add(self, corner: Array, poses: Array, state: KinematicState, length: float) -> None:
        self.corners.append(corner)
        self.states.append(state)
        self.paths.append(poses)
        self.lengths.append(self.length + length)

    def drop(self, count: int) -> None:
        for _ in range(min(count, len(self.paths))):
            for part in (self.corners, self.states, self.paths, self.lengths):
                part.pop()


class RandomRoutePlanner:
    """Proposes routes of ``length_m`` [m] on free ground; all randomness comes from ``rng``.

    ``reached`` returns how many waypoints of a route (1 + n, 2) [m] the robot really reaches; None to rely on
    ``simulator``.
    """

    def __init__(
        self,
        ground: Traversability,
        simulator: KinematicSimulator,
        length_m: float,
        rng: np.random.Generator,
        reached: Callable[[Array], int] | None = None,
    ) -> None:
        self._ground = ground
        self._simulator = simulator
        self._length = length_m
        self._rng = rng
        self._reached = reached
        self._grid = RouteGrid(ground)

    def proposals(self) -> Iterator[tuple[Array | None, float]]:
        """Yield start and waypoints (1 + n, 2) [m], or None, with the length [m] that the attempt reached."""
        for attempt in range(ATTEMPTS):
            draft = self._start(at_end_of_ground=attempt % 2 == 1)
            if draft is None:
                yield None, 0.0
                continue
            longest = 0.0
            for _ in range(ENDS):
                longest = max(longest, self._extend(draft))
                corners = self._cut(draft)
                if corners is not None and self._missed(corners):
                    corners = None
                if corners is not None or draft.length < self._length:
                    break
                draft.drop(4)  # no free last waypoint; try another end
            yield corners, min(self._length, longest)

    def _start(self, *, at_end_of_ground: bool) -> _Draft | None:
        """Start at random where there is enough clearance, or at the free node around that is farthest from there."""
        part = self._grid.anywhere(self._rng)
        if not len(part.nodes):
            return None
        start = part.nodes[self._rng.choice(np.flatnonzero(part.is_clear))]
        if at_end_of_ground:
            part = self._grid.around(start)
            away = np.where(part.is_clear, part.distances_from(start), -1.0)
            start = part.nodes[np.where(np.isfinite(away), away, -1.0).argmax()]
        return _Draft([start], [self._simulator.start(start, start + self._rng.normal(size=2))])

    def _extend(self, draft: _Draft) -> float:
        """Add waypoints along random paths until the route is long enough or too many paths fail.

        Returns:
            The greatest length [m] that was reached; the draft may be shorter again.
        """
        longest, failures = draft.length, 0
        while draft.length < self._length and failures < MAX_FAILURES + TRIES_PER_WAYPOINT * len(draft.paths):
            driven = np.concatenate([draft.corners[0][None], *(poses[::10, :2] for poses in draft.paths)])
            state = draft.states[-1]
            path = self._grid.around(np.array([state.x, state.y])).random_path(state, driven, self._rng)
            if self._follow(draft, path) and not self._drop_missed(draft):
                failures = 0 if draft.length > longest else failures  # what was dropped has to be made up for first
                longest = max(longest, draft.length)
            else:
                failures += 1
                draft.drop(failures // 3)
        return longest

    def _missed(self, corners: Array) -> int:
        """Return how many waypoints of start and waypoints (1 + n, 2) [m] the robot does not reach."""
        return 0 if self._reached is None else len(corners) - 1 - self._reached(corners)

    def _drop_missed(self, draft: _Draft) -> bool:
        """Drop the waypoints that the robot does not reach; those beyond the wanted length are not tried."""
        beyond = sum(length > self._length for length in draft.lengths)
        missed = self._missed(np.array(draft.corners[: len(draft.corners) - beyond]))
        draft.drop(beyond + missed if missed else 0)
        return missed > 0

    def _follow(self, draft: _Draft, path: Array) -> bool:
        """Set waypoints on ``path`` by depth-first search, the widest spacing first; True if any was set."""
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        # The robot turns this far before a waypoint, and there the path begins.
        first, at = len(draft.paths), [self._simulator.control.arrival_distance if draft.paths else 0.0]
        untried = [self._choices()]
        for _ in range(80):
            rest = SPACINGS[-1] if len(draft.paths) > first else CLOSE_SPACINGS[-1]
            if not untried or draft.length >= self._length or at[-1] > arc[-1] - rest:
                break
            if not untried[-1]:  # dead end: back to the waypoint before
                untried.pop()
                if untried:
                    draft.drop(1)
                    at.pop()
                continue
            spacing, clear = untried[-1].pop(0)
            ahead = at[-1] + spacing
            if ahead > arc[-1]:
                continue
            target = np.array([np.interp(ahead, arc, path[:, k]) for k in range(2)])
            leg = self._leg(draft, target, clear=clear, min_spacing=min(spacing, MIN_SPACING))
            if leg is not None:
                draft.add(target, *leg, self._ground.path_length(leg[0]))
                at.append(ahead)
                untried.append(self._choices())
        return len(draft.paths) > first

    def _choices(self) -> list[tuple[float, bool]]:
        """Spacings [m] in the order in which they are tried, a random one first; True: only with wide clearance."""
        first = float(self._rng.uniform(6.5, 18.0))
        spacings = [first, *(s for s in SPACINGS if s < first)]
        return [*((s, True) for s in spacings), *((s, False) for s in (*spacings, *CLOSE_SPACINGS))]

    def _leg(
        self, draft: _Draft, target: Array, *, clear: bool, min_spacing: float
    ) -> tuple[Array, KinematicState] | None:
        """Poses and final state of the leg from the draft's end to ``target``; None if it is not free.

        Args:
            draft: the route so far.
            target: the next waypoint [m].
            clear: require wide clearance on the whole leg.
            min_spacing: least length [m] of path between the waypoints; eight tenths of it in a straight line.
        """
        ground = self._ground
        line = line_points(draft.corners[-1], target)
        if not 0.8 * min_spacing <= np.linalg.norm(line[-1] - line[0]) <= MAX_SPACING:
            return None
        clearance = ground.clearance_at(line).min()
        # The map decides most cases quickly; its clearance holds for the robot's corners, a line needs less.
        if (
            clearance < (0.0 if clear else line_gap(ground.robot) - ground.robot_radius - CELL)
            or ground.terrain_clearance_at(line).min() < 0
        ):
            return None
        if clearance < 0 and line_conflict(ground, line) is not None:
            return None
        state = draft.states[-1] if draft.paths else self._simulator.start(draft.corners[0], target)
        poses, arrived = self._simulator.drive_leg(state, target)
        return (poses, arrived) if arrived is not None and _is_free(ground, thinned(poses), clear) else None

    def _cut(self, draft: _Draft) -> Array | None:
        """Start and waypoints of a draft, ended at the wanted length by a new last waypoint; None if that fails."""
        if draft.length < self._length:
            return None
        enough = int(np.searchsorted(draft.lengths, self._length))  # the first waypoint beyond
        for last in range(enough - 1, max(-1, enough - 4), -1):
            rest = self._length - draft.lengths[last]
            if rest < 5.0 and last > 0 and last == enough - 1 and draft.lengths[last] > 15.0:
                continue  # better one waypoint less and the last one farther out
            start = _Draft(draft.corners[: last + 1], draft.states[: last + 1], draft.paths[:last])
            direction = draft.corners[last + 1] - draft.corners[last]
            target = self._last_waypoint(start, direction / np.linalg.norm(direction), rest)
            if target is not None:
                return np.array([*start.corners, target])
        return None

    def _last_waypoint(self, draft: _Draft, direction: Array, rest: float) -> Array | None:
        """Waypoint in ``direction`` at which the robot arrives after ``rest`` [m], within 1 % of the route's length."""
        spacing = rest
        for _ in range(8):
            target = draft.corners[-1] + spacing * direction
            leg = self._leg(draft, target, clear=False, min_spacing=min(rest, MIN_SPACING))
            if leg is None:
                return None
            missing = rest - self._ground.path_length(leg[0])
            if abs(missing) <= 0.01 * self._length:
                return np.asarray(target)
            spacing += missing
        return None


def _is_free(ground: Traversability, poses: Array, clear: bool) -> bool:
    """Return whether the robot keeps its gap to obstacles, also in turns, where it may leave the simulated path."""
    turn = np.cumsum(np.abs(np.diff(poses[:, 2], prepend=poses[0, 2])))
    turn_margin = TURN_GAP * min(1.0, float(turn[-1]) / SHARP_TURN)
    spacing = float(np.linalg.norm(poses[1, :2] - poses[0, :2])) if len(poses) > 1 else 1.0
    turning = poses[: int(np.searchsorted(turn, 0.95 * turn[-1])) + 1 + int(AFTER_TURN / spacing)]
    for part, margin in ((turning, turn_margin), (poses, 0.0)):
        clearance = ground.clearance_at(part[:, :2]).min()
        if clearance >= (PATH_CLEARANCE if clear else PLANNED_GAP) + margin:
            continue
        on_terrain = ground.terrain_clearance_at(part[:, :2]).min()
        if clear or clearance < ground.robot.outline[1] / 2 + PLANNED_GAP + margin - ground.robot_radius - CELL:
            return False
        if on_terrain < PLANNED_GAP / 2 + margin / 2 or path_conflict(ground, part, PLANNED_GAP + margin) is not None:
            return False
    return True
