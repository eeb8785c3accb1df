# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lenses against OpenCV and closed formulas; images through them against the pinhole's."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter
from sense_worlds import F8, Placed, at, box, floating, quad

from fieldtruth.core.classes import Label
from fieldtruth.core.lenses import FLAT, Lens, directions, fields_of_view, greatest_angle, project
from fieldtruth.experiment.imaging_config import LensConfig
from fieldtruth.kernels.camera_rays import NO_TABLE, View, new_batch, set_directions
from fieldtruth.sense.lens import intrinsics_of, ray_table
from fieldtruth.sensors.camera.check_geometry import pixel_ray
from fieldtruth.sensors.camera.config import StereoConfig
from fieldtruth.sensors.camera.labels import LabelCamera

WIDTH, HEIGHT = 640, 360
BARREL = (-0.28, 0.09, 0.001, -0.0007, -0.01)
PINCUSHION = (0.1, -0.05, -0.003, 0.002, 0.0)
RATIONAL = (5.0, 1.2, 1e-4, -2e-4, 0.03, 5.3, 2.6, 0.2)  # a wide camera of a depth sensor: 150 deg
FISHEYE = (-0.02, 0.003, -0.001, 0.0001)
LENSES = {
    "barrel": Lens("plumb_bob", 350.0, 352.5, 321.2, 178.3, BARREL),
    "pincushion": Lens("plumb_bob", 450.0, 452.5, 318.0, 181.3, PINCUSHION),
    "rational": Lens("rational_polynomial", 250.0, 252.0, 321.2, 178.3, RATIONAL),
    "fisheye": Lens("equidistant", 175.0, 176.0, 319.5, 179.5, FISHEYE),
}


def config_of(lens: Lens, **values: float) -> StereoConfig:
    own = LensConfig(
        model=lens.model,  # type: ignore[arg-type]
        coefficients=lens.coefficients,
        fx=lens.fx,
        fy=lens.fy,
        cx=lens.cx,
        cy=lens.cy,
        **values,
    )
    return StereoConfig(width=WIDTH, height=HEIGHT, lens=own)


def pixels() -> F8:
    """Pixel centres (h, w, 2)."""
    return np.stack(np.meshgrid(np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float)), axis=-1)


def matrix(lens: Lens) -> F8:
    return np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])


def opencv_project(lens: Lens, rays: F8) -> F8:
    """Image points (n, 2) by OpenCV; its fisheye model wants rays in front of the camera."""
    zero, d = np.zeros(3), np.array(lens.coefficients)
    if lens.model == "equidistant":
        return np.asarray(cv2.fisheye.projectPoints(rays[:, None], zero, zero, matrix(lens), d)[0][:, 0])
    return np.asarray(cv2.projectPoints(rays[:, None], zero, zero, matrix(lens), d)[0][:, 0])


@pytest.mark.parametrize("name", LENSES)
def test_opencv_images_the_rays_on_the_pixel_centres(name: str) -> None:
    lens = LENSES[name]
    rays = directions(lens, pixels()[..., 0], pixels()[..., 1])
    front = rays[..., 2] > 0.02
    assert front.mean() > 0.7
    np.testing.assert_allclose(opencv_project(lens, rays[front]), pixels()[front], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(rays[front], axis=1), 1.0, atol=1e-12)
    table = ray_table(config_of(lens))  # single precision, as Embree's rays
    np.testing.assert_allclose(table[..., :3], np.nan_to_num(rays), atol=6e-8)
    np.testing.assert_array_equal(table[..., 3], table[..., 2] if lens.model in FLAT else ~np.isnan(rays[..., 2]))


@pytest.mark.parametrize("row", range(8))
def test_a_wrong_sign_of_any_coefficient_is_seen(row: int) -> None:
    """Otherwise the comparison with OpenCV would not be one."""
    for name in ("pincushion", "rational"):
        lens = LENSES[name]
        wrong = np.array(lens.coefficients)
        if row >= len(wrong) or not wrong[row]:
            continue
        wrong[row] *= -1
        rays = directions(lens, pixels()[::20, ::20, 0], pixels()[::20, ::20, 1]).reshape(-1, 3)
        off = opencv_project(lens._replace(coefficients=tuple(wrong)), rays) - pixels()[::20, ::20].reshape(-1, 2)
        assert np.abs(off).max() > 1e-2


