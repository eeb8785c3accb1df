# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Water of a site: lakes and ponds with a bed and banks, streams that fall along their course, dry ditches.

Maps say where water is, not how high it stands. A lake stands a little below the low parts of its shore. A stream
stands below both of its banks, and never rises downstream (a line of the map runs downstream: OSM wiki,
Key:waterway). The ground is cut down to beds and banks; below a trail it stays, as on a culvert or a causeway.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter1d
from scipy.spatial import cKDTree

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.maps.osm import Feature
from fieldtruth.world.environments.site.sources import area_mask
from fieldtruth.world.grids import make_raster
from fieldtruth.world.model import Mesh, Raster
from fieldtruth.world.relief import Axes
from fieldtruth.world.solids import signed_area
from fieldtruth.world.water import DRY, make_sheet

FREEBOARD: Final = 0.15
"""Height [m] of a lake's low shores above its water."""
BED, DEEPEST = 0.35, 2.0
"""Slope of a lake's bed away from its shore, and its greatest depth [m]."""
BANK: Final = 0.6
"""Greatest slope of a lake's banks."""
STEEP: Final = 0.8
"""Greatest slope of the banks of streams and ditches; ditches are dug at 1 : 1 to 1 : 1.5."""
RISE: Final = 0.06
"""Height [m] of the ground beside water above it, where it is not higher."""
BERM: Final = 1.2
"""Distance [m] from the shore up to which the ground is raised to that."""
_STEP: Final = 0.5  # [m] between points of a stream
_UNDER: Final = 0.4  # [m] by which a sheet of water reaches into its bank
_BEYOND: Final = 10.0  # [m] by which water goes on outside the world's edge, below the land there
_DITCHES: Final = ("ditch", "drain")


class Waters(NamedTuple):
    """Heights (nx, ny) [m] with beds and banks, the level of the water, and its sheets with their heights [m]."""

    heights: Array
    level: Raster | None
    sheets: tuple[tuple[Mesh, float], ...]


class _Bodies:
    """The ground while beds are cut into it, one after the other."""

    def __init__(self, heights: Array, nodes: Axes, size: tuple[float, float]) -> None:
        self.heights, self.nodes, self.size = heights.copy(), nodes, size
        self.spacing = float(nodes[0][1] - nodes[0][0])
        self.level = np.full(heights.shape, DRY, np.float32)
        self.sheets: list[tuple[Mesh, float]] = []

    def add_lake(self, lake: Feature) -> None:
        """Cut the bed and banks of an area of water, and lay its sheet."""
        rows = self._around(lake.geometry, 12.0)
        ground, own = self.heights[rows], (self.nodes[0][rows[0]], self.nodes[1][rows[1]])
        inside = area_mask([lake], own)
        if not inside.any():
            return
        away = distance_transform_edt(~inside) * self.spacing if not inside.all() else np.zeros(inside.shape)
        deep = distance_transform_edt(np.pad(inside, 1, mode="edge"))[1:-1, 1:-1] * self.spacing
        shore = (away > 0) & (away < 2.5 * self.spacing)
        level = float(np.quantile(ground[shore] if shore.any() else ground, 0.1)) - FREEBOARD
        bank = np.minimum(ground, level + RISE + BANK * away)
        bank = np.where(away < BERM, np.maximum(bank, level + RISE), bank)
        bed = np.minimum(ground, level - np.minimum(0.1 + BED * (deep - self.spacing), DEEPEST))
        self.heights[rows] = np.where(inside, bed, bank)
        wet = binary_dilation(inside, iterations=2)
        self.level[rows] = np.where(wet, level, self.level[rows])
        self.sheets.append((_sheet(f"water_{len(self.sheets)}", lake, self.size), level))

    def add_stream(self, stream: Feature) -> None:
        """Cut the channel of a line of water, and lay its strip, unless it is a dry ditch."""
        points, tangents = _resampled(stream.geometry)
        width = stream.width or 1.0
        half, depth = width / 2.0, min(0.12 + 0.1 * width, 1.0)
        bank = self._banks(points, tangents, half)
        if bank[-1] > bank[0] + 0.5:  # drawn uphill
            points, tangents, bank = points[::-1], -tangents[::-1], bank[::-1]
        dry = stream.tags.get("intermittent") == "yes" or any(stream.tags.get("waterway") == d for d in _DITCHES)
        below = (0.45 if dry else 0.25) + 0.08 * min(width, 6.0)
        level = gaussian_filter1d(np.minimum.accumulate(bank), 4.0 / _STEP, mode="nearest") - below
        rows = self._around(points, half + 5.0)
        x, y = np.meshgrid(self.nodes[0][rows[0]], self.nodes[1][rows[1]], indexing="ij")
        found = cKDTree(points).query(np.stack([x.ravel(), y.ravel()], -1), distance_upper_bound=half + 4.0)
        away, nearest = (np.asarray(each) for each in found)
        near = np.isfinite(away)
        own = np.full(x.shape, np.inf)
        d, at = away[near], level[nearest[near]]
        # A channel narrower than the nodes are apart is at least one node wide.
        half = max(half, 0.75 * self.spacing)
        bed = at - depth * (1.0 - 0.8 * (d / half) ** 2)
        own.reshape(-1)[near] = np.where(d <= half, bed, at + 0.02 + STEEP * (d - half))
        self.heights[rows] = np.minimum(self.heights[rows], own)
        if not dry:
            wet = np.full(x.shape, DRY, np.float32)
            wet.reshape(-1)[near] = np.where(d <= half + self.spacing, at, DRY)
            self.level[rows] = np.maximum(self.level[rows], wet)
            self.sheets.append((_strip(f"water_{len(self.sheets)}", points, tangents, level, half), 0.0))

    def _banks(self, points: Array, tangents: Array, half: float) -> Array:
        """Height [m] of the lower bank beside each point."""
        ground = RectBivariateSpline(*self.nodes, self.heights, kx=1, ky=1)
        left = np.stack([-tangents[:, 1], tangents[:, 0]], axis=-1) * (half + 0.8)
        sides = [ground.ev(*(points + side * left).T) for side in (-1.0, 1.0)]
        return np.asarray(gaussian_filter1d(np.min(sides, axis=0), 3.0 / _STEP, mode="nearest"))

    def _around(self, points: Array, margin: float) -> tuple[slice, slice]:
        low, high = points.min(axis=0) - margin, points.max(axis=0) + margin
        first, second = (slice(*np.searchsorted(axis, (low[k], high[k]))) for k, axis in enumerate(self.nodes))
        return first, second


