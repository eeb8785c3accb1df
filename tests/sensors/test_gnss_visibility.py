# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Signals through small worlds: walls, edges, trunks, leaves and hills, against closed forms."""

import numpy as np
import pytest
from sense_worlds import at, box, floating, make_world, quad

from fieldtruth.sense.scene import Scene
from fieldtruth.sensors.gnss.sensing import RAYS, WAVELENGTH, amplitudes, sunflower

HERE = np.zeros(3)


def _towards(azimuth_deg: np.ndarray, elevation_deg: float) -> np.ndarray:
    azimuth, elevation = np.radians(azimuth_deg), np.radians(elevation_deg)
    flat = np.cos(elevation)
    return np.stack(
        [np.cos(azimuth) * flat, -np.sin(azimuth) * flat, np.full(azimuth.shape, np.sin(elevation))], axis=-1
    )


def test_rays_stand_for_equal_areas() -> None:
    """Of a disc: its centre, and the mean of the squared radius, which is 1/2."""
    disc = sunflower()
    assert np.abs(disc.mean(axis=0)).max() < 0.05
    assert (disc**2).sum(axis=1).mean() == pytest.approx(0.5, abs=1e-9)


def test_a_wall_in_the_south_takes_the_satellites_behind_it() -> None:
    """It stands 10 m away and is seen from 135 to 225 deg; the first Fresnel zone there is 1.4 m or 8 deg wide."""
    wall = floating((box("wall", (0.1, 10.0, 30.0)), at(-10.1, 0, 0)))
    azimuth = np.arange(0.0, 360.0, 1.0)
    found = amplitudes(wall, HERE, _towards(azimuth, 20.0), 0.8)
    aside = np.abs(azimuth - 180.0)
    assert (found[aside < 45.0 - 9.0] == 0.0).all()
    assert (found[aside > 45.0 + 9.0] == 1.0).all()
    edges = found[np.abs(aside - 45.0) < 0.1]
    assert edges == pytest.approx(0.5, abs=1.5 / RAYS)  # 6 dB at the edge, as a knife edge has
    over = amplitudes(wall, HERE, _towards(np.array([180.0]), 80.0), 0.8)  # the wall reaches up to 71.6 deg
    assert over.tolist() == [1.0]


@pytest.mark.parametrize("count", [0, 1, 3, 7])
def test_each_leaf_takes_its_share(count: int) -> None:
    leaves = [
        (quad(f"leaf_{k}", [[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], "leaf"), at(0, 0, 1.1 + k))
        for k in range(count)
    ]
    roof = (quad("far", [[50, -9, 0], [60, -9, 0], [60, 9, 0], [50, 9, 0]]), at(0, 0, 0))
    found = amplitudes(floating(*leaves, roof), HERE, np.array([[0.0, 0.0, 1.0]]), 0.8)
    assert found == pytest.approx([0.8**count])


@pytest.mark.parametrize(("width", "distance"), [(0.2, 3.0), (0.5, 6.0), (0.9, 12.0)])
def test_a_trunk_takes_the_part_of_the_zone_that_it_covers(width: float, distance: float) -> None:
    """A strip of a disc: (2 / pi) (asin a + a sqrt(1 - a^2)), with a half of the width by the radius."""
    trunk = floating((box("trunk", (0.01, width / 2.0, 40.0), "bark"), at(distance, 0, 0)))
    a = width / 2.0 / np.sqrt(WAVELENGTH * distance)
    covered = 2.0 / np.pi * (np.arcsin(a) + a * np.sqrt(1.0 - a * a))
    found = amplitudes(trunk, HERE, _towards(np.array([0.0]), 1.0), 0.8)
    assert found == pytest.approx([1.0 - covered], abs=2.5 / RAYS)
    assert 0.0 < found[0] < 1.0


def test_flat_ground_hides_nothing_above_and_all_below_the_horizon() -> None:
    ground = Scene(make_world(side=400.0, spacing=20.0))
    antenna = np.array([0.0, 0.0, 1.0])
    azimuth = np.arange(0.0, 360.0, 20.0)
    for elevation in (5.0, 10.0, 45.0, 90.0):
        assert (amplitudes(ground, antenna, _towards(azimuth, elevation), 0.8) == 1.0).all()
    assert (amplitudes(ground, antenna, _towards(azimuth, -20.0), 0.8) == 0.0).all()


def test_hills_far_away_count() -> None:
    hill = floating((box("hill", (50.0, 500.0, 400.0)), at(2000.0, 0, 0)))  # 11.6 deg high from 1950 m
    found = amplitudes(hill, HERE, np.concatenate([_towards(np.array([0.0]), e) for e in (10.0, 13.0)]), 0.8)
    assert found.tolist() == [0.0, 1.0]
