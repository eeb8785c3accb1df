# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Trees of an inventory: a table (CSV) or a layer (GeoPackage, GeoJSON, Shapefile) with a position for each.

Columns are found by their usual names, with units as in ``BHD (cm)`` or ``Höhe [m]``.
"""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, world_from_geodetic
from fieldtruth.maps.canopy import TALLEST
from fieldtruth.maps.columns import found_columns, numbers, split_unit
from fieldtruth.maps.elevation import crs_of
from fieldtruth.maps.trees import Tree

MOST_TREES: Final = 2_000_000
"""Rows of an inventory that are read at most."""
MOST_BYTES: Final = 1_000_000_000
_LARGEST: Final = {
    "height": TALLEST,
    "diameter": 12.0,
    "girth": 12.0 * np.pi,
    "crown_radius": 40.0,
    "crown_diameter": 80.0,
}
"""Quantity: length [m] that no tree exceeds."""
_CENTIMETRES_FROM: Final = 3.0
"""Median above which diameters and girths without a unit are centimetres, not metres."""


class Inventory(NamedTuple):
    """Trees of an inventory within a world."""

    trees: list[Tree]
    outside: int
    """Number of trees that are not within the world."""
    notes: tuple[str, ...]
    """What was assumed, and what could not be read, in words."""


class _Table(NamedTuple):
    """Columns of an inventory that are used, as text or numbers, and where its rows are."""

    columns: Mapping[str, Sequence[Any]]
    rows: Sequence[int]
    """Line of the file, or number of the feature, of each row."""
    word: str
    """What a row is called: line or feature."""
    places: Array | None = None
    """(n, 2), coordinates of a layer's features."""
    crs: str | None = None
    names: Sequence[str] = ()
    """Names of all columns."""


def read_inventory(
    path: Path,
    origin: Origin,
    size: tuple[float, float],
    *,
    crs: str | None = None,
    columns: Mapping[str, str] | None = None,
) -> Inventory:
    """Read the trees of an inventory that stand within a world.

    Args:
        path: a table (.csv, .tsv, .txt) with decimal points or commas, or a file of points or crowns that GDAL reads.
        origin: of the world frame.
        size: length and width [m] of the world along x and y.
        crs: coordinate reference system, of a file that states none; "world" for x and y [m] in the world frame.
            Columns of longitude and latitude need none; of a table that has east and north as well, those are taken
            if ``columns`` names them, or if the system is not in degrees.
        columns: names of columns, such as {"height": "H_m"}, of quantities whose columns have no usual name.

    Raises:
        ConfigurationError: no table, no positions, a number that no tree has, or no tree within the world.
    """
    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file")
    if path.stat().st_size > MOST_BYTES:
        raise ConfigurationError(f"{path}: larger than {MOST_BYTES / 1e9:g} GB; cut it to the world")
    read = _csv if path.suffix.lower() in (".csv", ".tsv", ".txt") else _layer
    given = dict(columns or {})
    table, found = read(path, given)
    if not table.rows:
        raise ConfigurationError(f"{path}: it contains no trees")
    places, system = _places(path, table, _pair_of(path, found, given, crs), crs)
    xy = _world(path, places, system, origin)
    with np.errstate(invalid="ignore"):
        inside = (np.abs(xy) <= np.array(size) / 2).all(axis=1)
    if not inside.any():
        raise _nowhere(path, table, places, system, origin, size)
    notes: list[str] = []
    if missing := int(np.isnan(xy).any(axis=1).sum()):
        notes.append(f"{missing} of {len(xy)} trees have no position")
    measures = {each: _lengths(path, table, found, each, inside, notes) for each in _LARGEST}
    height, diameter, girth, radius, width = (measures[each] for each in _LARGEST)
    radius = np.where(np.isnan(radius), width / 2, radius)
    diameter = np.where(np.isnan(diameter), girth / np.pi, diameter)
    trees = []
    for k in np.flatnonzero(inside).tolist():
        lengths = _known(height[k]), _known(radius[k]), _known(diameter[k])
        trees.append(Tree(float(xy[k, 0]), float(xy[k, 1]), *lengths, _species(table, found, k)))
    return Inventory(trees, len(xy) - len(trees) - missing, tuple(notes))


