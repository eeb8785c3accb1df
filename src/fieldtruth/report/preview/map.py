# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What is drawn upon the view from above: routes, way-points, starts (paper, Figures 8 to 11), views, scale, north."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import AbstractPathEffect, withStroke

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.rig import CameraConfig
from fieldtruth.report.drawing.aerial import Aerial
from fieldtruth.report.drawing.style import FONT, INK, RED, ROUTES
from fieldtruth.report.preview.content import Findings, Route, View
from fieldtruth.world.model import Heightfield

WAYPOINT_RADIUS: Final = 3.0  # [m]; paper, section 3
_ARROWS: Final = 24.0  # [m] of way from one arrow to the next
_SCALE: Final = 10.0  # [m]
_WEDGE: Final = 4.5  # [m] that a view's wedge reaches


def on_ground(aerial: Aerial, field: Heightfield, xy: Array) -> Array:
    """Column and row (n, 2) in the aerial view of points x, y (n, 2) [m] on the ground."""
    return aerial.pixels(np.column_stack([xy, field.height_at(xy[:, 0], xy[:, 1])]))


def circle(centre: Array, radius: float, start: float = 0.0, end: float = 2.0 * np.pi) -> Array:
    """Points (65, 2) of an arc about x, y [m], from and to an angle [rad]."""
    angle = np.linspace(start, end, 65)
    return centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def draw_map(axes: Axes, found: Findings, lens: CameraConfig) -> None:
    """Draw on axes whose unit is the aerial photograph's pixel."""
    field, aerial = found.world.terrain.field, found.aerial
    for route in found.routes:
        for waypoint in route.waypoints[1:]:
            ring = on_ground(aerial, field, circle(waypoint, WAYPOINT_RADIUS))
            axes.fill(*ring.T, facecolor=(1.0, 0.23, 0.19, 0.10), edgecolor=RED, linewidth=1.1)
    for k, route in enumerate(found.routes):
        line, colour = on_ground(aerial, field, route.path), ROUTES[k % len(ROUTES)]
        axes.plot(*line.T, color=colour, linewidth=2.0, path_effects=_halo(3.6, "white", 0.75))
        _arrows(axes, line, route.path, colour)
        _start(axes, line[0], route, colour, aerial)
    for number, view in enumerate(found.views, 1):
        _view(axes, found, view, number, np.radians(lens.horizontal_fov_deg))
    _scale_and_north(axes, aerial, float(field.heights.mean()))


def badge(axes: Axes, column: float, row: float, number: int) -> None:
    """Put a small dark disc with a number at a pixel."""
    disc = {"boxstyle": "circle,pad=0.22", "facecolor": INK, "edgecolor": "white", "linewidth": 1.0}
    _write(axes, column, row, str(number), 7.0, color="white", va="center_baseline", bbox=disc, zorder=7)


def _halo(width: float, colour: str, alpha: float) -> list[AbstractPathEffect]:
    return [withStroke(linewidth=width, foreground=colour, alpha=alpha)]


def _write(axes: Axes, column: float, row: float, words: str, size: float, **options: Any) -> None:
    style: dict[str, Any] = {"family": FONT, "weight": "bold", "ha": "center", "va": "center"} | options
    axes.text(column, row, words, fontsize=size, **style)


def _arrow(axes: Axes, tail: Array, head: Array, **options: Any) -> None:
    style: dict[str, Any] = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0} | options
    axes.annotate("", (head[0], head[1]), (tail[0], tail[1]), arrowprops=style)


def _arrows(axes: Axes, line: Array, path: Array, colour: str) -> None:
    """Heads along the line, one each so many metres."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    shape = "-|>,head_width=0.34,head_length=0.55"
    for row in np.searchsorted(way, np.arange(_ARROWS / 2, way[-1], _ARROWS)):
        _arrow(
            axes, line[max(row - 12, 0)], line[row],
            arrowstyle=shape, color=colour, linewidth=0.0, mutation_scale=13, path_effects=_halo(1.4, "white", 1.0),
        )  # fmt: skip


def _start(axes: Axes, here: Array, route: Route, colour: str, aerial: Aerial) -> None:
    """A cross, and the experiment's name behind it."""
    for width, ink in ((4.4, "white"), (2.4, colour)):
        axes.plot(*here, marker="x", markersize=9, markeredgewidth=width, color=ink, zorder=5)
    ahead = route.path[min(60, len(route.path) - 1)] - route.path[0]
    back = -ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    size = np.array(aerial.photo.shape[1::-1])
    column, row = np.clip(here + back * (0.028, -0.018) * size[0], 0.03 * size, 0.97 * size)
    plate = {
        "boxstyle": "round,pad=0.32,rounding_size=0.6",
        "facecolor": "white",
        "edgecolor": colour,
        "linewidth": 1.2,
    }
    _write(axes, column, row, route.name, 7.6, color=INK, bbox=plate, zorder=6)


def _view(axes: Axes, found: Findings, view: View, number: int, fov: float) -> None:
    """A view's number where the robot stands, and a wedge over what it looks at."""
    xy, heading = view.station[:2], float(view.station[2])
    arc = circle(xy, _WEDGE, heading - fov / 2, heading + fov / 2)
    wedge = on_ground(found.aerial, found.world.terrain.field, np.vstack([xy, arc]))
    axes.fill(*wedge.T, facecolor="white", alpha=0.45, linewidth=0.0, zorder=3)
    badge(axes, wedge[0, 0], wedge[0, 1], number)


def _scale_and_north(axes: Axes, aerial: Aerial, ground: float) -> None:
    """A bar of ten metres, and the arrow that points north, in the lower right corner."""
    metres = np.diff(aerial.pixels([(-_SCALE / 2, 0.0, ground), (_SCALE / 2, 0.0, ground)])[:, 0])[0]
    size = np.array(aerial.photo.shape[1::-1])
    end = size * (0.975, 0.955)
    start, up = end - (metres, 0.0), 0.014 * size[1]
    shade, words = (
        _halo(3.2, "black", 0.55),
        {"color": "white", "va": "bottom", "path_effects": _halo(1.8, "black", 0.6)},
    )
    axes.plot(*np.array([start, end]).T, color="white", linewidth=2.0, solid_capstyle="butt", path_effects=shade)
    _write(axes, float(start[0] + end[0]) / 2, end[1] - up, f"{_SCALE:.0f} m", 7.4, weight="normal", **words)
    tail, head = start - (0.056 * size[0], 0.0), start - (0.022 * size[0], 0.0)
    _arrow(axes, tail, head, color="white", linewidth=1.6, mutation_scale=11, path_effects=shade)
    _write(axes, float(tail[0] + head[0]) / 2, end[1] - up, "north", 7.4, weight="normal", **words)
