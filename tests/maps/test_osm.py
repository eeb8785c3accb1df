# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""OpenStreetMap: coordinates, areas with holes, what lies across the edge, what is missing, tags, refusals."""

from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

from fieldtruth.core.arrays import Array
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import Origin, geodetic_from_world

osmium = pytest.importorskip("osmium")
pyproj = pytest.importorskip("pyproj")
shapely = pytest.importorskip("shapely")

from fieldtruth.maps import osm  # noqa: E402
from fieldtruth.maps.osm import Feature, StreetMap, read_osm  # noqa: E402
from fieldtruth.maps.pbf import unpacked_size  # noqa: E402
from fieldtruth.maps.tags import kinds, metres, table  # noqa: E402

PLACE = Origin(47.6, 11.3, 620.0)
SIZE = (100.0, 80.0)
SQUARE = [(-10, -10), (10, -10), (10, 10), (-10, 10)]
MULTIPOLYGON = {"type": "multipolygon", "natural": "wood"}


class Sketch:
    """A file of OpenStreetMap, drawn in metres of the world; its coordinates are rounded to 1e-7 deg, 11 mm."""

    def __init__(self, origin: Origin = PLACE) -> None:
        self.origin = origin
        self.parts: dict[str, list[str]] = {"node": [], "way": [], "relation": []}
        self.count = 0

    def node(self, x: float, y: float, tags: dict[str, str] | None = None) -> int:
        latitude, longitude, _ = geodetic_from_world((x, y, 0.0), self.origin)
        return self.at(latitude, longitude, tags)

    def at(self, latitude: float, longitude: float, tags: dict[str, str] | None = None) -> int:
        return self._add("node", f' lat="{latitude:.7f}" lon="{longitude:.7f}"', "", tags or {})

    def way(self, points: list[Any], tags: dict[str, str], *, closed: bool = False) -> int:
        """A way through places, or nodes if they are numbers."""
        nodes = [p if isinstance(p, int) else self.node(*p) for p in points]
        return self._add("way", "", "".join(f'<nd ref="{n}"/>' for n in nodes + nodes[: int(closed)]), tags)

    def relation(self, members: list[tuple[int, str]], tags: dict[str, str]) -> int:
        text = "".join(f'<member type="way" ref="{way}" role="{role}"/>' for way, role in members)
        return self._add("relation", "", text, tags)

    def _add(self, element: str, attributes: str, inside: str, tags: dict[str, str]) -> int:
        self.count += 1
        inside += "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items())
        self.parts[element].append(f'<{element} id="{self.count}"{attributes}>{inside}</{element}>')
        return self.count

    def write(self, path: Path, *, order: str = "node way relation", bounds: str = "") -> Path:
        lines = [line for element in order.split() for line in self.parts[element]]
        path.write_text("\n".join(["<osm version='0.6'>", bounds, *lines, "</osm>"]), encoding="utf-8")
        return path

    def read(self, folder: Path) -> StreetMap:
        return read_osm(self.write(folder / "map.osm"), self.origin, SIZE)


def drawn(folder: Path, points: list[Any], tags: dict[str, str], *, closed: bool = False) -> list[Feature]:
    sketch = Sketch()
    sketch.way(points, tags, closed=closed)
    return sketch.read(folder).features


def area(feature: Feature) -> float:
    return float(shapely.Polygon(feature.geometry, feature.holes).area)


