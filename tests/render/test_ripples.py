# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ripples in wind: slopes of Cox and Munk, waves that travel by the dispersion of water, and photographs of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import at, make_world, quad
from water_probe import rays_on_water

from fieldtruth.core import transforms
from fieldtruth.experiment.imaging_config import OPTICAL
from fieldtruth.experiment.wind_config import WindConfig
from fieldtruth.kernels.camera_rays import new_batch
from fieldtruth.kernels.gbuffer import FIELDS, MIRROR
from fieldtruth.kernels.water import blur_sky, new_secondary_batch
from fieldtruth.render.bake import bake
from fieldtruth.sense.interval import Moving
from fieldtruth.sense.ripples import Ripples
from fieldtruth.sense.scene import Scene
from fieldtruth.sense.wind import leaning_of
from fieldtruth.sensors.camera.config import CameraConfig
from fieldtruth.sensors.camera.sensing import IdealCamera

F8 = NDArray[np.float64]
STAMP = 3_123_456_789


def slopes(ripples: NDArray[np.float32], xy: F8) -> F8:
    """Slopes (n, 2) of the water at positions (n, 2) [m], of the rays that photographs reflect from above."""
    count = len(xy)
    batch, second, gbuffer = new_batch(count), new_secondary_batch(count), np.zeros((count, FIELDS), np.float32)
    batch.direction[2], batch.point[:2, :count], batch.top[:], batch.distance[:] = -1.0, xy.T, 1, 1.0
    gbuffer[:, MIRROR] = 0.02
    assert rays_on_water((batch, gbuffer), ripples, count, 1e-9, True, second) == count
    normal = second.batch.direction[:, :count].T + np.array([0.0, 0.0, 1.0])
    return np.asarray(-normal[:, :2] / normal[:, 2:], np.float64)


@pytest.mark.parametrize("speed", [2.0, 8.0, 15.0])
def test_mean_square_slopes_are_those_of_cox_and_munk(speed: float) -> None:
    config = WindConfig(speed_m_s=speed, direction_deg=300.0)
    found = slopes(Ripples.drawn(config, 1).at(STAMP), np.random.default_rng(2).uniform(-40, 40, (20_000, 2)))
    along = np.array(config.heading)
    across = np.array([-along[1], along[0]])
    assert ((found @ along) ** 2).mean() == pytest.approx(3.16e-3 * speed, rel=0.04)
    assert ((found @ across) ** 2).mean() == pytest.approx(3e-3 + 1.92e-3 * speed, rel=0.04)
    assert ((found**2).sum(axis=1)).mean() == pytest.approx(3e-3 + 5.12e-3 * speed, rel=0.04)


def test_each_wave_travels_down_the_wind_at_the_speed_of_its_length() -> None:
    """In a wind from the west, all to the east, -y; the slowest are those of 17 mm, at 0.23 m/s (Lamb, section 267)."""
    ripples, later = Ripples.drawn(WindConfig(speed_m_s=8.0, direction_deg=270.0), 1), 40_000_000
    length = 2.0 * np.pi / np.linalg.norm(ripples.k, axis=1)
    assert 0.017 < length.min() < 0.019
    assert 0.3 < length.max() < 0.5
    assert (ripples.k[:, 1] < 0.0).all()
    assert abs(ripples.k.sum(axis=0)[0]) < 0.2 * -ripples.k.sum(axis=0)[1]
    speed = np.sqrt(9.81 * length / (2.0 * np.pi) + 7.28e-5 * 2.0 * np.pi / length)
    assert 0.231 < speed.min() < 0.233
    xy, opposite = np.random.default_rng(3).uniform(-0.5, 0.5, (200, 2)), list[float]()
    for n in range(len(length)):
        wave = Ripples(*(part[n : n + 1] for part in ripples))
        step = speed[n] * later / 1e9 * wave.k[0] / np.linalg.norm(wave.k[0])
        now, then = slopes(wave.at(STAMP), xy), slopes(wave.at(STAMP + later), xy + step)
        np.testing.assert_allclose(then, now, atol=1e-4)
        opposite.append(np.abs(slopes(wave.at(STAMP + later), xy - step) - now).max())
    assert np.median(opposite) > 0.01


