# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The light volume against closed forms: planes, walls and furnaces below an even sky or a sun."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from sense_worlds import F8, Placed, at, box, make_world, quad

from fieldtruth.experiment.light_config import LightConfig
from fieldtruth.kernels.light import AIR_LAYER, LightTable, among, falling_on
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear
from fieldtruth.render.air import air_of
from fieldtruth.render.daylight import sphere
from fieldtruth.render.light import COEFFICIENTS, bake_light, fill_volume
from fieldtruth.render.materials import LEAF_GLOW, material_table
from fieldtruth.render.surfaces import shading_of
from fieldtruth.sense.scene import Scene
from fieldtruth.world.model import World

SUN = LightConfig(sun_azimuth_deg=0.0, sun_elevation_deg=40.0)
SIDE = 24.0
RED_GROUND = (200, 120, 40)
DOWN, LEVEL = -1.0, 0.0


def coloured(objects: Sequence[Placed] = (), ground: tuple[int, int, int] = RED_GROUND) -> World:
    """A plane of one colour, and grey objects on it."""
    world = make_world(objects, side=SIDE)
    textures = {**world.textures, "ground": np.tile(np.array(ground, np.uint8), (4, 4, 1))}
    materials = {**world.materials, "soil": replace(world.materials["soil"], texture="ground")}
    return replace(world, textures=textures, materials=materials)


def albedo(colour: tuple[int, int, int]) -> F8:
    return linear_from_srgb(np.array(colour) / 255.0)


def filled(world: World, *lights: tuple[float, float], workers: int = 1) -> list[LightTable]:
    """Light below each even sky of a radiance, and a white sun of an irradiance."""
    scene = Scene(world)
    baked, materials, tables = bake_light(scene, SUN, 1), material_table(world), []
    clear = air_of(None, baked, world.terrain.surface.heights)
    for sky, sun in lights:
        even = np.full(3, sky, np.float32)
        dome = baked.dome._replace(rgb=np.full_like(baked.dome.rgb, sky), mean=even, horizon=even)
        table = baked._replace(dome=dome, sun_rgb=np.full(3, sun, np.float32), volume=np.zeros_like(baked.volume))
        with ThreadPoolExecutor(workers) as pool:
            volume = fill_volume(shading_of(scene, table, materials, clear), np.zeros(3, np.float32), pool)
        tables.append(table._replace(volume=volume))
    return tables


def irradiance(light: LightTable, x: float, y: float, layer: int, normal: Sequence[float]) -> NDArray[np.float32]:
    """Irradiance over pi by channel on a surface with a normal, at a probe."""
    probe = light.volume[round(x + SIDE / 2), round(y + SIDE / 2), layer]
    nx, ny, nz = np.array(normal, np.float32)
    return np.array([falling_on(probe, channel, nx, ny, nz) for channel in range(3)])


@pytest.fixture(scope="module")
def plain() -> list[LightTable]:
    return filled(coloured(), (1.0, 0.0), (0.0, 1.0))


@pytest.fixture
def below_sky(plain: list[LightTable]) -> LightTable:
    return plain[0]


@pytest.fixture
def below_sun(plain: list[LightTable]) -> LightTable:
    return plain[1]


def test_level_ground_has_the_irradiance_pi_of_an_even_sky(below_sky: LightTable) -> None:
    assert irradiance(below_sky, 0, 0, 0, (0, 0, 1)) == pytest.approx(np.ones(3), rel=0.02)


@pytest.mark.parametrize(("nz", "share"), [(DOWN, 1.0), (LEVEL, 0.5)])
def test_ground_lights_what_is_above_it_by_its_colour_and_form_factor(
    below_sky: LightTable, below_sun: LightTable, nz: float, share: float
) -> None:
    """A wall sees half of the infinite ground and half of the sky: form factors of 1/2; a ceiling only the ground."""
    normal, rho = (np.sqrt(1 - nz * nz), 0.0, nz), albedo(RED_GROUND)
    sky = irradiance(below_sky, 0, 0, 0, normal)
    assert sky == pytest.approx(rho * share + (1 - share), rel=0.06)
    sun = irradiance(below_sun, 0, 0, 0, normal)
    assert sun == pytest.approx(rho * share * np.sin(np.radians(40.0)) / np.pi, rel=0.06)


