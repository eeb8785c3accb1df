# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Broadleaved park trees: lime (tall dense dome), birch (slim, airy, hanging twigs) and oak (low, wide, crooked).

Leaves are up to twice as long as nature's (see `leaves`). Forms follow field guides; the numbers were set by eye.
"""

from dataclasses import replace
from typing import Final

from fieldtruth.world.plants.species import Habit, Leaf, Order, Species
from fieldtruth.world.plants.variation import in_stand

_LIME_LEAF: Final = Leaf(number=23500, length=0.145, width=0.8, widest=0.31, droop=0.7)
_LIME: Final = Habit(
    height=11,
    trunk_radius=0.0175,
    clear=2.3,
    crown_base=0.24,
    outline="domed",
    lopsided=0.16,
    leaf=_LIME_LEAF,
    orders=(
        Order(
            number=24, length=0.3, length_spread=0.18, angle=(65, 22), lift=(0.1, 0.5), bend=0.35, wander=0.35,
            thickness=1.2, segments=9, sides=6,
        ),
        Order(
            number=240, start=0.2, length=0.55, length_spread=0.25, angle=(62, 38), divergence=180,
            divergence_spread=35, lift=(0.1, -0.1), bend=0.4, wander=0.4, segments=4, sides=3,
            foliage=0.7, leaf_start=0.5,
        ),
        Order(
            number=1500, start=0.15, length=0.6, length_spread=0.25, angle=(60, 40), divergence=180,
            divergence_spread=35, lift=(0.1, -0.4), bend=0.4, wander=0.4, thickness=1.0, segments=1, sides=3,
            foliage=1, leaf_start=0.05,
        ),
    ),
)  # fmt: skip
LIME: Final = Species(
    name="lime",
    latin="Tilia platyphyllos",
    wood="bark_lime",
    foliage="leaf_lime",
    grown=_LIME,
    young=Habit(
        height=4,
        trunk_radius=0.0105,
        clear=1.25,
        crown_base=0.36,
        outline="domed",
        lopsided=0.12,
        trunk_segments=14,
        trunk_sides=9,
        flare=0.25,
        leaf=replace(_LIME_LEAF, number=4000, length=0.095, rounded=True),
        orders=(
            Order(
                number=17, length=0.33, length_spread=0.2, angle=(50, 25), lift=(0.2, 0.3), bend=0.3, wander=0.3,
                thickness=1.2, segments=6, sides=4,
            ),
            Order(
                number=120, start=0.15, length=0.5, length_spread=0.25, angle=(55, 35), divergence=180,
                divergence_spread=35, lift=(0.1, -0.1), bend=0.4, wander=0.4, segments=3, sides=3,
                foliage=1, leaf_start=0.1,
            ),
            Order(
                number=260, start=0.2, length=0.5, length_spread=0.25, angle=(55, 40), divergence=180,
                divergence_spread=35, lift=(0.1, -0.3), bend=0.4, wander=0.4, thickness=1.0, segments=2, sides=3,
                foliage=1, leaf_start=0.05,
            ),
        ),
    ),
    stand=in_stand(_LIME, crown_base=0.46, reach=0.72, slim=0.82, leaves=0.85, clear=2.3),
)  # fmt: skip

_BIRCH_LEAF: Final = Leaf(
    number=20500, length=0.097, width=0.82, widest=0.33, droop=0.9, flatness=0.6, arrangement=137.5
)
_BIRCH: Final = Habit(
    height=11,
    trunk_radius=0.0115,
    leader=0.97,
    clear=2.3,
    crown_base=0.24,
    outline="flame",
    lopsided=0.12,
    trunk_lean=3.0,
    trunk_wander=0.25,
    trunk_sides=12,
    flare=0.35,
    leaf=_BIRCH_LEAF,
    orders=(
        Order(
            number=36, length=0.19, length_spread=0.2, angle=(58, 26), lift=(0.3, -0.6), bend=0.3, wander=0.35,
            thickness=1.15, segments=7, sides=5,
        ),
        Order(
            number=300, start=0.18, length=0.55, length_spread=0.3, angle=(50, 40), lift=(0.2, -1.8), bend=0.3,
            wander=0.4, segments=4, sides=3, foliage=0.8, leaf_start=0.3,
        ),
        Order(
            number=1200, start=0.15, length=0.9, length_spread=0.35, angle=(45, 35), lift=(-1.2, -2.4), bend=0.2,
            wander=0.3, thickness=1.0, segments=2, sides=3, foliage=1, leaf_start=0.05,
        ),
    ),
)  # fmt: skip
BIRCH: Final = Species(
    name="birch",
    latin="Betula pendula",
    wood="bark_birch",
    foliage="leaf_birch",
    grown=_BIRCH,
    young=Habit(
        height=4,
        trunk_radius=0.0075,
        leader=0.98,
        clear=1.1,
        crown_base=0.3,
        outline="flame",
        lopsided=0.12,
        trunk_lean=3.0,
        trunk_wander=0.25,
        trunk_segments=14,
        trunk_sides=8,
        flare=0.2,
        leaf=replace(_BIRCH_LEAF, number=3600, length=0.07, rounded=True),
        orders=(
            Order(
                number=26, length=0.24, length_spread=0.25, angle=(45, 25), lift=(0.3, -0.2), bend=0.3, wander=0.35,
                thickness=1.1, segments=6, sides=4,
            ),
            Order(
                number=150, start=0.15, length=0.5, length_spread=0.3, angle=(45, 35), lift=(0.2, -0.8), bend=0.3,
                wander=0.4, segments=3, sides=3, foliage=1, leaf_start=0.1,
            ),
            Order(
                number=180, start=0.2, length=0.6, length_spread=0.3, angle=(45, 35), lift=(-0.4, -1.2), bend=0.2,
                wander=0.3, thickness=1.0, segments=2, sides=3, foliage=1, leaf_start=0.05,
            ),
        ),
    ),
    stand=in_stand(_BIRCH, crown_base=0.5, reach=0.75, slim=0.9, leaves=0.75, clear=2.3),
)  # fmt: skip

_OAK_LEAF: Final = Leaf(
    number=23500, length=0.155, width=0.65, widest=0.6, fold=12, stalk=0.015, droop=0.1, arrangement=137.5
)
_OAK: Final = Habit(
    height=11,
    trunk_radius=0.026,
    leader=0.72,
    clear=2.3,
    crown_base=0.23,
    outline="hemispherical",
    lopsided=0.18,
    trunk_lean=3.0,
    trunk_wander=0.3,
    flare=0.7,
    trunk_sides=16,
    leaf=_OAK_LEAF,
    orders=(
        Order(
            number=20, length=0.4, length_spread=0.17, angle=(72, 22), angle_spread=10, lift=(0.2, 0.5), bend=0.5,
            wander=0.9, thickness=1.0, segments=11, sides=7,
        ),
        Order(
            number=230, start=0.25, length=0.46, length_spread=0.3, angle=(60, 40), divergence=150,
            divergence_spread=40, lift=(0.2, 0.3), bend=0.5, wander=0.8, thickness=1.0, segments=5, sides=4,
            foliage=0.8, leaf_start=0.5,
        ),
        Order(
            number=1450, start=0.2, length=0.55, length_spread=0.25, angle=(60, 40), lift=(0.3, 0.0), bend=0.5,
            wander=0.6, thickness=1.0, segments=1, sides=3, foliage=1, leaf_start=0.1,
        ),
    ),
)  # fmt: skip
OAK: Final = Species(
    name="oak",
    latin="Quercus robur",
    wood="bark_oak",
    foliage="leaf_oak",
    grown=_OAK,
    young=Habit(
        height=4,
        trunk_radius=0.012,
        leader=0.92,
        clear=1.2,
        crown_base=0.34,
        outline="spherical",
        lopsided=0.15,
        trunk_lean=3.0,
        trunk_wander=0.35,
        trunk_segments=14,
        trunk_sides=9,
        flare=0.3,
        leaf=replace(_OAK_LEAF, number=4200, length=0.105, rounded=True),
        orders=(
            Order(
                number=15, length=0.32, length_spread=0.25, angle=(60, 28), angle_spread=10, lift=(0.2, 0.4), bend=0.4,
                wander=0.7, thickness=1.0, segments=7, sides=4,
            ),
            Order(
                number=110, start=0.2, length=0.5, length_spread=0.3, angle=(55, 40), lift=(0.2, 0.2), bend=0.4,
                wander=0.6, thickness=1.0, segments=3, sides=3, foliage=1, leaf_start=0.1,
            ),
            Order(
                number=240, start=0.2, length=0.5, length_spread=0.25, angle=(55, 40), lift=(0.3, 0.0), bend=0.4,
                wander=0.5, thickness=1.0, segments=2, sides=3, foliage=1, leaf_start=0.05,
            ),
        ),
    ),
    stand=in_stand(_OAK, crown_base=0.46, reach=0.68, slim=0.72, leaves=0.85, clear=2.3),
)  # fmt: skip
