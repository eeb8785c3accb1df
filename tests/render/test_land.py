# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The land beyond the edge: the world's ground at the edge, far land far away, another texture where it is steep."""

import numpy as np
import pytest
from kept_worlds import KEPT

from fieldtruth.kernels.gbuffer import FADES, near_edge
from fieldtruth.kernels.light import MaterialTable
from fieldtruth.kernels.textures import is_steep
from fieldtruth.render.materials import material_table

FAR = np.array([0.5, 0.02, 0.3], np.float32)  # no ground has this colour


@pytest.fixture(scope="module")
def materials() -> MaterialTable:
    return material_table(KEPT.load_world("park"))


def land(materials: MaterialTable, x: float, y: float) -> np.ndarray:
    """Colour at x, y, where a pixel is so wide that it sees the mean of a texture."""
    values = (np.float32(v) for v in (x, y, 50.0, 0.5))
    return np.array(near_edge(materials, tuple(FAR), *values))


def ground(materials: MaterialTable, x: float, y: float) -> np.ndarray:
    x0, y0 = materials.corner
    per = materials.per_metre_rgb
    return materials.ground[int((x - x0) * per), int((y - y0) * per), :3]


@pytest.mark.parametrize("y", [-21.35, -7.75, 3.25, 18.95])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_at_the_edge_it_has_the_colour_of_the_ground_at_the_mirrored_place(
    materials: MaterialTable, side: float, y: float
) -> None:
    for off in (0.35, 1.05, 2.05):
        inside, outside = ground(materials, side * (50.0 - off), y), land(materials, side * (50.0 + off), y)
        np.testing.assert_allclose(outside, inside, rtol=0.03)  # a mean of codes of 8 bits
    np.testing.assert_allclose(land(materials, y, side * 25.95), ground(materials, y, side * 24.05), rtol=0.03)


def test_far_away_it_is_that_of_far_land_and_between_it_fades(materials: MaterialTable) -> None:
    reach = 1.5 * float(FADES)
    np.testing.assert_array_equal(land(materials, 50.0 + reach, 3.0), FAR)
    np.testing.assert_array_equal(land(materials, 3.0, -25.0 - reach), FAR)
    red = np.array([[land(materials, 50.0 + off, y)[0] for off in (2.0, 12.0, 22.0, 32.0)] for y in range(-20, 21, 2)])
    assert (np.diff(red.mean(axis=0)) > 0.03).all()


def test_steep_land_shows_its_other_texture_with_a_ragged_border() -> None:
    rng = np.random.default_rng(0)
    places = rng.uniform(-500, 500, (2000, 2)).astype(np.float32)

    def share(slope_deg: float) -> float:
        up = np.float32(np.cos(np.radians(slope_deg)))
        return float(np.mean([is_steep(x, y, up) for x, y in places]))

    assert share(20.0) == 0.0
    assert 0.3 < share(37.0) < 0.7
    assert share(55.0) == 1.0
