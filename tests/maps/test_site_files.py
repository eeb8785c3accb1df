# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""A site's file that cannot be used: one line that names the file, exit code 2, and nothing half-made."""

import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import fieldtruth
from fieldtruth import cli
from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin
from fieldtruth.core.readings import Fix
from fieldtruth.experiment.files import with_overrides
from fieldtruth.maps.elevation import read_raster
from fieldtruth.validation.runner import validate
from fieldtruth.world.objects.files import with_named

rasterio = pytest.importorskip("rasterio")
laspy = pytest.importorskip("laspy")
pyproj = pytest.importorskip("pyproj")

CENTRE = (-33.45, -70.65)  # south of the equator and west of Greenwich
UTM = "EPSG:32719"
SIZE = (30.0, 24.0)
EAST, NORTH = pyproj.Transformer.from_crs(4326, UTM, always_xy=True).transform(*CENTRE[::-1])


def raster(path: Path, *, side: int = 100, cell: float = 1.0, crs: str | None = UTM, **profile: Any) -> Path:
    """A raster about the centre, of 0 m; without ``write=False`` its cells are stored."""
    write = profile.pop("write", True)
    transform = rasterio.transform.from_origin(EAST - side * cell / 2, NORTH + side * cell / 2, cell, cell)
    profile = {"driver": "GTiff", "dtype": "float32", "count": 1, "height": side, "width": side} | profile
    with rasterio.open(path, "w", crs=crs, transform=transform, **profile) as dataset:
        if write:
            dataset.write(np.full((side, side), 560.0, np.float32), 1)
    return path


def laser(path: Path) -> Path:
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets, header.scales = (EAST, NORTH, 0.0), (0.01, 0.01, 0.01)
    header.add_crs(pyproj.CRS(UTM))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = EAST + np.arange(9.0), NORTH + np.arange(9.0), np.zeros(9)
    cloud.write(path)
    return path


def text(content: str) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        path.write_text(content)
        return path

    return write


CITY = '<osm version="0.6"><node id="1" version="1" lat="-33.45" lon="-70.65"/></osm>'


@pytest.mark.parametrize(
    ("key", "name", "make", "words"),
    [
        ("elevation", "no_crs.tif", lambda path: raster(path, crs=None), "no coordinate reference system; give crs"),
        ("elevation", "far.tif", lambda path: raster(path, side=20), "does not cover the world of 30 m x 24 m"),
        ("elevation", "dem.tif", text("heights"), "not a raster that GDAL reads"),
        ("elevation", "gone.tif", None, "elevation.file: no such file"),
        ("elevation", "raw.laz", laser, "no point has the class 2, ground"),
        ("elevation", "torn.laz", text("LASF"), "not a whole LAS or LAZ file"),
        ("trees", "sea.csv", text("lon,lat,height_m\n-20.0,-40.0,12\n"), "none of its 1 trees is within the world"),
        ("trees", "giant.csv", text("lon,lat,height_m\n-70.65,-33.45,900\n"), "trees have at most 130 m"),
        ("trees", "raw.laz", laser, "no point has the class 2, ground"),
        ("map", "city.osm", text(CITY), "at most 0 are read; cut it first: osmium extract"),
        ("map", "page.osm", text("<html>"), "not a file of OpenStreetMap"),
        ("map", "map.shp", text(""), "must be OpenStreetMap's XML"),
    ],
)
def test_a_map_that_cannot_be_used_is_one_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    key: str,
    name: str,
    make: Callable[[Path], Path] | None,
    words: str,
) -> None:
    folder, cache = tmp_path / "maps", tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.chdir(folder)
    if name == "city.osm":
        monkeypatch.setattr("fieldtruth.maps.osm.MOST_BYTES", 60)
    if make is not None:
        make(folder / name)
    (folder / "site.yaml").write_text(yaml.safe_dump({"centre": CENTRE, "size": SIZE, key: {"file": name}}))
    before = sorted(folder.iterdir())
    assert cli.main(["world", "site.yaml"]) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if ": done in" not in line]
    assert len(error) == 1
    assert error[0].startswith("error: ")
    assert name in error[0]
    assert words in error[0]
    assert sorted(folder.iterdir()) == before
    assert not list(cache.rglob("*.npz*"))
    with pytest.raises(ConfigurationError, match=name):
        fieldtruth.build_site("site.yaml")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"elevation": {"file": "dem.tif", "refrence": "geoid"}},
            "site.yaml: unknown key 'elevation.refrence'; did",
        ),
        ({"elevation": "dem.tif"}, "site.yaml: elevation must be "),
        ({"surface": "asphalt"}, "site.yaml: surface must be "),
        ({"centre": [95.0, 0.0]}, "site.yaml: centre[0] must be "),
        ({"species": {"oka": 1}}, "site.yaml: species: unknown species 'oka'; did you mean 'oak'"),
    ],
)
def test_a_wrong_key_of_a_site_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, changes: Any, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    raster(tmp_path / "dem.tif")
    (tmp_path / "site.yaml").write_text(yaml.safe_dump({"centre": CENTRE, "size": SIZE} | changes))
    for command in (["world", "site.yaml"], ["scene", "site.yaml", "--to", "gltf", "--out", "a.glb"]):
        assert cli.main(command) == 2
        (line,) = [line for line in capsys.readouterr().err.splitlines() if ": done in" not in line]
        assert words in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dem.tif", "site.yaml"]


