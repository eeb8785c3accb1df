# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Pixels in closed form: fields of view, pixel centres, handedness, depth along the optical axis, sky."""

import numpy as np
import pytest
from sense_worlds import F8, Placed, at, box, floating, make_world, quad

from fieldtruth.core import transforms
from fieldtruth.core.classes import PALETTE, Label
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.rig import Rig
from fieldtruth.sense.lens import intrinsics_of
from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.camera.config import CAMERA_FROM_OPTICAL, StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera, LabelImages, tag_image

CONFIG = StereoConfig()
WIDTH, HEIGHT = 1280, 720
TAN_X, TAN_Y = np.tan(np.radians(69.0 / 2)), np.tan(np.radians(42.0 / 2))


def tangents(config: StereoConfig = CONFIG) -> tuple[F8, F8]:
    """Tangents of the angles from the optical axis to the pixel centres, right (w,) and down (h,)."""
    a = (2 * (np.arange(config.width) + 0.5) / config.width - 1) * np.tan(np.radians(config.horizontal_fov_deg / 2))
    b = (2 * (np.arange(config.height) + 0.5) / config.height - 1) * np.tan(np.radians(config.vertical_fov_deg / 2))
    return a, b


def patch(name: str, u: tuple[float, float], v: tuple[float, float], z: float, material: str = "stone") -> Placed:
    """A quadrilateral at depth z [m] that fills image points u, v [pixel]; (0, 0) is the corner pixel's centre."""
    x = [(2 * (c + 0.5) / WIDTH - 1) * TAN_X * z for c in u]
    y = [(2 * (c + 0.5) / HEIGHT - 1) * TAN_Y * z for c in v]
    return quad(name, [[x[0], y[0], z], [x[1], y[0], z], [x[1], y[1], z], [x[0], y[1], z]], material), at(0, 0, 0)


def label(*objects: Placed) -> LabelImages:
    return LabelCamera(CONFIG, floating(*objects)).label(np.eye(4))


def test_intrinsics() -> None:
    lens = intrinsics_of(CONFIG)
    assert np.degrees(np.arctan2(WIDTH / 2, lens.fx)) * 2 == pytest.approx(69.0)
    assert np.degrees(np.arctan2(HEIGHT / 2, lens.fy)) * 2 == pytest.approx(42.0)
    assert (lens.cx, lens.cy) == (639.5, 359.5)


