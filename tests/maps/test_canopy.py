# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Heights of a canopy from rasters and laser points, and the trees found in them at their places."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.maps.trees import Tree, find_trees

rasterio = pytest.importorskip("rasterio")
pyproj = pytest.importorskip("pyproj")
laspy = pytest.importorskip("laspy")

from fieldtruth.maps.canopy import Canopy, read_canopy, read_canopy_points  # noqa: E402
from fieldtruth.maps.elevation import read_raster  # noqa: E402

PLACE = Origin(47.6, 11.3, 600.0)
UTM = "EPSG:32632"
SIZE = (90.0, 70.0)
TREES = np.array([(0.0, 0.0, 24.0, 4.0), (20.0, -15.0, 12.0, 2.0), (-30.0, 22.0, 30.0, 5.5), (-25.0, -20.0, 8.0, 1.7)])
"""x, y, height, crown's radius [m] of paraboloids in the world frame."""


def above(x: Any, y: Any) -> Any:
    """Height [m] of the canopy above the ground."""
    h = np.zeros(np.broadcast(x, y).shape)
    for tree_x, tree_y, height, radius in TREES:
        r = np.hypot(x - tree_x, y - tree_y) / radius
        h = np.maximum(h, np.where(r <= 1.0, height * (1.0 - 0.6 * r * r), 0.0))
    return h


def ground(x: Any, y: Any) -> Any:
    return 12.0 * np.sin(x / 40.0) + 0.2 * y


def world(crs: str, east: Any, north: Any) -> Any:
    """World x and y [m] of coordinates at the origin's height."""
    longitude, latitude = pyproj.Transformer.from_crs(crs, 4326, always_xy=True).transform(east, north)
    places = world_from_geodetic(np.stack([latitude, longitude, np.full_like(latitude, PLACE.height)], -1), PLACE)
    return places[..., 0], places[..., 1]


def written(path: Path, value: Any, *, crs: str = UTM, cell: float = 0.5, side: int = 300) -> Path:
    """A raster of a function of the world's x and y, its cells in a coordinate reference system."""
    east, north = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(PLACE.longitude, PLACE.latitude)
    transform = rasterio.transform.from_origin(east - side * cell / 2, north + side * cell / 2, cell, cell)
    columns, rows = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    profile = {"driver": "GTiff", "dtype": "float64", "count": 1, "height": side, "width": side, "transform": transform}
    with rasterio.open(path, "w", crs=crs, nodata=-9999.0, **profile) as dataset:
        dataset.write(value(*world(crs, *(transform @ (columns, rows)))), 1)
    return path


def assert_the_trees(found: list[Tree], position: float, height: float, radius: float) -> None:
    """The trees found are those known, each within some metres, and a share of the crown's radius."""
    assert len(found) == len(TREES)
    for x, y, h, r in TREES:
        tree = min(found, key=lambda each: np.hypot(each.x - x, each.y - y))
        assert np.hypot(tree.x - x, tree.y - y) < position
        assert tree.height == pytest.approx(h, abs=height)
        assert tree.crown_radius == pytest.approx(r, rel=radius)


@pytest.mark.parametrize(("crs", "cell"), [(UTM, 0.5), ("EPSG:4326", 5e-6), ("EPSG:3857", 0.7)])
def test_trees_of_a_canopy_raster_are_at_their_places(tmp_path: Path, crs: str, cell: float) -> None:
    canopy = read_canopy(written(tmp_path / "chm.tif", above, crs=crs, cell=cell), PLACE, SIZE)
    assert_the_trees(find_trees(canopy), 0.4, 0.4, 0.08)
    rows, columns = np.array([40, 100, 60]), np.array([70, 20, 110])
    x, y = canopy.world_from_cell @ np.stack([rows, columns, np.ones(3)])
    assert canopy.heights[rows, columns] == pytest.approx(above(x, y), abs=0.01)
    assert canopy.missing == 0


def test_fine_rasters_are_reduced_to_the_highest_of_a_block(tmp_path: Path) -> None:
    canopy = read_canopy(written(tmp_path / "chm.tif", above, cell=0.1, side=1200), PLACE, SIZE)
    assert np.sqrt(canopy.cell_area) == pytest.approx(0.3, rel=1e-3)
    assert_the_trees(find_trees(canopy), 0.3, 0.1, 0.08)


