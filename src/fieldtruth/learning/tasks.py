# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tasks of an episode: start, goal and the planner's path between them, chosen by difficulty.

A start and a goal are nodes of the planner's free ground; Dijkstra's algorithm from the goal proves that a path
connects them, on nodes that are free at any heading, and gives the path that is left from everywhere else.

Difficulty. The distance grows from ``NEAREST`` to ``FARTHEST``. Of the starts at that distance from the goal, some are
compared by what is in their way, and the one is taken below which that share of them is: 0 takes the easiest of the
world, 1 the hardest. In the way are obstacles near the straight line, slope and soft ground on it, how much longer the
planner's path is, and how narrow: ``hazard`` is the mean of the five, each from 0 to 1.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fieldtruth.core.arrays import Array, Float32Array, Index, Mask
from fieldtruth.core.errors import RouteError
from fieldtruth.drive.routes import NODE, NODE_CLEARANCE, RoutePart, check_point
from fieldtruth.drive.standing import has_trail
from fieldtruth.drive.traversability import MAX_SLOPE_DEG
from fieldtruth.kernels.height_maps import least_along, path_left
from fieldtruth.learning.task_world import TaskWorld

NEAREST: Final = 10.0
FARTHEST: Final = 60.0
"""Distance [m] from start to goal at difficulty 0 and 1; less where a world is smaller."""
BAND: Final = 0.1
"""Share of that distance by which it may differ."""
COMPARED: Final = 48
"""Starts among which difficulty chooses."""
APART: Final = 3.0
"""Least distance [m] between the starts and goals of several robots."""
_RING: Final = (0.7, 1.05)  # distance of these from the middle of all, over the radius
_SAMPLES: Final = 64  # points of the straight line
_TRIES: Final = 8  # goals
_SOFT: Final = 0.03  # [m] of sinkage that counts as the softest
_DETOUR: Final = 0.5  # share by which a path is longer than the straight line that counts as the longest
_WIDE: Final = 1.0  # [m] of clearance on a path that counts as no gap
_SHARE: Final = 0.25  # of the straight line in obstacles that counts as the most


@dataclass(frozen=True, eq=False)
class Task:
    """Start, heading, and where it goes; ``lengths`` (nx, ny) [m] are those of the paths from the nodes of a grid."""

    start: Array  # (2,) [m]
    heading: float  # [rad]
    goal: Array | None  # (2,) [m]
    shortest: float  # [m] of the planner's path; 0 without a goal
    lengths: Float32Array  # NaN where no path is
    corner: Array  # (2,) [m] of the grid
    hazard: float  # 0 to 1
    wanted: Mask | None = None  # (nx, ny) nodes that are to be seen

    def left(self, xy: Array) -> float:
        """Length [m] of the path from a point (2,) to the goal; infinite where no free node is near."""
        return float(path_left(self.lengths, self.corner, NODE, float(xy[0]), float(xy[1]))[0])

    def ahead(self, xy: Array, distance: float = 1.0) -> Array | None:
        """Point (2,) [m] of the path that is so far ahead of a point (2,); None off the free ground."""
        left, point = self.left(xy), xy
        if not np.isfinite(left):
            return None
        for _ in range(int(distance / NODE)):
            _, i, j = path_left(self.lengths, self.corner, NODE, float(point[0]), float(point[1]))
            rows, columns = slice(max(i - 1, 0), i + 2), slice(max(j - 1, 0), j + 2)
            around = np.nan_to_num(self.lengths[rows, columns], nan=np.inf)
            k = np.unravel_index(int(around.argmin()), around.shape)
            point = self.corner + NODE * (np.array([rows.start, columns.start]) + k)
        return point


def _grid_of(part: RoutePart, values: Array) -> Float32Array:
    """Values (n,) of the nodes on the grid of a part, NaN elsewhere."""
    grid = np.full(part.free.shape, np.nan, np.float32)
    grid[part.free] = np.where(np.isfinite(values), values, np.nan)
    return grid