@pytest.mark.parametrize(("width", "height"), [(2, 2), (3, 5), (9, 7), (16, 31), (131, 33), (321, 181)])
def test_every_pixel_of_an_image_of_any_size_is_labelled(width: int, height: int) -> None:
    """A patch that fills a part of the view, with a border inside the last tile of rays, and sky around."""
    config = CONFIG.model_copy(update={"width": width, "height": height})
    x, y, z = (-0.45 * TAN_X, 0.93 * TAN_X), (-0.93 * TAN_Y, 0.7 * TAN_Y), 8.0
    corners = [[x[i] * z, y[j] * z, z] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    scene = floating((quad("patch", corners, "stone"), at(0, 0, 0)))
    seen = LabelCamera(config, scene).label(np.eye(4))
    a, b = tangents(config)
    inside = ((b > y[0]) & (b < y[1]))[:, None] & ((a > x[0]) & (a < x[1]))
    assert 0 < inside.sum() < inside.size
    assert np.array_equal(seen.label == Label.ROCK, inside)
    assert np.array_equal(seen.label == Label.SKY, ~inside)
    assert np.array_equal(seen.instance, np.where(inside, 2, 0))
    np.testing.assert_allclose(seen.depth, np.where(inside, z, 0.0), atol=1e-5)


@pytest.mark.parametrize("column", [0, 1, 401, 639, 640, 1279])
def test_thin_post_fills_the_column_whose_centre_it_covers(column: int) -> None:
    seen = label(patch("post", (column - 0.4, column + 0.4), (-9, 729), 8.0))
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[:, column] = True
    assert np.array_equal(seen.label == Label.ROCK, expected)
    assert np.array_equal(seen.instance == 2, expected)


@pytest.mark.parametrize("row", [0, 1, 359, 360, 719])
def test_thin_bar_fills_the_row_whose_centre_it_covers(row: int) -> None:
    seen = label(patch("bar", (-9, 1289), (row - 0.4, row + 0.4), 8.0))
    expected = np.zeros((HEIGHT, WIDTH), bool)
    expected[row] = True
    assert np.array_equal(seen.label == Label.ROCK, expected)


def test_surfaces_outside_the_image_or_between_pixel_centres_are_not_seen() -> None:
    seen = label(
        patch("left", (-9, -0.6), (-9, 729), 5.0),
        patch("right", (1279.6, 1290), (-9, 729), 5.0),
        patch("up", (-9, 1290), (-9, -0.6), 5.0),
        patch("down", (-9, 1290), (719.6, 729), 5.0),
        patch("between", (500.1, 500.9), (-9, 729), 5.0),
    )
    assert set(seen.label.ravel()) == {Label.SKY}
    assert np.all(seen.instance == 0)
    assert np.all(seen.depth == 0)


def test_image_is_not_mirrored() -> None:
    """Objects on the robot's left (+y) and above it, in the paper's frames and in our optical frame."""
    objects = [
        (box("left", (0.2, 0.2, 0.2), "wood"), at(6, 1.5, 1)),
        (box("right", (0.2, 0.2, 0.2), "stone"), at(6, -1.5, 1)),
        (box("above", (0.2, 0.2, 0.2), "leaf"), at(6, 0, 2.5)),
        (box("below", (0.2, 0.2, 0.2), "bark"), at(6, 0, -0.5)),
        (box("behind", (0.2, 0.2, 0.2), "soil"), at(-6, 0, 1)),
    ]
    scene = floating(*objects)
    base = at(0, 0, 1)
    straight = LabelCamera(CONFIG, scene).label(base @ OPTICAL)
    paper = transforms.pose((0, 0, 0), (0, 90, 0)) @ CAMERA_FROM_OPTICAL
    assert np.array_equal(straight.label, LabelCamera(CONFIG, scene).label(base @ paper).label)
    centres = {int(k): np.argwhere(straight.instance == k).mean(axis=0) for k in np.unique(straight.instance) if k}
    assert set(centres) == {2, 3, 4, 5}
    fx, fy = intrinsics_of(CONFIG).fx, intrinsics_of(CONFIG).fy
    # The camera sees the near face of each box, 0.2 m before its centre, and one side.
    assert centres[2] == pytest.approx([359.5, 639.5 - fx * 1.5 / 5.8], abs=fx * 0.05)
    assert centres[3] == pytest.approx([359.5, 639.5 + fx * 1.5 / 5.8], abs=fx * 0.05)
    assert centres[4] == pytest.approx([359.5 - fy * 1.5 / 5.8, 639.5], abs=fy * 0.05)
    assert centres[5] == pytest.approx([359.5 + fy * 1.5 / 5.8, 639.5], abs=fy * 0.05)
    assert straight.label[straight.instance == 2].max() == straight.label[straight.instance == 2].min() == Label.BENCH


def test_mounts_of_the_stereo_cameras() -> None:
    rig = Rig().stereo
    left, right = (mount.base_from_sensor @ CAMERA_FROM_OPTICAL for mount in (rig.left, rig.right))
    for pose, y in ((left, 0.06), (right, -0.06)):
        assert pose[:3, 3] == pytest.approx([0.15, y, 0.72])
        assert pose[:3, :3] == pytest.approx(np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], float), abs=1e-12)
    # A post 6 m ahead on the centre line is in the right half of the left image, and the left half of the right one.
    camera = LabelCamera(CONFIG, floating((box("post", (0.01, 0.01, 3)), at(6, 0, 0))))
    half = intrinsics_of(CONFIG).fx * 0.06 / 5.85
    for pose, u in ((left, 639.5 + half), (right, 639.5 - half)):
        assert np.argwhere(camera.label(pose).label == Label.ROCK)[:, 1].mean() == pytest.approx(u, abs=0.5)


