# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Inventories as people have them: languages, units, decimal commas, layers; refusals that name the line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fieldtruth.core.errors import ConfigurationError, UnknownNameError
from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.maps.trees import Tree

pyproj = pytest.importorskip("pyproj")
pyogrio = pytest.importorskip("pyogrio")
shapely = pytest.importorskip("shapely")

from fieldtruth.maps.columns import numbers  # noqa: E402
from fieldtruth.maps.inventory import Inventory, read_inventory  # noqa: E402

PLACE = Origin(47.6, 11.3, 600.0)
UTM = "EPSG:32632"
SIZE = (100.0, 80.0)
XY = np.array([(10.0, -20.0), (-45.5, 31.25), (0.0, 0.0)])
"""World x and y [m] of three trees."""


def coordinates(crs: str = "EPSG:4326", xy: Any = XY) -> Any:
    """East and north, or longitude and latitude, (n, 2) of world positions."""
    latitude, longitude, _ = geodetic_from_world(np.column_stack([xy, np.zeros(len(xy))]), PLACE).T
    return np.column_stack(pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(longitude, latitude))


def table(path: Path, header: str, rows: list[str], places: Any, *, comma: bool = False, coding: str = "utf-8") -> Path:
    """A table whose first two cells are places, separated as its header is."""
    sign = ";" if ";" in header else ","
    cells = [sign.join(f"{v:.9f}".replace(".", "," if comma else ".") for v in place) for place in places]
    lines = [header, *(f"{place}{sign}{row}" for place, row in zip(cells, rows, strict=True))]
    path.write_bytes("\r\n".join([*lines, ""]).encode(coding))
    return path


def assert_at(trees: list[Tree], xy: Any = XY) -> None:
    assert np.array([t[:2] for t in trees]) == pytest.approx(np.array(xy), abs=1e-3)


def rest(inventory: Inventory) -> list[Any]:
    """Height, crown's radius, diameter and species of the trees."""
    return [tuple(round(v, 6) if isinstance(v, float) else v for v in tree[2:]) for tree in inventory.trees]


def test_english(tmp_path: Path) -> None:
    path = table(
        tmp_path / "a.csv",
        "Longitude,Latitude,Tree Height (ft),dbh_in,crownWidth_m,Species,note",
        ["60,10,5,Acer rubrum,a", ',NA,,"Fagus, sylvatica",b', "0,20,,,c"],
        coordinates(),
    )
    read = read_inventory(path, PLACE, SIZE)
    assert_at(read.trees)
    assert rest(read) == [
        (18.288, 2.5, 0.254, "Acer rubrum"),
        (None, None, None, "Fagus, sylvatica"),
        (None, None, 0.508, None),
    ]
    assert (read.outside, read.notes) == (0, ())


def test_german_with_decimal_commas_in_another_coding(tmp_path: Path) -> None:
    path = table(
        tmp_path / "a.csv",
        "Ostwert;Nordwert;Höhe [m];BHD;Kronendurchmesser_m;Baumart",
        ["12,5;31;4,0;Bergahorn", "7;12,5;;Lärche", "1.0;8;2;"],
        coordinates(UTM),
        comma=True,
        coding="cp1252",
    )
    read = read_inventory(path, PLACE, SIZE, crs=UTM)
    assert_at(read.trees)
    assert rest(read) == [
        (12.5, 2.0, 0.31, "Bergahorn"),
        (7.0, None, 0.125, "Lärche"),
        (1.0, 1.0, 0.08, None),
    ]
    assert read.notes == ("BHD: taken as cm, since its name states no unit",)


def test_french_with_girth_and_one_cell_of_a_place(tmp_path: Path) -> None:
    rows = [f'"{lat:.9f}, {lon:.9f}";Platanus;x hispanica;157;25' for lon, lat in coordinates()]
    path = tmp_path / "a.csv"
    path.write_text(
        "\n".join(["geo_point_2d;GENRE;ESPÈCE;CIRCONFERENCE (cm);HAUTEUR (m)", *rows]), encoding="utf-8-sig"
    )
    read = read_inventory(path, PLACE, SIZE)
    assert_at(read.trees)
    assert rest(read) == 3 * [(25.0, None, 0.499747, "Platanus x hispanica")]


