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

_FRESH: Final = [(66, 92, 40), (86, 114, 52), (106, 132, 62)]
_SILVER: Final = [(84, 100, 66), (104, 120, 84), (124, 138, 102)]
_SPRUCE: Final = [(30, 44, 24), (44, 62, 34), (62, 82, 46)]
_PINE: Final = [(44, 58, 40), (62, 80, 56), (84, 102, 74)]

RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType(
    {
        "bark_lime": Recipe(plants.bark_lime, (0.150, 0.128, 0.103)),
        "bark_birch": Recipe(plants.bark_birch, (0.540, 0.515, 0.470)),
        "bark_oak": Recipe(plants.bark_oak, (0.112, 0.094, 0.073)),
        "bark_beech": Recipe(plants.bark_beech, (0.175, 0.170, 0.150)),
        "bark_spruce": Recipe(plants.bark_spruce, (0.115, 0.090, 0.072)),
        "bark_pine": Recipe(plants.bark_pine, (0.130, 0.092, 0.068)),
        "bark_pine_upper": Recipe(plants.bark_pine_upper, (0.290, 0.160, 0.085)),
        "bark_alder": Recipe(plants.bark_alder, (0.088, 0.075, 0.060)),
        "bark_willow": Recipe(plants.bark_willow, (0.140, 0.120, 0.094)),
        "bark_dead": Recipe(plants.bark_dead, (0.225, 0.208, 0.180)),
        "bark_moss": Recipe(plants.bark_moss, (0.052, 0.066, 0.022)),
        "leaf_lime": Recipe(partial(plants.leaf, pairs=8, slope=0.75, vein=0.30, tones=_GREEN), (0.062, 0.105, 0.026)),
        "leaf_birch": Recipe(partial(plants.leaf, pairs=9, slope=0.9, vein=0.28, tones=_GREEN), (0.068, 0.112, 0.026)),
        "leaf_oak": Recipe(partial(plants.leaf, pairs=7, slope=0.9, vein=0.30, tones=_DARK), (0.050, 0.085, 0.024)),
        "leaf_beech": Recipe(partial(plants.leaf, pairs=8, slope=0.9, vein=0.25, tones=_FRESH), (0.054, 0.100, 0.022)),
        "leaf_alder": Recipe(partial(plants.leaf, pairs=7, slope=0.8, vein=0.25, tones=_DARK), (0.044, 0.080, 0.022)),
        "leaf_willow": Recipe(
            partial(plants.leaf, pairs=14, slope=0.5, vein=0.18, tones=_SILVER), (0.082, 0.118, 0.050)
        ),
        "leaf_spruce": Recipe(
            partial(plants.needles, rows=16, slope=0.7, twig=0.022, tones=_SPRUCE), (0.040, 0.060, 0.024)
        ),
        "leaf_pine": Recipe(partial(plants.needles, rows=11, slope=1.3, twig=0.03, tones=_PINE), (0.048, 0.064, 0.033)),
    }
)