def test_depth_of_a_slanted_plane_matches_closed_form() -> None:
    """A plane through (0, 0, 6) in the optical frame with a slanted normal, and a tilted camera."""
    pose = transforms.pose((3, -4, 20), (25, -40, 110))
    normal = np.array([0.4, -0.5, -1.0])
    side = np.cross(normal, [0, 1, 0]) / np.linalg.norm(np.cross(normal, [0, 1, 0]))
    up = np.cross(normal, side) / np.linalg.norm(normal)
    corners = np.array([[0, 0, 6]]) + 40 * np.array([side + up, side - up, -side - up, -side + up])
    seen = LabelCamera(CONFIG, floating((quad("plane", corners), pose))).label(pose)
    a, b = tangents()
    expected = normal[2] * 6 / (normal[0] * a + normal[1] * b[:, None] + normal[2])
    assert expected.min() > 3
    assert set(seen.label.ravel()) == {Label.ROCK}
    assert np.abs(seen.depth / expected - 1).max() < 1e-5


def test_depth_of_a_plane_normal_to_the_axis_is_constant() -> None:
    seen = label(patch("wall", (-9, 1289), (-9, 729), 7.5))
    assert np.abs(seen.depth - 7.5).max() < 1e-5
    assert (seen.label.dtype, seen.instance.dtype, seen.depth.dtype) == (
        np.dtype(np.uint8),
        np.dtype(np.uint32),
        np.dtype(np.float32),
    )


def test_depth_of_the_ground_matches_closed_form() -> None:
    config = StereoConfig(width=320, height=184)
    seen = LabelCamera(config, Scene(make_world(side=60.0))).label(at(0, 0, 0.8) @ OPTICAL)
    _, b = tangents(config)
    near = (b > 0) & (0.8 / np.maximum(b, 1e-9) < 20.0)
    assert np.count_nonzero(near) > 60
    assert np.abs(seen.depth[near] * b[near][:, None] / 0.8 - 1).max() < 1e-4
    assert set(seen.label[near].ravel()) == {Label.GROUND}
    assert set(seen.instance[near].ravel()) == {1}
    assert set(seen.label[b < 0].ravel()) == {Label.SKY}


def test_far_limits_the_distance_along_the_ray() -> None:
    wall = patch("wall", (-9, 1289), (-9, 729), 10.0)
    seen = LabelCamera(StereoConfig(far=11.0), floating(wall)).label(np.eye(4))
    a, b = tangents()
    distance = 10.0 * np.sqrt(1 + a**2 + b[:, None] ** 2)
    assert np.all(seen.label[distance < 11.0 - 1e-4] == Label.ROCK)
    assert np.all(seen.label[distance > 11.0 + 1e-4] == Label.SKY)
    assert np.all(seen.depth[distance > 11.0 + 1e-4] == 0)


def test_water_has_label_and_depth() -> None:
    seen = label(patch("pond", (-9, 1289), (-9, 729), 4.0, "water"), patch("stone", (-9, 1289), (-9, 729), 5.0))
    assert set(seen.label.ravel()) == {Label.WATER}
    assert set(seen.instance.ravel()) == {2}
    assert np.abs(seen.depth - 4.0).max() < 1e-5


@pytest.mark.parametrize(("width", "height"), [(8, 8), (40, 24), (328, 56)])
def test_depth_for_other_sizes_and_fields_of_view(width: int, height: int) -> None:
    config = StereoConfig(width=width, height=height, horizontal_fov_deg=100.0, vertical_fov_deg=30.0)
    half = np.array([5.0, 4.0, 3.0])
    seen = LabelCamera(config, floating((box("room", half.tolist()), at(0, 0, 0)))).label(at(0, 0, 0) @ OPTICAL)
    a, b = tangents(config)
    expected = np.minimum(np.minimum(5.0, 4.0 / np.abs(a)), (3.0 / np.abs(b))[:, None])
    assert np.abs(seen.depth - expected).max() < 1e-4


def test_tag_image_colours() -> None:
    label = np.arange(1, 16, dtype=np.uint8).reshape(3, 5)
    assert np.array_equal(tag_image(label), PALETTE[label])
    assert tag_image(label)[0, 0].tolist() == [0, 255, 0]
    assert tag_image(label)[2, 4].tolist() == [127, 127, 127]
    assert tag_image(label).dtype == np.uint8