def test_columns_with_names_of_ones_own_and_a_world_of_ones_own(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "x,y,H_m,alt,kind", ["9,700,oak", "8,700,ash", "7,700,elm"], XY)
    own = {"height": "H_m", "species": "kind"}
    read = read_inventory(path, PLACE, SIZE, crs="world", columns=own)
    assert_at(read.trees)
    assert rest(read) == [(9.0, None, None, "oak"), (8.0, None, None, "ash"), (7.0, None, None, "elm")]
    with pytest.raises(UnknownNameError, match=r"a.csv: unknown column 'H'; .*H_m"):
        read_inventory(path, PLACE, SIZE, crs="world", columns={"height": "H"})
    with pytest.raises(UnknownNameError, match=r"a.csv: unknown quantity 'hight'; did you mean 'height'"):
        read_inventory(path, PLACE, SIZE, crs="world", columns={"hight": "H_m"})


@pytest.mark.parametrize(
    ("crs", "columns", "taken"),
    [
        (UTM, {}, "metres"),
        ("world", {}, "world"),
        (None, {}, "degrees"),
        ("EPSG:4258", {}, "degrees"),
        (UTM, {"east": "Ost", "north": "Nord"}, "metres"),
        (UTM, {"longitude": "lon", "latitude": "lat"}, "degrees"),
    ],
)
def test_of_two_pairs_of_columns_the_one_that_is_meant_counts(
    tmp_path: Path, crs: str | None, columns: dict[str, str], taken: str
) -> None:
    """The other pair is 30 m away."""
    away, path = XY + np.array((30.0, 0.0)), tmp_path / "a.csv"
    degrees = coordinates(xy=XY if taken == "degrees" else away)
    metres = {"degrees": coordinates(UTM, away), "metres": coordinates(UTM), "world": XY}[taken]
    names = ("Ost", "Nord") if columns.get("east") else ("x", "y")
    rows = [",".join(f"{value:.9f}" for value in row) for row in np.column_stack([degrees, metres])]
    path.write_text("\n".join([f"lon,lat,{','.join(names)}", *rows]))
    assert_at(read_inventory(path, PLACE, SIZE, crs=crs, columns=columns).trees)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("412,345.67", 412_345.67), ("412.345,67", 412_345.67), ("1,412,345.67", 1_412_345.67), ("3,5", 3.5),
        ("1.412.345", 1_412_345.0), ("1,412,345", 1_412_345.0), ("3.5", 3.5), ("-1 412,5", -1412.5), ("12", 12.0),
    ],
)  # fmt: skip
def test_the_later_sign_of_a_number_is_the_decimal_one(text: str, number: float) -> None:
    assert numbers([text])[0] == [number]


@pytest.mark.parametrize("name", ["a.gpkg", "a.geojson", "a.shp"])
def test_layers_of_points(tmp_path: Path, name: str) -> None:
    crs = "EPSG:4326" if name.endswith("json") else UTM
    points = shapely.to_wkb(shapely.points(coordinates(crs)))
    fields = {
        "hoehe": np.array([12.0, np.nan, 0.0]),
        "bhd_cm": np.array([30, 20, 10]),
        "art": ["Kiefer", None, "Eiche"],
    }
    pyogrio.raw.write(
        tmp_path / name,
        points,
        [np.array(v, object) if isinstance(v, list) else v for v in fields.values()],
        list(fields),
        geometry_type="Point",
        crs=crs,
    )
    read = read_inventory(tmp_path / name, PLACE, SIZE)
    assert_at(read.trees)
    assert rest(read) == [(12.0, None, 0.3, "Kiefer"), (None, None, 0.2, None), (None, None, 0.1, "Eiche")]


def test_crowns_stand_in_their_middles(tmp_path: Path) -> None:
    crowns = shapely.to_wkb(shapely.buffer(shapely.points(coordinates(UTM)), 3.0))
    pyogrio.raw.write(tmp_path / "a.gpkg", crowns, [], [], geometry_type="Polygon", crs=UTM)
    assert_at(read_inventory(tmp_path / "a.gpkg", PLACE, SIZE).trees)