@pytest.mark.parametrize(
    "origin", [PLACE, Origin(-36.85, 174.76, 30.0), Origin(16.5, 179.9999, 5.0), Origin(64.1, -179.9999, 5.0)]
)
def test_coordinates_are_those_of_pyproj(tmp_path: Path, origin: Origin) -> None:
    rng = np.random.default_rng(0)
    metres_per_degree = 111_000.0 * np.cos(np.radians(origin.latitude)), 111_000.0
    away = rng.uniform(-500.0, 500.0, (50, 2)) / metres_per_degree
    longitude, latitude = np.round(np.array([origin.longitude, origin.latitude]) + away, 7).T
    longitude = np.round((longitude + 180.0) % 360.0 - 180.0, 7)
    text = "".join(
        f'<node id="{i + 1}" lat="{lat:.7f}" lon="{lon:.7f}"><tag k="natural" v="tree"/></node>'
        for i, (lon, lat) in enumerate(zip(longitude, latitude, strict=True))
    )
    (tmp_path / "trees.osm").write_text(f"<osm version='0.6'>{text}</osm>")
    found = read_osm(tmp_path / "trees.osm", origin, (1100.0, 1100.0)).features
    pipeline = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 +step "
        f"+proj=topocentric +ellps=WGS84 +lon_0={origin.longitude} +lat_0={origin.latitude} +h_0={origin.height}"
    )
    east, north, _ = pipeline.transform(longitude, latitude, np.full(50, origin.height))
    assert [f.source for f in found] == [f"node/{i + 1}" for i in range(50)]
    assert np.abs(np.concatenate([f.geometry for f in found]) - np.stack([north, -east], axis=-1)).max() < 1e-3


def test_a_multipolygon_of_two_ways_has_its_hole_and_its_island(tmp_path: Path) -> None:
    sketch = Sketch()
    corners = [sketch.node(*p) for p in [(-30, -30), (30, -30), (30, 30), (-30, 30)]]
    outer = [sketch.way([*corners[:3]], {}), sketch.way([corners[2], corners[3], corners[0]], {})]
    hole = sketch.way([(-10, -10), (-10, 10), (10, 10), (10, -10)], {}, closed=True)
    island = sketch.way([(-5, -5), (5, -5), (5, 5), (-5, 5)], {}, closed=True)
    relation = sketch.relation([(w, "outer") for w in (*outer, island)] + [(hole, "inner")], MULTIPOLYGON)
    found = sketch.read(tmp_path)
    assert found.incomplete == 0
    assert [(f.kind, f.closed, len(f.geometry), len(f.holes)) for f in found.features] == [
        ("wood", True, 4, 1),
        ("wood", True, 4, 0),
    ]
    assert {f.source for f in found.features} == {f"relation/{relation}"}
    assert [area(f) for f in found.features] == pytest.approx([3600.0 - 400.0, 100.0], abs=1.5)
    assert shapely.LinearRing(found.features[0].geometry).is_ccw
    assert not shapely.LinearRing(found.features[0].holes[0]).is_ccw


def test_an_outline_with_the_tags_of_its_multipolygon_is_no_second_area_without_the_hole(tmp_path: Path) -> None:
    sketch = Sketch()
    outer = sketch.way([(-20, -20), (20, -20), (20, 20), (-20, 20)], {"building": "yes"}, closed=True)
    inner = sketch.way(SQUARE, {"landuse": "grass", "building": "yes"}, closed=True)  # within it, something else
    sketch.relation([(outer, "outer"), (inner, "inner")], {"type": "multipolygon", "building": "school"})
    lonely = sketch.way([(30, 0), (40, 0), (40, 9)], {"building": "yes"}, closed=True)
    sketch.relation([(lonely, "outer"), (901, "outer")], {"type": "multipolygon", "building": "yes"})  # incomplete
    found = sketch.read(tmp_path).features
    assert [(f.kind, len(f.holes), f.source.split("/")[0]) for f in found] == [
        ("building", 1, "relation"),
        ("building", 0, "way"),
        ("building", 0, "way"),
    ]
    assert [area(f) for f in found] == pytest.approx([1200.0, 400.0, 45.0], abs=1.0)


def test_a_hole_that_crosses_the_edge_is_cut_with_its_area(tmp_path: Path) -> None:
    sketch = Sketch()
    outer = sketch.way([(-90, -20), (0, -20), (0, 20), (-90, 20)], {}, closed=True)
    inner = sketch.way([(-70, -10), (-30, -10), (-30, 10), (-70, 10)], {}, closed=True)
    sketch.relation([(outer, "outer"), (inner, "inner")], MULTIPOLYGON)
    (wood,) = sketch.read(tmp_path).features
    assert wood.geometry[:, 0].min() == -50.0
    assert wood.holes == ()  # the outline goes around it
    assert area(wood) == pytest.approx(50.0 * 40.0 - 20.0 * 20.0, abs=1.5)


