# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The map of what the sun sees, against closed forms and against shadow rays."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from sense_worlds import at, box, make_world, quad

from fieldtruth.core.arrays import Array
from fieldtruth.kernels.light import OFFSET, TEXEL, SunMap, sun_share
from fieldtruth.render.daylight import sun_direction
from fieldtruth.render.light import MARGIN, make_sun_map, sun_disc, visibility
from fieldtruth.sense.scene import Scene

ROOF = 6.0  # [m]
EDGES = (-2.0, 3.0)  # x [m] of the roof's edges
SPREAD = 0.05


@pytest.fixture(scope="module")
def roof() -> Scene:
    """A roof over the middle of level ground."""
    a, b = EDGES
    plate = quad("roof", [[a, -4, ROOF], [b, -4, ROOF], [b, 4, ROOF], [a, 4, ROOF]])
    return Scene(make_world([(plate, at(0, 0, 0))], side=30.0))


def map_of(scene: Scene, sun: Array) -> SunMap:
    with ThreadPoolExecutor(2) as pool:
        return make_sun_map(scene, sun, pool)


def shares(sun_map: SunMap, points: Array, normal: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Array:
    """Share of the sun and distance of what hides it (n, 2) of surfaces with a normal."""
    x, y, z = normal
    across = np.float32(x), np.float32(y), np.float32(z)
    spread = np.float32(SPREAD)
    return np.array([sun_share(sun_map, tuple(point), across, spread) for point in points.astype(np.float32)])


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 30.0), (180.0, 30.0), (180.0, 60.0), (90.0, 50.0)])
def test_shadow_of_a_roof_lies_where_the_sun_throws_it(roof: Scene, azimuth: float, elevation: float) -> None:
    sun = sun_direction(azimuth, elevation)
    x = np.arange(-14.0, 14.0, 0.01)
    found = shares(map_of(roof, sun), np.stack([x, np.zeros_like(x), np.full_like(x, 0.1)], axis=-1))
    below = ROOF - 0.1 - float(OFFSET)
    moved = -below * sun[0] / sun[2]  # of the shadow from the roof
    inside = (x > EDGES[0] + moved) & (x < EDGES[1] + moved)
    if abs(sun[1] / sun[2] * ROOF) > 4.0:
        inside[:] = False  # the shadow passes beside the line
    sharp = np.abs(x[:, None] - np.array(EDGES) - moved).min(axis=1) > SPREAD + 2.0 * TEXEL / sun[2]
    np.testing.assert_array_equal(found[sharp, 0], 1.0 - inside[sharp])
    np.testing.assert_allclose(found[sharp & inside, 1], below / sun[2], atol=1e-3)
    if inside.any():
        np.testing.assert_allclose((1.0 - found[:, 0]).sum() * 0.01, EDGES[1] - EDGES[0], atol=TEXEL / sun[2])


def test_points_outside_and_a_sun_below_the_horizon_have_no_share(roof: Scene) -> None:
    sun_map = map_of(roof, sun_direction(0.0, 40.0))
    beyond = 15.0 + MARGIN + 8.0
    assert (shares(sun_map, np.array([[beyond, beyond, 0.0], [-beyond, -beyond, 0.0]]))[:, 0] == -1.0).all()
    set_sun = map_of(roof, sun_direction(0.0, -3.0))
    assert set_sun.depth.size == 0
    assert shares(set_sun, np.zeros((1, 3)))[0, 0] == -1.0


def test_it_agrees_with_rays_to_the_sun_disc() -> None:
    """Among 300 boxes that float at random: the same mean share, and the same share at nearly every point."""
    rng = np.random.default_rng(3)
    poses = [at(*rng.uniform((-8, -8, 4), (8, 8, 9))) for _ in range(300)]
    scene = Scene(
        make_world([(box(f"box_{k}", rng.uniform(0.1, 0.5, 3).tolist()), pose) for k, pose in enumerate(poses)])
    )
    sun = sun_direction(35.0, 48.0)
    points = rng.uniform((-6, -6, 0.2), (6, 6, 2.0), (4000, 3))
    rays = visibility(scene.rays.handle, points.astype(np.float32), None, sun_disc(sun, 0.27, 24), 0.0)
    found = shares(map_of(scene, sun), points)[:, 0]
    assert 0.2 < rays.mean() < 0.8
    assert found.mean() == pytest.approx(rays.mean(), abs=0.005)
    assert (np.abs(found - rays) > 0.5).mean() < 0.005


def test_a_box_does_not_shade_itself() -> None:
    """Seen from the map, the lit sides of a box are lit up to its edges, and its other sides are not asked."""
    scene = Scene(make_world([(box("box", (1.0, 1.0, 1.0)), at(0, 0, 1.0))]))
    sun_map = map_of(scene, sun_direction(0.0, 35.0))
    across, z = np.meshgrid(np.linspace(-0.95, 0.95, 40), np.linspace(0.1, 1.9, 40))
    front = np.stack([np.full(across.size, 1.0), across.ravel(), z.ravel()], axis=-1)
    top = np.stack([across.ravel(), z.ravel() - 1.0, np.full(across.size, 2.0)], axis=-1)
    assert (shares(sun_map, front, (1.0, 0.0, 0.0))[:, 0] == 1.0).all()
    assert (shares(sun_map, top)[:, 0] == 1.0).all()
