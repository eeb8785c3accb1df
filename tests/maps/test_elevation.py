# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Elevation from rasters and laser points: heights at the data, no steps, voids, references, refusals."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic

rasterio = pytest.importorskip("rasterio")
pyproj = pytest.importorskip("pyproj")
laspy = pytest.importorskip("laspy")

from fieldtruth.maps.elevation import read_ground_points, read_raster  # noqa: E402

PLACE = Origin(47.6, 11.3, 0.0)
UTM = "EPSG:32632"


def hills(east: Any, north: Any) -> Any:
    """Height [m] of a closed form, 600 m above the ellipsoid."""
    return 600.0 + 9.0 * np.sin(east / 23.0) * np.cos(north / 31.0) + 0.02 * (north - 5_273_000.0)


def written(path: Path, *, crs: str | None = UTM, cell: float = 1.0, side: int = 240, **others: Any) -> Path:
    """A raster of ``hills`` about the place, its cells in a coordinate reference system."""
    to = pyproj.Transformer.from_crs(4326, crs or UTM, always_xy=True)
    east, north = to.transform(PLACE.longitude, PLACE.latitude)
    transform = rasterio.transform.from_origin(east - side * cell / 2, north + side * cell / 2, cell, cell)
    columns, rows = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    x, y = transform @ (columns, rows)
    back = pyproj.Transformer.from_crs(crs or UTM, UTM, always_xy=True)
    values = others.pop("change", lambda h: h)(hills(*back.transform(x, y)))
    profile = {"driver": "GTiff", "dtype": "float64", "count": 1, "height": side, "width": side, "transform": transform}
    profile |= others
    with rasterio.open(path, "w", crs=crs, **profile) as dataset:
        dataset.write(values.astype(profile["dtype"]), 1)
    return path


@pytest.mark.parametrize(("crs", "cell"), [(UTM, 1.0), ("EPSG:4326", 1e-5), ("EPSG:3857", 1.3)])
def test_heights_at_the_data_are_those_of_the_file(tmp_path: Path, crs: str, cell: float) -> None:
    surface = read_raster(written(tmp_path / "dem.tif", crs=crs, cell=cell), PLACE, (80.0, 60.0), reference="ellipsoid")
    origin = PLACE._replace(height=600.0)
    x, y = np.linspace(-40, 40, 161), np.linspace(-30, 30, 121)
    z = surface.at(x, y, origin)
    latitude, longitude, height = (
        geodetic_from_world(np.stack([*np.meshgrid(x, y, indexing="ij"), z], -1), origin).reshape(-1, 3).T
    )
    east, north = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform(longitude, latitude)
    assert np.abs(height - hills(east, north)).max() < 0.01  # the closed form between the cells, the spline's error
    assert surface.note == "heights are above the ellipsoid"


def test_heights_in_the_middle_of_cells_are_exact(tmp_path: Path) -> None:
    noise = np.random.default_rng(0)
    path = written(tmp_path / "dem.tif", change=lambda h: h + noise.normal(0.0, 1.0, h.shape))
    surface = read_raster(path, PLACE, (80.0, 60.0), reference="ellipsoid")
    origin = PLACE._replace(height=600.0)
    rows, columns = np.array([70, 64, 81]), np.array([50, 64, 47])
    east, north = surface.transform @ (columns + 0.5, rows + 0.5)
    longitude, latitude = pyproj.Transformer.from_crs(UTM, 4326, always_xy=True).transform(east, north)
    heights = surface.heights[rows, columns]
    for place, height in zip(
        world_from_geodetic(np.stack([latitude, longitude, heights], -1), origin), heights, strict=True
    ):
        x, y = place[0] + np.array([-0.5, 0.0, 0.5, 1.0]), place[1] + np.array([-0.5, 0.0, 0.5, 1.0])
        assert surface.at(x, y, origin)[1, 1] == pytest.approx(place[2], abs=1e-4), height


