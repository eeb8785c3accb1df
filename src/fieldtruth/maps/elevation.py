# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Elevation of a place: a raster in any coordinate reference system, or the ground points of an airborne laser scan.

The surface between the raster's cells is the interpolating cubic spline: it passes through the middles of the cells and
its slope is continuous (de Boor 1978; `scipy.ndimage`). Cells without data are filled from their edges by inverse
distance (GDAL's `fillnodata`), and counted.

A raster's heights are above the ellipsoid if its coordinate reference system says so, or a geoid's otherwise;
``geoid_height`` is then added. The height of the geoid changes by centimetres over a kilometre, so that one number
does. A world's x and y are in the plane that touches the ellipsoid at its origin, so a node's latitude and longitude
depend on its height, by 1e-7 of it within a kilometre: two rounds find both.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import map_coordinates, spline_filter

from fieldtruth.core.arrays import Array, Mask
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.maps.units import METRES

if TYPE_CHECKING:
    from rasterio.io import DatasetReader

logging.getLogger("laspy").addHandler(logging.NullHandler())  # what it logs it raises as well

MOST_CELLS: Final = 64_000_000
"""Cells of a raster that are read at most: the part that a world covers, not the whole file."""
MOST_POINTS: Final = 200_000_000
MARGIN: Final = 4
"""Cells read beyond the edge of a world, so that the spline there knows how the ground goes on."""
_GROUND: Final = 2  # class of ground in LAS 1.1 and later (ASPRS)
_LATTICE: Final = 16.0
"""Distance [m] between the positions that are converted; between them a spline is exact to a micrometre."""


class OutsideError(ConfigurationError):
    """A raster does not cover a world."""


@dataclass(frozen=True)
class Elevation:
    """Heights of the ground of a place, as a smooth surface over a grid of a coordinate reference system."""

    source: Path
    crs: Any
    """pyproj's ``CRS``."""
    heights: Array
    """(rows, columns) [m] of the cells' middles above the ellipsoid."""
    filled: Mask
    """(rows, columns), cells that had no data."""
    transform: Any
    """Affine transform from (column, row) of the cells' corners to the coordinates of ``crs``, as rasterio has it."""
    resolution: float
    """Distance [m] between the middles of cells, the larger one of rows and columns."""
    note: str
    """Surface above which the heights of the source are, and what is assumed about it."""

    def at(self, x: Array, y: Array, origin: Origin) -> Array:
        """Heights z [m] in the world frame of nodes x (nx,), y (ny,) [m]; (nx, ny).

        Raises:
            ConfigurationError: a node is outside the data.
        """
        u, v = (np.linspace(axis[0], axis[-1], max(4, int(np.ptp(axis) / _LATTICE) + 2)) for axis in (x, y))
        places = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)
        coefficients = spline_filter(self.heights, order=3, mode="mirror")
        z = np.zeros(places.shape[:2])
        for _ in range(2):
            cells = self._cells(np.concatenate([places, z[..., None]], axis=-1), origin)
            z = self._world_height(_sampled(coefficients, cells), places, origin)
        rows, columns = (RectBivariateSpline(u, v, cells[..., k])(x, y) for k in (0, 1))
        ellipsoidal = _sampled(coefficients, np.stack([rows, columns], axis=-1))
        drop = self._world_height(np.zeros(places.shape[:2]), places, origin)  # of the ellipsoid below the plane
        return np.asarray(ellipsoidal + RectBivariateSpline(u, v, drop)(x, y))

    def _cells(self, points_world: Array, origin: Origin) -> Array:
        """Row and column (..., 2), 0 in the middle of the first cell, of points (..., 3)."""
        from pyproj import Transformer

        latitude, longitude, _ = np.moveaxis(geodetic_from_world(points_world, origin), -1, 0)
        east, north = Transformer.from_crs(4326, self.crs, always_xy=True).transform(longitude, latitude)
        column, row = ~self.transform @ (np.asarray(east), np.asarray(north))
        cells = np.stack([row - 0.5, column - 0.5], axis=-1)
        if not (
            np.isfinite(cells).all() and (cells >= -0.5).all() and (cells <= np.array(self.heights.shape) - 0.5).all()
        ):
            raise OutsideError(f"{self.source}: the data do not cover the world; make size smaller, or move its centre")
        return cells

    @staticmethod
    def _world_height(ellipsoidal: Array, places: Array, origin: Origin) -> Array:
        """Height z [m] in the world frame above places (..., 2) of heights (...) [m] above the ellipsoid."""
        geodetic = geodetic_from_world(np.concatenate([places, np.zeros((*places.shape[:-1], 1))], axis=-1), origin)
        geodetic[..., 2] = ellipsoidal
        return world_from_geodetic(geodetic, origin)[..., 2]


