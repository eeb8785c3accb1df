# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A picture of a rig: the robot from two sides with frames and fields of view, and a plan of the ground in view.

The ground is flat: which of it appears in images and in clouds, and where the sensors are blind.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patches import Circle, Polygon, Rectangle
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.experiment.field_of_view import SensorView
from fieldtruth.experiment.rig import Box, Rig, body_parts, chassis_box, rollers, sensor_views
from fieldtruth.experiment.sensor_config import BASE
from fieldtruth.report.drawing.paper import Paper
from fieldtruth.report.drawing.style import FONT, HAIRLINE, INK, MUTED, percent, sensor_nouns
from fieldtruth.sense.robot import meet, part_table

HALF: Final = 10.0
"""Distance [m] from base_link to the sides of the ground that is looked at."""
STEP: Final = 0.05  # [m] between its points


def ground_height(rig: Rig) -> float:
    """Height [m] of flat ground on which the robot stands."""
    return rig.robot.footprint.xyz[2]


def ground_hits(view: SensorView, height: float) -> Array:
    """Points of its rays, shaped as these, on ground at ``height`` [m] in base_link; NaN above and out of range."""
    rays = view.rays()
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (height - view.position[2]) / rays[..., 2]
        reached = (distance > 0.0) & (distance >= view.nearest) & (distance <= view.farthest)
        points = view.position + rays * distance[..., None]
    return np.asarray(np.where(reached[..., None], points, np.nan))


def nearest_ground(view: SensorView, height: float) -> float:
    """Horizontal distance [m] from a view to the nearest ground that it sees; NaN if it sees none.

    Of an upright one that scans this is the radius of its blind circle.
    """
    x, y, _ = np.moveaxis(ground_hits(view, height) - view.position, -1, 0)
    distance = np.hypot(x, y)
    return float(np.nanmin(distance)) if np.isfinite(distance).any() else float("nan")


@dataclass(frozen=True)
class Coverage:
    """Ground points at all pairs of ``axis`` (n,) [m], in x and y of base_link, and who sees them."""

    axis: Array
    views: tuple[SensorView, ...]
    in_view: Mask
    """(views, n, n), by view, y and x."""
    hidden: Mask
    """(views, n, n): the robot itself is between, which simulated sensors see with ``rig.visible`` only."""

    def seen(self, scans: bool) -> Mask:
        """Points (n, n) in a cloud, or in an image."""
        chosen = [view.scans == scans for view in self.views]
        return np.asarray((self.in_view & ~self.hidden)[chosen].any(axis=0))


def ground_coverage(rig: Rig, half: float = HALF, step: float = STEP) -> Coverage:
    """Look at flat ground, ``half`` [m] to each side, from all views of a rig."""
    axis = np.linspace(-half, half, 2 * round(half / step) + 1)
    x, y = (each.ravel() for each in np.meshgrid(axis, axis))
    points = np.column_stack([x, y, np.full(x.shape, ground_height(rig))])
    table = part_table(body_parts(rig))
    views, shape = sensor_views(rig), (len(axis), len(axis))
    in_view, hidden = np.zeros((2, len(views), *shape), np.bool_)
    for k, view in enumerate(views):
        seen = view.sees(points)
        in_view[k] = seen.reshape(shape)
        away = points - view.position
        distance = np.linalg.norm(away, axis=1)
        hidden[k] = (seen & (meet(table, view.position, away / distance[:, None]).range_m < distance)).reshape(shape)
    return Coverage(axis, views, in_view, hidden)


HULL: Final = "#e9d9a6"
TYRE: Final = "#8b929c"
SIDE: Final = (0, 2)
"""Axes of base_link to the right and up in the view from the side, from the robot's right."""
ABOVE: Final = (0, 1)
"""The same in the view from above."""
_AXES: Final = ("#d62728", "#2ca02c", "#1f55d6")  # x, y, z
_SAME: Final = 0.02  # of the robot's size: frames that are drawn at one point
_TEXT: Final = 6.6  # [point]
_LINE: Final = 0.037  # of half the width of a view, between labels
PIXELS: Final = 2400
"""Width of the picture."""
_WIDTH: Final = 15.0  # [inch], like all lengths below
_EDGE: Final = 0.4
_LEFT: Final = 7.3
_SIDE_TOP: Final = 1.3
_SIDE_HEIGHT: Final = 3.7
_ABOVE_TOP: Final = 5.45
_ABOVE_HEIGHT: Final = 4.0
_PLAN_LEFT: Final = 8.35
_PLAN: Final = 6.2
_LEGEND_TOP: Final = 8.02
_ROWS: Final = 24
"""Sensors that are listed."""
_COLOURS: Final = (
    *("#1f55d6", "#d9480f", "#0b8f6a", "#a3278f", "#b58900"),
    *("#0c8599", "#c2255c", "#5f6b2f", "#6741d9", "#8d5a2b"),
)
_GROUND: Final = {
    "blind": "#f4c7c3",
    "behind the robot": "#d9a6c9",
    "clouds only": "#cfe0fb",
    "images only": "#fbe6b8",
    "clouds and images": "#cdebcf",
}
_RINGS: Final = 48  # circles of beams that are drawn