def reach_task(made: TaskWorld, difficulty: float, rng: np.random.Generator) -> Task:
    """Choose a start and a goal that the planner connects.

    Raises:
        RouteError: there is no free ground that a route could cross.
    """
    part = made.grid.anywhere(rng)
    clear = np.flatnonzero(part.is_clear) if len(part.nodes) else np.zeros(0, np.intp)
    return _chosen(made, part, clear, difficulty, rng, f"no route crosses {made.world.name} (seed {made.world.seed})")


def crossing_tasks(made: TaskWorld, difficulty: float, count: int, rng: np.random.Generator) -> list[Task]:
    """Choose tasks of several robots, of which most straight lines cross.

    The first is as ``reach_task``. The others start in a ring around the middle of its straight line, and their goals
    are in it on the far side, as far as there is room. All of these are ``APART`` from each other, or two diagonals of
    the robot; where that leaves too few, the ring grows.

    Raises:
        RouteError: there is no free ground that a route could cross, or no room for so many robots.
    """
    part = made.grid.anywhere(rng)
    clear = np.flatnonzero(part.is_clear) if len(part.nodes) else np.zeros(0, np.intp)
    name = f"{made.world.name} (seed {made.world.seed})"
    apart = max(APART, 2.0 * float(np.hypot(*made.rig.robot.outline[:2])))
    for harder in np.linspace(difficulty, 1.0, _TRIES):
        found = [_chosen(made, part, clear, float(harder), rng, f"no route crosses {name}")]
        ends = np.array([found[0].start, found[0].goal])
        shares = np.linalg.norm(part.nodes[clear] - ends.mean(axis=0), axis=1) / (np.linalg.norm(ends[0] - ends[1]) / 2)
        ring = clear[(shares >= _RING[0]) & (shares <= _RING[1])]
        while len(found) < count:
            ends = np.array([found[-1].start, found[-1].goal])
            ring = ring[np.linalg.norm(part.nodes[ring][:, None] - ends, axis=2).min(axis=1) >= apart]
            try:
                found.append(_chosen(made, part, ring, float(harder), rng, name))
            except RouteError:
                break
        if len(found) == count:
            return found
    raise RouteError(f"{name} has no room for the ways of {count} robots; take fewer, or another environment")


def follow_task(made: TaskWorld, difficulty: float, rng: np.random.Generator) -> Task:
    """Choose a start on a trail, and a goal that is on the same one.

    Raises:
        RouteError: the world has no trail, or none that can be driven.
    """
    name = f"{made.world.name} (seed {made.world.seed})"
    if not has_trail(made.world):
        raise RouteError(f"{name} has no trail to follow; choose another environment, or the task Reach")
    part = made.grid.anywhere(rng)
    inside = np.zeros_like(part.free)
    if len(part.nodes):
        inside[part.free] = made.world.terrain.trail_distance.at(*part.nodes.T) < 0
    on_trail = RoutePart(inside, _grid_of(part, part.clearance), part.corner)
    task = _chosen(
        made, on_trail, np.arange(len(on_trail.nodes)), difficulty, rng, f"no trail of {name} can be driven", along=True
    )
    ahead = task.ahead(task.start)
    heading = task.heading if ahead is None else float(np.arctan2(*(ahead - task.start)[::-1]))
    return changed(task, heading=heading)


def changed(task: Task, **values: object) -> Task:
    """Return a task with other values."""
    return replace(task, **values)  # type: ignore[arg-type]


def explore_task(made: TaskWorld, difficulty: float, rng: np.random.Generator) -> Task:
    """Choose a start; what is to be seen are the free nodes within 5 to 20 m around it, by difficulty.

    Raises:
        RouteError: there is no free ground.
    """
    part = made.grid.anywhere(rng)
    if not len(part.nodes):
        raise RouteError(f"no route crosses {made.world.name} (seed {made.world.seed})")
    start = part.nodes[rng.choice(np.flatnonzero(part.is_clear))]
    lengths, wanted = _grid_of(part, part.distances_from(start)), part.free.copy()
    wanted[part.free] = np.linalg.norm(part.nodes - start, axis=1) <= 5.0 + 15.0 * difficulty
    heading = float(rng.uniform(-np.pi, np.pi))
    return Task(start, heading, None, 0.0, lengths, part.corner, 0.0, wanted)


