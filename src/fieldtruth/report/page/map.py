# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The path on a map: on the aerial view of the world of the bag or, without it, on a grid in metres.

North is right and west is up, as in the paper's Figures 8 to 11.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from fieldtruth.bag.geometry import Trajectory, read_objects
from fieldtruth.bag.run import Run
from fieldtruth.bag.topics import ROBOT
from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import FieldtruthError, RouteError
from fieldtruth.core.progress import Progress
from fieldtruth.core.transforms import rotation_from_quaternion_wxyz, yaw_from_rotation
from fieldtruth.experiment.config import metres_from_route
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.images import jpeg_below
from fieldtruth.report.drawing.maps import Aerial, arc, render_aerial, sector
from fieldtruth.report.drawing.style import TO, trimmed
from fieldtruth.report.page.tables import ViewRow
from fieldtruth.sense.scene import Scene
from fieldtruth.world.build import world_of
from fieldtruth.world.model import World

WIDTH: Final = 1800
"""Width of the view [pixel]."""
_TOLERANCE: Final = 1e-3  # [m]
PHOTO_BYTES: Final = 700_000
VERTICES: Final = 1500
_STEPS: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)  # [m]
_WIDTH: Final = 1000.0  # of a grid
_FIELD_OF_VIEW: Final = 0.055  # radius of a field of view, as a share of the width
_APART: Final = 2.6  # [% of the width]; closer marks become one


def view_world(run: Run, progress: Progress) -> tuple[Aerial | None, str]:
    """Render the world of a run from above, or explain why that is not possible.

    Raises:
        BagError: the bag is damaged.
    """
    if run.experiment is None:
        return None, "The world cannot be rebuilt, because there is no experiment.yaml beside the bag."
    try:
        with progress.stage("build the world"):
            world = world_of(run.experiment)
    except FieldtruthError as error:
        return None, f"The world cannot be rebuilt: {error}."
    if not _same_objects(run, world):
        return None, "This version of fieldtruth builds another world from experiment.yaml than the one in the bag."
    with progress.stage("render the aerial view"):
        return render_aerial(bake(Scene(world), run.experiment.light), WIDTH), ""


def _same_objects(run: Run, world: World) -> bool:
    """Return True if the objects in the bag, if it has any, have the names and positions of the world's."""
    names, poses = read_objects(run)
    robots = () if run.experiment is None else tuple(run.experiment.robots)
    return not names or (
        names == (ROBOT, *world.object_names[1:], *robots)
        and all(
            np.allclose(poses[each.object_id, :3], each.world_from_object[:3, 3], rtol=0.0, atol=_TOLERANCE)
            for each in world.instances
        )
    )


class Mark(NamedTuple):
    """A text on the map, at percent from the left and the top."""

    left: float
    top: float
    text: str
    kind: str


@dataclass(frozen=True)
class Map:
    """Parts of the page's map, in units of an image ``width`` x ``height``."""

    width: float
    height: float
    photo: bytes
    """JPEG; empty for a grid."""
    path: str
    """Points of the driven path, like those of ``rings`` and ``sectors`` for an SVG."""
    rings: tuple[str, ...]
    """Circles around the waypoints with the radius at which the next one is taken."""
    sectors: tuple[str, ...]
    """Fields of view of the sample images."""
    grid: tuple[tuple[float, float, float, float], ...]
    """Lines x1, y1, x2, y2."""
    marks: tuple[Mark, ...]
    scale_m: float
    scale: float
    """Length of the scale bar in metres and in percent of the width."""
    positions: list[list[float]]
    """Time [ms from the start], percent from the left and from the top."""
    waypoints: int


def draw_map(
    run: Run,
    trajectory: Trajectory | None,
    aerial: Aerial | None,
    samples_ns: Sequence[int],
    view: ViewRow | None,
) -> Map | None:
    """Draw the path, the waypoints and the viewpoints of the sample images; None without a trajectory.

    Args:
        run: its experiment, if there is one, has the waypoints.
        trajectory: true poses of the robot.
        aerial: background; None draws a grid.
        samples_ns: stamps of the sample images.
        view: whose field of view is drawn, if known.
    """
    if trajectory is None:
        return None
    rows = np.unique(np.linspace(0, len(trajectory) - 1, VERTICES).round().astype(int))
    path = trajectory.position[rows, :2]
    waypoints, arrival = _waypoints(run)
    sheet = _grid(np.concatenate([path, waypoints])) if aerial is None else _photograph(aerial)
    pixels, shape = sheet.project(path), np.array([sheet.width, sheet.height])
    percent = 100 * pixels / shape
    marks = [*sheet.marks, *(_mark(sheet, point, str(k), "waypoint") for k, point in enumerate(waypoints[1:], 1))]
    marks.append(_mark(sheet, path[0], "start", "start"))
    samples, sectors = _samples(trajectory, samples_ns, view, sheet)
    metre = sheet.pixels_per_metre(path.mean(axis=0))
    scale_m = max(step for step in _STEPS if step * metre < 0.2 * sheet.width or step == _STEPS[0])
    times = (trajectory.stamps_ns[rows] - run.start_ns) / 1e6
    return Map(
        width=round(sheet.width, 2), height=round(sheet.height, 2),
        photo=b"" if aerial is None else jpeg_below(aerial.photo, PHOTO_BYTES),
        path=_points(pixels), sectors=sectors, grid=sheet.grid, marks=(*marks, *samples),
        rings=tuple(_points(sheet.project(arc(point, arrival)[1:])) for point in waypoints[1:]),
        scale_m=scale_m, scale=round(100 * scale_m * metre / sheet.width, 3),
        positions=[[round(t), *xy] for t, xy in zip(times.tolist(), percent.round(2).tolist(), strict=True)],
        waypoints=max(len(waypoints) - 1, 0),
    )  # fmt: skip


