# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The route before the drive: found, where the program is to find one, and checked against the world in any case."""

from typing import Final

import numpy as np

from fieldtruth.drive.husky import OUTLINE
from fieldtruth.drive.outlines import distance_to, gap_to
from fieldtruth.drive.rehearsal import Rehearsal
from fieldtruth.drive.traversability import BAR_TEXTS, ROBOT_RADIUS, Bar, Traversability, traversability
from fieldtruth.drive.wander import wander
from fieldtruth.errors import RouteError
from fieldtruth.experiment.config import Experiment, RandomRouteConfig, RouteConfig
from fieldtruth.experiment.route import geodetic_route, metres_from_route, route_from_metres
from fieldtruth.frames import Array
from fieldtruth.world.model import World

SPACING: Final = (1.0, 25.0)  # [m] between way-points; the paper has 5 to 20, and less near obstacles
LINE_GAP: Final = OUTLINE[1] / 2 + 0.05  # [m] from the line through the way-points to an obstacle
PATH_GAP: Final = 0.05  # [m] from the robot's outline to an obstacle; rehearsal and drive differ by as much
_STEP: Final = 0.1  # [m] between the places that are looked at


def plan_route(world: World, experiment: Experiment) -> RouteConfig:
    """The way-points that ``experiment`` drives in ``world``: its own, checked, or those that the program finds.

    Checked are every way-point and the spacing, the straight lines between them, and the path of the follower, which
    cuts corners. Same world, same experiment, same route.

    Raises:
        RouteError: a way-point or a way that the robot cannot take, by its number, with what is in the way; or no free
            route of the wished length, with the longest that was found.
    """
    ground, rehearsal = traversability(world), Rehearsal(experiment)
    route = experiment.route
    if not isinstance(route, RandomRouteConfig):
        planned = geodetic_route(route)
        check_route(ground, rehearsal, metres_from_route(planned))
        return planned
    rng = np.random.default_rng(route.random.seed)
    longest = 0.0
    for corners, length in wander(ground, rehearsal, route.random.length_m, rng):
        longest = max(longest, length)
        if corners is None:
            continue
        planned = route_from_metres(corners[0].tolist(), corners[1:].tolist())
        try:
            check_route(ground, rehearsal, metres_from_route(planned))
        except RouteError:
            continue
        return planned
    raise RouteError(
        f"no free route of {route.random.length_m:g} m found in {world.name} (seed {world.seed}); "
        f"the longest that was found is {longest:.0f} m"
    )


def check_route(ground: Traversability, rehearsal: Rehearsal, corners: Array) -> None:
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
        _check_path(ground, corners, row, poses[:: max(1, len(poses) // 400)])


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
    if bar not in (Bar.NOTHING, Bar.OBSTACLE):
        raise RouteError(f"{_named(corners, row)} lies {BAR_TEXTS[bar]}")
    if row:
        spacing = float(np.linalg.norm(corners[row] - corners[row - 1]))
        if not SPACING[0] <= spacing <= SPACING[1]:
            raise RouteError(
                f"{_named(corners, row)} is {spacing:.2f} m from {'the one before it' if row > 1 else 'the start'}; "
                f"allowed is {SPACING[0]:g} to {SPACING[1]:g} m"
            )


def _check_line(ground: Traversability, corners: Array, row: int) -> None:
    first, last = corners[row], corners[row + 1]
    count = 2 + int(np.linalg.norm(last - first) / _STEP)
    places = np.linspace(first, last, count)
    for number in _near(ground, places, LINE_GAP):
        outline = ground.outlines[number]
        away = distance_to(outline, places)
        nearest = int(away.argmin())
        if away[nearest] < LINE_GAP:
            raise RouteError(
                f"{_way(row)} passes {outline.name} at {max(0.0, away[nearest]):.2f} m, at {_at(places[nearest])}; "
                f"the robot needs {LINE_GAP:.2f} m"
            )
    _check_ground(ground, row, places)


def _check_path(ground: Traversability, corners: Array, row: int, poses: Array) -> None:
    """The way that the follower takes: it turns to the next way-point before it is at one, and cuts the corner."""
    for number in _near(ground, poses[:, :2], ROBOT_RADIUS + PATH_GAP):
        outline = ground.outlines[number]
        gap = gap_to(outline, poses)
        nearest = int(gap.argmin())
        if gap[nearest] < PATH_GAP:
            raise RouteError(
                f"on {_way(row)} the robot comes within {max(0.0, gap[nearest]):.2f} m of {outline.name}, "
                f"at {_at(poses[nearest])}, since it cuts the corner; it needs {PATH_GAP} m, so set way-points closer"
            )
    _check_ground(ground, row, poses[:, :2])


def _check_ground(ground: Traversability, row: int, places: Array) -> None:
    bars = ground.bar_at(places)
    barred = np.flatnonzero(bars > Bar.OBSTACLE)
    if len(barred):
        raise RouteError(f"{_way(row)} leads {BAR_TEXTS[Bar(bars[barred[0]])]}, at {_at(places[barred[0]])}")


def _near(ground: Traversability, places: Array, reach: float) -> list[int]:
    """Outlines whose circle comes within ``reach`` [m] of the box about places (n, 2)."""
    x, y, radius = ground.circles.T
    low, high = places.min(axis=0), places.max(axis=0)
    away = np.hypot(x - np.clip(x, low[0], high[0]), y - np.clip(y, low[1], high[1]))
    return np.flatnonzero(away <= radius + reach).tolist()