def _csv(path: Path, given: dict[str, str]) -> tuple[_Table, dict[str, str]]:
    """Read a table, and the names of its columns by quantity.

    It is in UTF-8 or Windows-1252, with the separator that its first line has most often.
    """
    data = path.read_bytes()
    if b"\0" in data[:4096]:
        raise ConfigurationError(f"{path}: not a table of text; save it as CSV in UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    lines = text.splitlines(keepends=True)
    separator = max(";\t,|", key=(lines or [""])[0].count)
    reader = csv.reader(lines, delimiter=separator)
    try:
        header = [" ".join(name.split()) for name in next(reader, [])]
        found = found_columns(path, header, given)
        used = sorted(header.index(name) for name in set(found.values()))
        rows, numbers = [], []
        for row in reader:
            if not any(cell.strip() for cell in row):
                continue
            if len(row) != len(header):
                raise ConfigurationError(
                    f"{path}: line {reader.line_num} has {len(row)} cells; the first line has {len(header)}"
                )
            rows.append([row[k] for k in used])
            numbers.append(reader.line_num)
            _few(path, len(rows))
    except csv.Error as error:
        raise ConfigurationError(f"{path}: line {reader.line_num}: not a table: {error}") from error
    columns = dict(zip((header[k] for k in used), zip(*rows, strict=True), strict=bool(rows)))
    return _Table(columns, numbers, "line", names=header), found


def _layer(path: Path, given: dict[str, str]) -> tuple[_Table, dict[str, str]]:
    """Read the first layer of a file that has places; of crowns, the middles; and the names of columns by quantity."""
    import pyogrio
    import shapely
    from pyogrio.errors import DataSourceError

    try:
        name = next((each for each, kind in pyogrio.list_layers(path) if kind), None)
        if name is None:
            raise ConfigurationError(f"{path}: no layer of it has places; give a layer of points")
        _few(path, pyogrio.read_info(path, layer=name)["features"])
        meta, numbers, geometry, fields = pyogrio.raw.read(path, layer=name, return_fids=True)
    except DataSourceError as error:
        raise ConfigurationError(f"{path}: not a table (.csv) nor a layer that GDAL reads: {error}") from error
    middles = shapely.centroid(shapely.from_wkb(geometry))
    places = np.column_stack([shapely.get_x(middles), shapely.get_y(middles)])
    columns = dict(zip(meta["fields"].tolist(), fields, strict=True))
    found = found_columns(path, list(columns), given)
    return _Table(columns, numbers.tolist(), "feature", places, meta["crs"]), found


def _few(path: Path, rows: int) -> None:
    if rows > MOST_TREES:
        raise ConfigurationError(f"{path}: more than {MOST_TREES:,} trees; cut it to the world")


def _pair_of(path: Path, found: Mapping[str, str], given: Mapping[str, str], crs: str | None) -> Mapping[str, str]:
    """The columns by quantity, without longitude and latitude where a table has east and north that are meant."""
    degrees, metres = {"longitude", "latitude", "place"}, {"east", "north"}
    if not metres <= found.keys() or degrees & given.keys():
        return found
    if not metres & given.keys() and (crs is None or _in_degrees(path, crs)):
        return found
    return {quantity: name for quantity, name in found.items() if quantity not in degrees}


def _in_degrees(path: Path, crs: str) -> bool:
    return crs != "world" and bool(crs_of(path, crs, None).is_geographic)


def _places(path: Path, table: _Table, found: Mapping[str, str], crs: str | None) -> tuple[Array, str]:
    """Coordinates (n, 2), NaN where they are missing, and their coordinate reference system."""
    if table.places is not None:
        system = crs or table.crs
        places = table.places
    elif {"longitude", "latitude"} <= found.keys():
        places = _pair(path, table, found["longitude"], found["latitude"])
        system = crs if crs is not None and _in_degrees(path, crs) else "EPSG:4326"
    elif "place" in found:
        texts = [str(text or "").partition(",")[::2] for text in table.columns[found["place"]]]
        pair = table._replace(columns={"latitude": [a for a, _ in texts], "longitude": [b for _, b in texts]})
        places = _pair(path, pair, "longitude", "latitude")
        system = crs if crs is not None and _in_degrees(path, crs) else "EPSG:4326"
    elif {"east", "north"} <= found.keys():
        places, system = _pair(path, table, found["east"], found["north"]), crs
    else:
        names = ", ".join(table.names)[:300]
        raise ConfigurationError(
            f"{path}: no columns of a position among {names}; give columns of east and north, or longitude and latitude"
        )
    if system is None:
        raise ConfigurationError(
            f"{path}: it states no coordinate reference system; give crs, such as EPSG:32632, or world"
        )
    return places, system


def _pair(path: Path, table: _Table, first: str, second: str) -> Array:
    """Coordinates (n, 2) of two columns; an empty cell is NaN, any other text an error."""
    places = []
    for name in (first, second):
        values, wrong = numbers(table.columns[name])
        if wrong:
            row, text = table.rows[wrong[0]], table.columns[name][wrong[0]]
            raise ConfigurationError(f"{path}: {table.word} {row}: {name} is {text!r}, not a number")
        places.append(values)
    return np.column_stack(places)


def _world(path: Path, places: Array, crs: str, origin: Origin) -> Array:
    """World x and y (n, 2) [m] of coordinates, NaN where they are missing."""
    from pyproj import Transformer
    from pyproj.exceptions import ProjError

    if crs == "world":
        return places
    try:
        to_geodetic = Transformer.from_crs(crs, 4326, always_xy=True)
    except ProjError as error:
        raise ConfigurationError(f"{path}: unknown coordinate reference system {crs!r}") from error
    longitude, latitude = to_geodetic.transform(*places.T)
    degrees = np.column_stack([latitude, longitude])
    degrees[~np.isfinite(degrees).all(axis=1) | (np.abs(degrees[:, 0]) > 90.0)] = np.nan
    world = world_from_geodetic(np.column_stack([degrees, np.full(len(degrees), origin.height)]), origin)
    world[~np.isfinite(places).all(axis=1)] = np.nan
    world[np.isfinite(places).all(axis=1) & np.isnan(world).any(axis=1)] = np.inf
    return world[:, :2]


def _nowhere(
    path: Path, table: _Table, places: Array, crs: str, origin: Origin, size: tuple[float, float]
) -> ConfigurationError:
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    if not len(known):
        return ConfigurationError(f"{path}: none of its {len(places)} trees has a position")
    exchanged = _world(path, places[:, ::-1], crs, origin)
    with np.errstate(invalid="ignore"):
        hint = "; its two coordinates are exchanged" if (np.abs(exchanged) <= np.array(size) / 2).all(1).any() else ""
    first = places[known[0]]
    return ConfigurationError(
        f"{path}: none of its {len(places)} trees is within the world of {size[0]:g} m x {size[1]:g} m about "
        f"{origin.latitude:.6f}, {origin.longitude:.6f} (latitude, longitude); {table.word} {table.rows[known[0]]} is "
        f"at {first[0]:.10g}, {first[1]:.10g} of {crs.splitlines()[0][:40]}{hint}"
    )


def _lengths(
    path: Path, table: _Table, found: Mapping[str, str], quantity: str, inside: Any, notes: list[str]
) -> Array:
    """Lengths (n,) [m] of a quantity, NaN where it is missing, or 0 or less.

    Raises:
        ConfigurationError: a tree within the world has a length that no tree has.
    """
    if quantity not in found:
        return np.full(len(table.rows), np.nan)
    name = found[quantity]
    values, wrong = numbers(table.columns[name])
    if wrong := [k for k in wrong if inside[k]]:
        notes.append(f"{name}: {len(wrong)} cells are no numbers, such as {table.columns[name][wrong[0]]!r}")
    values[~(values > 0.0)] = np.nan
    unit = split_unit(name)[1]
    if unit is None and np.isfinite(values).any():
        centimetres = quantity in ("diameter", "girth") and np.nanmedian(values) > _CENTIMETRES_FROM
        unit = 0.01 if centimetres else 1.0
        notes.append(f"{name}: taken as {'cm' if centimetres else 'm'}, since its name states no unit")
    values *= unit or 1.0
    most = _LARGEST[quantity]
    with np.errstate(invalid="ignore"):
        giants = np.flatnonzero((values > most) & inside)
    if len(giants):
        raise ConfigurationError(
            f"{path}: {table.word} {table.rows[giants[0]]}: {name} is {values[giants[0]]:g} m; trees have at most "
            f"{most:.3g} m; state its unit in the column's name, such as {name}_cm"
        )
    return values


def _species(table: _Table, found: Mapping[str, str], row: int) -> str | None:
    """Species of a row, after its genus if it is an epithet, and so begins with a small letter."""
    genus, species = (_text(table.columns[found[each]][row]) if each in found else "" for each in ("genus", "species"))
    return (f"{genus} {species}".strip() if not species or species[0].islower() else species) or None


def _known(length: float) -> float | None:
    return None if np.isnan(length) else float(length)


def _text(value: Any) -> str:
    return "" if value is None or value != value else str(value).strip()