def test_of_a_large_tile_only_the_window_is_read(tmp_path: Path) -> None:
    tile: dict[str, Any] = {"tiled": True, "blockxsize": 256, "blockysize": 256, "sparse_ok": True, "write": False}
    path = raster(tmp_path / "tile.tif", side=40_000, compress="deflate", **tile)
    with rasterio.open(path, "r+") as dataset:
        dataset.write(np.full((256, 256), 560.0, np.float32), 1, window=((19_968, 20_224), (19_968, 20_224)))
    peak, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    surface = read_raster(path, Origin(*CENTRE, 0.0), SIZE, reference="ellipsoid")
    assert surface.heights.shape < (60, 60)
    assert np.abs(surface.heights - 560.0).max() < 1e-6
    assert time.process_time() - start < 2.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 100_000  # [kB]; the tile has 6.4 GB


def test_a_raster_that_unpacks_at_once_is_refused(tmp_path: Path) -> None:
    tile: dict[str, Any] = {
        "tiled": True,
        "blockxsize": 16_384,
        "blockysize": 16_384,
        "sparse_ok": True,
        "dtype": "uint8",
    }
    path = raster(tmp_path / "bomb.tif", side=16_384, compress="deflate", write=False, **tile)
    assert path.stat().st_size < 10_000
    with pytest.raises(ConfigurationError, match=r"bomb\.tif: it unpacks 268,435,456 cells at once"):
        read_raster(path, Origin(*CENTRE, 0.0), SIZE)


