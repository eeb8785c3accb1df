# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Random route planning: repeated random paths to distant ground that was not driven yet, with waypoints along them.

Waypoints are set as far apart as the simulated robot can follow: it cuts corners, so near obstacles they are closer
together.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.drive.kinematics import KinematicSimulator, KinematicState
from fieldtruth.drive.route_check import line_conflict, line_gap, line_points, path_conflict, thinned
from fieldtruth.drive.route_grid import PATH_CLEARANCE, RouteGrid
from fieldtruth.drive.traversability import CELL, Traversability

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
        """How many waypoints of start and waypoints (1 + n, 2) [m] the robot does not reach."""
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
    """Whether the robot keeps its gap to obstacles, also in turns, where it may leave the simulated path."""
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