def test_the_slope_has_no_steps(tmp_path: Path) -> None:
    noise = np.random.default_rng(0)
    path = written(tmp_path / "dem.tif", cell=2.0, change=lambda h: h + noise.normal(0.0, 0.5, h.shape))
    surface = read_raster(path, PLACE, (40.0, 40.0), reference="ellipsoid")
    for step in (0.1, 0.05):
        x = np.arange(-15.0, 15.0, step)
        bend = (
            np.abs(np.diff(surface.at(x, np.arange(0.0, 0.4, 0.1), PLACE._replace(height=600.0)), 2, axis=0)).max()
            / step
        )
        assert bend < 3.0 * step  # of a continuous slope it goes to 0 with the step; of a step in it, it does not


def test_voids_are_filled_and_counted(tmp_path: Path) -> None:
    def holed(h: Any) -> Any:
        h[115:120, 110:130] = -9999.0
        h[125, 122] = np.nan
        return h

    surface = read_raster(written(tmp_path / "dem.tif", change=holed, nodata=-9999.0), PLACE, (60.0, 60.0))
    assert surface.filled.sum() == 101
    assert np.isfinite(surface.heights).all()
    rows, columns = np.nonzero(surface.filled)
    true = hills(*(surface.transform @ (columns + 0.5, rows + 0.5)))
    assert np.abs(surface.heights[surface.filled] - true).max() < 1.0
    assert "assumed to be 0 m above the ellipsoid: give geoid_height" in surface.note


def test_a_geoid_raises_the_heights(tmp_path: Path) -> None:
    path = written(tmp_path / "dem.tif", crs="EPSG:32632+5773")
    low = read_raster(path, PLACE, (60.0, 60.0), reference="ellipsoid")
    high = read_raster(path, PLACE, (60.0, 60.0), geoid_height=46.5)
    assert np.allclose(high.heights - low.heights, 46.5)
    assert high.note == "heights are above the geoid, 46.5 m above the ellipsoid"


@pytest.mark.parametrize(
    ("changes", "size", "text"),
    [
        ({"crs": None}, (60.0, 60.0), "no coordinate reference system; give crs, such as EPSG:32632"),
        ({}, (600.0, 60.0), r"does not cover the world of 600 m x 60 m about 47.600000, 11.300000"),
        ({"change": lambda h: np.full_like(h, np.nan)}, (60.0, 60.0), "no heights within the world"),
    ],
)
def test_unusable_rasters_are_one_line(tmp_path: Path, changes: dict[str, Any], size: Any, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        read_raster(written(tmp_path / "dem.tif", **changes), PLACE, size)


@pytest.mark.parametrize(
    ("unit", "metres"), [("feet", 0.3048), ("cm", 0.01), ("US survey foot", 1200 / 3937), ("Meter", 1.0)]
)
def test_heights_are_in_the_unit_of_the_band(tmp_path: Path, unit: str, metres: float) -> None:
    path = written(tmp_path / "dem.tif", change=lambda h: h / metres)
    with rasterio.open(path, "r+") as dataset:
        dataset.units = [unit]
    found = read_raster(path, PLACE, (60.0, 60.0))
    assert np.abs(found.heights - read_raster(written(tmp_path / "m.tif"), PLACE, (60.0, 60.0)).heights).max() < 1e-9


def test_an_unknown_unit_and_a_raster_without_bands_are_one_line(tmp_path: Path) -> None:
    path = written(tmp_path / "dem.tif")
    with rasterio.open(path, "r+") as dataset:
        dataset.units = ["degC"]
    with pytest.raises(ConfigurationError, match=r"dem\.tif: heights in 'degC', an unknown unit"):
        read_raster(path, PLACE, (60.0, 60.0))
    for part in ("heights", "slopes"):
        written(tmp_path / "a.gpkg", driver="GPKG", dtype="float32", raster_table=part, append_subdataset="YES")
    with pytest.raises(ConfigurationError, match=r"a\.gpkg: has no bands of its own"):
        read_raster(tmp_path / "a.gpkg", PLACE, (60.0, 60.0), crs=UTM)


def test_of_fine_cells_the_mean_is_read_where_coarse_ones_do(tmp_path: Path) -> None:
    def plane(heights: Any) -> Any:
        rows, columns = np.mgrid[: len(heights), : len(heights)]
        return 600.0 + 0.3 * rows - 0.2 * columns

    path = written(tmp_path / "dem.tif", change=plane)
    whole = read_raster(path, PLACE, (80.0, 60.0), reference="ellipsoid")
    coarse = read_raster(path, PLACE, (80.0, 60.0), reference="ellipsoid", spacing=10.0)
    assert coarse.heights.size < whole.heights.size / 50
    assert coarse.resolution == pytest.approx(10.0, rel=0.2)
    axes, origin = (np.linspace(-20.0, 20.0, 9), np.linspace(-15.0, 15.0, 7)), PLACE._replace(height=600.0)
    assert np.abs(coarse.at(*axes, origin) - whole.at(*axes, origin)).max() < 0.2


def test_what_is_no_raster_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "dem.tif").write_text("heights")
    with pytest.raises(ConfigurationError, match="not a raster that GDAL reads"):
        read_raster(tmp_path / "dem.tif", PLACE, (60.0, 60.0))