def lay_water(
    features: Sequence[Feature], heights: Array, nodes: Axes, size: tuple[float, float], kept: Array
) -> Waters:
    """Cut water into the ground.

    Args:
        features: of the map; those of the kinds water and stream count.
        heights: (nx, ny) [m] of the ground without water.
        nodes: of them.
        size: length and width [m] of the world along x and y.
        kept: (nx, ny), signed distance [m] to the nearest trail's edge, below which the ground stays.
    """
    bodies = _Bodies(heights, nodes, size)
    for each in features:
        if each.kind == "stream":
            bodies.add_stream(each)
    for each in features:
        if each.kind == "water" and each.closed:
            bodies.add_lake(each)
    if (bodies.level == DRY).all() and (bodies.heights == heights).all():
        return Waters(heights, None, ())
    share = np.clip((kept - 0.3) / 0.9, 0.0, 1.0)
    dry: Mask = kept < 0.3
    cut = np.asarray(heights + share * (bodies.heights - heights))
    level = np.where(dry & (cut > bodies.level), DRY, bodies.level)
    wet = bool((level > DRY).any())
    return Waters(cut, make_raster(level, bodies.spacing, *nodes) if wet else None, tuple(bodies.sheets))


def _resampled(line: Array) -> tuple[Array, Array]:
    """Points (n, 2) along a polyline, ``_STEP`` apart or less, and its unit tangents, smoothed at the corners."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    steps = np.linspace(0.0, along[-1], max(2, int(along[-1] / _STEP) + 2))
    points = np.stack([np.interp(steps, along, line[:, k]) for k in range(2)], axis=-1)
    points[1:-1] = gaussian_filter1d(points, 1.0 / _STEP, axis=0, mode="nearest")[1:-1]
    tangents = np.gradient(points, axis=0)
    return points, tangents / np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)


def _strip(name: str, points: Array, tangents: Array, level: Array, half: float) -> Mesh:
    """Strip of water along points (n, 2) at heights ``level`` (n,) [m], wider than the channel by what banks hide."""
    left = np.stack([-tangents[:, 1], tangents[:, 0]], axis=-1) * (half + 0.1)
    rows = [np.column_stack([points + side * left, level]) for side in (-1.0, 1.0)]
    vertices = np.stack(rows, axis=1).reshape(-1, 3)
    k = 2 * np.arange(len(points) - 1)
    faces = np.stack([k, k + 2, k + 3, k, k + 3, k + 1], axis=-1).reshape(-1, 3)
    return make_sheet(name, vertices, faces)


def _sheet(name: str, lake: Feature, size: tuple[float, float]) -> Mesh:
    """Sheet of water at height 0 over an area and a little of its banks; where it reaches the edge it goes on there."""
    import shapely

    area = shapely.make_valid(shapely.Polygon(lake.geometry, lake.holes))
    world = shapely.box(-size[0] / 2, -size[1] / 2, size[0] / 2, size[1] / 2)
    over = area.buffer(_UNDER, quad_segs=2)
    whole = over.intersection(world)
    if area.distance(world.exterior) < 0.01:
        edge = shapely.line_merge(over.intersection(world.exterior))
        whole = shapely.union(whole, edge.buffer(_BEYOND, cap_style="flat", join_style="mitre").difference(world))
    whole = whole.simplify(0.05)
    triangles = [np.array(each.exterior.coords)[:3] for each in shapely.constrained_delaunay_triangles(whole).geoms]
    corners = np.array(triangles)
    turned = [signed_area(each) < 0 for each in corners]
    corners[turned] = corners[turned, ::-1]
    points, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    return make_sheet(name, np.column_stack([points, np.zeros(len(points))]), faces.reshape(-1, 3))