@pytest.mark.parametrize("elevation", [0.02, 0.1, 0.5, 1.2])
def test_waves_below_a_pixel_mirror_what_the_facets_that_are_seen_mirror(elevation: float) -> None:
    """Against a million facets, each weighted by its projected area: slope, reflectance, and skies."""
    ripples, azimuth = Ripples.drawn(WindConfig(speed_m_s=8.0, direction_deg=250.0), 1).at(STAMP), 0.7
    ahead = np.array([np.cos(azimuth), np.sin(azimuth)])
    batch, second, gbuffer = new_batch(1), new_secondary_batch(1), np.zeros((1, FIELDS), np.float32)
    ray = np.array([*ahead * np.cos(elevation), -np.sin(elevation)])
    batch.direction[:], batch.top[:], batch.distance[:], gbuffer[:, MIRROR] = ray[:, None], 1, 100.0, 0.02
    hit = batch, gbuffer
    assert rays_on_water(hit, ripples, 1, 1.0, True, second) == 1
    number = np.linalg.norm(ripples[:, :2], axis=1)
    part = ripples[:, 2:3] * ripples[:, :2] / number[:, None]
    facets = np.random.default_rng(1).multivariate_normal([0.0, 0.0], 0.5 * part.T @ part, 1_000_000)
    normal = np.column_stack([-facets, np.ones(len(facets))])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    seen = np.maximum(facets @ ahead + np.tan(elevation), 0.0)
    away = -(normal @ ray)[:, None]
    there = ray + 2.0 * away * normal
    there[:, 2] = np.abs(there[:, 2])
    fresnel = 0.02 + 0.98 * (1.0 - np.clip(away[:, 0], 0.0, 1.0)) ** 5
    assert second.share[0] == pytest.approx(np.average(fresnel, weights=seen), rel=0.03)

    mean = np.average(facets, axis=0, weights=seen)  # of the ray that is traced
    middle = np.array([*-mean, 1.0]) / np.linalg.norm([*mean, 1.0])
    traced = ray - 2.0 * (middle @ ray) * middle
    if traced[2] > 0.01:
        np.testing.assert_allclose(second.batch.direction[:, 0], traced, atol=0.01)

    second.batch.top[:] = -1
    skies: list[Callable[[F8, F8, F8], F8]] = [
        lambda x, y, z: 1.0 + 0.5 * x + 0.3 * y,
        lambda x, y, z: np.asarray(1.0 / (1.0 + np.exp(10.0 * (0.3 - z)))),
        lambda x, y, z: z**2,
    ]
    for sky in skies:
        blur_sky(hit, second, 1, dome_of(sky), np.float32(2.0))
        expected = 2.0 * np.average(sky(*there.T), weights=seen * fresnel)
        assert second.colour[0, 0] == pytest.approx(expected, rel=0.03, abs=0.03)
        assert second.colour[0, 1] == 0.0


def dome_of(sky: Callable[[F8, F8, F8], F8]) -> NDArray[np.float32]:
    """Image (n, n, 3) of a sky that is red by a function of the direction, as ``light.sky_radiance`` reads it."""
    size = 512
    x, y = np.meshgrid(*2 * [(np.arange(size) - (0.5 * size - 0.5)) / (0.5 * size * 0.998)], indexing="ij")
    squared = x**2 + y**2
    scale = 2.0 / (1.0 + squared)
    red = sky(x * scale, y * scale, np.maximum((1.0 - squared) / (1.0 + squared), 0.0))
    return np.stack([red, 0 * red, 0 * red], axis=-1).astype(np.float32)


def test_the_sky_is_blurred_by_waves_below_a_pixel_and_sharp_where_each_is_seen() -> None:
    """Without waves below the pixel, or where the ray meets the shore, a colour stays."""
    drawn, second = Ripples.drawn(WindConfig(speed_m_s=8.0), 1).at(STAMP), new_secondary_batch(1)
    batch, gbuffer = new_batch(1), np.full((1, FIELDS), 0.02, np.float32)
    batch.direction[:, 0], batch.top[:], batch.distance[:] = (np.cos(0.1), 0.0, -np.sin(0.1)), 1, 100.0
    for pixel, top, blurred in ((1.0, -1, True), (1e-9, -1, False), (1.0, 3, False)):
        assert rays_on_water((batch, gbuffer), drawn, 1, pixel, True, second) == 1
        second.batch.top[:], second.colour[:] = top, 7.0
        blur_sky((batch, gbuffer), second, 1, dome_of(lambda x, y, z: 1.0 + 0.0 * x), np.float32(1.0))
        assert second.colour[0, 0] == pytest.approx(1.0 if blurred else 7.0)


def test_photographs_show_the_ripples_of_their_stamp_and_still_water_without_wind() -> None:
    water = quad("lake", [[-20, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0]], "water")
    world = make_world([(water, at(0, 0, 0))], height=-2.0)
    mirror = replace(world.materials["water"], mirror=0.02)
    world = replace(world, materials={**world.materials, "water": mirror}, water_level=0.0)
    config = CameraConfig(width=96, height=64, horizontal_fov_deg=12.0, vertical_fov_deg=8.0)
    pose = transforms.pose((-4, 0, 1.0), (0, 15, 0)) @ OPTICAL
    photos = []
    for wind in (WindConfig(speed_m_s=8.0), None):
        baked = bake(Scene(world, Moving(leaning=leaning_of(wind, world, 1))))
        photos.append([IdealCamera(config, baked).render(pose, stamp_ns=STAMP + k).photo for k in (0, 0, 50_000_000)])
    for (first, again, later), differs in zip(photos, (True, False), strict=True):
        np.testing.assert_array_equal(first, again)
        assert (np.abs(first.astype(int) - later)[40:].mean() > 1.0) == differs
    assert np.abs(photos[0][0].astype(int) - photos[1][0])[40:].mean() > 1.0