def scanned(path: Path, classes: int = 2, crs: str = UTM, unit: float = 1.0) -> Path:
    rng = np.random.default_rng(1)
    east, north = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform(PLACE.longitude, PLACE.latitude)
    xy = rng.uniform(-60.0, 60.0, (120_000, 2)) + np.array([east, north])
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = (*xy.min(axis=0) / unit, 0.0), (0.001, 0.001, 0.001)
    header.add_crs(pyproj.CRS(crs))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y = xy.T / unit
    tall = rng.random(len(xy)) < 0.4
    above = np.where(tall, rng.uniform(1.0, 20.0, len(xy)), rng.normal(0.0, 0.02, len(xy)))
    cloud.z = (hills(*xy.T) + above) / unit
    cloud.classification = np.where(tall, 5, classes)
    cloud.write(path)
    return path


@pytest.mark.parametrize(("crs", "unit"), [(UTM, 1.0), ("+proj=utm +zone=32 +units=us-ft", 1200 / 3937)])
def test_ground_points_of_a_laser_scan_give_the_ground(tmp_path: Path, crs: str, unit: float) -> None:
    path = scanned(tmp_path / "als.laz", crs=crs, unit=unit)
    surface = read_ground_points(path, PLACE, (80.0, 60.0), reference="ellipsoid")
    origin = PLACE._replace(height=600.0)
    x, y = np.linspace(-40, 40, 81), np.linspace(-30, 30, 61)
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), surface.at(x, y, origin)], -1)
    latitude, longitude, height = geodetic_from_world(points, origin).reshape(-1, 3).T
    east, north = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform(longitude, latitude)
    assert np.abs(height - hills(east, north)).std() < 0.04
    with pytest.raises(ConfigurationError, match="no point has the class 2, ground"):
        read_ground_points(scanned(tmp_path / "raw.laz", classes=1), PLACE, (80.0, 60.0))


@pytest.mark.parametrize(
    "damage", [lambda data: data[: len(data) * 2 // 3], lambda data: data.replace(b"PROJCRS", b"PROJ\nRS")]
)
def test_a_damaged_scan_is_one_line(tmp_path: Path, damage: Callable[[bytes], bytes]) -> None:
    path = scanned(tmp_path / "als.laz")
    whole = path.read_bytes()
    path.write_bytes(damaged := damage(whole))
    assert damaged != whole
    with pytest.raises(ConfigurationError, match=r"als\.laz: not a whole LAS or LAZ file: [^\n]+$"):
        read_ground_points(path, PLACE, (80.0, 60.0))