def _chosen(
    made: TaskWorld,
    part: RoutePart,
    allowed: Index,
    difficulty: float,
    rng: np.random.Generator,
    problem: str,
    *,
    along: bool = False,
) -> Task:
    """Choose among the ``allowed`` nodes, at a distance of the path if ``along``, else of the straight line.

    Raises:
        RouteError: ``problem``: no two of them are far enough from each other.
    """
    usual = NEAREST + (FARTHEST - NEAREST) * difficulty
    for rest in reversed(range(_TRIES if len(allowed) > 1 else 0)):
        goal = int(rng.choice(allowed))
        straight = np.linalg.norm(part.nodes - part.nodes[goal], axis=1)
        if rest and straight[allowed].max() < usual:
            continue
        lengths, following = part.paths_to(goal)
        distance = np.where(np.isfinite(lengths), lengths if along else straight, 0.0)[allowed]
        wanted = min(usual, float(distance.max()) / (1 + BAND))
        starts = allowed[np.abs(distance - wanted) <= BAND * wanted]
        if wanted < 0.5 * NEAREST or not len(starts):
            continue
        starts = np.sort(rng.choice(starts, min(COMPARED, len(starts)), replace=False))
        narrow = np.empty(len(starts))
        least_along(following, part.clearance, starts, narrow)
        hazards = _hazards(made, part.nodes[starts], part.nodes[goal], lengths[starts], narrow)
        k = int(np.argsort(hazards, kind="stable")[round(difficulty * (len(starts) - 1))])
        start, heading = starts[k], float(rng.uniform(-np.pi, np.pi))
        return Task(
            part.nodes[start],
            heading,
            part.nodes[goal],
            float(lengths[start]),
            _grid_of(part, lengths),
            part.corner,
            float(hazards[k]),
        )
    raise RouteError(f"{problem}: no free nodes {0.5 * NEAREST:g} m from each other are connected")


def _hazards(made: TaskWorld, starts: Array, goal: Array, lengths: Array, narrow: Array) -> Array:
    """Return what is in the way from each of the starts (n, 2) to the goal: the mean of five shares, (n,)."""
    shares = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
    points = starts[:, None] + shares * (goal - starts)[:, None]  # (n, samples, 2)
    clearance = made.ground.clearance_at(points.reshape(-1, 2)).reshape(points.shape[:2])
    straight = np.maximum(np.linalg.norm(goal - starts, axis=1), 1e-9)
    parts = (
        (clearance < NODE_CLEARANCE).mean(axis=1) / _SHARE,
        made.slope_at(points).max(axis=1) / MAX_SLOPE_DEG,
        made.sinkage_at(points).mean(axis=1) / _SOFT,
        (lengths / straight - 1.0) / _DETOUR,
        1.0 - narrow / _WIDE,
    )
    return np.asarray(np.mean(np.clip(parts, 0.0, 1.0), axis=0))


def given_task(made: TaskWorld, start: Array, goal: Array, heading: float) -> Task:
    """Return the task from a start to a goal (2,) [m] that are given.

    Raises:
        RouteError: one of them is in an obstacle or on ground that blocks, or no path connects them.
    """
    for point, what in ((start, "the start"), (goal, "the goal")):
        check_point(made.ground, point, f"{what} at x {point[0]:.1f} m, y {point[1]:.1f} m")
    part = made.grid.around(goal)
    if not len(part.nodes):
        raise RouteError(f"no route crosses {made.world.name} (seed {made.world.seed})")
    node = part.nearest(goal)
    lengths, _ = part.paths_to(node)
    grid = _grid_of(part, lengths)
    shortest = path_left(grid, part.corner, NODE, float(start[0]), float(start[1]))[0]
    if np.linalg.norm(part.nodes[node] - goal) > 2 * NODE or not np.isfinite(shortest):
        raise RouteError(
            f"no free path leads from the start at x {start[0]:.1f} m, y {start[1]:.1f} m "
            f"to the goal at x {goal[0]:.1f} m, y {goal[1]:.1f} m"
        )
    hazard = _hazards(made, start[None], goal, np.array([shortest]), np.array([0.0]))[0]
    return Task(start, heading, goal, float(shortest), grid, part.corner, float(hazard))