def test_trees_elsewhere_and_nowhere_are_counted(tmp_path: Path) -> None:
    xy = [(0.0, 39.9), (0.0, 40.1), (51.0, 0.0), (-4e6, 6e6)]
    path = table(tmp_path / "a.csv", "lon,lat,height", ["5"] * 4, coordinates(xy=np.array([*xy[:3], (9.0, 9.0)])))
    text = path.read_text().splitlines()
    path.write_text(
        "\n".join([*text[:4], "-168.7,-47.6,5", ",,5", "180,91,5"])
    )  # far away, nowhere, and beyond the pole
    read = read_inventory(path, PLACE, SIZE)
    assert_at(read.trees, xy[:1])
    assert read.outside == 4
    assert read.notes == (
        "1 of 6 trees have no position",
        "height: taken as m, since its name states no unit",
    )


def test_what_is_no_number_is_no_length_and_said(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", "lon,lat,height_m", ["k.A.", "10-15", "7"], coordinates())
    read = read_inventory(path, PLACE, SIZE)
    assert [t.height for t in read.trees] == [None, None, 7.0]
    assert read.notes == ("height_m: 2 cells are no numbers, such as 'k.A.'",)


AWAY = coordinates(xy=XY + np.array((500.0, 0.0)))


@pytest.mark.parametrize(
    ("header", "rows", "places", "text"),
    [
        ("lon,lat,height_m", ["1", "2500", "1"], None, r"line 3: height_m is 2500 m; trees have at most 130 m"),
        (
            "lon,lat,bhd_m",
            ["0.3", "0.3", "31"],
            None,
            r"line 4: bhd_m is 31 m; trees have at most 12 m; state its unit",
        ),
        ("lon,lat,h", ["1", "1,2", "1"], None, r"line 3 has 4 cells; the first line has 3"),
        (
            "lon,lat,h",
            ["1", "1", "1"],
            AWAY,
            r"none of its 3 trees .* 100 m x 80 m about 47.600000, 11.300000 .* line 2",
        ),
        ("lat,lon,h", ["1", "1", "1"], None, r"its two coordinates are exchanged"),
        ("x,y,h", ["1", "1", "1"], None, r"no coordinate reference system; give crs, such as EPSG:32632, or world"),
        ("a,b,h", ["1", "1", "1"], None, r"no columns of a position among a, b, h; give columns of east and north"),
        ("lon,lat,h", [], np.zeros((0, 2)), r"it contains no trees"),
    ],
)
def test_unusable_tables_are_one_line(tmp_path: Path, header: str, rows: list[str], places: Any, text: str) -> None:
    path = table(tmp_path / "a.csv", header, rows, coordinates() if places is None else places)
    with pytest.raises(ConfigurationError, match=rf"^{path}: .*{text}") as caught:
        read_inventory(path, PLACE, SIZE)
    assert "\n" not in str(caught.value)


def test_unusable_files_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with pytest.raises(ConfigurationError, match=r"a.csv: there is no such file"):
        read_inventory(path, PLACE, SIZE)
    path.write_text("lon,lat\n11.3,47.6\n11.3,north\n")
    with pytest.raises(ConfigurationError, match=r"a.csv: line 3: lat is 'north', not a number"):
        read_inventory(path, PLACE, SIZE)
    with pytest.raises(ConfigurationError, match=r"a.csv: unknown coordinate reference system 'EPSG:1'"):
        read_inventory(table(path, "x,y,h", ["1"] * 3, XY), PLACE, SIZE, crs="EPSG:1")
    path.write_bytes(b"PK\3\4\0\0\0")
    with pytest.raises(ConfigurationError, match=r"a.csv: not a table of text"):
        read_inventory(path, PLACE, SIZE)
    (tmp_path / "a.gpkg").write_text("trees")
    with pytest.raises(ConfigurationError, match=r"a.gpkg: not a table \(.csv\) nor a layer that GDAL reads"):
        read_inventory(tmp_path / "a.gpkg", PLACE, SIZE)