class Window(NamedTuple):
    """Extent of a view [m]: its middle and lower end, half its width, and its height; and the robot's size."""

    middle: float
    low: float
    half: float
    height: float
    size: float


def robot_size(rig: Rig) -> float:
    """Longest side [m] of a box around hull, wheels and sensors."""
    box = chassis_box(rig)
    corners = [box.centre - box.size / 2, box.centre + box.size / 2, *(m.xyz for m in rig.mounts().values())]
    return float(np.ptp(np.array(corners), axis=0).max())


def draw_view(
    axes: Axes, rig: Rig, views: Sequence[tuple[SensorView, str]], plane: tuple[int, int], aspect: float
) -> None:
    """Draw the robot and the fields of view of sensors, each with a colour, into ``axes``.

    Args:
        axes: empty, ``aspect`` times as wide as high.
        rig: the robot.
        views: whose fields of view are drawn.
        plane: ``SIDE`` or ``ABOVE``.
        aspect: width divided by height.
    """
    size, ground = robot_size(rig), ground_height(rig)
    half = 1.9 * size
    tall = 2.0 * half / aspect
    low = ground - 0.12 * size if plane == SIDE else -tall / 2
    window = Window(0.0, low, half, tall, size)
    axes.set(xlim=(-half, half), ylim=(low, low + tall))
    axes.set_aspect("equal")
    axes.set_autoscale_on(False)
    if plane == SIDE:
        axes.axhline(ground, color=MUTED, linewidth=0.8, zorder=1)
    for view, colour in views:
        for shape in _field_of_view(view, plane, 0.75 * size):
            axes.add_patch(Polygon(shape, facecolor=colour, alpha=0.07, linewidth=0.0, zorder=1))
            axes.add_patch(Polygon(shape, fill=False, edgecolor=colour, linewidth=0.8, alpha=0.8, zorder=3))
    _draw_body(axes, rig, plane)
    poses = {BASE: np.eye(4)} | {name: mount.base_from_sensor for name, mount in rig.mounts().items()}
    for pose in poses.values():
        _draw_axes(axes, pose, plane, 0.09 * size)
    _write_names(axes, {name: pose[list(plane), 3] for name, pose in poses.items()}, window)


def _draw_body(axes: Axes, rig: Rig, plane: tuple[int, int]) -> None:
    patches = []
    for wheel in rollers(rig):
        round_one = Circle(_point(wheel.centre, plane), wheel.radius, facecolor=TYRE, zorder=2.5)
        patches.append(round_one if plane == SIDE else _rectangle(wheel.box, plane, facecolor=TYRE, zorder=1.5))
    for patch in (*patches, _rectangle(chassis_box(rig), plane, facecolor=HULL, zorder=2)):
        patch.set(edgecolor=INK, linewidth=0.7)
        axes.add_patch(patch)


def _rectangle(box: Box, plane: tuple[int, int], **style: Any) -> Rectangle:
    return Rectangle(_point(box.centre - box.size / 2, plane), *_point(box.size, plane), **style)


def _point(xyz: Array, plane: tuple[int, int]) -> tuple[float, float]:
    return float(xyz[plane[0]]), float(xyz[plane[1]])


def _draw_axes(axes: Axes, base_from_frame: Array, plane: tuple[int, int], length: float) -> None:
    flat = list(plane)
    x, y = base_from_frame[flat, 3]
    for k, colour in enumerate(_AXES):
        dx, dy = base_from_frame[flat, k] * length
        if np.hypot(dx, dy) > 0.1 * length:
            axes.plot([x, x + dx], [y, y + dy], color=colour, linewidth=1.3, solid_capstyle="round", zorder=5)
    axes.plot(x, y, "o", color=INK, markersize=1.8, zorder=6)


