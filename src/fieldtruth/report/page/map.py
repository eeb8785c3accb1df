# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The way on a map: upon the place's photograph from above, or where that is not to be had, upon a grid of metres.

North is to the right and west up, as in the paper's Figures 8 to 11.
"""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import simplejpeg

from fieldtruth.bag.run import Run
from fieldtruth.bag.trajectory import Trajectory
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import RouteError
from fieldtruth.core.frames import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.experiment.route import metres_from_route
from fieldtruth.report.drawing.aerial import Aerial
from fieldtruth.report.drawing.text import TO, trimmed
from fieldtruth.report.page.aerial_view import Place

PHOTO_BYTES: Final = 700_000
VERTICES: Final = 1500
_STEPS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # [m]
_WIDE: Final = 1000.0
_APART: Final = 2.6  # [% of the width]; marks nearer to each other are written as one


@dataclass(frozen=True)
class Mark:
    """Something to read on the map, at percent from the left and the top."""

    left: float
    top: float
    text: str
    kind: str


@dataclass(frozen=True)
class Map:
    """What the page draws, in units of a picture ``width`` x ``height``."""

    width: float
    height: float
    photo: str
    """JPEG in base64; empty for a grid."""
    route: str
    """Points of the driven way."""
    rings: tuple[str, ...]
    """Outlines about the way-points, within which the next one is taken."""
    wedges: tuple[str, ...]
    grid: tuple[tuple[float, float, float, float], ...]
    """Lines x1, y1, x2, y2."""
    marks: tuple[Mark, ...]
    scale_m: float
    scale: float
    """Length of the scale bar in percent of the width, and what it is in metres."""
    way: list[list[float]]
    """Time [ms from the start], percent from the left and from the top."""
    waypoints: int


def draw_map(
    run: Run, trajectory: Trajectory | None, place: Place | None, looks_ns: Sequence[int], fov_deg: float | None
) -> Map | None:
    """Draw the way with the way-points that led it, and whence the sample images look; None if no pose is known.

    Args:
        run: its experiment, if it is known, has the way-points.
        trajectory: where the robot was.
        place: the world and its photograph; None draws a grid.
        looks_ns: stamps of sample images.
        fov_deg: the camera's horizontal field of view, if it is known.
    """
    if trajectory is None:
        return None
    rows = np.unique(np.linspace(0, len(trajectory) - 1, VERTICES).round().astype(int))
    way = trajectory.position[rows, :2]
    waypoints, arrival = _waypoints(run)
    if place is None:
        project, width, height, grid, marks = _grid(np.concatenate([way, waypoints]))
    else:
        project, width, height, grid, marks = _photograph(place)
    shape = np.array([width, height])
    pixels = project(way)
    percent = 100 * pixels / shape
    rings = [project(point + arrival * _circle()) for point in waypoints[1:]]
    marks += [_mark(project(p[None])[0] / shape, str(k), "waypoint") for k, p in enumerate(waypoints[1:], 1)]
    marks.append(_mark(pixels[0] / shape, "start", "start"))
    looks, wedges = _looks(trajectory, looks_ns, fov_deg, project, shape)
    metre = float(np.linalg.norm(np.diff(project(way.mean(axis=0) + np.array([[-0.5, 0.0], [0.5, 0.0]])), axis=0)))
    scale_m = max(step for step in _STEPS if step * metre < 0.2 * width or step == _STEPS[0])
    times = (trajectory.stamps_ns[rows] - run.start_ns) / 1e6
    return Map(
        width=round(width, 2), height=round(height, 2), photo="" if place is None else _jpeg(place.aerial),
        route=_points(pixels), rings=tuple(map(_points, rings)), wedges=wedges, grid=grid,
        marks=(*marks, *looks), scale_m=scale_m, scale=round(100 * scale_m * metre / width, 3),
        way=[[round(t), round(x, 2), round(y, 2)] for t, (x, y) in zip(times.tolist(), percent.tolist(), strict=True)],
        waypoints=max(len(waypoints) - 1, 0),
    )  # fmt: skip


Projection = Callable[[Array], Array]
Ground = tuple[Projection, float, float, tuple[tuple[float, float, float, float], ...], list[Mark]]


def _photograph(place: Place) -> Ground:
    from fieldtruth.report.preview.map import on_ground

    height, width = place.aerial.photo.shape[:2]
    # A picture's units begin at the corner of its first pixel; the projection's at that pixel's centre.
    return (
        lambda xy: on_ground(place.aerial, place.world.terrain.field, xy) + 0.5, float(width), float(height), (), [],
    )  # fmt: skip


def _grid(points: Array) -> Ground:
    """A sheet that holds all points, with lines at round metres."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, side = (low + high) / 2, np.maximum(1.15 * (high - low), 4.0)
    side = np.maximum(side, side[::-1] * (0.62, 0.42))  # neither a ribbon nor a tower
    scale = _WIDE / side[0]
    corner = middle + side * (-0.5, 0.5)
    step = next(step for step in _STEPS if step * 12 >= side.max() or step == _STEPS[-1])

    def project(xy: Array) -> Array:
        return np.asarray((xy - corner) * (scale, -scale))

    height = float(scale * side[1])
    lines, marks = [], []
    for value in np.arange(np.ceil(corner[0] / step), (corner[0] + side[0]) / step) * step:
        x = float(scale * (value - corner[0]))
        lines.append((round(x, 2), 0.0, round(x, 2), round(height, 2)))
        marks.append(Mark(round(100 * x / _WIDE, 2), 100.0, trimmed(value, 2), "x"))
    for value in np.arange(np.ceil((corner[1] - side[1]) / step), corner[1] / step) * step:
        y = float(scale * (corner[1] - value))
        lines.append((0.0, round(y, 2), _WIDE, round(y, 2)))
        marks.append(Mark(0.0, round(100 * y / height, 2), trimmed(value, 2), "y"))
    return project, _WIDE, height, tuple(lines), marks