def test_a_missing_library_is_named_with_its_extra(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.osm").write_text(CITY)
    (tmp_path / "site.yaml").write_text(yaml.safe_dump({"centre": CENTRE, "size": SIZE, "map": {"file": "a.osm"}}))
    monkeypatch.setitem(sys.modules, "osmium", None)
    assert cli.main(["world", "site.yaml"]) == 2
    assert "error: the library osmium is not installed; run: pip install 'fieldtruth[maps]'" in capsys.readouterr().err


@pytest.mark.slow
def test_fixes_of_a_site_are_those_of_the_map(tmp_path: Path) -> None:
    """Positions of the robot in degrees, against PROJ by way of the earth's centre, within 1 mm."""
    raster(tmp_path / "dem.tif")
    layout = {
        "size": SIZE,
        "elevation": {"file": "dem.tif", "reference": "ellipsoid"},
        "grass_per_m2": 0.0,
        "grid": 0.2,
    }
    (tmp_path / "quinta.yaml").write_text(
        yaml.safe_dump({"centre": CENTRE, "litter": 0, "beyond": False, "individuals": 1, **layout})
    )
    route = {"start": [-33.45008, -70.65], "waypoints": [[-33.44998, -70.65002]]}
    values = {"name": "q", "environment": str(tmp_path / "quinta.yaml"), "seconds": 1.0, "route": route}
    experiment = with_overrides(fieldtruth.Experiment.model_validate(values), cameras=False, lidar=False)
    bag = fieldtruth.generate(experiment, tmp_path / "data")
    to_earth = pyproj.Transformer.from_crs(4979, 4978, always_xy=True)
    earth_from_world = fieldtruth.bag.static_transforms(bag)["earth", "world"]
    run = fieldtruth.open_run(bag)
    antenna, poses = run.rig.first(Fix).mount.xyz, run.trajectory
    at = {stamp: row for row, stamp in enumerate(poses.stamps_ns.tolist())}
    fixes = [each for each in fieldtruth.read_bag(bag, ["/navsat/fix"]) if each.stamp_ns in at]
    assert len(fixes) >= 2
    for fix in fixes:
        row = at[fix.stamp_ns]
        lever = transforms.rotation_from_quaternion_wxyz(poses.quaternion_wxyz[row]) @ np.array(antenna)
        expected = transforms.transform(earth_from_world, poses.position[row] + lever)
        found = to_earth.transform(fix.message.longitude, fix.message.latitude, fix.message.altitude)
        assert np.linalg.norm(found - expected) < 1e-3
    first = fixes[0].message
    assert abs(first.altitude - 560.0) < 2.0  # the robot stands on the raster
    place = to_earth.transform(first.longitude, first.latitude, 0.0)
    assert np.linalg.norm(np.subtract(place, to_earth.transform(-70.65, -33.45008, 0.0))) < 0.5
    checks = validate(bag.parent, quick=True)
    assert [check.name for check in checks if check.passed is False] == []


def test_a_stored_world_is_that_of_the_bytes_of_every_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys: list[str] = []
    monkeypatch.setattr("fieldtruth.world.build.load_or_make", lambda path, *_: keys.append(path.name))
    site, table, beside = (tmp_path / name for name in ("site.yaml", "trees.shp", "trees.dbf"))
    site.write_text(yaml.safe_dump({"centre": CENTRE, "size": SIZE, "trees": {"file": "trees.shp"}}))
    for path in (table, beside):
        path.write_text("first")
    fieldtruth.load_world(str(site))
    for path in (table, beside, tmp_path / "trees.prj"):
        path.write_text("second")
        fieldtruth.load_world(str(site))
    fieldtruth.load_world(str(site))
    (tmp_path / "other.csv").write_text("no file of the site")
    fieldtruth.load_world(str(site))
    assert len(set(keys[:4])) == 4
    assert len(set(keys[3:])) == 1


def test_a_stored_world_is_that_of_the_libraries_that_read_its_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    keys: list[str] = []
    monkeypatch.setattr("fieldtruth.world.build.load_or_make", lambda path, *_: keys.append(path.name))
    (tmp_path / "trees.csv").write_text("lon,lat\n")
    given: dict[str, Any] = {"centre": CENTRE, "size": SIZE}
    for layout in (given, given | {"trees": {"file": str(tmp_path / "trees.csv")}}):
        for pyproj_version in ("3.6.0", "3.7.0"):
            versions = {"pyproj": pyproj_version}
            monkeypatch.setattr("fieldtruth.world.build.version", lambda name, known=versions: known.get(name, "1"))
            fieldtruth.load_world("site", 0, layout)
    assert keys[0] == keys[1]
    assert keys[2] != keys[3]


def mosaic(path: Path, tile: str) -> Path:
    source = f'<SimpleSource><SourceFilename relativeToVRT="1">{tile}</SourceFilename><SourceBand>1</SourceBand>'
    band = f'<VRTRasterBand dataType="Float32" band="1">{source}</SimpleSource></VRTRasterBand>'
    size = "<SRS>EPSG:32719</SRS>" + f"<GeoTransform>{EAST - 50}, 1, 0, {NORTH + 50}, 0, -1</GeoTransform>"
    path.write_text(f'<VRTDataset rasterXSize="100" rasterYSize="100">{size}{band}</VRTDataset>')
    return path


def test_a_stored_world_is_that_of_the_tiles_of_a_mosaic(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys: list[str] = []
    monkeypatch.setattr("fieldtruth.world.build.load_or_make", lambda path, *_: keys.append(path.name))
    (tmp_path / "tiles").mkdir()
    tile = raster(tmp_path / "tiles" / "east.tif")
    layout = {
        "centre": CENTRE,
        "size": SIZE,
        "elevation": {"file": str(mosaic(tmp_path / "dem.vrt", "tiles/east.tif"))},
    }
    surface = read_raster(tmp_path / "dem.vrt", Origin(*CENTRE, 0.0), SIZE, reference="ellipsoid")
    assert np.abs(surface.heights - 560.0).max() < 1e-6
    fieldtruth.load_world("site", 0, layout)
    with rasterio.open(tile, "r+") as dataset:
        dataset.write(np.full((100, 100), 561.0, np.float32), 1)
    fieldtruth.load_world("site", 0, layout)
    assert keys[0] != keys[1]
    for name in ("tiles/west.tif", "dem.vrt"):
        mosaic(tmp_path / "dem.vrt", name)
        with pytest.raises(ConfigurationError, match=rf"dem\.vrt: names '{name}', which must be a file, and no \.vrt"):
            fieldtruth.load_world("site", 0, layout)


def test_only_meshes_are_limited_in_size(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("fieldtruth.world.objects.files.MOST_BYTES", 1 << 10)
    for name in ("photo.tif", "scan.laz", "trees.gpkg", "bench.glb"):
        (tmp_path / name).write_bytes(bytes(2000))
    assert [with_named(tmp_path / name) for name in ("photo.tif", "scan.laz", "trees.gpkg")]
    with pytest.raises(ConfigurationError, match=r"bench\.glb: must have at most"):
        with_named(tmp_path / "bench.glb")


def test_the_command_says_what_was_read_filled_and_left_out(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    path = raster(tmp_path / "dem.tif", nodata=-9999.0)
    with rasterio.open(path, "r+") as dataset:
        dataset.write(np.full((2, 3), -9999.0, np.float32), 1, window=((49, 51), (50, 53)))
    (tmp_path / "trees.csv").write_text("lon,lat,height_m\n-70.65,-33.45,12\n-70.65,-33.4499,\n-70.6,-33.4,9\n")
    nodes = '<node id="1" version="1" lat="-33.45" lon="-70.65"/><node id="2" version="1" lat="-33.4499" lon="-70.65"/>'
    way = '<way id="1" version="1"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="highway" v="path"/></way>'
    (tmp_path / "a.osm").write_text(f'<osm version="0.6">{nodes}{way}</osm>')
    files = {"elevation": "dem.tif", "trees": "trees.csv", "map": "a.osm"}
    site: dict[str, Any] = {
        "centre": list(CENTRE),
        "size": list(SIZE),
        **{key: {"file": name} for key, name in files.items()},
    }
    site |= {"grid": 0.2, "litter": 0, "individuals": 1, "beyond": False, "grass_per_m2": 0.0}
    (tmp_path / "quinta.yaml").write_text(yaml.safe_dump(site))
    assert cli.main(["world", "quinta.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "quinta: 30 m x 24 m about -33.4500000, -70.6500000"
    assert lines[1].startswith("origin: 560.000 m above the ellipsoid")
    assert lines[2].startswith("ground: dem.tif: cells of 1 m, 6 of ")
    assert "had no data and were filled; heights are assumed to be above the geoid" in lines[2]
    assert lines[3] == "trees: trees.csv: 2 trees; 1 outside of the site"
    assert lines[4] == "map: a.osm: 1 path; 1 incomplete ways and areas; © OpenStreetMap contributors, ODbL"
    assert lines[5].startswith("world: 2 objects of ")