def test_an_area_far_larger_than_the_world_covers_it(tmp_path: Path) -> None:
    sketch = Sketch()
    corners = [(40.0, -150.0), (40.0, 170.0), (80.0, 170.0), (80.0, -150.0)]  # in the plane they are all north of it
    sketch.way([sketch.at(*corner) for corner in corners], {"natural": "heath"}, closed=True)
    (heath,) = sketch.read(tmp_path).features
    assert area(heath) == pytest.approx(SIZE[0] * SIZE[1])
    assert np.abs(heath.geometry).max(axis=0) == pytest.approx((50.0, 40.0))


def test_the_other_side_of_the_earth_is_not_below_the_world(tmp_path: Path) -> None:
    sketch = Sketch(Origin(0.0, 179.9999, 0.0))
    sketch.at(0.0, -179.9999, {"natural": "tree"})
    sketch.at(0.0, -0.0001, {"natural": "tree"})
    (tree,) = sketch.read(tmp_path).features
    assert tree.geometry == pytest.approx(np.array([(0.0, -22.26)]), abs=0.01)


def test_a_path_across_the_edge_is_cut_there_and_keeps_its_direction(tmp_path: Path) -> None:
    first, second = drawn(tmp_path, [(-80, -10), (0, -10), (80, -10), (80, 10), (0, 10)], {"highway": "path"})
    assert np.allclose(first.geometry, [(-50, -10), (0, -10), (50, -10)], atol=0.02)
    assert np.allclose(second.geometry, [(50, 10), (0, 10)], atol=0.02)
    assert first.source == second.source
    assert np.abs(first.geometry[[0, -1], 0]).tolist() == [50.0, 50.0]


def test_a_path_that_crosses_itself_is_one_line(tmp_path: Path) -> None:
    points = [(-20, 0), (20, 0), (20, 20), (0, 20), (0, -20)]
    (path,) = drawn(tmp_path, points, {"highway": "path"})
    assert np.allclose(path.geometry, points, atol=0.02)


def test_a_path_without_length_is_none(tmp_path: Path) -> None:
    assert drawn(tmp_path, [(5, 5), (5, 5)], {"highway": "path"}) == []


def test_a_loop_is_a_line_unless_it_is_an_area(tmp_path: Path) -> None:
    (ring,) = drawn(tmp_path, SQUARE, {"highway": "footway"}, closed=True)
    assert not ring.closed
    assert np.array_equal(ring.geometry[0], ring.geometry[-1])
    (plaza,) = drawn(tmp_path, SQUARE, {"highway": "footway", "area": "yes"}, closed=True)
    assert (plaza.kind, plaza.closed, plaza.width) == ("path", True, None)
    both = drawn(tmp_path, SQUARE, {"landuse": "grass", "barrier": "hedge"}, closed=True)
    assert [(f.kind, f.closed) for f in both] == [("grass", True), ("hedge", False)]
    assert drawn(tmp_path, SQUARE, {"natural": "scrub", "area": "no"}, closed=True) == []
    assert drawn(tmp_path, SQUARE, {"natural": "scrub"}) == []  # not closed


@pytest.mark.parametrize("kind", kinds())
def test_each_tag_of_the_table_makes_its_kind(tmp_path: Path, kind: str) -> None:
    row = next(row for row in table()["kinds"] if row.name == kind)
    for key, values in row.tags.items():
        for value in ["yes"] if values == "*" else values:
            sketch, tags = Sketch(), {key: value}
            if "point" in row.shapes:
                sketch.node(1.0, 2.0, tags)
            if "line" in row.shapes:
                sketch.way([(0, 0), (9, 0)], tags)
            if "area" in row.shapes:
                sketch.way(SQUARE, tags | {"area": "yes"}, closed=True)
            found = sketch.read(tmp_path).features
            assert [f.kind for f in found] == [kind] * len(row.shapes)
            assert [f.tags[key] for f in found] == [value] * len(row.shapes)


