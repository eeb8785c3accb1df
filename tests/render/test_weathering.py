# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Weathering: noise, tilted normals and slopes against closed forms; moss in the north, soil at the foot."""

import numpy as np
import pytest

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.textures import (
    STEEPEST,
    corked,
    flat_value,
    overgrown,
    patchy,
    solid_value,
    srgb_from_linear,
    texture_slope,
    tilted,
)
from fieldtruth.render.materials import make_atlas

F = np.float32
GREY = (F(0.15), F(0.15), F(0.15))


def vector(*values: float) -> tuple[np.float32, np.float32, np.float32]:
    x, y, z = (F(v) for v in values)
    return x, y, z


def test_noise_interpolates_between_nodes_and_is_spread_over_its_range() -> None:
    rng = np.random.default_rng(0)
    nodes = rng.integers(-2000, 2000, (4000, 3)).astype(np.float32)
    at = np.array([solid_value(*node) for node in nodes])
    assert at.min() >= 0
    assert at.max() < 1
    assert at.mean() == pytest.approx(0.5, abs=0.02)  # uniform numbers: 0.5, deviation 1 / sqrt(12)
    assert at.std() == pytest.approx(12**-0.5, abs=0.02)
    half = np.array([solid_value(x + F(0.5), y, z) for x, y, z in nodes[:200]])
    next_node = np.array([solid_value(x + F(1), y, z) for x, y, z in nodes[:200]])
    np.testing.assert_allclose(half, (at[:200] + next_node) / 2, atol=1e-6)
    assert abs(np.corrcoef(at[:200], next_node)[0, 1]) < 0.2
    assert flat_value(F(3), F(-7)) == solid_value(F(3), F(-7), F(0))


@pytest.mark.parametrize(("su", "sv"), [(0.0, 0.0), (0.5, 0.0), (0.0, -0.4), (-0.3, 0.8), (9.0, 0.0)])
def test_tilted_normal_is_that_of_the_relief(su: float, sv: float) -> None:
    """Height su u + sv v on a plane: u along y, v along z of a wall that faces x; u along x, v along y of ground."""
    a, b = (float(np.clip(s, -STEEPEST, STEEPEST)) for s in (su, sv))
    scale = np.sqrt(1 + a * a + b * b)
    wall, ground = (tilted(vector(*n), F(su), F(sv)) for n in ((1, 0, 0), (0, 0, 1)))
    np.testing.assert_allclose(wall, np.array([1, -a, -b]) / scale, atol=1e-6)
    np.testing.assert_allclose(ground, np.array([-a, -b, 1]) / scale, atol=1e-6)


@pytest.mark.parametrize("level", [0, 2])
def test_slope_of_a_ramp(level: int) -> None:
    """Brightness that rises by 0.5 along u, then up v (row 0 is the top), has a slope of 0.5 per repeat."""
    ramp = np.round(255 * (0.2 + 0.5 * (np.arange(64) + 0.5) / 64)).astype(np.uint8)
    along_u = np.broadcast_to(ramp[None, :, None], (64, 64, 3))
    along_v = np.broadcast_to(ramp[::-1, None, None], (64, 64, 3))
    atlas = make_atlas([np.ascontiguousarray(t) for t in (along_u, along_v)])
    spots = np.random.default_rng(1).uniform(0.3, 0.7, (300, 2)).astype(np.float32)
    for texture, expected in ((0, (0.5, 0.0)), (1, (0.0, 0.5))):
        found = np.mean([texture_slope(atlas, np.uintp(texture), u, v, level) for u, v in spots], axis=0)
        np.testing.assert_allclose(found, expected, atol=0.03)


def aged(north: float, above: float, amount: float = 1.0, count: int = 1500) -> Array:
    """Mean colour of grey bark on a side that faces north (1) or south (-1) ``above`` [m] the ground."""
    points = np.random.default_rng(2).uniform(-30, 30, (count, 3)).astype(np.float32)
    own = np.random.default_rng(3).random(count).astype(np.float32)
    colours = [
        overgrown(GREY, F(1), (x, y, z), vector(north, 0, 0), F(above), o, F(amount))
        for (x, y, z), o in zip(points, own, strict=True)
    ]
    assert np.isfinite(colours).all()
    assert np.min(colours) > 0
    return np.asarray(np.mean(colours, axis=0), np.float64)


def test_moss_grows_on_the_north_side_and_soil_is_at_the_foot() -> None:
    north, south, foot = aged(1, 1.5), aged(-1, 1.5), aged(-1, 0.01)
    assert (north[1] / north[2]) > 1.03 * (south[1] / south[2])  # moss is green
    assert north[1] < south[1]  # and darker than grey bark
    assert foot[0] / foot[2] > 1.2  # soil is brown
    assert south[0] / south[2] < 1.2


def test_nothing_ages_without_an_amount() -> None:
    np.testing.assert_allclose(aged(1, 0.1, amount=0.0), GREY, rtol=1e-6)
    np.testing.assert_allclose(patchy(GREY, F(12), F(34), F(0)), GREY, rtol=1e-6)


def test_patches_keep_the_mean_brightness_and_vary_by_the_amount() -> None:
    xy = np.random.default_rng(4).uniform(-900, 900, (3000, 2)).astype(np.float32)
    green = np.array([patchy(GREY, x, y, F(0.4))[1] for x, y in xy]) / GREY[1]
    assert green.mean() == pytest.approx(1.0, abs=0.03)
    assert 0.1 < green.std() < 0.3


def test_srgb_brightness_is_what_slopes_are_of() -> None:
    """The slope is of the encoded value: a step of 0.1 there is the same in light and in shade."""
    for linear in (0.02, 0.3):
        code = float(srgb_from_linear(np.array(linear)))
        texture = np.full((64, 64, 3), round(255 * code), np.uint8)
        texture[:, 32:] += 25
        atlas = make_atlas([texture])
        rise, _ = texture_slope(atlas, np.uintp(0), F(0.5), F(0.5), 0)
        assert rise == pytest.approx(64 * 25 / 255, rel=1e-5)


def test_the_foot_of_pale_bark_is_dark_and_grey_bark_stays() -> None:
    def mean(colour: tuple[F, F, F], above: float) -> Array:
        points = np.random.default_rng(4).uniform(-30, 30, (800, 3)).astype(np.float32)
        return np.asarray(np.mean([corked(colour, (x, y, z), F(above), F(0.5)) for x, y, z in points], axis=0))

    birch, beech = (F(0.42), F(0.4), F(0.36)), (F(0.2), F(0.19), F(0.17))
    assert mean(birch, 0.1)[1] < 0.2
    assert mean(birch, 1.0)[1] < 0.36
    np.testing.assert_allclose(mean(birch, 6.0), birch, rtol=1e-6)
    np.testing.assert_allclose(mean(beech, 0.1), beech, rtol=1e-6)
