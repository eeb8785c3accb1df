# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The comparison itself, without Gazebo: it finds every changed beam and pixel, and knows which lie on an edge."""

from typing import Final

import numpy as np
import pytest
from comparison import NEARBY, Beams, compare_image, compare_scan
from sense_worlds import at, box, make_world

from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera
from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.world.model import Raster

LIDAR: Final = LidarConfig(columns=8, rings=5, vertical_fov_deg=40.0, min_range=0.1)
CAMERA: Final = StereoConfig(width=320, height=184)
POSE: Final = at(0.0, 0.0, 1.0)
WORLD_FROM_CAMERA: Final = transforms.pose((0.0, 0.0, 1.0), (0.0, 90.0, 0.0))


def scene(beside: float) -> Scene:
    """A wall 5 m ahead whose edge to the left is ``beside`` [rad] to the right of the column at 45 deg."""
    half = 5.0 * np.tan(np.pi / 4 - beside)
    return Scene(make_world([(box("wall", (1.0, half, 4.0)), at(6.0, 0.0, 0.0))]))


def own_beams(of: Scene) -> Beams:
    nothing = Beams(np.full((8, 5), np.inf), np.zeros((8, 5)))
    ours = compare_scan(of, LIDAR, POSE, nothing).ours
    return Beams(ours.range_m.copy(), ours.label.copy())


@pytest.mark.parametrize("side", [1, -1])
def test_only_beams_with_an_edge_beside_them_graze_it(side: int) -> None:
    for beside, expected in ((NEARBY / 2, [1, 7]), (NEARBY * 2, [])):  # columns 45 deg to the right and to the left
        walls = scene(side * beside)
        beams = own_beams(walls)
        beams.label[:, :3] += 1  # the other beams meet the ground before the wall
        found = compare_scan(walls, LIDAR, POSE, beams)
        assert found.differ[:, :3].all()
        assert not found.differ[:, 3:].any()
        assert np.flatnonzero(found.grazing.any(axis=1)).tolist() == expected
        assert found.grazing[expected, :3].all()


def test_beams_on_the_ground_graze_the_edge_of_a_trail_within_a_centimetre() -> None:
    for beside, expected in ((0.008, True), (0.012, False)):
        distance = np.array([[-beside - 20.0, -beside - 20.0], [20.0 - beside, 20.0 - beside]], np.float32)
        ahead = 1.0 / np.tan(np.radians(20.0))  # where the lowest beam ahead meets the ground
        trail = Raster(values=distance, spacing=40.0, x0=ahead - 20.0, y0=-20.0)
        ground = Scene(make_world(trail=trail))
        beams = own_beams(ground)
        beams.label[0, 4] += 1
        assert compare_scan(ground, LIDAR, POSE, beams).grazing[0, 4] == expected


@pytest.mark.parametrize(("metres", "expected"), [(2.0, True), (1.5, False)])
def test_a_beam_between_two_triangles_may_meet_what_is_behind(metres: float, expected: bool) -> None:
    up = np.radians(10.0)  # ahead and upwards, the beam meets the diagonal of the wall's front, 2 m before its back
    wall = Scene(make_world([(box("wall", (1.0, 3.0, 4.0)), at(6.0, 0.0, 1.0 + 5.0 * np.tan(up)))]))
    beams = own_beams(wall)
    beams.range_m[0, 1] += metres / np.cos(up)
    assert compare_scan(wall, LIDAR, POSE, beams).grazing[0, 1] == expected


def test_changed_ranges_and_classes_differ() -> None:
    walls = scene(0.1)
    for change, expected in (((0, 2, 0.004, 0), False), ((0, 2, 0.006, 0), True), ((0, 2, 0.0, 1), True)):
        column, ring, metres, label = change
        beams = own_beams(walls)
        beams.range_m[column, ring] += metres
        beams.label[column, ring] += label
        found = compare_scan(walls, LIDAR, POSE, beams)
        assert found.differ.sum() == int(expected)
        assert found.differ[column, ring] == expected
    lost = own_beams(walls)
    lost.range_m[3, 4], lost.label[3, 4] = np.inf, 0
    assert np.argwhere(compare_scan(walls, LIDAR, POSE, lost).differ).tolist() == [[3, 4]]


def test_changed_pixels_differ_and_silhouettes_are_known() -> None:
    walls = Scene(make_world([(box("wall", (1.0, 1.0, 4.0)), at(6.0, 0.0, 0.0))]))
    label = LabelCamera(CAMERA, walls).label(WORLD_FROM_CAMERA @ CAMERA_FROM_OPTICAL).label
    row = CAMERA.height // 2
    edge = int(np.argmax(label[row] == Label.ROCK))
    image = PALETTE[label].copy()
    for column in (edge - 3, edge - 2, edge + 1, edge + 4):
        image[row, column] = (9, 9, 9)
    found = compare_image(walls, CAMERA, WORLD_FROM_CAMERA, image)
    np.testing.assert_array_equal(found.ours, PALETTE[label])
    assert np.argwhere(found.differ).tolist() == [[row, edge + k] for k in (-3, -2, 1, 4)]
    assert [bool(found.near_silhouette[row, edge + k]) for k in (-4, -2, 1, 4)] == [False, True, True, False]


def test_a_silhouette_thinner_than_the_rays_is_found_where_pixels_differ() -> None:
    thin = Scene(make_world([(box("blade", (0.01, 0.001, 4.0)), at(6.0, 0.0, 0.0))]))
    label = LabelCamera(CAMERA, thin).label(WORLD_FROM_CAMERA @ CAMERA_FROM_OPTICAL).label
    assert not (label == Label.ROCK).any()  # 2 mm of width; rays through pixels are 26 mm apart there
    image = PALETTE[label].copy()
    row, column = 20, CAMERA.width // 2
    image[row, column] = PALETTE[Label.ROCK]
    image[row, column + 40] = PALETTE[Label.ROCK]
    found = compare_image(thin, CAMERA, WORLD_FROM_CAMERA, image)
    assert found.near_silhouette[row, column]
    assert not found.near_silhouette[row, column + 40]
