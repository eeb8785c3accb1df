# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tileable images of all surfaces, drawn from a seed: one table of name, drawing and mean albedo.

The drawing gives structure and tones; its mean is set to a measured albedo, so that light adds up to a real scene's.
Each image has a seed of its own, made from its name: adding one texture leaves the others as they were.
"""

import zlib
from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.textures import ground, plants, works
from fieldtruth.world.textures.canvas import Image, Rng, finish


class Recipe(NamedTuple):
    """How a texture is drawn, and its mean linear albedo (red, green, blue)."""

    draw: Callable[[Rng], Image]
    albedo: tuple[float, float, float]


_GREEN: Final = [(70, 92, 44), (88, 112, 55), (104, 128, 66)]
_DARK: Final = [(54, 71, 36), (68, 89, 45), (84, 105, 56)]

# Albedos in the visible: grass 0.05 to 0.13, bare soil 0.08 to 0.2, sand and gravel 0.2 to 0.4, concrete 0.3 to 0.4
# (Oke, Boundary Layer Climates, 1987; ECOSTRESS spectral library for barks, leaves and stones).
RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "lawn": Recipe(ground.lawn, (0.105, 0.126, 0.041)),
        "lawn_dry": Recipe(ground.lawn_dry, (0.170, 0.155, 0.072)),
        "soil": Recipe(ground.soil, (0.105, 0.075, 0.048)),
        "mulch": Recipe(ground.mulch, (0.105, 0.060, 0.034)),
        "litter": Recipe(ground.litter, (0.105, 0.075, 0.044)),
        "gravel": Recipe(ground.gravel, (0.305, 0.270, 0.214)),
        "setts": Recipe(ground.setts, (0.205, 0.192, 0.172)),
        "meadow": Recipe(ground.meadow, (0.115, 0.130, 0.050)),
        "bark_lime": Recipe(plants.bark_lime, (0.150, 0.128, 0.103)),
        "bark_birch": Recipe(plants.bark_birch, (0.540, 0.515, 0.470)),
        "bark_oak": Recipe(plants.bark_oak, (0.112, 0.094, 0.073)),
        "bark_bush": Recipe(plants.bark_bush, (0.140, 0.110, 0.080)),
        "leaf_lime": Recipe(partial(plants.leaf, pairs=8, slope=0.75, vein=0.30, tones=_GREEN), (0.062, 0.105, 0.026)),
        "leaf_birch": Recipe(partial(plants.leaf, pairs=9, slope=0.9, vein=0.28, tones=_GREEN), (0.068, 0.112, 0.026)),
        "leaf_oak": Recipe(partial(plants.leaf, pairs=7, slope=0.9, vein=0.30, tones=_DARK), (0.050, 0.085, 0.024)),
        "leaf_box": Recipe(partial(plants.leaf, pairs=16, slope=0.8, vein=0.10, tones=_DARK), (0.042, 0.072, 0.022)),
        "leaf_hazel": Recipe(partial(plants.leaf, pairs=7, slope=0.8, vein=0.35, tones=_GREEN), (0.066, 0.108, 0.028)),
        "wood": Recipe(works.wood, (0.250, 0.137, 0.062)),
        "wood_grey": Recipe(works.wood_grey, (0.265, 0.238, 0.200)),
        "iron": Recipe(works.iron, (0.030, 0.045, 0.036)),
        "steel": Recipe(works.steel, (0.400, 0.410, 0.420)),
        "concrete": Recipe(works.concrete, (0.365, 0.350, 0.318)),
        "glass": Recipe(works.glass, (0.760, 0.750, 0.700)),
    }
)


def make_texture(name: str, seed: np.random.SeedSequence) -> NDArray[np.uint8]:
    """Image (n, n, 3) sRGB of one recipe; ``seed`` is the one of all textures."""
    recipe = RECIPES[name]
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, zlib.crc32(name.encode())))
    return finish(recipe.draw(np.random.default_rng(own)), recipe.albedo)


def make_textures(seed: np.random.SeedSequence) -> dict[str, NDArray[np.uint8]]:
    """Every texture by name: (n, n, 3) sRGB, n a power of two; u runs along axis 1, v up axis 0."""
    return {name: make_texture(name, seed) for name in RECIPES}