def test_a_fisheye_sees_behind_itself_as_its_formula_says() -> None:
    lens = LENSES["fisheye"]._replace(coefficients=(0.0, 0.0, 0.0, 0.0), fy=175.0)
    u = np.linspace(0.0, WIDTH - 1.0, 50)
    theta = (u - lens.cx) / 175.0
    assert np.degrees(np.abs(theta).max()) > 100.0
    expected = np.stack([np.sin(theta), 0.0 * theta, np.cos(theta)], axis=-1)
    np.testing.assert_allclose(directions(lens, u, lens.cy), expected, atol=1e-12)
    distorted = LENSES["fisheye"]
    rays = directions(distorted, u, 100.0)
    angle = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    assert np.degrees(angle.max()) > 100.0
    height = sum(k * angle ** (2 * n + 1) for n, k in enumerate((1.0, *FISHEYE)))
    np.testing.assert_allclose(np.hypot((u - 319.5) / 175.0, (100.0 - 179.5) / 176.0), height, atol=1e-12)


def test_a_panorama_has_longitudes_and_latitudes() -> None:
    config = StereoConfig(width=64, height=32, lens=LensConfig(model="equirectangular"))
    table = ray_table(config)
    longitude, latitude = np.radians((np.arange(64) - 31.5) * 5.625), np.radians((np.arange(32) - 15.5) * 5.625)
    for v, u in ((0, 0), (31, 63), (16, 32), (3, 50)):
        x, y = longitude[u], latitude[v]
        expected = [np.sin(x) * np.cos(y), np.sin(y), np.cos(x) * np.cos(y), 1.0]  # y points down
        np.testing.assert_allclose(table[v, u], expected, atol=6e-8)
    assert fields_of_view(config.projection, 64, 32) == pytest.approx((360.0, 180.0))


@pytest.mark.parametrize("name", LENSES)
def test_projecting_a_direction_gives_its_image_point(name: str) -> None:
    lens, image = LENSES[name], pixels()[::17, ::19]
    np.testing.assert_allclose(project(lens, 7.0 * directions(lens, image[..., 0], image[..., 1])), image, atol=1e-9)


def test_fields_of_view_end_at_the_borders_of_the_image() -> None:
    for model, coefficients, angles in (
        ("pinhole", (), (90.0, 60.0)),
        ("plumb_bob", (*BARREL[:2], 0.0, 0.0, BARREL[4]), (90.0, 60.0)),
        ("equidistant", FISHEYE, (200.0, 110.0)),
    ):
        config = StereoConfig(
            horizontal_fov_deg=angles[0],
            vertical_fov_deg=angles[1],
            lens=LensConfig(model=model, coefficients=coefficients),  # type: ignore[arg-type]
        )
        assert fields_of_view(config.projection, config.width, config.height) == pytest.approx(angles, abs=1e-9)


def test_beyond_the_image_circle_there_is_no_ray_and_sky() -> None:
    lens = LensConfig(model="equidistant", coefficients=(0.0, 0.0, 0.0, 0.0), image_circle_deg=190.0)
    config = StereoConfig(width=160, height=160, horizontal_fov_deg=190.0, vertical_fov_deg=190.0, lens=lens)
    table, (x, y) = ray_table(config), np.meshgrid(np.arange(160) - 79.5, np.arange(160) - 79.5)
    inside = np.hypot(x, y) <= 80.0
    assert np.array_equal(table[..., 3] != 0.0, inside)
    room = box("room", (5.0, 5.0, 5.0))
    seen = LabelCamera(config, floating((room, at(0, 0, 0)))).label(np.eye(4))
    assert np.array_equal(seen.label, np.where(inside, Label.ROCK, Label.SKY))
    assert not seen.instance[~inside].any()
    assert not seen.depth[~inside].any()
    reach = 5.0 / np.abs(table[..., :3]).max(axis=-1, where=inside[..., None], initial=1e-9)
    np.testing.assert_allclose(seen.depth[inside], reach[inside], rtol=1e-5)  # along the ray, also from behind


def things() -> list[Placed]:
    """Boxes before a wall."""
    wall = quad("wall", [[-40, -40, 12], [40, -40, 12], [40, 40, 12], [-40, 40, 12]], "bark")
    rng = np.random.default_rng(3)
    some = [(box(f"b{k}", (0.5, 0.4, 0.3)), at(*rng.uniform((-7, -4, 4), (7, 4, 11)))) for k in range(40)]
    return [(wall, at(0, 0, 0)), *some]


