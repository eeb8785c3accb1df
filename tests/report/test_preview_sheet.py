# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The sheet of a small park, with and without an experiment."""

import numpy as np
import pytest
from numpy.typing import NDArray
from report_worlds import EXPERIMENT
from small_park import RIG, small_park

import fieldtruth
from fieldtruth.core.errors import UnknownNameError
from fieldtruth.core.progress import Silent
from fieldtruth.experiment.config import Experiment
from fieldtruth.report import preview as content_module
from fieldtruth.report.preview import SheetContent, collect_content, draw_sheet, occurring_classes, preview

pytestmark = pytest.mark.usefixtures("small_sky", "in_park")


def content_of(monkeypatch: pytest.MonkeyPatch, experiments: list[Experiment]) -> SheetContent:
    monkeypatch.setattr(content_module, "experiments_in", lambda environment: experiments)
    return collect_content(small_park(), aerial_width=160, rig=RIG, spacing=3.0, workers=2, progress=Silent())


def near(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> int:
    """Number of pixels that differ from a colour by less than 12 in each channel."""
    return int((np.abs(picture.astype(int) - colour) < 12).all(axis=2).sum())


def test_sheet_shows_route_views_cloud_and_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    found = content_of(monkeypatch, [EXPERIMENT])
    [route] = found.routes
    assert route.name == "small_1"
    np.testing.assert_allclose(route.waypoints, [(-8, 0), (0, 0), (8, 0)], atol=1e-3)
    assert len(found.viewpoints) == len(found.shares.pixels) == found.cloud.scans == 5
    assert len(found.views) == 4
    for view in found.views:
        assert view.photo.shape == (48, 64, 3)
        assert any((view.viewpoint == viewpoint).all() for viewpoint in found.viewpoints)
    assert len(found.cloud.label) <= found.shares.points.sum()
    assert (np.abs(found.cloud.xyz[:, :2]) < 12).all()
    assert {row.name for row, _, _ in occurring_classes(found.shares)} >= {"ground", "trail", "treetop", "sky"}

    sheet = draw_sheet(found, 1200)
    assert sheet.shape[1:] == (1200, 3)
    assert sheet.dtype == np.uint8
    assert (sheet[:20] == 255).all()
    above = sheet[150 : 150 + 1110]
    assert near(above, (47, 128, 255)) > 150  # the line
    assert near(above, (255, 59, 48)) > 200  # the circles
    below = sheet[-460:]
    assert near(below, (47, 111, 222)) > 200  # bars of pixels
    assert near(below, (220, 63, 54)) > 200  # bars of points
    np.testing.assert_array_equal(sheet, draw_sheet(found, 1200))


def test_environment_without_experiments_has_a_sheet_without_routes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content_module, "FREE_VIEWPOINTS", 6)
    found = content_of(monkeypatch, [])
    assert found.routes == ()
    assert (len(found.viewpoints), len(found.views)) == (6, 4)
    sheet = draw_sheet(found, 1200)
    assert near(sheet[150:1260], (47, 128, 255)) == 0


def test_unknown_environment_lists_the_known_ones() -> None:
    assert fieldtruth.preview is preview
    with pytest.raises(UnknownNameError, match=r"unknown environment 'prak'; did you mean 'park'\? Available: .*park"):
        preview("prak")
