# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The robot from the side and from above: hull, wheels, named frames and fields of view."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon, Rectangle
from scipy.spatial import ConvexHull

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import Rig
from fieldtruth.experiment.topic import BASE
from fieldtruth.report.drawing.style import FONT, INK, MUTED
from fieldtruth.report.rig import body
from fieldtruth.report.rig.coverage import SensorView

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


class Window(NamedTuple):
    """What a view shows [m]: its middle and lower end, half its width, and its height; and the robot's size."""

    middle: float
    low: float
    half: float
    height: float
    size: float


def robot_size(rig: Rig) -> float:
    """Longest side [m] of a box around hull, wheels and sensors."""
    box = body.chassis(rig)
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
    size, ground = robot_size(rig), body.ground_height(rig)
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
    for wheel in body.rollers(rig):
        round_one = Circle(_point(wheel.centre, plane), wheel.radius, facecolor=TYRE, zorder=2.5)
        patches.append(round_one if plane == SIDE else _rectangle(wheel.box, plane, facecolor=TYRE, zorder=1.5))
    for patch in (*patches, _rectangle(body.chassis(rig), plane, facecolor=HULL, zorder=2)):
        patch.set(edgecolor=INK, linewidth=0.7)
        axes.add_patch(patch)


def _rectangle(box: body.Box, plane: tuple[int, int], **style: Any) -> Rectangle:
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
    """Outlines (n, 2) of the shadow of its rays; of a LiDAR from the side, of what it scans in this plane."""
    flat, origin = list(plane), view.position[list(plane)]
    if not view.is_lidar or plane == ABOVE:
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