@pytest.mark.parametrize(
    "tags",
    [{"shop": "bakery"}, {"building": "no"}, {"highway": "proposed"}, {"highway": "path", "tunnel": "yes"}, {}],
)
def test_what_is_unknown_or_not_on_the_ground_is_left_out(tmp_path: Path, tags: dict[str, str]) -> None:
    assert drawn(tmp_path, SQUARE, tags, closed=True) == []


def test_ways_without_some_nodes_are_drawn_without_them(tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.way([(0, 0), (5, 0), 901, 909, (10, 0), (15, 0), (15, 5), 902, (20, 0)], {"highway": "path"})
    sketch.way([903, 904], {"highway": "path"})  # nothing is known of it
    sketch.way([(0, 10), (5, 10), (5, 15), 905], {"natural": "scrub"}, closed=True)
    sketch.way(SQUARE[:1] + SQUARE[2:3] + SQUARE[1:2] + SQUARE[3:], {"natural": "sand"}, closed=True)  # crosses itself
    sketch.relation([(906, "outer")], MULTIPOLYGON)  # nothing is known of it
    near = sketch.way([(0, 20), (5, 20)], {})
    sketch.relation([(near, "outer"), (907, "outer")], MULTIPOLYGON)
    far = sketch.way([(0, 2000), (5, 2000)], {})
    sketch.relation([(far, "outer"), (908, "outer")], MULTIPOLYGON)
    whole = sketch.way(SQUARE, {"landuse": "grass"}, closed=True)
    sketch.relation([(whole, "outer"), (910, "outer")], MULTIPOLYGON)
    found = sketch.read(tmp_path)
    assert [len(f.geometry) for f in found.features] == [4, 2, 3]
    assert found.incomplete == 5  # the path, the scrub, the sand and the two woods nearby


@pytest.mark.parametrize("first", [0, 1])
def test_areas_come_by_size_and_then_lines_and_points(tmp_path: Path, first: int) -> None:
    sketch = Sketch()
    sketch.node(0.0, 0.0, {"natural": "tree"})
    sketch.way([(0, 0), (5, 5)], {"highway": "path"})
    large = [(45, -5), (500, -5), (500, 5), (45, 5)]  # little of it is here
    ways: list[Any] = [(SQUARE, {"natural": "water"}), (large, {"landuse": "meadow"})]
    for points, tags in ways[first:] + ways[:first]:
        sketch.way(points, tags, closed=True)
    found = sketch.read(tmp_path).features
    assert [f.kind for f in found] == ["meadow", "water", "path", "tree"]
    assert area(found[0]) < area(found[1])


@pytest.mark.parametrize(
    ("tags", "kind"),
    [
        ({"leisure": "park", "natural": "water"}, "water"),
        ({"landuse": "forest", "natural": "wetland"}, "wetland"),
        ({"amenity": "parking", "building": "yes"}, "building"),
    ],
)
def test_the_first_kind_of_the_table_counts(tmp_path: Path, tags: dict[str, str], kind: str) -> None:
    (found,) = drawn(tmp_path, SQUARE, tags, closed=True)
    assert found.kind == kind


@pytest.mark.parametrize(
    ("text", "length"),
    [
        ("2", 2.0),
        ("2.5 m", 2.5),
        ("0,6", 0.6),
        ("16'3\"", 4.953),
        ("12 ft", 3.6576),
        ("80 cm", 0.8),
        ("80cm", 0.8),
        ("narrow", None),
        ("2-3", None),
        ("0", None),
        ("-1", None),
        ("nan", None),
        ("", None),
        (None, None),
    ],
)
def test_lengths_in_tags(text: str | None, length: float | None) -> None:
    assert metres(text) == (None if length is None else pytest.approx(length))


@pytest.mark.parametrize(
    ("tags", "width"),
    [
        ({"highway": "track"}, 3.5),
        ({"highway": "track", "width": "2"}, 2.0),
        ({"highway": "track", "est_width": "2.2"}, 2.2),
        ({"highway": "residential", "lanes": "3"}, 10.5),
        ({"highway": "primary", "width": "wide"}, 7.0),
        ({"highway": "steps"}, None),
        ({"highway": "cycleway"}, 2.0),
        ({"waterway": "ditch"}, 1.0),
        ({"power": "line"}, None),
    ],
)
def test_widths_of_lines(tmp_path: Path, tags: dict[str, str], width: float | None) -> None:
    (line,) = drawn(tmp_path, [(0, 0), (9, 0)], tags)
    assert line.width == width


def test_names_species_and_heights_are_kept(tmp_path: Path) -> None:
    sketch = Sketch()
    tree = {"natural": "tree", "species": "Quercus robur", "leaf_type": "broadleaved", "height": "21 m", "fixme": "?"}
    sketch.node(1.0, 1.0, tree)
    house = {"building": "barn", "building:levels": "2", "name": 'Gut "Ötz" & Söhne'}
    sketch.way(SQUARE, house, closed=True)
    barn, oak = sketch.read(tmp_path).features
    assert oak.tags == {k: v for k, v in tree.items() if k != "fixme"}
    assert (oak.height, oak.width, oak.geometry.shape) == (21.0, None, (1, 2))
    assert barn.tags == {"building": "barn", "levels": "2", "name": 'Gut "Ötz" & Söhne'}
    assert barn.height == 6.0


def sketched() -> Sketch:
    sketch = Sketch()
    sketch.node(3.0, 4.0, {"amenity": "bench"})
    sketch.way([(-80, -10), (0, -12), (80, -10)], {"highway": "track"})
    outer, inner = sketch.way(SQUARE, {}, closed=True), sketch.way([(0, 0), (5, 0), (5, 5)], {}, closed=True)
    sketch.relation([(outer, "outer"), (inner, "inner")], MULTIPOLYGON)
    return sketch


def plain(found: StreetMap) -> list[dict[str, Any]]:
    """Features with lists for arrays, which compare as a whole."""
    lists = [(f.geometry.tolist(), [hole.tolist() for hole in f.holes]) for f in found.features]
    return [f._asdict() | {"geometry": g, "holes": h} for f, (g, h) in zip(found.features, lists, strict=True)]


def test_any_order_of_a_file_and_its_binary_form_are_the_same(tmp_path: Path) -> None:
    expected = plain(sketched().read(tmp_path))
    assert [f["kind"] for f in expected] == ["wood", "track", "bench"]
    turned = sketched().write(tmp_path / "turned.osm", order="relation way node")
    assert plain(read_osm(turned, PLACE, SIZE)) == expected
    sizes = set()
    for compression in ("none", "zlib"):
        path = tmp_path / f"{compression}.osm.pbf"
        merge = osmium.MergeInputReader()
        merge.add_file(str(turned))
        with osmium.SimpleWriter(osmium.io.File(str(path), f"pbf,pbf_compression={compression}")) as writer:
            merge.apply(writer)
        assert plain(read_osm(path, PLACE, SIZE)) == expected
        sizes.add(unpacked_size(path))
    assert len(sizes) == 1
    assert sizes.pop() == pytest.approx((tmp_path / "none.osm.pbf").stat().st_size, abs=100)  # but for its headers


def test_what_an_editor_has_not_uploaded_is_read(tmp_path: Path) -> None:
    path = sketched().write(tmp_path / "map.osm")
    expected = plain(read_osm(path, PLACE, SIZE))
    path.write_text(path.read_text().replace('id="', 'id="-').replace('ref="', 'ref="-'))
    found = read_osm(path, PLACE, SIZE)
    assert plain(found) == [f | {"source": f["source"].replace("/", "/-")} for f in expected]
    assert found.incomplete == 0


@pytest.mark.parametrize("inside", ["", '<node id="1" lat="47.6" lon="11.3"/>'])
def test_a_file_without_features_is_empty(tmp_path: Path, inside: str) -> None:
    (tmp_path / "map.osm").write_text(f"<osm version='0.6'>{inside}</osm>")
    assert read_osm(tmp_path / "map.osm", PLACE, SIZE) == ([], 0)


def test_a_meadow_between_what_is_mapped_is_empty_but_another_place_is_refused(tmp_path: Path) -> None:
    sketch = Sketch()
    sketch.way([(300, 250), (-300, 250)], {"highway": "track"})
    sketch.way([(300, 300), (300, -300)], {"highway": "track"})
    sketch.way([(300, 300), (-300, 300)], {"highway": "track"})
    assert sketch.read(tmp_path) == ([], 0)
    away = Origin(48.6, 11.3, 500.0)
    with pytest.raises(ConfigurationError, match=r"about 48.6.*the file is of 47.597302, 11.296011 to 47.602698"):
        read_osm(tmp_path / "map.osm", away, SIZE)
    bounds = '<bounds minlat="48.5" minlon="11.2" maxlat="48.7" maxlon="11.4"/>'
    assert read_osm(sketch.write(tmp_path / "map.osm", bounds=bounds), away, SIZE) == ([], 0)


@pytest.mark.parametrize(
    ("name", "content", "text"),
    [
        ("map.osm", b"trees", "not a file of OpenStreetMap that osmium reads"),
        ("map.osm", b"", "not a file of OpenStreetMap that osmium reads"),
        ("map.osm.pbf", b"trees and paths", "not a file of OpenStreetMap's PBF"),
        ("map.osm.pbf", b"\x00\x00\x00\x0d\x0a\x09OSMHeader\x18\x7f", "it ends within a blob"),
        ("map.osm.bz2", b"BZh9", "unpacked, or PBF"),
        ("map.geojson", b"{}", "unpacked, or PBF"),
        (
            "map.osm",
            b'<!DOCTYPE osm [<!ENTITY a "b">]><osm version="0.6"><node id="1" lat="&a;" lon="1"/></osm>',
            "entities are not supported",
        ),
    ],
)
def test_what_is_no_map_is_one_line(tmp_path: Path, name: str, content: bytes, text: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ConfigurationError, match=text) as caught:
        read_osm(tmp_path / name, PLACE, SIZE)
    assert str(caught.value).startswith(f"{tmp_path / name}: ")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="there is no such file"):
        read_osm(tmp_path / "map.osm", PLACE, SIZE)


