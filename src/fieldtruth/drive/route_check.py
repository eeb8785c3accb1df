# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a route can be driven in a world: each point, each straight line, and the path that cuts the corners."""

from typing import Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import RouteError
from fieldtruth.drive.ground import BELLY, belly_rise_on_path
from fieldtruth.drive.kinematics import KinematicSimulator
from fieldtruth.drive.outlines import distance_to, gap_to
from fieldtruth.drive.traversability import BAR_TEXTS, ROBOT_RADIUS, Bar, Traversability

SPACING: Final = (1.0, 25.0)  # [m] between way-points; the paper has 5 to 20, and less near obstacles
LINE_GAP: Final = 0.4  # [m] from the line through the way-points to an obstacle; the robot is 0.67 m wide
PATH_GAP: Final = 0.05  # [m] from the robot's outline to an obstacle; rehearsal and drive differ by as much
_ROUNDING: Final = 0.001  # [m], of geodetic coordinates
_GROUND_BARS: Final = (Bar.WATER, Bar.STEEP, Bar.EDGE)  # whether ground is too rough depends on the heading
_STEP: Final = 0.1  # [m] between the places that are looked at


class Conflict(NamedTuple):
    """An obstacle that is too near: its name, the gap to it [m], and where (x, y, ...) [m] on the way."""

    name: str
    gap: float
    place: Array


def line_conflict(ground: Traversability, places: Array) -> Conflict | None:
    """The first obstacle that is nearer than LINE_GAP to places (n, 2) [m] on a straight line."""
    for number in _near(ground, places, LINE_GAP):
        outline = ground.outlines[number]
        away = distance_to(outline, places)
        nearest = int(away.argmin())
        if away[nearest] < LINE_GAP:
            return Conflict(outline.name, max(0.0, float(away[nearest])), places[nearest])
    return None


def path_conflict(ground: Traversability, poses: Array, least: float = PATH_GAP) -> Conflict | None:
    """The first obstacle that is nearer than ``least`` [m] to the robot's outline at poses (n, 3)."""
    for number in _near(ground, poses[:, :2], ROBOT_RADIUS + least):
        outline = ground.outlines[number]
        gap = gap_to(outline, poses)
        nearest = int(gap.argmin())
        if gap[nearest] < least:
            return Conflict(outline.name, max(0.0, float(gap[nearest])), poses[nearest])
    return None


def line_places(first: Array, last: Array) -> Array:
    """Places (n, 2), 10 cm apart, on a straight line."""
    return np.linspace(first, last, 2 + int(np.linalg.norm(last - first) / _STEP))


def thinned(poses: Array) -> Array:
    """Poses of a rehearsed leg at most 6 cm apart, its last one among them."""
    apart = max(1, int(0.06 / max(1e-6, float(np.linalg.norm(poses[-1, :2] - poses[-2, :2]))))) if len(poses) > 1 else 1
    return poses[::-apart][::-1]


def check_route(ground: Traversability, rehearsal: KinematicSimulator, corners: Array) -> None:
    """Raise ``RouteError`` if the start and way-points (1 + n, 2) [m] are no route that the robot can drive."""
    for row in range(len(corners)):
        _check_point(ground, corners, row)
    for row in range(len(corners) - 1):
        _check_line(ground, corners, row)
    legs, endless = rehearsal.legs(corners)
    if endless is not None:
        raise RouteError(
            f"the robot cannot get to {_named(corners, endless + 1)}: it circles; "
            "drive slower, turn faster or make control.arrival_distance greater"
        )
    for row, poses in enumerate(legs):
        _check_path(ground, row, thinned(poses))


def _named(corners: Array, row: int) -> str:
    name = f"way-point {row} of {len(corners) - 1}" if row else "the start"
    return f"{name} at {_at(corners[row])}"


def _at(place: Array) -> str:
    x, y = np.round(place[:2], 1) + 0.0
    return f"x {x:.1f} m, y {y:.1f} m"


def _way(row: int) -> str:
    return f"the way from way-point {row} to {row + 1}" if row else "the way from the start to way-point 1"


def _check_point(ground: Traversability, corners: Array, row: int) -> None:
    for number in _near(ground, corners[row : row + 1], 0.0):
        outline = ground.outlines[number]
        if distance_to(outline, corners[row : row + 1])[0] <= 0:
            raise RouteError(f"{_named(corners, row)} lies in {outline.name}; move it to free ground")
    bar = Bar(ground.bar_at(corners[row])[0])
    if bar in _GROUND_BARS:
        raise RouteError(f"{_named(corners, row)} lies {BAR_TEXTS[bar]}")
    if row:
        spacing = float(np.linalg.norm(corners[row] - corners[row - 1]))
        if not SPACING[0] - _ROUNDING <= spacing <= SPACING[1] + _ROUNDING:
            raise RouteError(
                f"{_named(corners, row)} is {spacing:.2f} m from {'the one before it' if row > 1 else 'the start'}; "
                f"allowed is {SPACING[0]:g} to {SPACING[1]:g} m"
            )


def _check_line(ground: Traversability, corners: Array, row: int) -> None:
    places = line_places(corners[row], corners[row + 1])
    conflict = line_conflict(ground, places)
    if conflict is not None:
        raise RouteError(
            f"{_way(row)} passes {conflict.name} at {conflict.gap:.2f} m, at {_at(conflict.place)}; "
            f"the robot needs {LINE_GAP:.2f} m"
        )
    _check_ground(ground, row, places)


def _check_path(ground: Traversability, row: int, poses: Array) -> None:
    """The way that the follower takes: it turns to the next way-point before it is at one, and cuts the corner."""
    conflict = path_conflict(ground, poses)
    if conflict is not None:
        raise RouteError(
            f"on {_way(row)} the robot comes within {conflict.gap:.2f} m of {conflict.name}, at {_at(conflict.place)}, "
            f"since it cuts the corner; it needs {PATH_GAP} m, so set way-points closer"
        )
    _check_ground(ground, row, poses[:, :2])
    sits = np.flatnonzero(belly_rise_on_path(ground.field, poses) > BELLY)
    if len(sits):
        raise RouteError(f"{_way(row)} leads {BAR_TEXTS[Bar.ROUGH]}, at {_at(poses[sits[0]])}")


def _check_ground(ground: Traversability, row: int, places: Array) -> None:
    bars = ground.bar_at(places)
    barred = np.flatnonzero(np.isin(bars, _GROUND_BARS))
    if len(barred):
        raise RouteError(f"{_way(row)} leads {BAR_TEXTS[Bar(bars[barred[0]])]}, at {_at(places[barred[0]])}")


def _near(ground: Traversability, places: Array, reach: float) -> list[int]:
    """Outlines whose circle comes within ``reach`` [m] of the box about places (n, 2)."""
    x, y, radius = ground.circles.T
    low, high = places.min(axis=0), places.max(axis=0)
    away = np.hypot(x - np.clip(x, low[0], high[0]), y - np.clip(y, low[1], high[1]))
    return np.flatnonzero(away <= radius + reach).tolist()