def _sampled(coefficients: Array, cells: Array) -> Array:
    return map_coordinates(coefficients, np.moveaxis(cells, -1, 0), order=3, mode="mirror", prefilter=False)


Reference = Literal["ellipsoid", "geoid"]


def read_raster(
    path: Path,
    origin: Origin,
    size: tuple[float, float],
    *,
    crs: str | None = None,
    reference: Reference | None = None,
    geoid_height: float | None = None,
    spacing: float = 0.0,
) -> Elevation:
    """Read the part of a raster of heights that a world covers.

    Args:
        path: a GeoTIFF, or any raster that GDAL reads; its first band are heights.
        origin: of the world frame; its height does not matter.
        size: length and width [m] of the world along x and y.
        crs: coordinate reference system, of a file that states none.
        reference: surface above which its heights are; None: as its coordinate reference system says, else the geoid.
        geoid_height: height [m] of the geoid above the ellipsoid there; None: 0, and the note says so.
        spacing: distance [m] between heights that is fine enough: of smaller cells the mean of some is read.

    Raises:
        OutsideError: it does not cover the world.
        ConfigurationError: no raster, no coordinate reference system, or too many cells.
    """
    import rasterio
    from rasterio import Affine
    from rasterio.enums import Resampling
    from rasterio.errors import RasterioError
    from rasterio.windows import Window

    try:
        with rasterio.open(path) as dataset:
            if not dataset.count:
                raise ConfigurationError(f"{path}: has no bands of its own; write the part with heights as a GeoTIFF")
            system = crs_of(path, crs, dataset.crs.to_wkt() if dataset.crs else None)
            low, high = covered(path, dataset, system, origin, size)
            blocks = np.maximum(1, spacing * (high - low - 2 * MARGIN) // size)  # of cells; rows are along x
            shape = np.ceil((high - low) / blocks).astype(int)
            if (cells := np.prod(shape)) > MOST_CELLS:
                raise ConfigurationError(f"{path}: the world covers {cells:,} cells; at most {MOST_CELLS:,} are read")
            window = Window.from_slices(*zip(low.tolist(), high.tolist(), strict=True))
            wanted = {"window": window, "out_shape": tuple(shape.tolist()), "resampling": Resampling.average}
            heights = dataset.read(1, masked=True, **wanted).astype(np.float64)
            rows, columns = (high - low) / shape
            transform = dataset.window_transform(window) @ Affine.scale(columns, rows)
            unit = _metres(path, dataset.units[0])
    except RasterioError as error:
        raise ConfigurationError(f"{path}: not a raster that GDAL reads: {error}") from error
    missing = np.ma.getmaskarray(heights) | ~np.isfinite(heights.filled(np.nan))
    above, factor, note = _reference(system, reference, geoid_height)
    filled = _without_voids(path, heights.filled(0.0) * (unit or factor) + above, missing)
    return Elevation(path, system, filled, missing, transform, _resolution(system, transform, filled.shape), note)


def covered(
    path: Path, dataset: "DatasetReader", crs: Any, origin: Origin, size: tuple[float, float]
) -> tuple[Array, Array]:
    """First row and column, and those after the last, of the cells that a world covers, with ``MARGIN``."""
    from pyproj import Transformer

    x, y = (np.linspace(-side / 2, side / 2, 17) for side in size)
    border = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((17, 17))], axis=-1).reshape(-1, 3)
    latitude, longitude, _ = geodetic_from_world(border, origin).T
    east, north = Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude)
    columns, rows = ~dataset.transform @ (np.asarray(east), np.asarray(north))
    cells, shape = np.stack([rows, columns], axis=-1), np.array(dataset.shape)
    if not np.isfinite(cells).all() or (cells < 0.0).any() or (cells > shape).any():
        world = f"{size[0]:g} m x {size[1]:g} m about {origin.latitude:.6f}, {origin.longitude:.6f}"
        raise OutsideError(f"{path}: the raster does not cover the world of {world} (latitude, longitude)")
    if (block := int(np.prod(dataset.block_shapes[0]))) > MOST_CELLS:
        raise ConfigurationError(
            f"{path}: it unpacks {block:,} cells at once, at most {MOST_CELLS:,} are read; "
            "cut it into tiles first: gdal_translate -co TILED=YES"
        )
    low, high = np.floor(cells.min(axis=0)) - MARGIN, np.ceil(cells.max(axis=0)) + MARGIN
    return np.maximum(low, 0).astype(int), np.minimum(high, shape).astype(int)


