# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Barks and leaves of trees: recipes from the drawings in ``plants``."""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Final

from fieldtruth.world.textures import plants
from fieldtruth.world.textures.canvas import Recipe

_GREEN: Final = [(70, 92, 44), (88, 112, 55), (104, 128, 66)]
_DARK: Final = [(54, 71, 36), (68, 89, 45), (84, 105, 56)]

RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "bark_lime": Recipe(plants.bark_lime, (0.150, 0.128, 0.103)),
        "bark_birch": Recipe(plants.bark_birch, (0.540, 0.515, 0.470)),
        "bark_oak": Recipe(plants.bark_oak, (0.112, 0.094, 0.073)),
        "leaf_lime": Recipe(partial(plants.leaf, pairs=8, slope=0.75, vein=0.30, tones=_GREEN), (0.062, 0.105, 0.026)),
        "leaf_birch": Recipe(partial(plants.leaf, pairs=9, slope=0.9, vein=0.28, tones=_GREEN), (0.068, 0.112, 0.026)),
        "leaf_oak": Recipe(partial(plants.leaf, pairs=7, slope=0.9, vein=0.30, tones=_DARK), (0.050, 0.085, 0.024)),
    }
)
