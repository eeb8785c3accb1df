# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A world from maps: ground, trees, paths and surfaces are where the maps have them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.classes import Label
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world, world_from_geodetic
from fieldtruth.interchange import write_scene
from fieldtruth.world.build import build_world, read_world, save_world
from fieldtruth.world.model import World

rasterio = pytest.importorskip("rasterio")
pyproj = pytest.importorskip("pyproj")
pytest.importorskip("osmium")

pytestmark = pytest.mark.usefixtures("untextured")

PLACE = Origin(47.6, 11.3, 0.0)
EAST_NORTH = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(PLACE.longitude, PLACE.latitude)
SIZE = (40.0, 30.0)
TREES = ((-12.0, 8.0, 16.0, "Picea abies"), (9.0, -7.0, 7.5, "Fagus sylvatica"), (14.0, 9.0, 22.0, "Quercus"))
PATH = ((-30.0, -4.0), (0.0, 0.0), (30.0, -4.0))
FIELD = ((5.0, 5.0), (18.0, 5.0), (18.0, 13.0), (5.0, 13.0))


def slope(east: Any, north: Any) -> Any:
    return 700.0 + 0.1 * (north - 5_273_200.0) + 0.04 * (east - 672_800.0)


def degrees(x: float, y: float) -> tuple[float, float]:
    latitude, longitude, _ = geodetic_from_world((x, y, 0.0), PLACE)
    return latitude, longitude


def raster(path: Path) -> Path:
    east, north = EAST_NORTH
    transform = rasterio.transform.from_origin(east - 60, north + 60, 1.0, 1.0)
    columns, rows = np.meshgrid(np.arange(120) + 0.5, np.arange(120) + 0.5)
    profile = {"driver": "GTiff", "dtype": "float64", "count": 1, "height": 120, "width": 120, "transform": transform}
    with rasterio.open(path, "w", crs="EPSG:32632", **profile) as dataset:
        dataset.write(slope(*(transform @ (columns, rows))), 1)
    return path


def table(path: Path) -> Path:
    rows = [f"{x},{y},{height},{species}" for x, y, height, species in TREES]
    path.write_text("\n".join(["x,y,height_m,species", *rows]))
    return path


def street_map(path: Path) -> Path:
    nodes, ways = [], []
    for name, corners, tags in (("1", PATH, {"highway": "path"}), ("2", FIELD, {"landuse": "farmland"})):
        ids = [f"{name}{k}" for k in range(len(corners))]
        for node, (x, y) in zip(ids, corners, strict=True):
            latitude, longitude = degrees(x, y)
            nodes.append(f'<node id="{node}" version="1" lat="{latitude:.9f}" lon="{longitude:.9f}"/>')
        refs = "".join(f'<nd ref="{each}"/>' for each in (ids if name == "1" else [*ids, ids[0]]))
        ways.append(
            f'<way id="{name}" version="1">{refs}'
            + "".join(f'<tag k="{k}" v="{v}"/>' for k, v in tags.items())
            + "</way>"
        )
    path.write_text(f'<osm version="0.6">{"".join(nodes)}{"".join(ways)}</osm>')
    return path


def layout(folder: Path) -> dict[str, Any]:
    return {
        "centre": [PLACE.latitude, PLACE.longitude],
        "size": list(SIZE),
        "elevation": {"file": str(raster(folder / "dem.tif")), "reference": "ellipsoid"},
        "trees": {"file": str(table(folder / "trees.csv")), "crs": "world"},
        "map": {"file": str(street_map(folder / "area.osm"))},
        "individuals": 1,
        "litter": 0,
        "beyond": False,
    }


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> World:
    return build_world("site", 0, layout(tmp_path_factory.mktemp("maps")))


def test_the_ground_is_that_of_the_raster_but_for_its_microrelief(world: World) -> None:
    x, y = np.meshgrid(np.linspace(-18, 18, 37), np.linspace(-13, 13, 27), indexing="ij")
    z = world.terrain.field.height_at(x, y)
    latitude, longitude, height = geodetic_from_world(np.stack([x, y, z], -1), world.origin).reshape(-1, 3).T
    east, north = pyproj.Transformer.from_crs(4326, 32632, always_xy=True).transform(longitude, latitude)
    away = height - slope(east, north)
    assert abs(away.mean()) < 0.005
    assert 0.0005 < away.std() < 0.03  # waves shorter than two cells of the raster only


