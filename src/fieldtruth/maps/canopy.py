# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Heights of a canopy above the ground, from a raster or an airborne laser scan.

The model of a scan is the highest first return of each cell; cells without one are filled from around, and pits,
where a pulse passed the foliage, by the median of the cells about them (Ben-Arie et al. 2009,
Computers & Geosciences 35, 1940).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter, median_filter

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.maps.elevation import Elevation, Reference, metres_of_points, read_ground_points, read_raster

TALLEST: Final = 130.0
"""Height [m] that no tree reaches."""
_FINEST: Final = 0.25
"""Side [m] of the smallest cells; finer rasters are reduced to the highest of a block."""
_MARGIN: Final = 10.0
"""Distance [m] beyond a world's edge to which returns are read, so that crowns there are whole."""
_PIT: Final = 1.0  # [m] below the median about it


@dataclass(frozen=True)
class Canopy:
    """Heights of a canopy above the ground, on a grid that may be turned or sheared in the world frame."""

    source: Path
    heights: Float32Array
    """(rows, columns) [m] above the ground."""
    world_from_cell: Array
    """(2, 3), world x and y [m] of (row, column, 1), whole numbers in the middles of cells."""
    size: tuple[float, float]
    """Length and width [m] of the world along x and y."""
    missing: int = 0
    """Number of cells of the world without data, which count as bare ground."""

    @property
    def cell_area(self) -> float:
        """Area [m²] of a cell."""
        return float(abs(np.linalg.det(self.world_from_cell[:, :2])))


def read_canopy(
    path: Path,
    origin: Origin,
    size: tuple[float, float],
    *,
    crs: str | None = None,
    ground: Elevation | None = None,
    reference: Reference = "ellipsoid",
    geoid_height: float | None = None,
) -> Canopy:
    """Read the part of a canopy height model that a world covers, or of a surface model, if ``ground`` is given.

    Other arguments are those of ``read_raster``; heights above the ground have no reference.

    Raises:
        ConfigurationError: as ``read_raster``, or its heights cannot be heights of trees above the ground.
    """
    surface = read_raster(path, origin, size, crs=crs, reference=reference, geoid_height=geoid_height)
    heights, transform = surface.heights, _matrix(surface.transform)
    if ground is not None:
        rows, columns = np.meshgrid(*(np.arange(n) + 0.5 for n in heights.shape), indexing="ij")
        heights = heights - height_of(ground, surface.crs, *(surface.transform @ (columns, rows)))
    low, high = np.percentile(heights[~surface.filled], [90.0, 99.0])
    if high > TALLEST:
        raise ConfigurationError(f"{path}: heights of {high:.0f} m are above the sea, not the ground; give the ground")
    if low < -1.0:
        raise ConfigurationError(f"{path}: it is {-low:.0f} m below the ground; give the geoid_height of both")
    heights = np.where(surface.filled, -np.inf, heights)
    world_from_crs, _, _ = plane(surface.crs, origin, size)
    cell = float(np.min(np.hypot(*(world_from_crs[:, :2] @ transform[:2, :2]))))
    return _canopy(path, heights, world_from_crs @ transform, size, _factor(_FINEST / cell), scan=False)


def read_canopy_points(path: Path, origin: Origin, size: tuple[float, float], *, crs: str | None = None) -> Canopy:
    """Read a LAS or LAZ file as a canopy height model: its first returns above its ground points.

    Arguments are those of ``read_raster``.

    Raises:
        ConfigurationError: as ``read_ground_points``, or the scan does not cover the world.
    """
    ground = read_ground_points(path, origin, size, crs=crs, reference="ellipsoid")
    return canopy_model(_first_returns(path, metres_of_points(ground.crs)), ground, origin, size)


def _first_returns(path: Path, factor: float) -> Iterator[Array]:
    """Points (n, 3) of a file that are first returns and not noise (classes 7 and 18), z times ``factor``."""
    import laspy

    with laspy.open(path) as reader:
        for points in reader.chunk_iterator(2_000_000):
            kept = (np.asarray(points.return_number) <= 1) & ~np.isin(np.asarray(points.classification), (7, 18))
            yield np.stack([points.x, points.y, np.asarray(points.z) * factor], axis=-1)[kept]


