# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Distances to trails in closed form; deviation and wavelength of noise."""

import numpy as np
import pytest

from fieldtruth.world.backdrop import COARSER, FAR_RINGS, RINGS, make_backdrop
from fieldtruth.world.grids import Line, Trail, fractal_noise, signed_distance
from fieldtruth.world.model import Heightfield, Raster


def test_line_passes_its_corners_in_steps_of_5_cm() -> None:
    corners = [(0.0, 0.0), (4.0, 3.0), (10.0, 3.0), (12.0, -5.0)]
    for smooth in (True, False):
        line = Line.through(corners, smooth=smooth)
        steps = np.linalg.norm(np.diff(line.points, axis=0), axis=1)
        assert 0.035 < steps.min() < steps.max() < 0.1  # a spline is longer than its chords
        assert line.points[0] == pytest.approx(corners[0])
        assert line.points[-1] == pytest.approx(corners[-1])
        for corner in corners:
            assert np.linalg.norm(line.points - corner, axis=1).min() < 0.06
        np.testing.assert_allclose(np.linalg.norm(line.tangents, axis=1), 1.0, rtol=1e-6)
    assert Line.through(corners, smooth=False).length == pytest.approx(5 + 6 + np.hypot(2, 8), rel=1e-3)


def test_smooth_line_has_no_kinks() -> None:
    line = Line.through([(0, 0), (4, 3), (10, 3), (12, -5)])
    turn = np.abs(np.diff(np.unwrap(np.arctan2(line.tangents[:, 1], line.tangents[:, 0]))))
    assert np.degrees(turn).max() < 6.0
    straight = Line.through([(0, 0), (4, 3), (10, 3), (12, -5)], smooth=False)
    turn = np.abs(np.diff(np.unwrap(np.arctan2(straight.tangents[:, 1], straight.tangents[:, 0]))))
    assert np.degrees(turn).max() > 15.0


def test_distance_to_a_straight_line() -> None:
    line = Line.through([(0.0, 0.0), (10.0, 0.0)])
    xy = [(5.0, 2.0), (5.013, -3.0), (-3.0, 4.0), (13.0, -4.0), (7.0, 0.0)]
    assert line.distance(xy) == pytest.approx([2.0, 3.0, 5.0, 5.0, 0.0], abs=1e-12)


def test_distance_to_a_circle() -> None:
    """Corners on a circle of 10 m, 10 deg apart: the spline stays within a millimetre of it."""
    angle = np.radians(np.arange(0, 181, 10))
    line = Line.through([(10 * np.cos(a), 10 * np.sin(a)) for a in angle])
    rng = np.random.default_rng(0)
    bearing, reach = np.radians(rng.uniform(25, 155, 200)), rng.uniform(5, 15, 200)
    xy = np.stack([reach * np.cos(bearing), reach * np.sin(bearing)], axis=-1)
    assert line.distance(xy) == pytest.approx(np.abs(reach - 10), abs=1e-3)


def test_signed_distance_to_the_nearest_of_two_trails() -> None:
    trails = [Trail(Line.through([(-50, 0), (50, 0)]), 2.0), Trail(Line.through([(3, -50), (3, 50)]), 4.0)]
    x, y = np.linspace(-10, 10, 21), np.linspace(-6, 6, 13)
    distance = signed_distance(trails, x, y)
    gx, gy = np.meshgrid(x, y, indexing="ij")
    assert distance.shape == (21, 13)
    assert distance.dtype == np.float32
    assert distance == pytest.approx(np.minimum(np.abs(gy) - 1.0, np.abs(gx - 3) - 2.0), abs=1e-6)


@pytest.mark.parametrize(("octaves", "gain"), [(1, 0.5), (3, 0.5), (4, 0.7)])
def test_noise_has_about_unit_deviation_and_no_offset(octaves: int, gain: float) -> None:
    x, y = np.linspace(-200, 200, 401), np.linspace(-150, 150, 301)
    noise = fractal_noise(x, y, wavelength=8.0, octaves=octaves, rng=np.random.default_rng(2), gain=gain)
    assert noise.shape == (401, 301)
    assert noise.std() == pytest.approx(1.0, rel=0.15)
    assert abs(noise.mean()) < 0.1


def test_noise_is_smooth_at_its_wavelength_and_repeats_with_its_generator() -> None:
    x = y = np.linspace(0, 100, 501)
    noise, again, other = (
        fractal_noise(x, y, wavelength=10.0, octaves=1, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert np.array_equal(noise, again)
    assert not np.allclose(noise, other)
    for axis in (0, 1):
        lag = {d: float((np.roll(noise, int(d / 0.2), axis) * noise).mean()) for d in (0.2, 10.0)}
        assert lag[0.2] > 0.95 * noise.var()
        assert abs(lag[10.0]) < 0.2 * noise.var()


def test_more_octaves_add_finer_waves() -> None:
    x = y = np.linspace(0, 50, 501)
    rough = [
        np.diff(fractal_noise(x, y, wavelength=16.0, octaves=n, rng=np.random.default_rng(0)), axis=0).std()
        for n in (1, 3, 5)
    ]
    assert rough[0] < 0.85 * rough[1] < 0.85**2 * rough[2]


def test_rasters_and_heightfields_in_closed_form() -> None:
    """Bilinear within a cell, and two triangles divided from (i, j) to (i + 1, j + 1)."""
    grid = np.array([[0.0, 1.0], [2.0, 7.0]], np.float32)
    raster = Raster(values=grid, spacing=2.0, x0=-1.0, y0=3.0)
    assert raster.at(0.0, 4.0) == pytest.approx(2.5)
    assert raster.at(0.5, 3.5) == pytest.approx(0.75 * 2 * 0.75 + 0.25 * (0.25 + 7 * 0.75))
    assert raster.at([-9.0, 9.0], [3.0, 9.0]) == pytest.approx([0.0, 7.0])
    field = Heightfield(heights=grid, spacing=2.0, x0=-1.0, y0=3.0)
    assert field.height_at(0.0, 4.0) == pytest.approx(3.5)  # on the diagonal from 0 to 7
    assert field.height_at(0.5, 3.5) == pytest.approx(0.25 * 0 + 0.5 * 2 + 0.25 * 7)
    assert field.height_at(-0.5, 4.5) == pytest.approx(0.25 * 0 + 0.5 * 1 + 0.25 * 7)


def test_backdrop_shares_the_edge_and_ends_above_the_horizon() -> None:
    heights = np.random.default_rng(0).uniform(-1, 1, (21, 11)).astype(np.float32)
    field = Heightfield(heights=heights, spacing=1.0, x0=-10.0, y0=-5.0)
    mesh = make_backdrop(field, (20.0, 10.0), "meadow", np.random.default_rng(1))
    count = 2 * (20 + 10)
    few = count // COARSER
    assert len(mesh.vertices) == count * len(RINGS) + few * len(FAR_RINGS)
    assert len(mesh.faces) == 2 * count * (len(RINGS) - 1) + 2 * few * (len(FAR_RINGS) - 1) + count + few
    x, y, z = mesh.vertices[:count].astype(float).T
    assert z == pytest.approx(field.height_at(x, y), abs=1e-6)
    assert len({(float(a), float(b)) for a, b in zip(x, y, strict=True)}) == count
    assert mesh.vertices[-few:, 2].min() > 5.0
    assert np.all(mesh.normals[:, 2] > 0)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, rtol=0.0, atol=1e-5)
    assert mesh.materials == ("meadow",)
