# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Textures tile, have the stated albedo, depend on the seed, and exist for every material."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fieldtruth.core.arrays import Array
from fieldtruth.core.classes import Label
from fieldtruth.world.materials import MATERIALS
from fieldtruth.world.plants import BUSHES, TREES, Species
from fieldtruth.world.textures import TEXTURES, make_texture
from fieldtruth.world.textures.canvas import cells, even_out, finish, halve, linear, mix, noise, settle, stamps, strokes

SEED = np.random.SeedSequence(3)
THIN = ("leaf_", "blade_", "frond_", "petal_")
"""Translucent surfaces are drawn as a whole leaf, blade or flower and do not tile."""

SLOW = pytest.mark.slow
FIRST = list({texture.draw: name for name, texture in reversed([*TEXTURES.items()])}.values())
"""One texture of each drawing; others are the same function with other numbers, and slow together."""


def every(names: Iterable[str]) -> list[Any]:
    return [name if name in FIRST else pytest.param(name, marks=SLOW) for name in names]


# Least and most mean linear albedo of red, green and blue.
ALBEDO = {
    "lawn": ((0.06, 0.13), (0.08, 0.14), (0.02, 0.06)),
    "lawn_dry": ((0.12, 0.22), (0.12, 0.20), (0.04, 0.10)),
    "soil": ((0.08, 0.13), (0.06, 0.10), (0.03, 0.07)),
    "gravel": ((0.25, 0.35), (0.25, 0.35), (0.15, 0.30)),
    "bark_oak": ((0.10, 0.20), (0.08, 0.18), (0.06, 0.15)),
    "bark_lime": ((0.10, 0.20), (0.08, 0.18), (0.06, 0.15)),
    "bark_birch": ((0.36, 0.50), (0.36, 0.50), (0.32, 0.45)),  # its lenticels and scars included
    "bark_beech": ((0.17, 0.30), (0.17, 0.30), (0.15, 0.27)),
    "leaf_lime": ((0.04, 0.09), (0.06, 0.12), (0.01, 0.05)),
    "leaf_box": ((0.03, 0.09), (0.06, 0.12), (0.01, 0.05)),
    "wood_grey": ((0.20, 0.30), (0.20, 0.30), (0.15, 0.25)),
    "concrete": ((0.30, 0.40), (0.30, 0.40), (0.27, 0.38)),
}


def mean_albedo(texture: NDArray[np.uint8]) -> Array:
    return np.asarray(linear(texture[..., :3]).astype(np.float64).mean(axis=(0, 1)))


@pytest.mark.parametrize("name", every(TEXTURES))
def test_shape_and_mean_albedo(name: str) -> None:
    texture = make_texture(name, SEED)
    n = len(texture)
    assert texture.dtype == np.uint8
    assert texture.shape in ((n, n, 3), (n, n, 4))
    assert n in (128, 256, 512, 1024)
    np.testing.assert_allclose(mean_albedo(texture), TEXTURES[name].albedo, atol=0.003)
    for value, (least, most) in zip(mean_albedo(texture), ALBEDO.get(name, ((0.02, 0.8),) * 3), strict=True):
        assert least <= value <= most


@pytest.mark.parametrize("name", every(n for n in TEXTURES if not n.startswith(THIN)))
def test_texture_has_no_seam(name: str) -> None:
    """Lines on both sides of the edge differ no more than neighbouring lines inside."""
    for axis in (0, 1):
        image = np.moveaxis(make_texture(name, SEED).astype(np.float64), axis, 0)
        steps = np.abs(image - np.roll(image, 1, axis=0)).mean(axis=(1, 2))
        assert steps[0] <= steps[1:].mean() + 4 * steps[1:].std(), axis


@SLOW
def test_ground_shows_millimetres_and_fits_into_memory() -> None:
    """Texels of 1 to 2 mm on what a robot drives on; an atlas of all textures, more than a world has, below 300 MB."""
    for name, material in MATERIALS.items():
        if material.relief > 0:
            texture = make_texture(material.texture, SEED)
            assert 0.0009 <= material.repeat / len(texture) <= 0.0025, name
            assert texture.shape[2] == 4
            assert np.ptp(texture[..., 3]) > 150
    codes = sum(len(make_texture(name, SEED)) ** 2 for name in TEXTURES)
    assert codes * 4 / 3 * (4 + 1) < 300e6


