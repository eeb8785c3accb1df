# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""OpenStreetMap: paths, water, woods, buildings, furniture and more in the frame of a world, cut at its edge.

What a tag means is in ``osm.yaml``. osmium reads the file and joins the ways of multipolygons. The whole file is gone
through, but only what lies in the world is kept; a way or multipolygon of which the file lacks a part is counted.

OpenStreetMap has no heights: coordinates are converted at the height of the world's origin. On ground 100 m above it,
500 m from it, this is an error of 8 mm; the file itself has coordinates of 1e-7 deg, 11 mm.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, NamedTuple

import numpy as np

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin
from fieldtruth.maps.pbf import unpacked_size
from fieldtruth.maps.rectangle import Rectangle
from fieldtruth.maps.tags import Kind, has_tag, kind_of, metres, number, table

MOST_BYTES: Final = 256 << 20
"""Bytes of a file, unpacked, that are read at most: a city of some millions of nodes."""
_NEW: Final = 10**15
"""Added to the ids, turned positive, of what a map editor has not uploaded yet: osmium takes no others."""


class Feature(NamedTuple):
    """Something on a map, in the world's frame."""

    kind: str
    """A kind of ``osm.yaml``."""
    geometry: Array
    """(n, 2), x and y [m]: a point, a line, or the outline of an area, counterclockwise from above, each node once."""
    closed: bool
    """Whether it is an area. A line may end where it begins: then its first node is also its last."""
    tags: dict[str, str]
    """The tag that makes it its kind, and those that ``osm.yaml`` keeps, by the names there."""
    width: float | None = None
    """Width [m] of a line: tagged, of its lanes, or as ``osm.yaml`` has it; None if that has none."""
    height: float | None = None
    """Height [m]: tagged, or of its levels; None if it has neither."""
    holes: tuple[Array, ...] = ()
    """Outlines (n, 2) [m] of what is not in the area, clockwise from above."""
    source: str = ""
    """Type and id in OpenStreetMap, such as way/12."""


class StreetMap(NamedTuple):
    """What a file has within a world."""

    features: list[Feature]
    """Areas, the largest in the file first, so that each can be drawn over those before; then lines, then points."""
    incomplete: int
    """Number of ways in the world that lack nodes, and are drawn without them, and of areas without a whole outline.

    Such areas are not there. ``osmium extract -s smart`` cuts a file so that none is broken.
    """


def read_osm(path: Path, origin: Origin, size: tuple[float, float]) -> StreetMap:
    """Read the part of a file of OpenStreetMap that a world covers.

    Args:
        path: an .osm (XML) or .osm.pbf file, in any order.
        origin: of the world frame.
        size: length and width [m] of the world along x and y; the origin is in the middle.

    Raises:
        ConfigurationError: no such file, too large, or all of it is somewhere else.
    """
    place = Rectangle(origin, size)
    try:
        with _sorted(path) as file:
            found = _Found(place)
            for each in _objects(file):
                found.add(each)
            found.add_broken(_ways(file, found.unused()))
            features = found.sorted()
            if not features:
                _refuse_elsewhere(path, place, found.elsewhere)
    except (RuntimeError, OSError) as error:
        raise ConfigurationError(f"{path}: not a file of OpenStreetMap that osmium reads: {error}") from error
    return StreetMap(features, len(found.broken))