class _Sheet(NamedTuple):
    """Background of a map, and the projection from x, y (n, 2) [m] to its units."""

    project: Callable[[Array], Array]
    width: float
    height: float
    grid: tuple[tuple[float, float, float, float], ...] = ()
    marks: tuple[Mark, ...] = ()

    def pixels_per_metre(self, xy: Array) -> float:
        """Scale along x at a point."""
        return float(np.linalg.norm(np.diff(self.project(xy + np.array([[-0.5, 0.0], [0.5, 0.0]])), axis=0)))


def _photograph(aerial: Aerial) -> _Sheet:
    height, width = aerial.photo.shape[:2]
    # SVG coordinates start at the corner of the first pixel; the projection's origin is that pixel's centre.
    return _Sheet(lambda xy: aerial.ground_pixels(xy) + 0.5, float(width), float(height))


def _grid(points: Array) -> _Sheet:
    """A sheet that contains all points, with lines at round metres."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, side = (low + high) / 2, np.maximum(1.15 * (high - low), 4.0)
    side = np.maximum(side, side[::-1] * (0.62, 0.42))  # limits the aspect ratio
    scale = _WIDTH / side[0]
    corner = middle + side * (-0.5, 0.5)
    step = next(step for step in _STEPS if step * 12 >= side.max() or step == _STEPS[-1])
    height = float(scale * side[1])
    lines, marks = [], []
    for value in np.arange(np.ceil(corner[0] / step), (corner[0] + side[0]) / step) * step:
        x = float(scale * (value - corner[0]))
        lines.append((round(x, 2), 0.0, round(x, 2), round(height, 2)))
        marks.append(Mark(round(100 * x / _WIDTH, 2), 100.0, trimmed(value, 2), "x"))
    for value in np.arange(np.ceil((corner[1] - side[1]) / step), corner[1] / step) * step:
        y = float(scale * (corner[1] - value))
        lines.append((0.0, round(y, 2), _WIDTH, round(y, 2)))
        marks.append(Mark(0.0, round(100 * y / height, 2), trimmed(value, 2), "y"))
    return _Sheet(lambda xy: (xy - corner) * (scale, -scale), _WIDTH, height, tuple(lines), tuple(marks))


def _waypoints(run: Run) -> tuple[Array, float]:
    """Start and waypoints (1 + n, 2) [m], and the arrival distance [m]; no rows if they are not known."""
    if run.experiment is not None:
        try:
            return metres_from_route(
                run.experiment.route, run.experiment.origin
            ), run.experiment.control.arrival_distance
        except RouteError:  # a random route is found in the world; its path shows it
            pass
    return np.zeros((0, 2)), 0.0


def _samples(
    trajectory: Trajectory, stamps_ns: Sequence[int], view: ViewRow | None, sheet: _Sheet
) -> tuple[list[Mark], tuple[str, ...]]:
    """Letters at the viewpoints of the sample images, and fields of view."""
    marks: list[Mark] = []
    sectors = []
    for letter, stamp in zip("ABCDEFGHIJKL", stamps_ns, strict=False):
        row = int(np.abs(trajectory.stamps_ns - stamp).argmin())
        xy = trajectory.position[row, :2]
        new = _mark(sheet, xy, letter, "sample")
        near = [k for k, m in enumerate(marks) if np.hypot(m.left - new.left, m.top - new.top) < _APART]
        if near:
            first = marks[near[-1]]
            marks[near[-1]] = first._replace(text=f"{first.text[0]}{TO}{letter}")
            continue
        marks.append(new)
        if view is not None:
            heading = float(yaw_from_rotation(rotation_from_quaternion_wxyz(trajectory.quaternion_wxyz[row])))
            heading += np.radians(view.heading_deg)
            radius = _FIELD_OF_VIEW * sheet.width / sheet.pixels_per_metre(xy)
            sectors.append(
                _points(sheet.project(sector(np.array([*xy, heading]), radius, np.radians(view.horizontal_fov_deg))))
            )
    return marks, tuple(sectors)


def _mark(sheet: _Sheet, xy: Array, text: str, kind: str) -> Mark:
    x, y = sheet.project(xy[None])[0]
    return Mark(round(100 * float(x) / sheet.width, 2), round(100 * float(y) / sheet.height, 2), text, kind)


def _points(pixels: Array) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in pixels)