@pytest.mark.parametrize("name", [*every(["lawn", "lawn_dry", "mulch", "litter", "meadow"]), "soil", "gravel"])
def test_quarters_of_a_ground_texture_are_equally_bright(name: str) -> None:
    """A brighter patch would show the repetition."""
    light = linear(make_texture(name, SEED)[..., :3]).mean(axis=2)
    quarters = light.reshape(2, len(light) // 2, 2, len(light) // 2).mean(axis=(1, 3))
    assert np.ptp(quarters) < 0.05 * quarters.mean()


@pytest.mark.parametrize("name", ["blade_green", "blade_dry", "blade_reed", "blade_fine"])
def test_blade_is_dark_at_its_root(name: str) -> None:
    """v = 0, a blade's root, is the last row of the image."""
    light = linear(make_texture(name, SEED)).mean(axis=(1, 2))
    n = len(light)
    assert light[-n // 10 :].mean() < 0.75 * light[n // 4 : n // 2].mean()


def test_same_seed_gives_same_bytes_and_another_seed_another_texture() -> None:
    for name in ("gravel", "bark_birch", "leaf_oak"):
        again = make_texture(name, np.random.SeedSequence(3))
        assert again.tobytes() == make_texture(name, SEED).tobytes()
        assert make_texture(name, np.random.SeedSequence(4)).tobytes() != again.tobytes()


def test_texture_depends_on_its_name_and_the_parent_seed_only() -> None:
    assert make_texture("concrete", SEED).tobytes() == make_texture("concrete", SEED).tobytes()
    parent = np.random.SeedSequence(3).spawn(2)
    assert make_texture("glass", parent[0]).tobytes() != make_texture("glass", parent[1]).tobytes()
    assert make_texture("leaf_lime", SEED).tobytes() != make_texture("leaf_birch", SEED).tobytes()


def test_every_material_has_its_texture_and_every_texture_a_material() -> None:
    assert {m.texture for m in MATERIALS.values()} == set(TEXTURES)
    assert all(name == material.name for name, material in MATERIALS.items())


def test_labels_of_materials() -> None:
    """The first word of a material's name implies its class; plants are tested below."""
    prefixes = {
        "bench": Label.BENCH, "table": Label.TABLE, "lamp": Label.LAMP_POST, "bin": Label.TRASH_BIN,
        "lawn": Label.GROUND, "soil": Label.GROUND, "mulch": Label.GROUND, "litter": Label.GROUND,
        "meadow": Label.GROUND, "gravel": Label.TRAIL, "setts": Label.TRAIL, "bark": Label.TRUNK,
    }  # fmt: skip
    for name, material in MATERIALS.items():
        wanted = prefixes.get(name.split("_")[0])
        assert wanted is None or material.label == wanted, name


@pytest.mark.parametrize("species", TREES.values(), ids=str)
def test_trees_are_trunk_and_treetop(species: Species) -> None:
    assert MATERIALS[species.wood].label == Label.TRUNK
    assert MATERIALS[species.foliage].label == Label.TREETOP


@pytest.mark.parametrize("species", BUSHES.values(), ids=str)
def test_bushes_are_bush(species: Species) -> None:
    assert MATERIALS[species.wood].label == MATERIALS[species.foliage].label == Label.BUSH


def test_only_thin_surfaces_are_translucent() -> None:
    assert all((m.translucency > 0) == m.texture.startswith(THIN) for m in MATERIALS.values())


def test_tinted_albedo_stays_below_one() -> None:
    for material in MATERIALS.values():
        assert (np.array(material.tint) * TEXTURES[material.texture].albedo).max() < 0.85


def test_leaf_texture_has_a_midrib() -> None:
    for name in ("leaf_lime", "leaf_birch", "leaf_oak", "leaf_hazel"):
        column = linear(make_texture(name, SEED)).mean(axis=(0, 2))
        assert 0.47 < (column.argmax() + 0.5) / len(column) < 0.53


def test_linear_light_follows_the_srgb_standard() -> None:
    np.testing.assert_allclose(linear([0, 255, 118, 188]), [0, 1, 0.1812, 0.5029], atol=2e-4)


def test_noise_has_the_requested_frequencies_and_wraps() -> None:
    rng = np.random.default_rng(1)
    field = noise(rng, 128, 8, 16, slope=0.0)
    assert abs(field.mean()) < 1e-5
    assert field.std() == pytest.approx(1, abs=1e-5)
    power = np.abs(np.fft.fft2(field)) ** 2
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(128, 1 / 128), np.fft.fftfreq(128, 1 / 128)))
    assert power[(k > 5) & (k < 20)].sum() > 0.98 * power.sum()
    drawn = noise(rng, 128, 4, 60, slope=0.0, stretch=16.0)
    assert np.abs(np.diff(drawn, axis=0)).mean() < 0.3 * np.abs(np.diff(drawn, axis=1)).mean()