@contextmanager
def _sorted(path: Path) -> Iterator[str]:
    """A file with nodes before ways before relations, as osmium's areas need and Overpass does not write."""
    import osmium

    if not path.is_file():
        raise ConfigurationError(f"{path}: there is no such file; give one that ends in .osm or .pbf")
    if path.suffix not in (".osm", ".pbf"):
        raise ConfigurationError(f"{path}: must be OpenStreetMap's XML, unpacked, or PBF, and end in .osm or .pbf")
    bytes_ = path.stat().st_size if path.suffix == ".osm" else unpacked_size(path)
    if bytes_ > MOST_BYTES:
        raise ConfigurationError(
            f"{path}: {bytes_ >> 20:,} MiB unpacked, at most {MOST_BYTES >> 20} are read; "
            "cut it first: osmium extract -b WEST,SOUTH,EAST,NORTH"
        )
    name = str(path.absolute())  # a name such as http: would be fetched
    if _header(path).get("sorting") == "Type_then_ID":
        yield name
        return
    data, format_ = path.read_bytes(), path.suffix[1:]
    if format_ == "osm":
        data = re.sub(rb"\b(id|ref)=([\"'])-(\d{1,17})\b", lambda m: b"%b=%b%d" % (m[1], m[2], _NEW + int(m[3])), data)
    merge = osmium.MergeInputReader()
    merge.add_buffer(data, format_)
    with TemporaryDirectory() as folder:
        with osmium.SimpleWriter(f"{folder}/sorted.osm.pbf") as writer:
            merge.apply(writer)
        yield f"{folder}/sorted.osm.pbf"


def _header(path: Path) -> Any:
    import osmium

    with osmium.io.Reader(str(path.absolute()), osmium.osm.NOTHING) as reader:
        return reader.header()


def _objects(name: str) -> Iterator[Any]:
    """Nodes, ways, relations and assembled areas of a sorted file that have a key of the table."""
    import osmium

    keys = osmium.filter.KeyFilter(*table()["keys"])
    yield from osmium.FileProcessor(name).with_locations().with_areas(keys).with_filter(keys)


def _ways(name: str, ids: set[int]) -> Iterator[Any]:
    """Ways of some ids."""
    import osmium

    if ids:
        ways = osmium.filter.EntityFilter(osmium.osm.WAY)
        yield from (
            osmium.FileProcessor(name).with_locations().with_filter(ways).with_filter(osmium.filter.IdFilter(ids))
        )


