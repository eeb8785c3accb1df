# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""One picture of a rig: the robot from the side and from above, and a plan of the ground that its sensors see."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from fieldtruth.core.arrays import Mask
from fieldtruth.experiment.rig import Rig
from fieldtruth.report.drawing.style import FONT, HAIRLINE, INK, MUTED
from fieldtruth.report.drawing.text import percent
from fieldtruth.report.preview.paper import Paper
from fieldtruth.report.rig import body
from fieldtruth.report.rig.coverage import Coverage, SensorView, ground_coverage, ground_hits, nearest_ground
from fieldtruth.report.rig.views import ABOVE, HULL, SIDE, TYRE, draw_view

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
    "LiDAR only": "#cfe0fb",
    "camera only": "#fbe6b8",
    "LiDAR and camera": "#cdebcf",
}
_RINGS: Final = 48  # circles of a LiDAR that are drawn


def draw_rig(rig: Rig, name: str, pixels: int = PIXELS) -> NDArray[np.uint8]:
    """Draw the rig of the experiment ``name``, an image (h, w, 3) in sRGB, ``pixels`` wide."""
    coverage = ground_coverage(rig)
    views = coverage.views
    colours = [_COLOURS[k % len(_COLOURS)] for k in range(len(views))]
    rows = (min(len(views), _ROWS) + 1) // 2
    paper = Paper(_WIDTH, max(_ABOVE_TOP + _ABOVE_HEIGHT, _LEGEND_TOP + 0.5 + 0.36 * rows) + _EDGE, pixels)
    paper.text(_EDGE - 0.02, 0.6, f"Rig of {name}", 22, weight="bold")
    kinds = {"LiDAR": rig.lidars, "camera view": rig.imagers, "IMU": rig.imus, "GNSS receiver": rig.antennas}
    counts = (f"{len(found)} {kind}{'s' * (len(found) != 1)}" for kind, found in kinds.items())
    paper.text(_EDGE, 0.86, ", ".join(counts), 9, color=MUTED)
    _heading(
        paper,
        _EDGE,
        _SIDE_TOP,
        "From the side",
        "axes x red, y green, z blue; fields of view are cut off; without optical frames",
    )
    for plane, top, height in ((SIDE, _SIDE_TOP, _SIDE_HEIGHT), (ABOVE, _ABOVE_TOP, _ABOVE_HEIGHT)):
        draw_view(
            _axes(paper, _EDGE, top, _LEFT, height), rig, list(zip(views, colours, strict=True)), plane, _LEFT / height
        )
    _heading(paper, _EDGE, _ABOVE_TOP, "From above", "forward is right, left is up")
    _heading(paper, _PLAN_LEFT, _SIDE_TOP, "Flat ground", "lines: circles of LiDAR beams, borders of images")
    _draw_plan(_axes(paper, _PLAN_LEFT, _SIDE_TOP, _PLAN, _PLAN), rig, coverage, colours)
    _write_legend(paper, rig, coverage, colours)
    return paper.render()


def ground_classes(coverage: Coverage) -> dict[str, Mask]:
    """Which points of the ground (n, n) belong to each class of ``_GROUND``; each point belongs to one."""
    lidar, camera = coverage.seen(lidar=True), coverage.seen(lidar=False)
    through = coverage.in_view.any(axis=0) & ~lidar & ~camera
    masks = (~(lidar | camera | through), through, lidar & ~camera, camera & ~lidar, lidar & camera)
    return dict(zip(_GROUND, masks, strict=True))


def _draw_plan(axes: Axes, rig: Rig, coverage: Coverage, colours: Sequence[str]) -> None:
    axis, ground = coverage.axis, body.ground_height(rig)
    image = np.ones((len(axis), len(axis), 3))
    for name, mask in ground_classes(coverage).items():
        image[mask] = to_rgb(_GROUND[name])
    half = axis[-1] + (axis[1] - axis[0]) / 2
    axes.imshow(image, origin="lower", extent=(-half, half, -half, half), interpolation="nearest")
    axes.set_autoscale_on(False)
    for view, colour, in_view in zip(coverage.views, colours, coverage.in_view, strict=True):
        if view.is_lidar:
            rings = ground_hits(view, ground)
            near = [ring for ring in rings if (np.abs(ring[:, :2]) < axis[-1]).all(axis=1).any()]
            for ring in near[:: len(near) // _RINGS + 1]:
                axes.plot(*ring[:, :2].T, color=colour, linewidth=0.4, alpha=0.75)
        elif in_view.any() and not in_view.all():
            smooth = gaussian_filter(in_view.astype(float), 1.5)  # without the steps of the grid
            axes.contour(axis, axis, smooth, levels=[0.5], colors=[colour], linewidths=1.0)
    box = body.chassis(rig)
    for part, colour in (*((wheel.box, TYRE) for wheel in body.rollers(rig)), (box, HULL)):
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
    ground = body.ground_height(rig)
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
    upright = view.is_lidar and view.base_from_sensor[2, 2] > 1.0 - 1e-9
    return f"blind circle of {distance:.2f} m" if upright else f"sees ground from {distance:.2f} m"


def _heading(paper: Paper, left: float, top: float, title: str, caption: str) -> None:
    width = paper.text(left, top - 0.1, title, 10.5, weight="bold")
    paper.text(left + width + 0.14, top - 0.1, caption, 8.0, color=MUTED)


def _axes(paper: Paper, left: float, top: float, width: float, height: float) -> Axes:
    box = (left / paper.width, 1.0 - (top + height) / paper.height, width / paper.width, height / paper.height)
    axes = paper.figure.add_axes(box)
    axes.tick_params(left=False, bottom=False, labelleft=False, labelbottom=False)
    for spine in axes.spines.values():
        spine.set(color=HAIRLINE, linewidth=0.8)
    return axes
