# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Maps of a site in a preview: each part is where the view from above shows it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_worlds import plain

from fieldtruth.core import transforms
from fieldtruth.core.errors import ConfigurationError
from fieldtruth.core.geodesy import PAPER_ORIGIN
from fieldtruth.core.lenses import Lens
from fieldtruth.core.progress import Progress, Silent
from fieldtruth.maps.elevation import Elevation
from fieldtruth.maps.osm import Feature, StreetMap
from fieldtruth.maps.tags import kinds
from fieldtruth.maps.trees import Tree
from fieldtruth.report import site_map
from fieldtruth.report.drawing.maps import HEIGHT, Aerial
from fieldtruth.report.drawing.paper import Paper
from fieldtruth.report.preview import _write_title, preview
from fieldtruth.report.site_map import draw_inputs
from fieldtruth.world.environments.site.config import Config
from fieldtruth.world.environments.site.inputs import Inputs, MappedTrees

pyproj = pytest.importorskip("pyproj")
transform = pytest.importorskip("rasterio.transform")

CENTRE = (47.6, 11.3)
SIDE = 40.0
SCALE = 8.0  # [pixel/m]


def aerial() -> Aerial:
    """A view of flat ground of 0 m, whose pixel is 1 / ``SCALE`` metres."""
    pixels = round(SIDE * SCALE)
    middle = (pixels - 1) / 2
    return Aerial(
        photo=np.zeros((pixels, pixels, 3), np.uint8),
        world_from_optical=transforms.pose((0.0, 0.0, HEIGHT), (180.0, 0.0, 0.0)),
        lens=Lens("pinhole", SCALE * HEIGHT, SCALE * HEIGHT, middle, middle),
        field=plain(SIDE).terrain.field,
    )


def at(image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], x: float, y: float) -> list[int]:
    """Colour at a position [m]; north is right, west is up."""
    middle = (image.shape[0] - 1) / 2
    return [int(value) for value in image[round(middle - SCALE * y), round(middle + SCALE * x)]]


def test_colours_are_of_kinds_that_there_are() -> None:
    assert set(site_map._AREAS) | set(site_map._LINES) <= set(kinds())


def test_a_sheet_says_where_a_site_is_even_where_the_paper_was(monkeypatch: pytest.MonkeyPatch) -> None:
    texts: list[str] = []
    paper = Paper(1.0, 1.0, 10)
    monkeypatch.setattr(paper, "text", lambda x, y, text, *_, **__: texts.append(text))
    world = plain(SIDE)
    assert world.origin == PAPER_ORIGIN
    for layout in ({}, {"centre": PAPER_ORIGIN[:2]}):
        _write_title(paper, replace(world, layout=layout))
    assert [text for text in texts if text.startswith("site about")] == [
        f"site about {PAPER_ORIGIN.latitude:.6f}, {PAPER_ORIGIN.longitude:.6f} (latitude, longitude)"
    ]


def test_the_stages_of_building_a_site_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []

    def load(*_: Any, progress: Progress | None = None) -> None:
        given.append(progress)
        raise ConfigurationError("enough")

    monkeypatch.setattr("fieldtruth.report.preview.load_world", load)
    with pytest.raises(ConfigurationError, match="enough"):
        preview("park", progress=(shown := Silent()))
    assert given == [shown]


def test_each_part_of_the_maps_is_drawn_at_its_place() -> None:
    lake = Feature("water", np.array([(2.0, 2.0), (12.0, 2.0), (12.0, 12.0), (2.0, 12.0)]), True, {})
    road = Feature("road", np.array([(-18.0, -10.0), (18.0, -10.0)]), False, {}, 4.0)
    trees = MappedTrees([Tree(-10.0, 8.0, 20.0, 3.0, None, None)], ())
    inputs = Inputs(None, trees, StreetMap([lake, road], 0))
    image = draw_inputs(Config(centre=CENTRE, size=(SIDE, SIDE)), inputs, aerial())
    assert image.shape == (320, 320, 3)
    red, green, blue = at(image, 7.0, 7.0)
    assert blue > green > red  # water
    assert max(at(image, 0.0, -10.0)) < 140  # the road's grey, across its 4 m
    assert max(at(image, 0.0, -11.7)) < 140
    assert at(image, 0.0, -12.5) == [255, 255, 255]
    red, green, blue = at(image, -10.0, 8.0)
    assert green > red > 100  # a crown
    assert at(image, -10.0, 11.6) == [255, 255, 255]  # beyond its radius
    assert at(image, 7.0, -2.0) == [255, 255, 255]


def test_the_relief_is_lit_from_the_upper_left() -> None:
    """A ridge along x: its side to the west, up in the picture, is bright."""
    crs = pyproj.CRS("EPSG:32632")
    east, north = pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(*CENTRE[::-1])
    to_west = -(np.arange(120) + 0.5 - 60.0)  # [m] of columns
    heights = np.tile(600.0 - 0.5 * np.abs(to_west), (120, 1))
    frame = transform.from_origin(east - 60.0, north + 60.0, 1.0, 1.0)
    surface = Elevation(Path("dem.tif"), crs, heights, heights < 0.0, frame, 1.0, "")
    image = draw_inputs(Config(centre=CENTRE, size=(SIDE, SIDE)), Inputs(surface, None, None), aerial())
    assert at(image, 0.0, 10.0)[0] > at(image, 0.0, -10.0)[0] + 40
