# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""GeoPackage files of point layers in WGS 84, as GIS programs read them (OGC 12-128r19, GeoPackage 1.4).

A GeoPackage is an SQLite database with tables of the standard's Annex C. The same layers give the same bytes: the date
of the last change is fixed.
"""

import sqlite3
import struct
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final, Literal, NamedTuple

from fieldtruth.core.arrays import Array

Value = int | float | str | None
ColumnType = Literal["INTEGER", "REAL", "TEXT"]

WGS_84: Final = 4326
"""EPSG code of latitude and longitude; coordinates in the file are (longitude, latitude)."""
_APPLICATION_ID: Final = 0x47504B47  # "GPKG"
_VERSION: Final = 10400
_CHANGED: Final = "1980-01-01T00:00:00.000Z"
_POINT: Final = struct.Struct("<2sBBiBIdd")
_DEFINITION: Final = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],'
    'AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],'
    'UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AUTHORITY["EPSG","4326"]]'
)
_SYSTEMS: Final = (
    ("Undefined Cartesian", -1, "NONE", -1, "undefined", "undefined Cartesian coordinates"),
    ("Undefined geographic", 0, "NONE", 0, "undefined", "undefined geographic coordinates"),
    ("WGS 84", WGS_84, "EPSG", WGS_84, _DEFINITION, "longitude and latitude [deg] on the WGS 84 ellipsoid"),
)
_TABLES: Final = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER PRIMARY KEY, organization TEXT NOT NULL,
    organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
    description TEXT DEFAULT '', last_change DATETIME NOT NULL, min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE,
    srs_id INTEGER REFERENCES gpkg_spatial_ref_sys (srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL UNIQUE REFERENCES gpkg_contents (table_name),
    column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL, srs_id INTEGER NOT NULL REFERENCES
    gpkg_spatial_ref_sys (srs_id), z TINYINT NOT NULL, m TINYINT NOT NULL, PRIMARY KEY (table_name, column_name));
"""


class PointLayer(NamedTuple):
    """A table with a point per row."""

    name: str
    description: str
    columns: Mapping[str, ColumnType]
    rows: Sequence[Sequence[Value]]
    geodetic: Array
    """(n, 2) latitude and longitude [deg] of the rows."""


def write_points(path: Path, layers: Sequence[PointLayer]) -> None:
    """Write a GeoPackage with these layers; their rows keep their order."""
    with closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        database.execute(f"PRAGMA user_version = {_VERSION}")
        database.executescript(_TABLES)
        database.executemany("INSERT INTO gpkg_spatial_ref_sys VALUES (?, ?, ?, ?, ?, ?)", _SYSTEMS)
        for layer in layers:
            _write_layer(database, layer)
        database.commit()
        path.write_bytes(database.serialize())


def _write_layer(database: sqlite3.Connection, layer: PointLayer) -> None:
    columns = "".join(f', "{name}" {kind}' for name, kind in layer.columns.items())
    database.execute(
        f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom POINT{columns})'
    )
    latitude, longitude = layer.geodetic.T.tolist()
    bounds = [f(v, default=None) for f in (min, max) for v in (longitude, latitude)]
    database.execute(
        "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, layer.description, _CHANGED, *bounds, WGS_84),
    )
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', 'POINT', ?, 0, 0)", (layer.name, WGS_84))
    blanks = ", ".join("?" * (len(layer.columns) + 1))
    database.executemany(
        f'INSERT INTO "{layer.name}" VALUES (NULL, {blanks})',
        ((_point(*position), *row) for position, row in zip(layer.geodetic.tolist(), layer.rows, strict=True)),
    )


def _point(latitude: float, longitude: float) -> bytes:
    """A point as GeoPackageBinary: its header without an envelope (flags 1: little endian), then well-known binary."""
    return _POINT.pack(b"GP", 0, 1, WGS_84, 1, 1, longitude, latitude)