def canopy_model(points: Iterable[Array], ground: Elevation, origin: Origin, size: tuple[float, float]) -> Canopy:
    """Heights of a canopy from its first returns.

    The cells have a return on average, but are at least 0.25 m wide.

    Args:
        points: arrays (n, 3) of coordinates of ``ground.crs`` and heights [m] in the ground's reference.
        ground: heights of the ground.
        origin: of the world frame.
        size: length and width [m] of the world along x and y.

    Raises:
        ConfigurationError: no point lies within the world.
    """
    world_from_crs, corners, unit = plane(ground.crs, origin, size)
    step = _FINEST / unit
    low = np.floor((corners.min(axis=0) - _MARGIN / unit) / step) * step
    shape = tuple(np.ceil((corners.max(axis=0) + _MARGIN / unit - low) / step).astype(int)[::-1].tolist())
    top, count = np.full(shape, -np.inf, np.float32), 0
    for chunk in points:
        column, row = ((chunk[:, :2] - low) // step).astype(np.int64).T
        row = shape[0] - 1 - row
        inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
        above = chunk[inside, 2] - height_of(ground, ground.crs, *chunk[inside, :2].T)
        kept = above <= TALLEST
        np.maximum.at(top, (row[inside][kept], column[inside][kept]), above[kept].astype(np.float32))
        count += int(kept.sum())
    if not count:
        raise ConfigurationError(f"{ground.source}: the scan has no returns within the world; move its centre")
    blocks = _blocks(np.isfinite(top), 8)  # 2 m wide: the part of the world that was scanned
    factor = _factor(np.sqrt(1.0 / count * np.mean(blocks) * top.size))
    transform = np.array([[step[0], 0.0, low[0]], [0.0, -step[1], low[1] + shape[0] * step[1]], [0.0, 0.0, 1.0]])
    return _canopy(ground.source, top, world_from_crs @ transform, size, factor, scan=True)


def height_of(ground: Elevation, crs: Any, east: Array, north: Array) -> Array:
    """Heights [m] of the ground at coordinates of ``crs``, linear between its cells."""
    from pyproj import Transformer

    if crs != ground.crs:
        east, north = Transformer.from_crs(crs, ground.crs, always_xy=True).transform(east, north)
    column, row = ~ground.transform @ (np.asarray(east), np.asarray(north))
    return np.asarray(map_coordinates(ground.heights, [row - 0.5, column - 0.5], order=1, mode="nearest"))


def _matrix(transform: Any) -> Array:
    """(3, 3), of rasterio's affine transform from (column, row, 1) of corners."""
    return np.array(tuple(transform)[:9], np.float64).reshape(3, 3)


def plane(crs: Any, origin: Origin, size: tuple[float, float]) -> tuple[Array, Array, Array]:
    """World x and y of (east, north, 1), (2, 3); coordinates of points all over the world (n, 2); metres per unit (2,).

    The best plane: a world of 1 km in degrees is within 5 cm of it, in a map projection within 1 cm.
    """
    from pyproj import Transformer

    x, y = (np.linspace(-side / 2, side / 2, 9) for side in size)
    world = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((9, 9))], axis=-1).reshape(-1, 3)
    latitude, longitude, _ = geodetic_from_world(world, origin).T
    places = np.stack(Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude), axis=-1)
    middle = places.mean(axis=0)
    known = np.column_stack([places - middle, np.ones(len(places))])
    scale = np.abs(known).max(axis=0)  # degrees are small numbers
    matrix = (np.linalg.lstsq(known / scale, world[:, :2], rcond=None)[0] / scale[:, None]).T
    matrix[:, 2] -= matrix[:, :2] @ middle
    return matrix, places, np.hypot(*matrix[:, :2])


def _factor(cells: float) -> int:
    """Number of cells along the side of a block whose side is to be that many, at least; 1 to 8."""
    return int(np.clip(np.ceil(cells - 1e-3), 1, 8))


def _blocks(image: Any, side: int) -> Any:
    """The highest of each block of cells; blocks at the end may be smaller."""
    starts = [np.arange(0, n, side) for n in image.shape]
    return np.maximum.reduceat(np.maximum.reduceat(image, starts[0], axis=0), starts[1], axis=1)


def _canopy(
    path: Path,
    heights: Array | Float32Array,
    world_from_corner: Array,
    size: tuple[float, float],
    side: int,
    *,
    scan: bool,
) -> Canopy:
    """A canopy of blocks of cells; ``world_from_corner`` is of (column, row, 1), 0 at the first cell's corner."""
    (a, b, c), (d, e, f) = world_from_corner
    half = side / 2
    matrix = np.array([[b * side, a * side, c + half * (a + b)], [e * side, d * side, f + half * (d + e)]])
    reduced = _blocks(heights.astype(np.float32), side)
    if scan:
        reduced = _without_pits(_without_pits(_filled(reduced)))  # the second time, pits of two cells
    empty = np.stack(np.nonzero(~np.isfinite(reduced)))
    places = matrix[:, :2] @ empty + matrix[:, 2:]
    missing = int(np.all(np.abs(places) <= np.array(size)[:, None] / 2, axis=0).sum())
    return Canopy(path, np.maximum(reduced, 0.0), matrix, size, missing)


def _filled(heights: Float32Array) -> Float32Array:
    """Cells of -inf filled from those within four cells; beyond, there is no canopy: water returns no pulse."""
    from rasterio.fill import fillnodata

    known = np.isfinite(heights)
    near = maximum_filter(known, size=9)
    filled = fillnodata(np.where(known, heights, 0.0).astype(np.float32), known, max_search_distance=6.0)
    return np.where(near, filled, -np.inf).astype(np.float32)


def _without_pits(heights: Float32Array) -> Float32Array:
    median = median_filter(heights, size=3, mode="nearest")
    return np.where(heights < median - _PIT, median, heights)