def _field_of_view(view: SensorView, plane: tuple[int, int], reach: float) -> Iterator[Array]:
    """Outlines (n, 2) of the shadow of its rays; of one that scans, from the side, of what it scans in this plane."""
    flat, origin = list(plane), view.position[list(plane)]
    if not view.scans or plane == ABOVE:
        rays = view.rays().reshape(-1, 3)[:, flat]
        points = np.concatenate([[origin], origin + reach * rays[np.isfinite(rays[:, 0])]])
        yield points[ConvexHull(points, qhull_options="QJ").vertices]  # QJ: they may be in one line
        return
    angle = np.radians(np.arange(0.0, 360.0, 0.5))
    around = np.zeros((len(angle), 3))
    around[:, plane[0]], around[:, plane[1]] = np.cos(angle), np.sin(angle)
    rim = origin + reach * around[:, flat]
    seen = view.sees(view.position + around * max(reach, 1.01 * view.nearest))
    turned = np.roll(np.arange(len(angle)), -int(np.argmin(seen)))  # begins at a direction that is not seen
    runs = np.split(turned, np.flatnonzero(np.diff(seen[turned].astype(int))) + 1)
    yield from (np.concatenate([[origin], rim[run]]) for run in runs if seen[run[0]])


def _write_names(axes: Axes, points: dict[str, Array], window: Window) -> None:
    """Write names at both sides, with lines to their frames; frames at one point share a line."""
    groups: list[tuple[Array, list[str]]] = []
    line = _LINE * window.half
    for name, point in points.items():
        near = next((g for g in groups if np.hypot(*(g[0] - point)) < _SAME * window.size), None)
        if near is None:
            groups.append((point, [name]))
        else:
            near[1].append(name)
    groups.sort(key=lambda group: float(group[0][0]))
    half = (len(groups) + 1) // 2
    for side, column in ((-1, groups[:half]), (1, groups[half:])):
        column.sort(key=lambda group: float(group[0][1]))
        rows = _spread([float(point[1]) for point, _ in column], line, window.low + line, window.low + window.height)
        x = window.middle + side * 0.985 * window.half
        for (point, names), row in zip(column, rows, strict=True):
            label = axes.text(
                x,
                row,
                ", ".join(names) if len(names) < 4 else f"{', '.join(names[:3])} and {len(names) - 3} more",
                fontsize=_TEXT,
                family=FONT,
                color=INK,
                ha="left" if side < 0 else "right",
                va="center",
                zorder=8,
                bbox={"facecolor": "white", "alpha": 0.9, "linewidth": 0.0, "pad": 0.6},
            )
            box = label.get_window_extent().transformed(axes.transData.inverted())
            end = box.x1 if side < 0 else box.x0
            axes.plot([end, point[0]], [row, point[1]], color=MUTED, linewidth=0.45, zorder=4)


def _spread(wanted: Sequence[float], step: float, low: float, high: float) -> list[float]:
    """Move ascending positions apart to at least ``step``, between ``low`` and ``high`` as far as they fit."""
    rows: list[float] = []
    for value in wanted:
        rows.append(max(value, rows[-1] + step if rows else low))
    limit = high - step
    for k in range(len(rows) - 1, -1, -1):
        rows[k] = min(rows[k], limit)
        limit = rows[k] - step
    return rows


def draw_rig(rig: Rig, name: str, pixels: int = PIXELS) -> NDArray[np.uint8]:
    """Draw the rig of the experiment ``name``, an image (h, w, 3) in sRGB, ``pixels`` wide."""
    coverage = ground_coverage(rig)
    views = coverage.views
    colours = [_COLOURS[k % len(_COLOURS)] for k in range(len(views))]
    rows = (min(len(views), _ROWS) + 1) // 2
    paper = Paper(_WIDTH, max(_ABOVE_TOP + _ABOVE_HEIGHT, _LEGEND_TOP + 0.5 + 0.36 * rows) + _EDGE, pixels)
    paper.text(_EDGE - 0.02, 0.6, f"Rig of {name}", 22, weight="bold")
    paper.text(_EDGE, 0.86, ", ".join(sensor_nouns(rig.in_order())) or "no sensors", 9, color=MUTED)
    caption = "axes x red, y green, z blue; fields of view are cut off; without optical frames"
    paper.heading(_EDGE, _SIDE_TOP, "From the side", caption)
    for plane, top, height in ((SIDE, _SIDE_TOP, _SIDE_HEIGHT), (ABOVE, _ABOVE_TOP, _ABOVE_HEIGHT)):
        axes = _framed(paper, _EDGE, top, _LEFT, height)
        draw_view(axes, rig, list(zip(views, colours, strict=True)), plane, _LEFT / height)
    paper.heading(_EDGE, _ABOVE_TOP, "From above", "forward is right, left is up")
    paper.heading(_PLAN_LEFT, _SIDE_TOP, "Flat ground", "lines: circles of beams, borders of images")
    _draw_plan(_framed(paper, _PLAN_LEFT, _SIDE_TOP, _PLAN, _PLAN), rig, coverage, colours)
    _write_legend(paper, rig, coverage, colours)
    return paper.render()