@pytest.mark.parametrize("name", LENSES)
def test_undistorting_with_opencv_meets_the_pinhole_image(name: str) -> None:
    """But at silhouettes, where the nearest pixel centre lies on the other side: below 2 % of the pixels here.

    A pixel of the fisheye is as large as two to three of the pinhole.
    """
    lens, scene = LENSES[name], floating(*things())
    seen = LabelCamera(config_of(lens), scene).label(np.eye(4))
    flat = lens._replace(model="pinhole", coefficients=(), fx=400.0, fy=400.0)
    true = LabelCamera(config_of(flat), scene).label(np.eye(4))
    rectify = cv2.fisheye.initUndistortRectifyMap if lens.model == "equidistant" else cv2.initUndistortRectifyMap
    size = (WIDTH, HEIGHT)
    maps = rectify(matrix(lens), np.array(lens.coefficients), np.eye(3), matrix(flat), size, cv2.CV_32FC1)
    ids = cv2.remap(seen.instance.astype(np.float32), *maps, cv2.INTER_NEAREST, borderValue=-1.0)
    known = ids >= 0.0
    assert known.mean() > 0.5
    wrong = (ids != true.instance) & known
    around = 5 if lens.model == "equidistant" else 3
    steps = maximum_filter(true.instance, around) != minimum_filter(true.instance, around)
    assert wrong.mean() < 0.02
    assert (wrong & ~steps).mean() < 2e-4
    metres = seen.depth if lens.model in FLAT else seen.depth * ray_table(config_of(lens))[..., 2]
    depth = cv2.remap(metres.astype(np.float32), *maps, cv2.INTER_NEAREST)
    wall = known & ~wrong & ~steps & (true.depth > 11.99)
    assert wall.sum() > 1000
    np.testing.assert_allclose(depth[wall], 12.0, rtol=1e-5)


@pytest.mark.parametrize("name", LENSES)
def test_between_pixels_directions_are_interpolated_to_four_thousandths_of_a_pixel(name: str) -> None:
    lens = LENSES[name]
    table, batch = ray_table(config_of(lens)), new_batch(16)
    rng, worst = np.random.default_rng(5), 0.0
    for _ in range(60):
        centre = rng.integers((0, 0), (WIDTH, HEIGHT), (16, 2))
        centre[:4] = [[0, 0], [WIDTH - 1, 0], [0, HEIGHT - 1], [WIDTH - 1, HEIGHT - 1]]
        batch.image[:] = (centre + rng.uniform(-0.38, 0.38, (16, 2))).T
        set_directions(np.eye(4), table, 16, batch)
        exact = directions(lens, batch.image[0].astype(float), batch.image[1].astype(float))
        worst = max(worst, float(np.linalg.norm(batch.direction.T - exact, axis=1).max()) * lens.fx)
    assert worst < 4e-3


@pytest.mark.parametrize("name", LENSES)
def test_the_second_search_finds_the_same_rays(name: str) -> None:
    lens = LENSES[name]._replace(circle=np.radians(95.0))
    rng = np.random.default_rng(7)
    for u, v in rng.integers((0, 0), (WIDTH, HEIGHT), (40, 2)):
        found, expected = pixel_ray(lens, float(u), float(v)), directions(lens, u, v)
        assert (found is None) == bool(np.isnan(expected).any())
        if found is not None:
            np.testing.assert_allclose(found.direction, expected, atol=1e-12)
            assert found.length == pytest.approx(1.0 / expected[2] if lens.model in FLAT else 1.0)


def test_the_pinhole_needs_no_table() -> None:
    config = StereoConfig()
    assert ray_table(config) is NO_TABLE
    tangents = np.tan(np.radians([34.5, 21.0]))
    assert intrinsics_of(config)[:2] == (640.0 / tangents[0], 360.0 / tangents[1])
    assert View(np.eye(4), intrinsics_of(config), 10.0).table is NO_TABLE
    trivial = config.model_copy(update={"lens": LensConfig(model="plumb_bob", coefficients=(0.0,) * 5)})
    through = ray_table(trivial)[100, 200]
    expected = np.array([(200 - 639.5) / intrinsics_of(config).fx, (100 - 359.5) / intrinsics_of(config).fy, 1.0])
    np.testing.assert_allclose(through[:3], expected / np.linalg.norm(expected), atol=6e-8)


def test_distortion_turns_where_its_derivative_is_zero() -> None:
    assert np.tan(greatest_angle("plumb_bob", (-0.3, 0.0, 0.0, 0.0, 0.0))) == pytest.approx(1 / np.sqrt(0.9), rel=1e-3)
    assert greatest_angle("equidistant", (-0.1, 0.0, 0.0, 0.0)) == pytest.approx(1 / np.sqrt(0.3), rel=1e-3)