def test_too_much_is_refused_before_it_is_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sketch = Sketch()
    for _ in range(4000):
        sketch.node(0.0, 0.0)
    xml = sketch.write(tmp_path / "city.osm")
    with osmium.SimpleWriter(str(tmp_path / "city.osm.pbf")) as writer:
        osmium.apply(str(xml), writer)
    packed = (tmp_path / "city.osm.pbf").stat().st_size
    assert packed < 0.5 * unpacked_size(tmp_path / "city.osm.pbf")
    monkeypatch.setattr(osm, "MOST_BYTES", packed)
    for path in (xml, tmp_path / "city.osm.pbf"):
        with pytest.raises(ConfigurationError, match=r"MiB unpacked, at most .* cut it first: osmium extract"):
            read_osm(path, PLACE, SIZE)


def test_points_on_and_beyond_the_edge(tmp_path: Path) -> None:
    sketch = Sketch()
    for x, y in [(49.9, 39.9), (50.1, 0.0), (0.0, -40.1), (-49.9, -39.9)]:
        sketch.node(x, y, {"natural": "tree"})
    found: list[Array] = [f.geometry for f in sketch.read(tmp_path).features]
    assert np.allclose(np.concatenate(found), [(49.9, 39.9), (-49.9, -39.9)], atol=0.01)
