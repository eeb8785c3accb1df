# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Twigs, leaves and blades of bushes, grass and herbs: recipes from the drawings in ``plants``."""

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
        "bark_bush": Recipe(plants.bark_bush, (0.140, 0.110, 0.080)),
        "leaf_box": Recipe(partial(plants.leaf, pairs=16, slope=0.8, vein=0.10, tones=_DARK), (0.042, 0.072, 0.022)),
        "leaf_hazel": Recipe(partial(plants.leaf, pairs=7, slope=0.8, vein=0.35, tones=_GREEN), (0.066, 0.108, 0.028)),
    }
)
