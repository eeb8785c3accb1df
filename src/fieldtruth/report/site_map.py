# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The maps of a site as they were read, drawn as the aerial view shows its world: relief, areas, lines, trees."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LightSource
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.maps.osm import Feature
from fieldtruth.report.drawing.maps import Aerial, arc
from fieldtruth.report.drawing.paper import Paper
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.inputs import Inputs

_AREAS: Final[Mapping[str, str]] = {
    "water": "#8fb8d6", "wetland": "#a9c9c4", "wood": "#8fb28a", "scrub": "#b4c79b", "orchard": "#b9d3a0",
    "grass": "#d3e3b6", "meadow": "#dce8bf", "heath": "#d8cfae", "farmland": "#eadfc4", "sand": "#f1e6c0",
    "bare_rock": "#cfcac4", "scree": "#d9d4cd", "building": "#a9907e",
}  # fmt: skip
_LINES: Final[Mapping[str, str]] = {
    "road": "#6b6b6b", "track": "#97744a", "path": "#b0603a", "stream": "#4a86b8", "wall": "#555555",
    "fence": "#7d6b55", "hedge": "#4f8a46",
}  # fmt: skip
"""Colours by kind, after those of OpenStreetMap's own map; other kinds are grey."""
_OTHER: Final = "#8a8a8a"
_TREE: Final = "#2f6b35"
_NODES: Final = 256
"""Along the longer side, at which the relief is drawn."""


def draw_inputs(config: Config, inputs: Inputs, aerial: Aerial) -> NDArray[np.uint8]:
    """Draw the maps with the projection and size of an aerial view of the world, (h, w, 3)."""
    high, wide = aerial.photo.shape[:2]
    paper = Paper(10.0, 10.0 * high / wide, wide)
    axes = paper.image_at(_relief(config, inputs, aerial), 0.0, 0.0, paper.width, paper.height)
    features = () if inputs.streets is None else inputs.streets.features
    for feature in features:
        _draw(axes, feature, aerial)
    for tree in () if inputs.trees is None else inputs.trees.trees:
        radius = tree.crown_radius or (tree.height or 10.0) / 6.0
        ring = aerial.ground_pixels(arc(np.array([tree.x, tree.y]), radius))
        axes.fill(*ring.T, facecolor=_TREE, alpha=0.35, edgecolor=_TREE, linewidth=0.6)
    return paper.render()


def _relief(config: Config, inputs: Inputs, aerial: Aerial) -> NDArray[np.uint8]:
    """The elevation, shaded and lit from the upper left, in the pixels of the view; white without one."""
    high, wide = aerial.photo.shape[:2]
    blank = np.full((high, wide, 3), 255, np.uint8)
    if inputs.elevation is None:
        return blank
    count = [max(16, round(_NODES * side / max(config.size))) for side in config.size]
    x, y = (np.linspace(-side / 2, side / 2, n) for side, n in zip(config.size, count, strict=True))
    heights = inputs.elevation.at(x, y, config.place)
    steps = x[1] - x[0], y[1] - y[0]
    shade = LightSource(azdeg=315, altdeg=45).hillshade(heights.T[::-1], vert_exag=2.0, dx=steps[0], dy=steps[1])
    corners = aerial.ground_pixels(np.array([(x[0], y[-1]), (x[-1], y[0])]))
    rows, columns = np.mgrid[0:high, 0:wide]
    i = (columns - corners[0, 0]) / (corners[1, 0] - corners[0, 0]) * (shade.shape[1] - 1)
    j = (rows - corners[0, 1]) / (corners[1, 1] - corners[0, 1]) * (shade.shape[0] - 1)
    inside = (i >= 0) & (i <= shade.shape[1] - 1) & (j >= 0) & (j <= shade.shape[0] - 1)
    grey = 130.0 + 120.0 * shade[j[inside].astype(int), i[inside].astype(int)]
    blank[inside] = grey[:, None].astype(np.uint8)
    return blank


def _draw(axes: Axes, feature: Feature, aerial: Aerial) -> None:
    line = aerial.ground_pixels(feature.geometry)
    if feature.closed:
        rings = [line, *(aerial.ground_pixels(hole) for hole in feature.holes)]
        path = Outline.make_compound_path(*(Outline(np.vstack([ring, ring[:1]]), closed=True) for ring in rings))
        colour = _AREAS.get(feature.kind, _OTHER)
        axes.add_patch(PathPatch(path, facecolor=colour, alpha=0.75, edgecolor=colour, linewidth=0.8))
    elif len(line) > 1:
        width = max(1.2, (feature.width or 0.0) * _pixels_per_metre(aerial) * 72.0 / axes.figure.dpi)
        axes.plot(*line.T, color=_LINES.get(feature.kind, _OTHER), linewidth=width, solid_capstyle="butt")
    else:
        colour = _TREE if feature.kind == "tree" else _OTHER
        axes.plot(*line.T, marker="o" if feature.kind == "tree" else "s", markersize=4.0, color=colour)


def _pixels_per_metre(aerial: Aerial) -> float:
    ends: Array = aerial.ground_pixels(np.array([[-0.5, 0.0], [0.5, 0.0]]))
    return float(np.linalg.norm(ends[1] - ends[0]))
