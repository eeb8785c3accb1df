# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rasters of classes and aerial pictures, at the nodes of a world's grid.

A picture is read at about the grid's resolution, so that one of centimetres does not fill the memory.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

from fieldtruth.core.arrays import Array, Float32Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.maps.elevation import MOST_CELLS, covered, crs_of

_LATTICE: Final = 16.0
"""Distance [m] between the positions that are converted; between them a spline is exact to a micrometre."""


def read_classes(
    path: Path, origin: Origin, size: tuple[float, float], nodes: tuple[Array, Array], *, crs: str | None = None
) -> NDArray[np.int64]:
    """Read the class (nx, ny) at the nodes x (nx,), y (ny,) [m] of a raster's first band; -1 where it has no data.

    Other arguments and errors are those of ``read_raster``.
    """
    image, missing, (row, column) = _read(path, origin, size, nodes, crs, bands=1, average=False)
    i, j = (np.clip(np.floor(c).astype(int), 0, n - 1) for c, n in zip((row, column), image.shape[1:], strict=True))
    return np.where(missing[i, j], -1, np.rint(image[0, i, j]).astype(np.int64))


def read_colours(
    path: Path, origin: Origin, size: tuple[float, float], nodes: tuple[Array, Array], *, crs: str | None = None
) -> Float32Array:
    """Read linear colours (nx, ny, 3) at the nodes x (nx,), y (ny,) [m] of a picture of three bands in sRGB.

    Where it has no data, it has its mean colour. Other arguments and errors are those of ``read_raster``.
    """
    image, missing, (row, column) = _read(path, origin, size, nodes, crs, bands=3, average=True)
    if missing.all():
        raise ConfigurationError(f"{path}: the picture has no data within the world")
    share = image.astype(np.float32) / (np.iinfo(image.dtype).max if image.dtype.kind in "iu" else 1.0)
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    linear[:, missing] = linear[:, ~missing].mean(axis=1, keepdims=True)
    i, j = (np.clip(np.floor(c).astype(int), 0, n - 1) for c, n in zip((row, column), image.shape[1:], strict=True))
    return np.asarray(np.moveaxis(linear[:, i, j], 0, -1), np.float32)


def _read(
    path: Path,
    origin: Origin,
    size: tuple[float, float],
    nodes: tuple[Array, Array],
    crs: str | None,
    *,
    bands: int,
    average: bool,
) -> tuple[NDArray[Any], NDArray[np.bool_], tuple[Array, Array]]:
    """Cells (bands, rows, columns) that a world covers, those without data, and row and column (nx, ny) of nodes."""
    import rasterio
    from rasterio.enums import Resampling
    from rasterio.errors import RasterioError
    from rasterio.windows import Window

    try:
        with rasterio.open(path) as dataset:
            if dataset.count < bands:
                raise ConfigurationError(f"{path}: has {dataset.count} bands; a picture has three, red, green and blue")
            system = crs_of(path, crs, dataset.crs.to_wkt() if dataset.crs else None)
            low, high = covered(path, dataset, system, origin, size)
            shape = high - low
            if average:  # not finer than the nodes
                shape = np.maximum(1, np.minimum(shape, [2 * len(axis) for axis in nodes]))
            if (cells := int(np.prod(shape))) > MOST_CELLS:
                raise ConfigurationError(f"{path}: the world covers {cells:,} cells; at most {MOST_CELLS:,} are read")
            window = Window.from_slices(*zip(low.tolist(), high.tolist(), strict=True))
            how = Resampling.average if average else Resampling.nearest
            wanted = {"window": window, "out_shape": (bands, *shape.tolist()), "resampling": how}
            image = dataset.read(list(range(1, bands + 1)), masked=True, **wanted)
            transform = dataset.transform
    except RasterioError as error:
        raise ConfigurationError(f"{path}: not a raster that GDAL reads: {error}") from error
    rows, columns = _cells(nodes, origin, system, transform)
    scale = shape / (high - low)
    missing = np.asarray(np.ma.getmaskarray(image).any(axis=0), np.bool_)
    return np.ma.getdata(image), missing, ((rows - low[0]) * scale[0], (columns - low[1]) * scale[1])


def _cells(nodes: tuple[Array, Array], origin: Origin, crs: Any, transform: Any) -> tuple[Array, Array]:
    """Row and column (nx, ny) of nodes, whole numbers at corners of cells."""
    from pyproj import Transformer

    lattice = [np.linspace(axis[0], axis[-1], max(4, int(np.ptp(axis) / _LATTICE) + 2)) for axis in nodes]
    points = np.stack([*np.meshgrid(*lattice, indexing="ij"), np.zeros([len(axis) for axis in lattice])], axis=-1)
    latitude, longitude, _ = np.moveaxis(geodetic_from_world(points, origin), -1, 0)
    east, north = Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude)
    columns, rows = ~transform @ (np.asarray(east), np.asarray(north))
    row, column = (RectBivariateSpline(lattice[0], lattice[1], each)(*nodes) for each in (rows, columns))
    return row, column
