# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Excerpts of real files, against what other readers find in them.

- ``autzen_60m.laz``: 60 m x 60 m of PDAL's ``test/data/laz/autzen_trim.laz`` (BSD), in feet.
- ``village.osm``: osmnx's ``tests/input_data/planet_10.068,48.135_10.071,48.137.osm`` (MIT; data © OpenStreetMap
  contributors, ODbL).
"""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from fieldtruth.core.geodesy import Origin, geodetic_from_world
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.inputs import describe, read_inputs

pyproj = pytest.importorskip("pyproj")
laspy = pytest.importorskip("laspy")
pytest.importorskip("osmium")

DATA = Path(__file__).parent / "data"
AUTZEN = Origin(44.050728, -123.07119, 0.0)
VILLAGE = Origin(48.136, 10.0695, 0.0)
FOOT = 0.3048


def site(place: Origin, size: tuple[float, float], **files: str) -> Config:
    given: dict[str, Any] = {key: {"file": str(DATA / name)} for key, name in files.items()}
    return Config.model_validate({"centre": place[:2], "size": size} | given)


def test_a_scan_in_feet_gives_the_ground_and_the_tallest_tree() -> None:
    config = site(AUTZEN, (30.0, 30.0), elevation="autzen_60m.laz", trees="autzen_60m.laz")
    inputs = read_inputs(config)
    cloud = laspy.read(DATA / "autzen_60m.laz")
    to_map = pyproj.Transformer.from_crs(4326, cloud.header.parse_crs(), always_xy=True)
    east, north = to_map.transform(AUTZEN.longitude, AUTZEN.latitude)
    ground = np.asarray(cloud.classification) == 2
    away = np.hypot(cloud.x - east, cloud.y - north) * FOOT
    assert inputs.elevation is not None
    here = inputs.elevation.at(np.array([-1.0, 0.0, 1.0, 2.0]), np.array([-1.0, 0.0, 1.0, 2.0]), AUTZEN)[1, 1]
    assert here == pytest.approx(np.median(cloud.z[ground & (away < 4.0)]) * FOOT, abs=0.4)
    assert inputs.trees is not None
    tallest = max(inputs.trees.trees, key=lambda tree: tree.height or 0.0)
    latitude, longitude, _ = geodetic_from_world((tallest.x, tallest.y, 0.0), AUTZEN)
    x, y = to_map.transform(longitude, latitude)
    away = np.hypot(cloud.x - x, cloud.y - y) * FOOT
    below = np.flatnonzero(ground)[np.argsort(away[ground])[:8]]  # the slope there falls by metres
    known = (np.max(cloud.z[away < 1.5]) - np.mean(cloud.z[below])) * FOOT
    assert tallest.height == pytest.approx(known, abs=1.0)


def test_a_village_has_the_buildings_of_its_map() -> None:
    config = site(VILLAGE, (160.0, 140.0), map="village.osm")
    root = ElementTree.parse(DATA / "village.osm").getroot()
    nodes = {
        each.get("id"): (float(each.get("lat", "nan")), float(each.get("lon", "nan"))) for each in root.iter("node")
    }
    to_map = pyproj.Transformer.from_crs(4326, 32632, always_xy=True)
    middle = np.array(to_map.transform(VILLAGE.longitude, VILLAGE.latitude))
    inside = 0
    for way in root.iter("way"):
        corners = [nodes[ref.get("ref")] for ref in way.iter("nd") if ref.get("ref") in nodes]
        if any(tag.get("k") == "building" for tag in way.iter("tag")):
            places = np.array([to_map.transform(longitude, latitude) for latitude, longitude in corners]) - middle
            inside += bool((np.abs(places.mean(axis=0)) < (65.0, 75.0)).all())  # well inside, whatever the map's north
    inputs = read_inputs(config)
    assert inputs.streets is not None
    found = [each for each in inputs.streets.features if each.kind == "building"]
    assert 3 < inside <= len(found) <= inside + 6  # those that the edge cuts
    text = " ".join(describe(config, inputs))
    assert f"{len(found)} building" in text
    assert "© OpenStreetMap contributors, ODbL" in text
