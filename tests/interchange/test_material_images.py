# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Images for other tools: tints in linear light, the ground as photographs show it."""

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from interchange_worlds import small_world
from numpy.typing import NDArray
from PIL import Image

from fieldtruth.core.classes import Label
from fieldtruth.interchange.ground import ground_image, ground_tiles
from fieldtruth.interchange.surfaces import encode_image, material_image
from fieldtruth.kernels.textures import linear_from_srgb, srgb_from_linear
from fieldtruth.world.model import Terrain, World

LOOKS = {"soil": (200, 40, 10), "gravel": (30, 60, 220), "wood": (90, 90, 90)}


def test_a_tint_multiplies_in_linear_light_up_to_white() -> None:
    world = small_world()
    image = material_image(world, "bark")  # a ramp times (1.4, 0.5, 0.5)
    assert image.shape == (8, 8, 3)
    texture = world.textures["ramp"].astype(float) / 255
    linear = ((texture + 0.055) / 1.055) ** 2.4 * (1.4, 0.5, 0.5)
    expected = np.where(texture > 0, (1.055 * linear ** (1 / 2.4) - 0.055) * 255, 0)
    bright = texture > 0.2  # away from the linear part of sRGB's curve
    np.testing.assert_allclose(image[bright], np.minimum(expected[bright], 255), atol=0.51)
    assert image[0, 7, 0] == min(round(float(expected[0, 7, 0])), 255)


def test_images_are_read_back() -> None:
    image = material_image(small_world(), "bark").repeat(8, axis=0).repeat(8, axis=1)
    jpeg = Image.open(BytesIO(encode_image(image)))
    assert jpeg.format == "JPEG"
    assert np.abs(np.asarray(jpeg).astype(int) - image).mean() < 6


def painted_world() -> World:
    """Soil, gravel (trail) and wood (its border) in single colours."""
    world = small_world()
    textures = {name: np.full((8, 8, 3), rgb, np.uint8) for name, rgb in LOOKS.items()}
    materials = {name: replace(world.materials[name], texture=name) for name in LOOKS}
    terrain = replace(world.terrain, border_material="wood", border_width=0.3)
    return replace(
        world, terrain=terrain, textures={**world.textures, **textures}, materials={**world.materials, **materials}
    )


def test_each_pixel_of_the_ground_has_the_colour_of_the_material_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trails here are worn to half their brightness, the other ground is as painted."""

    def worn(terrain: Terrain, rgb: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
        return np.broadcast_to([1.0, 1.0, 1.0, 0.5], (*rgb.shape[:2], 4))

    monkeypatch.setattr("fieldtruth.render.materials.ground_wear", worn)
    half = {n: srgb_from_linear(0.5 * linear_from_srgb(np.array(rgb) / 255)) * 255 for n, rgb in LOOKS.items()}
    expected = {**half, "soil": LOOKS["soil"]}
    world = painted_world()
    for tile in ground_tiles(world, 10.0):
        image = ground_image(world, tile, 20.0)
        assert image.shape == (200, 200, 3)
        for surface in tile.surfaces:  # through the mesh's own uv: v points up in the image
            at = surface.uv[surface.faces].mean(axis=1)
            x, y = tile.x0 + tile.size * at[:, 0], tile.y0 + tile.size * at[:, 1]
            edge = world.terrain.trail_distance.at(x, y)
            clear = (np.abs(edge) > 0.06) & (np.abs(edge + 0.3) > 0.06)
            pixel = image[((1 - at[:, 1]) * 200).astype(int), (at[:, 0] * 200).astype(int)][clear]
            name = np.where(edge > 0, "soil", np.where(edge > -0.3, "wood", "gravel"))[clear]
            np.testing.assert_allclose(pixel, np.array([expected[n] for n in name]), atol=1)
            assert (surface.label == Label.TRAIL) == (name[0] != "soil")


@pytest.mark.parametrize("along", [0, 1])
def test_the_grounds_texture_is_placed_as_in_photographs(along: int) -> None:
    """Repeat 2 m: red grows with x from 0 to 2 m, green falls with y (its rows run downwards)."""
    world = small_world()
    soil = replace(world.materials["soil"], texture="ramp", repeat=2.0, tint=(1.0, 1.0, 1.0))
    world = replace(world, materials={**world.materials, "soil": soil})
    tile = next(t for t in ground_tiles(world, 10.0) if (t.x0, t.y0) == (0.0, 0.0))
    image = ground_image(world, tile, 4.0)  # a texel of 0.25 m is a pixel
    x, y = (8 + np.arange(8) + 0.5) / 4, (36 + np.arange(4) + 0.5) / 4  # 2 to 4 m, 9 to 10 m: off the trail
    assert (world.terrain.trail_distance.at(*np.meshgrid(x, y)) > 0).all()
    red = image[39 - 38, 8:16, 0].astype(int)
    green = image[[39 - 39, 39 - 38, 39 - 37, 39 - 36], 10, 1].astype(int)  # y = 9.875, 9.625, ...
    if along == 0:
        np.testing.assert_allclose(red, np.arange(8) * 30, atol=1)
    else:
        np.testing.assert_allclose(green, [0, 30, 60, 90], atol=1)