def test_cells_agree_with_brute_force() -> None:
    n, across, along = 48, 4, 3
    found = cells(np.random.default_rng(5), n, across, along, jitter=0.6)
    offset = (np.random.default_rng(5).random((2, along, across)).astype(np.float32) - 0.5) * 0.6
    grid = (np.arange(n) + 0.5) / n
    u, v = np.meshgrid(grid * across, grid * along)
    distances = []
    for i in range(along):
        for j in range(across):
            du = (u - j - 0.5 - offset[0, i, j] + across / 2) % across - across / 2
            dv = (v - i - 0.5 - offset[1, i, j] + along / 2) % along - along / 2
            distances.append(np.hypot(du, dv))
    ranked = np.sort(distances, axis=0)
    np.testing.assert_allclose(found.nearest, ranked[0], atol=1e-5)
    np.testing.assert_allclose(found.second, ranked[1], atol=1e-5)
    assert (found.owner == np.argmin(distances, axis=0)).all()


def test_highest_piece_is_visible() -> None:
    rng = np.random.default_rng(2)
    low = stamps(rng, 64, [20.0], [20.0], lambda a, b, _: 1 - a**2 - b**2, 0.3)
    high = stamps(rng, 64, [9.0], [9.0], lambda a, b, _: 1 - a**2 - b**2, 0.9)
    for pieces in ([low, high._replace(owner=high.owner + 1)], [high._replace(owner=high.owner + 1), low]):
        relief = settle(64, pieces)
        assert np.count_nonzero(relief.owner == 1) == pytest.approx(np.pi * 81, rel=0.05)
        assert np.count_nonzero(relief.owner >= 0) >= np.count_nonzero(relief.owner == 1)
        assert (relief.height[relief.owner < 0] == 0).all()
    alone = settle(64, [low])
    assert np.count_nonzero(alone.owner == 0) == pytest.approx(np.pi * 400, rel=0.03)


def test_strokes_have_the_requested_length() -> None:
    blades = strokes(np.random.default_rng(4), 256, 50, (10.0, 20.0), 2.0, 0.0)
    for k in range(50):
        own = blades.owner == k
        extent = np.hypot(np.ptp(blades.x[own]), np.ptp(blades.y[own]))
        assert 8 < extent < 23
    assert blades.a.min() > 0
    assert blades.a.max() < 1
    assert blades.height.max() <= 1


def test_mix_halve_even_out_and_finish() -> None:
    ends = mix([(0, 0, 0), (255, 255, 255)], np.array([[0.0, 0.5], [1.0, 2.0]]))
    np.testing.assert_allclose(ends[..., 0], [[0.0, 0.5], [1.0, 1.0]], atol=1e-3)
    image = np.zeros((4, 4, 3), np.float32)
    image[:2, :2] = [[[4], [0]], [[0], [0]]]
    assert halve(image)[0, 0, 0] == 1.0
    wave = 1 + 0.3 * np.cos(2 * np.pi * np.arange(64) / 64)
    flat = even_out(np.broadcast_to(wave[:, None, None], (64, 64, 3)).astype(np.float32))
    assert np.ptp(flat) < 0.2 * np.ptp(wave)
    done = finish(np.ones((8, 8, 3), np.float32), (0.5, 0.2, 0.05))
    np.testing.assert_allclose(linear(done)[0, 0], (0.5, 0.2, 0.05), atol=0.003)
