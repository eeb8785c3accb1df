# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Overlay of the aerial view: routes, waypoints and starts (paper, Figures 8 to 11), viewpoints, scale, north."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import AbstractPathEffect, withStroke

from fieldtruth.core.arrays import Array
from fieldtruth.experiment.sensor_families import Imager
from fieldtruth.report.drawing.maps import Aerial, arc, distance_along, heading_of, sector
from fieldtruth.report.drawing.style import FONT, INK, RED, ROUTES
from fieldtruth.report.preview.content import Route, SheetContent, View

WAYPOINT_RADIUS: Final = 3.0
"""Radius [m] of the circles (paper, section 3)."""
_ARROW_SPACING: Final = 24.0  # [m]
_SCALE: Final = 10.0  # [m]
_FIELD_OF_VIEW: Final = 4.5  # [m] that the sectors extend


def draw_map(axes: Axes, content: SheetContent) -> None:
    """Draw on axes whose unit is the pixel of the aerial view."""
    aerial = content.aerial
    for route in content.routes:
        for waypoint in route.waypoints[1:]:
            ring = aerial.ground_pixels(arc(waypoint, WAYPOINT_RADIUS))
            axes.fill(*ring.T, facecolor=(1.0, 0.23, 0.19, 0.10), edgecolor=RED, linewidth=1.1)
    for k, route in enumerate(content.routes):
        line, colour = aerial.ground_pixels(route.path), ROUTES[k % len(ROUTES)]
        axes.plot(*line.T, color=colour, linewidth=2.0, path_effects=_halo(3.6, "white", 0.75))
        _draw_arrows(axes, line, route.path, colour)
        _draw_start(axes, line[0], route, colour, aerial)
    for number, view in enumerate(content.views, 1):
        assert content.camera is not None
        _draw_viewpoint(axes, aerial, view, number, content.camera)
    _draw_scale_and_north(axes, aerial)


def badge(axes: Axes, column: float, row: float, number: int) -> None:
    """Draw a small dark disc with a number at a pixel."""
    disc = {"boxstyle": "circle,pad=0.22", "facecolor": INK, "edgecolor": "white", "linewidth": 1.0}
    _write(axes, column, row, str(number), 7.0, color="white", va="center_baseline", bbox=disc, zorder=7)


def _halo(width: float, colour: str, alpha: float) -> list[AbstractPathEffect]:
    return [withStroke(linewidth=width, foreground=colour, alpha=alpha)]


def _write(axes: Axes, column: float, row: float, text: str, size: float, **options: Any) -> None:
    style: dict[str, Any] = {"family": FONT, "weight": "bold", "ha": "center", "va": "center"} | options
    axes.text(column, row, text, fontsize=size, **style)


def _arrow(axes: Axes, tail: Array, head: Array, **options: Any) -> None:
    style: dict[str, Any] = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0} | options
    axes.annotate("", (head[0], head[1]), (tail[0], tail[1]), arrowprops=style)


def _draw_arrows(axes: Axes, line: Array, path: Array, colour: str) -> None:
    distance = distance_along(path)
    shape = "-|>,head_width=0.34,head_length=0.55"
    style = {"arrowstyle": shape, "color": colour, "linewidth": 0.0, "path_effects": _halo(1.4, "white", 1.0)}
    for row in np.searchsorted(distance, np.arange(_ARROW_SPACING / 2, distance[-1], _ARROW_SPACING)):
        _arrow(axes, line[max(row - 12, 0)], line[row], mutation_scale=13, **style)


def _draw_start(axes: Axes, start: Array, route: Route, colour: str, aerial: Aerial) -> None:
    """Draw a cross at the start and the experiment's name behind it."""
    for width, ink in ((4.4, "white"), (2.4, colour)):
        axes.plot(*start, marker="x", markersize=9, markeredgewidth=width, color=ink, zorder=5)
    ahead = route.path[min(60, len(route.path) - 1)] - route.path[0]
    back = -ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    size = np.array(aerial.photo.shape[1::-1])
    column, row = np.clip(start + back * (0.028, -0.018) * size[0], 0.03 * size, 0.97 * size)
    shape = "round,pad=0.32,rounding_size=0.6"
    plate = {"boxstyle": shape, "facecolor": "white", "edgecolor": colour, "linewidth": 1.2}
    _write(axes, column, row, route.name, 7.6, color=INK, bbox=plate, zorder=6)


def _draw_viewpoint(axes: Axes, aerial: Aerial, view: View, number: int, camera: Imager) -> None:
    x, y, heading = view.viewpoint
    seen = np.array([x, y, heading + heading_of(camera)])
    fov = np.radians(camera.config.horizontal_fov_deg)
    outline = aerial.ground_pixels(sector(seen, _FIELD_OF_VIEW, fov))
    axes.fill(*outline.T, facecolor="white", alpha=0.45, linewidth=0.0, zorder=3)
    badge(axes, outline[0, 0], outline[0, 1], number)


def _draw_scale_and_north(axes: Axes, aerial: Aerial) -> None:
    """Draw a scale bar and an arrow to the north in the lower right corner."""
    ground = float(aerial.field.heights.mean())
    length = np.diff(aerial.pixels([(-_SCALE / 2, 0.0, ground), (_SCALE / 2, 0.0, ground)])[:, 0])[0]
    size = np.array(aerial.photo.shape[1::-1])
    end = size * (0.975, 0.955)
    start, text_row = end - (length, 0.0), end[1] - 0.014 * size[1]
    shadow = _halo(3.2, "black", 0.55)
    text = {"color": "white", "va": "bottom", "weight": "normal", "path_effects": _halo(1.8, "black", 0.6)}
    axes.plot(*np.array([start, end]).T, color="white", linewidth=2.0, solid_capstyle="butt", path_effects=shadow)
    _write(axes, float(start[0] + end[0]) / 2, text_row, f"{_SCALE:.0f} m", 7.4, **text)
    tail, head = start - (0.056 * size[0], 0.0), start - (0.022 * size[0], 0.0)
    _arrow(axes, tail, head, color="white", linewidth=1.6, mutation_scale=11, path_effects=shadow)
    _write(axes, float(tail[0] + head[0]) / 2, text_row, "north", 7.4, **text)