def _refuse_elsewhere(path: Path, place: Rectangle, elsewhere: list[tuple[float, float]]) -> None:
    """Raise if a file is of another place, by its header or by longitudes and latitudes [deg] of what it has."""
    box = _header(path).box()
    corners = np.array([(c.lon, c.lat) for c in (box.bottom_left, box.top_right)] if box.valid() else elsewhere)
    if not len(corners) or place.touches(place.degrees(corners)):
        return
    (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
    raise ConfigurationError(
        f"{path}: nothing in the world about {place.origin.latitude:.6f}, {place.origin.longitude:.6f}: the file is of "
        f"{south:.6f}, {west:.6f} to {north:.6f}, {east:.6f} (latitude, longitude)"
    )


class _Found:
    """What was found so far."""

    def __init__(self, place: Rectangle) -> None:
        self.place = place
        self.features: list[tuple[tuple[Any, ...], Feature]] = []  # with keys to sort by
        self.elsewhere: list[tuple[float, float]] = []  # corners, longitude and latitude [deg], of other objects
        self.broken: set[str] = set()  # sources
        self.outlines: dict[str, set[int]] = {}  # ways of the areas that there should be
        self.assembled: set[str] = set()
        self.repeated: dict[
            tuple[str, str], str
        ] = {}  # areas by kind and way on the outline of another, which has holes

    def add(self, each: Any) -> None:
        """Take an object of osmium that has a key of the table."""
        tags = {tag.k: tag.v for tag in each.tags}
        if any(has_tag(tags, key, values) for key, values in table()["hidden"].items()):
            return
        if each.is_node():
            self._add_node(each, tags)
        elif each.is_way():
            self._add_way(each, tags)
        elif each.is_area():
            self._add_area(each, tags)
        elif tags.get("type") == "multipolygon" and (found := kind_of(tags, "area")):
            ways, source = [m for m in each.members if m.type == "w"], f"relation/{_real(each.id)}"
            self.outlines[source] = {way.ref for way in ways}
            self.repeated |= {(found[0].name, f"way/{_real(m.ref)}"): source for m in ways if m.role != "inner"}

    def unused(self) -> set[int]:
        """Ids of the ways of areas that osmium did not assemble: they lack nodes or ways, or cross themselves."""
        return set().union(*(ids for source, ids in self.outlines.items() if source not in self.assembled))

    def add_broken(self, ways: Iterable[Any]) -> None:
        """Count those areas of which some ways are near the world."""
        near = {way.id for way in ways if self._near(way.nodes) is not None}
        self.broken |= {s for s, ids in self.outlines.items() if s not in self.assembled and ids & near}

    def sorted(self) -> list[Feature]:
        """Areas, lines and points; a way on the outline of a multipolygon of the same kind is no area again."""
        return [
            feature
            for _, feature in sorted(self.features, key=lambda pair: pair[0])
            if not (feature.closed and self.repeated.get((feature.kind, feature.source)) in self.assembled)
        ]

    def _add_node(self, node: Any, tags: dict[str, str]) -> None:
        if (kind := kind_of(tags, "point")) is None or not node.location.valid():
            return
        degrees = self._near([node])
        if degrees is not None and len(point := self.place.point(degrees)):
            self.features.append(((2, node.id), _feature(kind, point, tags, f"node/{_real(node.id)}")))

    def _add_way(self, way: Any, tags: dict[str, str]) -> None:
        if (degrees := self._near(way.nodes)) is None:
            return
        source, closed = f"way/{_real(way.id)}", way.is_closed()
        kind, area = kind_of(tags, "line", closed), kind_of(tags, "area", True) if closed else None
        if kind is None and area is None:
            return
        if np.isnan(degrees).any():
            self.broken.add(source)
        if area is not None:
            self.outlines[source] = {way.id}
        if kind is not None:
            for i, line in enumerate(self.place.lines(degrees)):
                self.features.append(((1, way.id, i), _feature(kind, line, tags, source)))

    def _add_area(self, area: Any, tags: dict[str, str]) -> None:
        source = f"{'way' if area.from_way() else 'relation'}/{_real(area.orig_id())}"
        if (kind := kind_of(tags, "area", area.from_way())) is None:
            return
        for i, outer in enumerate(area.outer_rings()):
            self.assembled.add(source)
            if (outline := self._near(outer)) is not None:
                holes = [self.place.degrees(_lonlat(inner)) for inner in area.inner_rings(outer)]
                large, pieces = self.place.areas([outline, *holes])
                for j, piece in enumerate(pieces):
                    feature = _feature(kind, piece[0], tags, source, closed=True, holes=piece[1])
                    self.features.append(((0, -large, area.id, i, j), feature))

    def _near(self, nodes: Iterable[Any]) -> Array | None:
        """Longitudes and latitudes of nodes, None if they are away from the world."""
        degrees = self.place.degrees(lonlat := _lonlat(nodes))
        if self.place.touches(degrees):
            return degrees
        if known := [each for each in lonlat if each[0] == each[0]]:
            longitudes, latitudes = zip(*known, strict=True)
            self.elsewhere += [(min(longitudes), min(latitudes)), (max(longitudes), max(latitudes))]
        return None


def _lonlat(nodes: Iterable[Any]) -> list[tuple[float, float]]:
    """Longitude and latitude [deg] of nodes; NaN of those that the file lacks."""
    return [(n.location.lon, n.location.lat) if n.location.valid() else (np.nan, np.nan) for n in nodes]


def _real(number: int) -> int:
    """Id that an object has in its file."""
    return number if number < _NEW else _NEW - number


def _feature(
    found: tuple[Kind, str],
    geometry: Array,
    tags: Mapping[str, str],
    source: str,
    closed: bool = False,
    holes: tuple[Array, ...] = (),
) -> Feature:
    """What a kind and the key of the tag that makes it are called with its other tags."""
    kind, key = found
    kept = {key: tags[key]}
    for name, keys in table()["tags"].items():
        if value := next((tags[each] for each in keys if each in tags), None):
            kept[name] = value
    width = None
    if len(geometry) > 1 and not closed:
        lanes = number(kept.get("lanes")) if kind.name == "road" else None
        width = metres(kept.get("width")) or (lanes * table()["lane"] if lanes else None)
        width = width or kind.widths.get(tags[key], kind.width)
    levels = number(kept.get("levels"))
    height = metres(kept.get("height")) or (levels * table()["level"] if levels else None)
    return Feature(kind.name, geometry, closed, kept, width, height, holes, source)
