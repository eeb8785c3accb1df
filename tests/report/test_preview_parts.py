# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Parts of the sheet: projection of the aerial view, choice of viewpoints, drawing of clouds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from report_worlds import EXPERIMENT, plain
from small_park import small_park

from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.drive.traversability import distance_to, obstacle_outlines
from fieldtruth.experiment.rig import Rig
from fieldtruth.render.bake import bake
from fieldtruth.report.drawing.cloud import Cloud, draw_cloud
from fieldtruth.report.drawing.images import downscaled
from fieldtruth.report.drawing.maps import HEIGHT, MARGIN, Aerial, arc, render_aerial
from fieldtruth.report.drawing.style import NIGHT
from fieldtruth.report.preview import free_viewpoints, most_informative, view_of
from fieldtruth.sense.scene import Scene

pytestmark = pytest.mark.usefixtures("small_sky")


@pytest.fixture(scope="module")
def aerial() -> Aerial:
    """View of flat ground 2 m high, which is grass in the south and gravel in the north."""
    world = plain(30.0, height=2.0, trail_north_of_0=True)
    return render_aerial(bake(Scene(world), EXPERIMENT.light), 160)


def test_aerial_projection_matches_closed_form(aerial: Aerial) -> None:
    assert aerial.photo.shape == (160, 160, 3)
    half = 15.0 + MARGIN
    scale = 160 / (2 * half)  # pixels per metre of ground
    corners = aerial.ground_pixels(np.array([[0.0, 0.0], [half, half], [-half, 4.0]]))
    np.testing.assert_allclose(corners, [(79.5, 79.5), (159.5, -0.5), (-0.5, 79.5 - 4 * scale)], atol=1e-9)
    # A point on a roof at 10 m is displaced outwards.
    roof = aerial.pixels([(6.0, -6.0, 12.0)])[0]
    np.testing.assert_allclose(roof - 79.5, 6 * scale * HEIGHT / (HEIGHT - 10) * np.ones(2), atol=1e-9)
    ring = aerial.ground_pixels(arc(np.array([5.0, -3.0]), 3.0))
    np.testing.assert_allclose(np.hypot(*(ring - (79.5 + 5 * scale, 79.5 + 3 * scale)).T), 3 * scale, atol=1e-9)


def test_aerial_photo_matches_projection_with_north_right(aerial: Aerial) -> None:
    bright = aerial.photo.astype(float).mean(axis=2)[20:140].mean(axis=0)
    edge = int(np.argmax(np.abs(np.diff(bright[20:140])))) + 20
    expected = float(aerial.pixels([(0.0, 0.0, 2.0)])[0, 0])
    assert abs(edge + 0.5 - expected) <= 1.5
    assert bright[100:140].mean() > bright[20:60].mean() + 20  # gravel is brighter than grass


def test_downscaling_averages_blocks() -> None:
    image = np.array([[[0, 0, 10], [2, 0, 10]], [[4, 0, 10], [6, 200, 10]]], np.uint8)
    np.testing.assert_array_equal(downscaled(image), [[[3, 50, 10]]])


def counts(*rows: tuple[int, ...]) -> NDArray[np.int64]:
    return np.array(rows, np.int64)


def test_most_informative_viewpoints_differ_in_classes_and_are_apart() -> None:
    everything = counts((90, 10, 0), (100, 0, 0), (30, 40, 30), (0, 0, 100))
    along = np.column_stack([np.arange(4) * 50.0, np.zeros(4)])
    assert most_informative(everything, along, 1) == [2]
    # Sum of the square roots of the shares: 2.350 with the first, 2.320 with the second or the fourth.
    assert most_informative(everything, along, 2) == [0, 2]
    assert most_informative(everything, along, 9) == [0, 1, 2, 3]
    near = np.array([[101.0, 0.0], [0.0, 0.0], [100.0, 0.0], [90.0, 0.0]])
    assert most_informative(everything, near, 2) == [1, 2]  # the only one far from the third


def test_free_viewpoints_are_clear_of_obstacles_dry_and_face_the_middle() -> None:
    park = small_park()
    found = free_viewpoints(park, Rig())
    assert len(found) == 40
    assert (np.abs(found[:, :2]) < 12).all()
    outlines = obstacle_outlines(park)
    assert len(outlines) > 3
    away = min(distance_to(each, found[:, :2]).min() for each in outlines)
    assert away > 1.5  # 1 m from the robot, whose corners are 0.6 m from its middle, less the rounding to cells
    towards = found[:, :2] + 5 * np.column_stack([np.cos(found[:, 2]), np.sin(found[:, 2])])
    assert np.hypot(*towards.T).mean() < np.hypot(*found[:, :2].T).mean()
    level = float(np.median(park.terrain.field.heights))
    dry = free_viewpoints(replace(park, water_level=level), Rig())
    assert (park.terrain.field.height_at(dry[:, 0], dry[:, 1]) > level).all()
    assert len(free_viewpoints(replace(park, water_level=99.0), Rig())) == 0


def test_cloud_points_are_drawn_at_their_projection_with_occlusion() -> None:
    cloud = Cloud(
        xyz=np.array([[10.0, 0, 0], [20.0, 0, 0], [10.0, 2.0, 0], [-5.0, 0, 0]]),
        label=np.array([Label.ROCK, Label.BUSH, Label.TREETOP, Label.TRUNK], np.uint8),
        scans=1,
    )
    ahead = transforms.pose((0, 0, 0), (-90, 0, -90))  # optical frame of a camera that looks along x
    picture = draw_cloud(cloud, ahead, width=200, height=100, fov_deg=90, size=0.5)
    np.testing.assert_array_equal(picture[50, 100], PALETTE[Label.ROCK])
    np.testing.assert_array_equal(picture[50, 80], PALETTE[Label.TREETOP])  # 2 m left of 10 m: a tenth of the width
    np.testing.assert_array_equal(picture[5, 5], NIGHT)
    colours = {tuple(colour) for colour in picture.reshape(-1, 3).tolist()}
    assert tuple(PALETTE[Label.BUSH].tolist()) not in colours
    assert tuple(PALETTE[Label.TRUNK].tolist()) not in colours


def test_view_of_points_contains_nearly_all_and_fills_the_image() -> None:
    points = np.random.default_rng(0).uniform((-50, -25, 0), (50, 25, 10), (5000, 3))
    pose = view_of(points, (10, 40, -20), fov_deg=50, aspect=1.6)
    np.testing.assert_allclose(pose[:3, 2], np.array((10, 40, -20)) / np.sqrt(2100), atol=1e-12)
    assert pose[2, 0] == 0.0  # upright
    assert pose[2, 1] < 0
    x, y, z = transforms.transform(transforms.inverse(pose), points).T
    slope = np.tan(np.radians(25))
    inside = (np.abs(x / z) < slope) & (np.abs(y / z) * 1.6 < slope) & (z > 0)
    assert inside.mean() > 0.93
    assert np.abs(x / z).max() > 0.8 * slope
    assert np.isfinite(view_of(np.zeros((0, 3)), (1, 0, -1), fov_deg=50, aspect=1.6)).all()
