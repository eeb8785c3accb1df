# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Twigs, leaves and blades of bushes, grass and herbs: recipes from the drawings in ``plants`` and ``herbage``.

Albedos of thin things are what they scatter back; they let about a third as much through (Jacquemoud and Baret 1990,
PROSPECT; dry grass after the ECOSTRESS spectral library).
"""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Final

from fieldtruth.world.textures import herbage, plants
from fieldtruth.world.textures.canvas import Recipe

_GREEN: Final = [(70, 92, 44), (88, 112, 55), (104, 128, 66)]
_DARK: Final = [(54, 71, 36), (68, 89, 45), (84, 105, 56)]
_GRASS: Final = [(72, 92, 42), (96, 114, 52), (122, 134, 66), (158, 156, 92)]
_FINE: Final = [(58, 80, 36), (76, 100, 46), (96, 118, 56)]
_REED: Final = [(78, 96, 54), (102, 118, 66), (130, 140, 82), (166, 160, 106)]
_STRAW: Final = [(132, 112, 74), (172, 150, 104), (196, 178, 132), (214, 200, 160)]
_HUSK: Final = [(96, 76, 50), (148, 122, 84), (188, 164, 122)]
_FERN: Final = [(62, 80, 38), (86, 104, 50), (112, 124, 64)]
_RUST: Final = [(86, 58, 36), (124, 86, 50), (150, 112, 70)]

_BUSHES: Final = {
    "bark_bush": Recipe(plants.bark_bush, (0.140, 0.110, 0.080)),
    "leaf_box": Recipe(partial(plants.leaf, pairs=16, slope=0.8, vein=0.10, tones=_DARK), (0.042, 0.072, 0.022)),
    "leaf_hazel": Recipe(partial(plants.leaf, pairs=7, slope=0.8, vein=0.35, tones=_GREEN), (0.066, 0.108, 0.028)),
    "leaf_juniper": Recipe(
        partial(herbage.needles, tones=[(50, 66, 52), (74, 92, 74), (108, 124, 104)], count=9, spread=1.1),
        (0.052, 0.077, 0.046),
    ),
    "leaf_gorse": Recipe(
        partial(herbage.needles, tones=[(66, 88, 36), (92, 112, 48), (128, 136, 66)], count=6, spread=0.9),
        (0.068, 0.096, 0.026),
    ),
    "petal_gorse": Recipe(
        partial(herbage.chaff, tones=[(206, 158, 20), (236, 190, 30), (248, 214, 70)]), (0.560, 0.400, 0.030)
    ),
    "leaf_bramble": Recipe(partial(plants.leaf, pairs=8, slope=0.8, vein=0.35, tones=_DARK), (0.050, 0.084, 0.024)),
    "leaf_willow_grey": Recipe(
        partial(plants.leaf, pairs=11, slope=0.9, vein=0.22, tones=[(96, 112, 78), (116, 132, 96), (136, 150, 116)]),
        (0.110, 0.140, 0.078),
    ),
    "leaf_heather": Recipe(
        partial(herbage.needles, tones=[(58, 66, 36), (84, 88, 50), (112, 104, 66)], count=10, spread=0.7),
        (0.062, 0.072, 0.032),
    ),
    "petal_heather": Recipe(
        partial(herbage.chaff, tones=[(112, 62, 96), (150, 92, 132), (178, 128, 158)]), (0.230, 0.095, 0.180)
    ),
}

_HERBS: Final = {
    "blade_green": Recipe(
        partial(herbage.blade, tones=_GRASS, foot=(148, 128, 84), tip=(168, 150, 98)), (0.074, 0.100, 0.031)
    ),
    "blade_fine": Recipe(
        partial(herbage.blade, tones=_FINE, foot=(112, 98, 58), tip=(112, 116, 62), spots=0.2), (0.050, 0.080, 0.023)
    ),
    "blade_dry": Recipe(
        partial(herbage.blade, tones=_STRAW, foot=(120, 96, 62), tip=(204, 186, 142)), (0.255, 0.200, 0.108)
    ),
    "blade_reed": Recipe(
        partial(herbage.blade, tones=_REED, foot=(146, 124, 82), tip=(160, 142, 92)), (0.092, 0.112, 0.044)
    ),
    "blade_seed": Recipe(partial(herbage.chaff, tones=_HUSK), (0.220, 0.160, 0.090)),
    "blade_plume": Recipe(
        partial(herbage.chaff, tones=[(98, 82, 70), (146, 126, 108), (184, 166, 148)]), (0.210, 0.160, 0.120)
    ),
    "frond_fern": Recipe(partial(herbage.frond, tones=_FERN), (0.054, 0.079, 0.025)),
    "frond_dry": Recipe(partial(herbage.frond, tones=_RUST), (0.160, 0.090, 0.045)),
    "leaf_nettle": Recipe(partial(plants.leaf, pairs=6, slope=0.8, vein=0.25, tones=_GREEN), (0.050, 0.084, 0.025)),
    "petal_daisy": Recipe(
        partial(herbage.petals, count=18, petal=(244, 244, 238), heart=(224, 176, 30), size=0.36), (0.600, 0.570, 0.450)
    ),
    "petal_buttercup": Recipe(
        partial(herbage.petals, count=5, petal=(246, 214, 30), heart=(206, 168, 24), size=0.3), (0.700, 0.540, 0.030)
    ),
    "petal_yarrow": Recipe(partial(herbage.umbel, floret=(240, 238, 226), gap=(120, 128, 90)), (0.520, 0.520, 0.420)),
    "spike_cattail": Recipe(
        partial(herbage.velvet, tones=[(58, 38, 26), (86, 58, 38), (112, 80, 54)]), (0.075, 0.042, 0.024)
    ),
}

RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType({**_BUSHES, **_HERBS})