def crs_of(path: Path, given: str | None, found: str | None) -> Any:
    """Coordinate reference system that is given, else that of the file; raises ConfigurationError without one."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    if given is None and found is None:
        raise ConfigurationError(f"{path}: it has no coordinate reference system; give crs, such as EPSG:32632")
    try:
        return CRS.from_user_input(given or found)
    except CRSError as error:
        raise ConfigurationError(f"{path}: unknown coordinate reference system {given or found!r}") from error


def _metres(path: Path, unit: str | None) -> float | None:
    """Metres per unit of a band, None if it states none; raises ConfigurationError for one that is no length."""
    name = (unit or "").strip().lower()
    if name and name not in METRES:
        raise ConfigurationError(f"{path}: heights in {unit!r}, an unknown unit; set it: gdal_edit.py -units m")
    return METRES.get(name)


def _reference(crs: Any, reference: Reference | None, geoid_height: float | None) -> tuple[float, float, str]:
    """Height [m] to add to heights, metres per unit of them, and a note."""
    vertical = next((each for each in crs.sub_crs_list if each.is_vertical), None)
    factor = vertical.axis_info[0].unit_conversion_factor if vertical is not None else 1.0
    known = "geoid" if vertical is not None else "ellipsoid" if len(crs.axis_info) == 3 else None
    surface, how = reference or known or "geoid", "are" if reference or known else "are assumed to be"
    if surface == "ellipsoid":
        return 0.0, factor, f"heights {how} above the ellipsoid"
    if geoid_height is None:
        return (
            0.0,
            factor,
            f"heights {how} above the geoid, which is assumed to be 0 m above the ellipsoid: give geoid_height",
        )
    return geoid_height, factor, f"heights {how} above the geoid, {geoid_height:g} m above the ellipsoid"


def metres_of_points(crs: Any) -> float:
    """Metres per unit of the heights of laser points: the vertical unit, or where none is stated the horizontal one."""
    vertical = next((each for each in crs.sub_crs_list if each.is_vertical), crs)
    return float(vertical.axis_info[0].unit_conversion_factor)


def _without_voids(path: Path, heights: Array, missing: Mask) -> Array:
    from rasterio.fill import fillnodata

    if missing.all():
        raise ConfigurationError(f"{path}: there are no heights within the world, only cells without data")
    if not missing.any():
        return heights
    base = float(heights[~missing].mean())  # single precision is for differences
    image = np.where(missing, 0.0, heights - base).astype(np.float32)
    filled = fillnodata(image, ~missing, max_search_distance=float(np.hypot(*heights.shape)))
    return np.where(missing, filled + base, heights)


def _resolution(crs: Any, transform: Any, shape: tuple[int, ...]) -> float:
    """Distance [m] between neighbouring cells in the middle of a raster, the larger one."""
    from pyproj import Geod, Transformer

    row, column = shape[0] // 2, shape[1] // 2
    east, north = transform @ (np.array([column, column + 1, column]), np.array([row, row, row + 1]))
    longitude, latitude = Transformer.from_crs(crs, 4326, always_xy=True).transform(east, north)
    _, _, distances = Geod(ellps="WGS84").inv(longitude[[0, 0]], latitude[[0, 0]], longitude[1:], latitude[1:])
    return float(np.max(distances))


def read_ground_points(
    path: Path,
    origin: Origin,
    size: tuple[float, float],
    *,
    crs: str | None = None,
    reference: Reference | None = None,
    geoid_height: float | None = None,
) -> Elevation:
    """Read the ground points (class 2) of a LAS or LAZ file, as the mean height in cells of two points on average.

    Arguments and errors are those of ``read_raster``; a file without points of the class is refused as well.
    """
    from rasterio.transform import from_origin

    reach = float(np.hypot(*size)) / 2.0 + 20.0
    points, system = _ground_points(path, crs, origin, reach)
    metres = system.axis_info[0].unit_conversion_factor  # of a foot, where the map has feet
    if len(points) < 2:
        raise ConfigurationError(f"{path}: no ground points within {reach:.0f} m of the world's centre")
    spacing = max(
        0.25 / metres, float(np.ceil(8.0 * np.sqrt(2.0 * np.prod(np.ptp(points[:, :2], axis=0)) / len(points))) / 8.0)
    )
    west, north = points[:, 0].min() - spacing / 2, points[:, 1].max() + spacing / 2
    column, row = ((points[:, 0] - west) // spacing).astype(int), ((north - points[:, 1]) // spacing).astype(int)
    shape = int(row.max()) + 1, int(column.max()) + 1
    cell, cells = row * shape[1] + column, shape[0] * shape[1]
    count = np.bincount(cell, minlength=cells).reshape(shape)
    mean = np.bincount(cell, points[:, 2], minlength=cells).reshape(shape) / np.maximum(count, 1)
    above, _, note = _reference(system, reference, geoid_height)
    filled = _without_voids(path, mean * metres_of_points(system) + above, count == 0)
    transform = from_origin(west, north, spacing, spacing)
    return Elevation(path, system, filled, count == 0, transform, _resolution(system, transform, shape), note)


def _ground_points(path: Path, crs: str | None, origin: Origin, reach: float) -> tuple[Array, Any]:
    """Ground points (n, 3) within ``reach`` [m] of the origin, in a file's coordinates, and the system of these."""
    import laspy

    chunks, grounds = [np.zeros((0, 3))], 0
    try:
        with laspy.open(path) as reader:
            if (count := reader.header.point_count) > MOST_POINTS:
                raise ConfigurationError(f"{path}: {count:,} points, more than {MOST_POINTS:,}; cut the file")
            found = reader.header.parse_crs() if crs is None else None
            system = crs_of(path, crs, found.to_wkt() if found is not None else None)
            if not system.is_projected:
                raise ConfigurationError(
                    f"{path}: {system.name} has degrees; laser points need a projected one, in metres"
                )
            middle, reach = np.array(_on_the_map(system, origin)), reach / system.axis_info[0].unit_conversion_factor
            for points in reader.chunk_iterator(2_000_000):
                ground = points[np.asarray(points.classification) == _GROUND]
                grounds += len(ground)
                xyz = np.stack([ground.x, ground.y, ground.z], axis=-1)
                chunks.append(xyz[(np.abs(xyz[:, :2] - middle) <= reach).all(axis=1)])
    except (laspy.errors.LaspyException, OSError, ValueError, RuntimeError) as error:  # the last: lazrs and pyproj
        raise ConfigurationError(
            f"{path}: not a whole LAS or LAZ file: {str(error).partition(chr(10))[0]:.160}"
        ) from error
    if not grounds:
        raise ConfigurationError(
            f"{path}: no point has the class 2, ground; classify it first, with PDAL's filters.smrf for example"
        )
    return np.concatenate(chunks), system


def _on_the_map(crs: Any, origin: Origin) -> tuple[float, float]:
    """Coordinates of a world's origin in a coordinate reference system."""
    from pyproj import Transformer

    east, north = Transformer.from_crs(4326, crs, always_xy=True).transform(origin.longitude, origin.latitude)
    return float(east), float(north)