def _waypoints(run: Run) -> tuple[Array, float]:
    """Start and way-points (1 + n, 2) [m], or none, and how near the robot comes to one before it takes the next."""
    if run.experiment is not None:
        try:
            return metres_from_route(run.experiment.route), run.experiment.control.arrival_distance
        except RouteError:  # a random one; it is found in the world, and is where the robot went
            pass
    return np.zeros((0, 2)), 0.0


def _looks(
    trajectory: Trajectory, stamps_ns: Sequence[int], fov_deg: float | None, project: Projection, shape: Array
) -> tuple[list[Mark], tuple[str, ...]]:
    """Letters where the robot stood when it took the sample images, and wedges over what the camera saw."""
    marks: list[Mark] = []
    wedges = []
    reach = 0.055 * shape[0]
    for letter, stamp in zip("ABCDEFGHIJKL", stamps_ns, strict=False):
        row = int(np.abs(trajectory.stamps_ns - stamp).argmin())
        xy = trajectory.position[row, :2]
        here = project(xy[None])[0] / shape
        near = [k for k, m in enumerate(marks) if np.hypot(m.left - 100 * here[0], m.top - 100 * here[1]) < _APART]
        if near:
            first = marks[near[-1]]
            marks[near[-1]] = Mark(first.left, first.top, f"{first.text[0]}{TO}{letter}", first.kind)
            continue
        marks.append(_mark(here, letter, "look"))
        if fov_deg is not None:
            heading = float(yaw_from_rotation(rotation_from_quaternion_wxyz(trajectory.quaternion_wxyz[row])))
            angles = heading + np.radians(fov_deg) * np.linspace(-0.5, 0.5, 13)
            metre = np.linalg.norm(np.diff(project(xy + np.array([[0.0, 0.0], [1.0, 0.0]])), axis=0))
            arc = xy + reach / metre * np.column_stack([np.cos(angles), np.sin(angles)])
            wedges.append(_points(project(np.vstack([xy, arc]))))
    return marks, tuple(wedges)


def _circle() -> Array:
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _mark(share: Array, text: str, kind: str) -> Mark:
    return Mark(round(100 * float(share[0]), 2), round(100 * float(share[1]), 2), text, kind)


def _points(pixels: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels)


def _jpeg(aerial: Aerial) -> str:
    data: Any = b""
    for quality in (85, 75, 65, 55, 45, 35, 25):
        data = simplejpeg.encode_jpeg(np.ascontiguousarray(aerial.photo), quality, "RGB", "420")
        if len(data) <= PHOTO_BYTES:
            break
    return base64.b64encode(data).decode()
