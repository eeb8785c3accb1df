# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Check a route against a world: each waypoint, each straight leg, and the path of the follower, which cuts corners."""

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import RouteError
from fieldtruth.drive.kinematics import KinematicSimulator
from fieldtruth.drive.outlines import Outline, distance_to, gap_to
from fieldtruth.drive.traversability import BLOCKAGE_TEXTS, Blockage, Traversability
from fieldtruth.experiment.robot_config import RobotConfig

SPACING: Final = (1.0, 25.0)  # [m] between waypoints; the paper has 5 to 20, and less near obstacles
LINE_MARGIN: Final = 0.065  # [m] from the robot's side on the straight legs to an obstacle
PATH_GAP: Final = 0.05  # [m] from the robot's outline to an obstacle; simulated path and drive differ by as much
_ROUNDING: Final = 0.001  # [m], of geodetic coordinates
_TERRAIN: Final = (Blockage.WATER, Blockage.STEEP, Blockage.EDGE)  # whether ground is too rough depends on the heading
_STEP: Final = 0.1  # [m] between the points of a line that are checked


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


def _check_waypoint(ground: Traversability, corners: Array, row: int) -> None:
    for outline in ground.outlines_near(corners[row : row + 1], 0.0):
        if distance_to(outline, corners[row : row + 1])[0] <= 0:
            raise RouteError(f"{_waypoint(corners, row)} is in {outline.name}; move it to free ground")
    blockage = Blockage(ground.blockage_at(corners[row])[0])
    if blockage in _TERRAIN:
        raise RouteError(f"{_waypoint(corners, row)} is {BLOCKAGE_TEXTS[blockage]}")
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
