# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Livox's patterns: fields of view, lines and points of the data sheets; no scan repeats another."""

import numpy as np
import pytest
from sense_worlds import F8, at, box, floating

from fieldtruth.sensors.lidar.config import LidarConfig
from fieldtruth.sensors.lidar.sensing import IdealLidar, column_times_ns, ray_directions

PERIOD_NS = 100_000_000


def angles(rays: F8) -> tuple[F8, F8]:
    """Azimuth and elevation [deg] of rays."""
    return np.degrees(np.arctan2(rays[..., 1], rays[..., 0])), np.degrees(np.arcsin(rays[..., 2]))


@pytest.mark.parametrize(("model", "lines", "points"), [("avia", 6, 240_000), ("mid_360", 4, 200_000)])
def test_a_scan_has_the_lines_and_points_of_the_sheet(model: str, lines: int, points: int) -> None:
    config = LidarConfig(model=model)
    rays = ray_directions(config, 12 * PERIOD_NS)
    assert rays.shape == (points // lines // 10, lines, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1.0, rtol=0, atol=1e-12)


def test_the_rays_of_a_mid_360_fill_its_field_of_view() -> None:
    azimuth, elevation = angles(ray_directions(LidarConfig(model="mid_360"), 0))
    assert elevation.min() == pytest.approx(-7.0, abs=0.3)
    assert elevation.max() == pytest.approx(52.0, abs=0.3)
    counts, _ = np.histogram(azimuth, bins=36, range=(-180, 180))
    assert counts.min() > 0.8 * counts.mean()
    counts, _ = np.histogram(elevation, bins=10, range=(-7, 52))
    assert counts.min() > 0.9 * counts.mean()  # even, unlike a swing that lingers where it turns


def test_the_rays_of_an_avia_fill_its_field_of_view() -> None:
    rays = np.concatenate([ray_directions(LidarConfig(model="avia"), k * PERIOD_NS) for k in range(10)])
    azimuth, elevation = angles(rays)
    assert np.ptp(azimuth[np.abs(elevation) < 5.0]) == pytest.approx(70.4, abs=0.5)
    assert np.ptp(elevation[np.abs(azimuth) < 3.0]) == pytest.approx(77.2, abs=0.5)


def covered(config: LidarConfig, scans: int) -> float:
    """Share of the cells of 1 deg of the field of view that rays of a number of scans meet."""
    cells = set()
    for k in range(scans):
        azimuth, elevation = angles(ray_directions(config, k * PERIOD_NS))
        cells |= set(zip(np.floor(azimuth).ravel().tolist(), np.floor(elevation).ravel().tolist(), strict=True))
    return len(cells) / (360 * 59 if config.pattern == "mid_360" else np.pi / 4 * 70.4 * 77.2)


@pytest.mark.parametrize("model", ["avia", "mid_360"])
def test_more_scans_see_more(model: str) -> None:
    """A pattern that repeats would see the same cells again."""
    config = LidarConfig(model=model)
    shares = [covered(config, scans) for scans in (1, 3, 10)]
    assert shares[0] < 0.95 * shares[1] or shares[1] > 0.95
    assert shares[0] < shares[1] < shares[2] or shares[0] > 0.99
    assert shares[2] > 0.9


@pytest.mark.parametrize("model", ["avia", "mid_360"])
def test_rays_depend_on_the_time_alone(model: str) -> None:
    """Column c of a scan leaves as column 0 of a scan that begins at that time."""
    config, stamp = LidarConfig(model=model), 7 * PERIOD_NS
    times = column_times_ns(config)
    rays = ray_directions(config, stamp)
    np.testing.assert_array_equal(rays, ray_directions(config, stamp))
    for column in (1, 777, 3999):
        assert ray_directions(config, stamp + int(times[column]))[0] == pytest.approx(rays[column], abs=1e-6)


@pytest.mark.parametrize("model", ["avia", "mid_360"])
def test_a_scan_measures_the_walls_along_its_rays(model: str) -> None:
    config, half = LidarConfig(model=model), np.array([6.0, 5.0, 4.0])
    lidar = IdealLidar(config, floating((box("room", tuple(half)), at(0, 0, 0))))
    for stamp in (0, PERIOD_NS, 31 * PERIOD_NS):
        scan = lidar.scan(np.broadcast_to(np.eye(4), (config.columns + 1, 4, 4)), stamp)
        assert len(scan.range_m) == config.columns * config.rings
        rays = ray_directions(config, stamp)[scan.column, scan.ring]
        expected = (half / np.maximum(np.abs(rays), 1e-12)).min(axis=1)
        np.testing.assert_allclose(scan.range_m, expected, rtol=0, atol=1e-4)
        np.testing.assert_allclose(scan.xyz, rays * expected[:, None], rtol=0, atol=1e-4)
        assert np.array_equal(scan.t_ns, column_times_ns(config)[scan.column])


def test_a_pattern_has_no_beams_of_its_own() -> None:
    with pytest.raises(ValueError, match="azimuth_offsets_deg must be null with the pattern avia"):
        LidarConfig(model="avia", azimuth_offsets_deg=(0.0,) * 6)