def test_cells_without_data_are_bare_and_counted(tmp_path: Path) -> None:
    path = written(tmp_path / "chm.tif", lambda x, y: np.where(np.hypot(x, y) < 5.0, -9999.0, above(x, y)))
    canopy = read_canopy(path, PLACE, SIZE)
    assert canopy.missing == pytest.approx(np.pi * 25.0 / 0.25, rel=0.05)
    assert len(find_trees(canopy)) == len(TREES) - 1


def test_a_surface_is_lowered_by_its_ground(tmp_path: Path) -> None:
    surface = written(tmp_path / "dsm.tif", lambda x, y: 600.0 + ground(x, y) + above(x, y))
    with pytest.raises(ConfigurationError, match=r"dsm.tif: heights of 6\d\d m are above the sea, not the ground"):
        read_canopy(surface, PLACE, SIZE)
    bare = written(tmp_path / "dem.tif", lambda x, y: 600.0 + ground(x, y), crs="EPSG:3857", cell=1.5, side=150)
    below = read_raster(bare, PLACE, (130.0, 110.0), reference="ellipsoid")
    assert_the_trees(find_trees(read_canopy(surface, PLACE, SIZE, ground=below)), 0.4, 0.4, 0.08)
    high = read_raster(bare, PLACE, (130.0, 110.0), reference="geoid", geoid_height=46.0)
    with pytest.raises(ConfigurationError, match=r"it is 4\d m below the ground; give the geoid_height of both"):
        read_canopy(surface, PLACE, SIZE, ground=high)


def scanned(path: Path, density: float, passing: float) -> Path:
    """Pulses [1/m²] over the world and beyond; a share of them passes the foliage, to the ground or part of the way."""
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-60.0, 60.0, (2, int(density * 120.0**2)))
    top = above(x, y)
    deep = rng.random(len(x)) < passing
    height = np.where(deep, top * rng.random(len(x)), top) + rng.normal(0.0, 0.03, len(x))
    bare = rng.uniform(-60.0, 60.0, (2, 30_000))
    x, y, height = (np.concatenate(pair) for pair in ((x, bare[0]), (y, bare[1]), (height, np.zeros(30_000))))
    places = geodetic_from_world(np.stack([x, y, ground(x, y) + height], -1), PLACE)
    east, north = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform(places[:, 1], places[:, 0])
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = (east.min(), north.min(), 0.0), (0.001, 0.001, 0.001)
    header.add_crs(pyproj.CRS(UTM))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = east, north, places[:, 2]
    last = np.arange(len(x)) >= len(x) - 30_000
    cloud.return_number, cloud.classification = np.where(last, 2, 1), np.where(last, 2, 5)
    cloud.write(path)
    return path


@pytest.mark.parametrize(
    ("density", "passing", "cell", "error"), [(20.0, 0.0, 0.25, 0.3), (20.0, 0.15, 0.25, 0.45), (5.0, 0.15, 0.5, 0.9)]
)
def test_trees_of_a_laser_scan_are_at_their_places(
    tmp_path: Path, density: float, passing: float, cell: float, error: float
) -> None:
    canopy = read_canopy_points(scanned(tmp_path / "als.laz", density, passing), PLACE, SIZE)
    assert np.sqrt(canopy.cell_area) == pytest.approx(cell, rel=1e-3)
    assert canopy.missing == 0
    assert_the_trees(find_trees(canopy), 0.7, 0.5, 0.12)
    assert depth(canopy) < error  # 3.2 m and 3.6 m with pits


def depth(canopy: Canopy) -> float:
    """Root mean square [m] of how far the canopy is from the true one, within crowns."""
    rows, columns = np.meshgrid(*map(range, canopy.heights.shape), indexing="ij")
    x, y = np.tensordot(canopy.world_from_cell, np.stack([rows, columns, np.ones(rows.shape)]), 1)
    within = np.any([np.hypot(x - t[0], y - t[1]) < 0.7 * t[3] for t in TREES], axis=0)
    return float(np.sqrt(np.mean((canopy.heights - above(x, y))[within] ** 2)))


def test_a_scan_elsewhere_is_one_line(tmp_path: Path) -> None:
    path = scanned(tmp_path / "als.laz", 1.0, 0.0)
    with pytest.raises(ConfigurationError, match=r"als.laz: (no ground points|the scan has no returns) within"):
        read_canopy_points(path, PLACE._replace(latitude=47.7), SIZE)