def test_trees_stand_where_the_inventory_has_them(world: World) -> None:
    kinds = {"Picea abies": "spruce", "Fagus sylvatica": "beech", "Quercus": "oak"}
    for x, y, height, species in TREES:
        near = [i for i in world.instances if np.hypot(*(i.world_from_object[:2, 3] - (x, y))) < 0.01]
        assert [each.kind for each in near] == [kinds[species]]
        mesh, pose = world.meshes[near[0].mesh], near[0].world_from_object
        top = (mesh.vertices.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3])[:, 2].max()
        assert top - world.terrain.field.height_at(x, y) == pytest.approx(height, abs=0.4)


def test_the_path_of_the_map_is_a_trail(world: World) -> None:
    along = np.linspace(-18, 18, 30)
    across = np.interp(along, *np.array(PATH).T)
    assert (world.terrain.label_at(along, across) == Label.TRAIL).mean() > 0.9
    assert (world.terrain.label_at(along, across + 4.0) == Label.GROUND).all()


def test_an_area_of_the_map_has_its_surface(world: World) -> None:
    soil = world.terrain.ground_materials.index("soil")
    inside, outside = world.terrain.cover.at(6.5, 10.0)[soil], world.terrain.cover.at(-12.0, -10.0)[soil]
    assert inside > 0.3 > outside


def test_the_origin_is_on_the_ellipsoid_above_the_place_and_is_stored(world: World, tmp_path: Path) -> None:
    assert world.origin[:2] == (PLACE.latitude, PLACE.longitude)
    assert world.origin.height == pytest.approx(slope(*EAST_NORTH), abs=0.2)
    save_world(tmp_path / "world.npz", world)
    assert read_world(tmp_path / "world.npz").origin == world.origin
    position = np.array([12.0, -7.0, 3.0])
    latitude, longitude, height = geodetic_from_world(position, world.origin)
    x, y, z = pyproj.Transformer.from_crs(4979, 4978, always_xy=True).transform(longitude, latitude, height)
    start = pyproj.Transformer.from_crs(4979, 4978, always_xy=True).transform(*np.array(world.origin)[[1, 0, 2]])
    assert np.linalg.norm(np.array([x, y, z]) - start) == pytest.approx(np.linalg.norm(position), abs=1e-3)
    assert world_from_geodetic((latitude, longitude, height), world.origin) == pytest.approx(position, abs=1e-6)


def test_the_inventory_has_the_trees_at_their_places_on_the_earth(world: World, tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    write_scene(world, tmp_path / "trees", to="inventory")
    meta, _, points, _ = pyogrio.raw.read(tmp_path / "trees/inventory.gpkg", layer="inventory")
    assert meta["crs"] == "EPSG:4326"
    longitude, latitude = np.array([np.frombuffer(point, "<f8", offset=5) for point in points])[:, :2].T
    near = f"+lat_0={world.origin.latitude} +lon_0={world.origin.longitude} +h_0={world.origin.height}"
    steps = f"+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 {near}"
    to_plane = pyproj.Transformer.from_pipeline(steps)
    heights = world.origin.height + world.terrain.field.height_at(*np.array(TREES, dtype=object)[:, :2].astype(float).T)
    for (x, y, *_), height in zip(TREES, heights, strict=True):
        east, north, _ = to_plane.transform(longitude, latitude, np.full(len(longitude), height))
        assert np.hypot(north - x, -east - y).min() < 1e-3


@pytest.mark.parametrize(
    ("key", "file", "text"),
    [
        ("elevation", "none.tif", r"layout: elevation\.file: no such file: .*none\.tif"),
        ("trees", "none.csv", r"layout: trees\.file: no such file: .*none\.csv"),
        ("map", "", r"layout: map\.file: a folder: "),
    ],
)
def test_a_missing_file_is_one_line(tmp_path: Path, key: str, file: str, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        build_world("site", 0, layout(tmp_path) | {key: {"file": str(tmp_path / file)}})
