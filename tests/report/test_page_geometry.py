# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Map and cloud of the page against the world."""

import base64
import dataclasses
import re
import shutil
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kept_worlds import KEPT
from numpy.typing import NDArray
from PIL import Image
from report_pages import (
    ODOMETRY,
    Messages,
    Page,
    only,
    pairs,
    positions_of,
    words,
)

from fieldtruth.core.classes import CLASSES
from fieldtruth.report.page import cloud, write_report
from fieldtruth.report.page import map as page_map
from fieldtruth.world.model import World


@pytest.fixture(scope="module")
def park_world() -> World:
    return KEPT.load_world("park", 0)


def test_path_on_the_map_matches_pinhole_projection(page: Page, messages: Messages, park_world: World) -> None:
    x, y, _ = positions_of(messages).T
    ground = park_world.terrain.surface
    above = float(ground.heights.mean()) + 300.0 - ground.height_at(x, y)
    sheet = page.one(".//figure[@class='map']//{*}svg")
    width, height = (float(v) for v in sheet.get("viewBox", "").split()[2:])
    column = width / 2 + width / 2 * (x / above) / (51.0 / 300.0)
    row = height / 2 - height / 2 * (y / above) / (26.0 / 300.0)
    photo = Image.open(BytesIO(base64.b64decode(page.images("image/jpeg")[0])))
    assert photo.size == (width, height)
    drawn = pairs(page.one(".//{*}polyline[@class='path']").get("points", ""))
    assert drawn == pytest.approx(np.column_stack([column, row]), abs=0.06)
    moves = page.data("numbers")["path"]
    assert np.array(moves)[:, 1:] == pytest.approx(100 * np.column_stack([column / width, row / height]), abs=0.02)
    assert [t for t, *_ in moves][:3] == [19, 39, 59]  # 0.02 s minus 0.001 s, the start of the bag


def test_waypoints_are_circles_of_the_arrival_distance(page: Page) -> None:
    rings = [pairs(ring.get("points", "")) for ring in page.root.findall(".//{*}polygon[@class='ring']")]
    assert len(rings) == 9
    metre = 600 / 102.0
    for ring in rings:
        radius = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
        assert radius == pytest.approx(np.full(64, 2.0 * metre), rel=0.02)
    # The route leads north, which is right.
    assert (np.diff([ring[:, 0].mean() for ring in rings]) > 0).all()


def cloud_of(page: Page) -> tuple[NDArray[np.float64], NDArray[np.uint8], dict[str, Any]]:
    """Points (n, 3) [m], labels and settings of the cloud, decoded independently."""
    settings = page.data("cloud-settings")
    found = re.search(r'id="cloud-data">([^<]*)<', page.text)
    assert found is not None
    data = base64.b64decode(found[1])
    n = settings["count"]
    assert len(data) == 7 * n
    steps = np.frombuffer(data, "<i2", 3 * n).reshape(n, 3)
    return steps * settings["step"] + settings["middle"], np.frombuffer(data, np.uint8, offset=6 * n), settings


def test_ground_and_trail_points_lie_on_the_terrain(page: Page, park_world: World) -> None:
    xyz, label, _ = cloud_of(page)
    inside = (np.abs(xyz[:, :2]) < np.array(park_world.size) / 2 - 0.5).all(axis=1)
    low = xyz[inside & np.isin(label, (1, 7))]
    assert len(low) > 20_000
    off = low[:, 2] - park_world.terrain.surface.height_at(low[:, 0], low[:, 1])
    assert (
        np.quantile(np.abs(off), 0.97) < 0.003
    )  # the rest are kerbs, mulch and litter, which also have the class ground
    assert np.abs(off).max() < 0.15  # blades on the lawn
    trail = xyz[inside & (label == 7)]
    assert len(trail) > 500
    spot = park_world.terrain.trail_distance
    column = np.rint((trail[:, 0] - spot.x0) / spot.spacing).astype(int)
    row = np.rint((trail[:, 1] - spot.y0) / spot.spacing).astype(int)
    assert (spot.values[column, row] < spot.spacing).mean() > 0.999


def test_cloud_contains_the_path_and_legend_counts_match(page: Page, messages: Messages) -> None:
    xyz, label, settings = cloud_of(page)
    route = xyz[label == settings["path"]]
    positions = positions_of(messages)
    assert route[[0, -1]] == pytest.approx(positions[[0, -1]], abs=2 * settings["step"])
    counts = np.bincount(label[label != settings["path"]], minlength=len(CLASSES))
    assert counts.sum() <= cloud.LARGEST
    legend = {
        words(row.find("span")): words(row.find("small"))  # type: ignore[arg-type]
        for row in page.root.findall(".//fieldset[@id='legend']/label")
    }
    assert legend.pop("path of the robot") == ""
    assert legend == {row.name: f"{counts[row.label]:,}" for row in CLASSES if counts[row.label]}
    cells = np.floor(xyz[label != settings["path"]] / settings["voxel"])
    assert len(np.unique(cells, axis=0)) > 0.9 * len(cells)  # rounding moves some points across the side of a voxel


def test_a_different_world_is_not_shown(
    small_run: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    park_world: World,
    messages: Messages,
) -> None:

    folder = tmp_path / "park_1"
    folder.mkdir()
    only(small_run / "park_1.bag", folder / "park_1.bag", ODOMETRY, "/gazebo/model_states")
    shutil.copy(small_run / "experiment.yaml", folder)
    moved = park_world.instances[5].world_from_object.copy()
    moved[1, 3] += 0.01
    instances = [*park_world.instances]
    instances[5] = dataclasses.replace(instances[5], world_from_object=moved)
    monkeypatch.setattr(page_map, "world_of", lambda _: dataclasses.replace(park_world, instances=tuple(instances)))
    page = Page(write_report(folder))
    assert "builds another world from experiment.yaml than the one in the bag" in page.words(".//section[@id='path']")
    assert page.one(".//figure[@class='map plain']") is not None
    metres = [ruler(page, "x", "left"), ruler(page, "y", "top")]
    assert metres[0][0] > 0.0 > metres[1][0]  # north is right, west is up
    width, height = (float(v) for v in page.one(".//figure[@class='map plain']//{*}svg").get("viewBox", "").split()[2:])
    percent = 100 * pairs(page.one(".//{*}polyline[@class='path']").get("points", "")) / (width, height)
    drawn = [scale * column + offset for (scale, offset), column in zip(metres, percent.T, strict=True)]
    assert np.array(drawn) == pytest.approx(positions_of(messages)[:, :2].T, abs=0.02)


def ruler(page: Page, kind: str, side: str) -> NDArray[np.float64]:
    """Metres per percent, and metres at zero, from the numbers along a side of the grid."""
    marks = page.root.findall(f".//span[@class='mark {kind}']")
    at = [float(re.findall(rf"{side}: ([-\d.]+)%", mark.get("style", ""))[0]) for mark in marks]
    assert len(at) > 2
    return np.polyfit(at, [float(words(mark)) for mark in marks], 1)