def ground_classes(coverage: Coverage) -> dict[str, Mask]:
    """Masks (n, n) of the points of the ground by class of ``_GROUND``; each point belongs to one."""
    cloud, image = coverage.seen(scans=True), coverage.seen(scans=False)
    through = coverage.in_view.any(axis=0) & ~cloud & ~image
    masks = (~(cloud | image | through), through, cloud & ~image, image & ~cloud, cloud & image)
    return dict(zip(_GROUND, masks, strict=True))


def _draw_plan(axes: Axes, rig: Rig, coverage: Coverage, colours: Sequence[str]) -> None:
    axis, ground = coverage.axis, ground_height(rig)
    image = np.ones((len(axis), len(axis), 3))
    for name, mask in ground_classes(coverage).items():
        image[mask] = to_rgb(_GROUND[name])
    half = axis[-1] + (axis[1] - axis[0]) / 2
    axes.imshow(image, origin="lower", extent=(-half, half, -half, half), interpolation="nearest")
    axes.set_autoscale_on(False)
    for view, colour, in_view in zip(coverage.views, colours, coverage.in_view, strict=True):
        if view.scans:
            rings = ground_hits(view, ground)
            near = [ring for ring in rings if (np.abs(ring[:, :2]) < axis[-1]).all(axis=1).any()]
            for ring in near[:: len(near) // _RINGS + 1]:
                axes.plot(*ring[:, :2].T, color=colour, linewidth=0.4, alpha=0.75)
        elif in_view.any() and not in_view.all():
            smooth = gaussian_filter(in_view.astype(float), 1.5)  # without the steps of the grid
            axes.contour(axis, axis, smooth, levels=[0.5], colors=[colour], linewidths=1.0)
    box = chassis_box(rig)
    for part, colour in (*((wheel.box, TYRE) for wheel in rollers(rig)), (box, HULL)):
        low, high = part.centre - part.size / 2, part.centre + part.size / 2
        x, y = ([corner[k] for corner in (low, high)] for k in (0, 1))
        axes.fill([x[0], x[1], x[1], x[0]], [y[0], y[0], y[1], y[1]], facecolor=colour, edgecolor=INK, linewidth=0.5)
    axes.tick_params(left=True, bottom=True, labelleft=True, labelbottom=True, labelsize=7, color=MUTED)
    axes.set_xlabel("x of base_link, forward [m]", fontsize=7.5, color=MUTED, family=FONT)
    axes.set_ylabel("y of base_link, to the left [m]", fontsize=7.5, color=MUTED, family=FONT, labelpad=1)


def _write_legend(paper: Paper, rig: Rig, coverage: Coverage, colours: Sequence[str]) -> None:
    left = _PLAN_LEFT
    for name, mask in ground_classes(coverage).items():
        if mask.any():
            paper.box(left, _LEGEND_TOP, 0.17, 0.13, _GROUND[name], edgecolor=HAIRLINE, linewidth=0.5)
            left += 0.35 + paper.text(left + 0.22, _LEGEND_TOP + 0.115, f"{name} {percent(mask.mean(), 0)}", 7.2)
    ground = ground_height(rig)
    for k, (view, colour) in enumerate(list(zip(coverage.views, colours, strict=True))[:_ROWS]):
        left, top = _PLAN_LEFT + 3.1 * (k % 2), _LEGEND_TOP + 0.34 + 0.36 * (k // 2)
        paper.box(left, top + 0.03, 0.17, 0.1, colour)
        width = paper.text(left + 0.23, top + 0.12, view.name, 7.6, weight="bold")
        paper.text(left + 0.31 + width, top + 0.12, _nearest(view, ground), 7.2)
        paper.text(left + 0.23, top + 0.25, view.config.figures(), 5.8, color=MUTED)
    if len(coverage.views) > _ROWS:
        top = _LEGEND_TOP + 0.34 + 0.36 * (_ROWS // 2)
        paper.text(_PLAN_LEFT, top + 0.1, f"and {len(coverage.views) - _ROWS} more", 7.4, color=MUTED)


def _nearest(view: SensorView, ground: float) -> str:
    distance = nearest_ground(view, ground)
    if np.isnan(distance):
        return "sees no ground"
    upright = view.scans and view.base_from_sensor[2, 2] > 1.0 - 1e-9
    return f"blind circle of {distance:.2f} m" if upright else f"sees ground from {distance:.2f} m"


def _framed(paper: Paper, left: float, top: float, width: float, height: float) -> Axes:
    axes = paper.axes(left, top, width, height)
    axes.set_axis_on()
    axes.tick_params(left=False, bottom=False, labelleft=False, labelbottom=False)
    for spine in axes.spines.values():
        spine.set(color=HAIRLINE, linewidth=0.8)
    return axes
