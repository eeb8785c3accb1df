# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Tileable images of all surfaces, drawn from a seed: one table of name, drawing and mean albedo.

The drawing gives structure and tones; its mean is set to a measured albedo, so that light adds up to a real scene's.
Each image has a seed of its own, made from its name: adding one texture leaves the others as they were.
"""

import zlib
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldtruth.world.textures import ground, rocks, trees, undergrowth, wild, woods, works
from fieldtruth.world.textures.canvas import Recipe, finish

_TABLES: Final = (ground, wild, woods, trees, undergrowth, rocks, works)

# Albedos in the visible: grass 0.05 to 0.13, bare soil 0.08 to 0.2, sand and gravel 0.2 to 0.4, concrete 0.3 to 0.4
# (Oke, Boundary Layer Climates, 1987; ECOSTRESS spectral library for barks, leaves and stones).
RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {name: recipe for table in _TABLES for name, recipe in table.RECIPES.items()}
)


def make_texture(name: str, seed: np.random.SeedSequence) -> NDArray[np.uint8]:
    """Image (n, n, 3) sRGB of one recipe; ``seed`` is the one of all textures."""
    recipe = RECIPES[name]
    own = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, zlib.crc32(name.encode())))
    return finish(recipe.draw(np.random.default_rng(own)), recipe.albedo)


def make_textures(seed: np.random.SeedSequence, names: Iterable[str] = RECIPES) -> dict[str, NDArray[np.uint8]]:
    """Textures by name: (n, n, 3) sRGB, n a power of two; u runs along axis 1, v up axis 0."""
    return {name: make_texture(name, seed) for name in names}