def test_ground_does_not_light_ground(below_sun: LightTable) -> None:
    assert irradiance(below_sun, 0, 0, 0, (0, 0, 1)) == pytest.approx(np.zeros(3), abs=0.006)


def test_a_furnace_of_walls_is_never_brighter_than_its_sky_and_nearly_as_bright_if_white() -> None:
    """A courtyard, 6 m wide and 12 m deep, of albedo 0.9: an enclosure of albedo 1 would be as bright as its sky."""
    walls: list[Placed] = [
        (box("x", (0.2, 3.4, 6.0)), at(3.2, 0, 6)), (box("x2", (0.2, 3.4, 6.0)), at(-3.2, 0, 6)),
        (box("y", (3.4, 0.2, 6.0)), at(0, 3.2, 6)), (box("y2", (3.4, 0.2, 6.0)), at(0, -3.2, 6)),
    ]  # fmt: skip
    levels = []
    for rho in (0.9, 0.3):
        grey = int(np.rint(255 * srgb_from_linear(np.array([rho]))[0]))
        world = coloured(walls, (grey, grey, grey))
        world = replace(world, textures=dict.fromkeys(world.textures, np.full((4, 4, 3), grey, np.uint8)))
        [light] = filled(world, (1.0, 0.0))
        assert light.volume[..., [0, 4, 8]].max() < 1.01
        levels.append(float(irradiance(light, 0, 0, 0, (0, 0, 1))[0]))
    assert 0.03 < levels[1] < 0.5 * levels[0] < 0.5


def test_light_in_a_corner_comes_from_the_open_side() -> None:
    """Under the sky beside a black wall at +x, the wall hides half of the sky."""
    wall = quad("wall", [[0.5, -19, 0], [0.5, 19, 0], [0.5, 19, 30], [0.5, -19, 30]])
    world = coloured([(wall, at(0, 0, 0))])
    world = replace(world, textures={**world.textures, "grey": np.zeros((4, 4, 3), np.uint8)})
    [light] = filled(world, (1.0, 0.0))
    assert irradiance(light, -1, 0, 1, (0, 0, 1))[0] == pytest.approx(0.5, abs=0.08)
    away, towards = (irradiance(light, -1, 0, 1, (side, 0, 0))[0] for side in (-1.0, 1.0))
    assert towards < 0.2 * away


def test_light_does_not_depend_on_workers_and_without_light_there_is_none() -> None:
    world = coloured([(box("crown", (1, 1, 1), "leaf"), at(1, 2, 3))])
    [one, none], [two] = filled(world, (1.0, 1.0), (0.0, 0.0)), filled(world, (1.0, 1.0), workers=2)
    assert np.array_equal(one.volume, two.volume)
    assert one.volume.any()
    assert not none.volume.any()
    assert one.volume.shape[2:] == (14, COEFFICIENTS)
    assert AIR_LAYER * 13 > 19


@pytest.mark.parametrize("count", [16, 48])
def test_directions_integrate_the_first_bands(count: int) -> None:
    rays = sphere(count, 0.3)
    assert rays.mean(axis=0) == pytest.approx(np.zeros(3), abs=0.03)
    assert rays.T @ rays / count == pytest.approx(np.eye(3) / 3, abs=0.03)


def test_near_surfaces_give_back_what_they_reflect() -> None:
    """A pit of albedo 1 is as bright as its sky; a black one has the open share only; half of each is between."""
    one = np.float32(1.0)
    assert among(np.float32(0.3), one) == pytest.approx(1.0)
    assert among(np.float32(0.3), np.float32(0.0)) == pytest.approx(0.3)
    assert among(np.float32(0.5), np.float32(0.5)) == pytest.approx(0.5 / 0.75)


def test_leaves_reflect_and_transmit_no_more_than_falls_on_them() -> None:
    world = make_world()
    bright = {**world.textures, "white": np.full((4, 4, 3), 240, np.uint8)}
    white = replace(world.materials["leaf"], name="petal", texture="white")
    table = material_table(replace(world, textures=bright, materials={**world.materials, "petal": white}))
    own = table.atlas.mean[table.texture] * table.tint
    assert (own * (1 + table.through)).max() <= 0.9 + 1e-6
    leaf = list(world.materials).index("leaf")
    assert table.through[leaf] == pytest.approx(0.4 * LEAF_GLOW, rel=1e-6)
    assert not table.through[:leaf].any()
