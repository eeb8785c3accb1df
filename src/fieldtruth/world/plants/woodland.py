# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Broadleaved trees of wood and water's edge: beech (layered), alder (upright) and crack willow (hanging twigs).

Forms follow field guides; the numbers were set by eye.
"""

from dataclasses import replace
from typing import Final

from fieldtruth.world.plants.species import Habit, Leaf, Order, Species
from fieldtruth.world.plants.variation import in_stand

_BEECH_LEAF: Final = Leaf(number=23500, length=0.155, width=0.64, widest=0.42, droop=0.15, flatness=2.2, stalk=0.012)
_BEECH: Final = Habit(
    height=12,
    trunk_radius=0.019,
    leader=0.93,
    clear=2.3,
    crown_base=0.2,
    outline="domed",
    lopsided=0.16,
    vigour=(0.85, 1.0),
    trunk_wander=0.12,
    trunk_sides=18,
    flare=0.65,
    leaf=_BEECH_LEAF,
    orders=(
        Order(
            number=26, length=0.32, length_spread=0.18, angle=(58, 20), lift=(0.1, -0.1), bend=0.3, wander=0.35,
            thickness=1.2, segments=8, sides=6,
        ),
        Order(
            number=250, start=0.18, length=0.5, length_spread=0.28, angle=(58, 38), divergence=180,
            divergence_spread=18, lift=(-0.3, 0.1), bend=0.3, wander=0.35, segments=4, sides=3, foliage=0.7,
            leaf_start=0.4,
        ),
        Order(
            number=1500, start=0.15, length=0.6, length_spread=0.25, angle=(55, 38), divergence=180,
            divergence_spread=14, lift=(-0.1, -0.2), bend=0.3, wander=0.3, thickness=1.0, segments=1, sides=3,
            foliage=1, leaf_start=0.05,
        ),
    ),
)  # fmt: skip
BEECH: Final = Species(
    name="beech",
    latin="Fagus sylvatica",
    wood="bark_beech",
    foliage="leaf_beech",
    grown=_BEECH,
    young=replace(
        _BEECH,
        height=4,
        trunk_radius=0.009,
        leader=0.95,
        clear=0.9,
        crown_base=0.26,
        outline="flame",
        trunk_segments=14,
        trunk_sides=9,
        flare=0.25,
        leaf=replace(_BEECH_LEAF, number=4400, length=0.1, rounded=True),
        orders=(
            replace(_BEECH.orders[0], number=20, length=0.3, angle=(60, 30), segments=6, sides=4),
            replace(_BEECH.orders[1], number=130, segments=3, foliage=1, leaf_start=0.1),
            replace(_BEECH.orders[2], number=280, start=0.2, segments=2),
        ),
    ),
    stand=in_stand(_BEECH, crown_base=0.52, reach=0.68, slim=0.78, leaves=0.85, clear=2.3),
)

_ALDER_LEAF: Final = Leaf(number=22500, length=0.125, width=0.88, widest=0.55, droop=0.4)
_ALDER: Final = Habit(
    height=11,
    trunk_radius=0.0145,
    leader=0.98,
    clear=1.9,
    crown_base=0.2,
    outline="flame",
    lopsided=0.14,
    vigour=(0.8, 1.0),
    dead_limbs=0.04,
    trunk_wander=0.16,
    trunk_sides=13,
    flare=0.4,
    leaf=_ALDER_LEAF,
    orders=(
        Order(
            number=38, length=0.215, length_spread=0.22, angle=(74, 34), lift=(0.1, 0.3), bend=0.3, wander=0.4,
            thickness=1.2, segments=7, sides=5,
        ),
        Order(
            number=280, start=0.25, length=0.48, length_spread=0.3, angle=(60, 40), divergence=140,
            divergence_spread=40, lift=(0.1, 0.1), bend=0.4, wander=0.5, segments=4, sides=3, foliage=0.8,
            leaf_start=0.4,
        ),
        Order(
            number=1100, start=0.2, length=0.5, length_spread=0.25, angle=(58, 40), lift=(0.1, 0.0), bend=0.4,
            wander=0.4, thickness=1.0, segments=1, sides=3, foliage=1, leaf_start=0.1,
        ),
    ),
)  # fmt: skip
ALDER: Final = Species(
    name="alder",
    latin="Alnus glutinosa",
    wood="bark_alder",
    foliage="leaf_alder",
    grown=_ALDER,
    young=replace(
        _ALDER,
        height=4,
        trunk_radius=0.0085,
        clear=0.8,
        crown_base=0.24,
        trunk_segments=14,
        trunk_sides=8,
        flare=0.2,
        leaf=replace(_ALDER_LEAF, number=4200, length=0.085, rounded=True),
        orders=(
            replace(_ALDER.orders[0], number=26, length=0.24, angle=(60, 30), segments=5, sides=4),
            replace(_ALDER.orders[1], number=140, segments=3, foliage=1, leaf_start=0.1),
            replace(_ALDER.orders[2], number=220),
        ),
    ),
    stand=in_stand(_ALDER, crown_base=0.48, reach=0.75, slim=0.85, leaves=0.8, clear=2.0),
)

_WILLOW_LEAF: Final = Leaf(
    number=20500, length=0.19, width=0.245, widest=0.35, fold=14, stalk=0.01, droop=0.8, flatness=0.5, forward=0.9,
    arrangement=137.5, size_spread=0.22,
)  # fmt: skip
_WILLOW: Final = Habit(
    height=10,
    trunk_radius=0.028,
    leader=0.66,
    clear=1.7,
    crown_base=0.19,
    outline="hemispherical",
    lopsided=0.2,
    vigour=(0.8, 1.05),
    dead_limbs=0.06,
    trunk_lean=4.0,
    lean_limit=9.0,
    trunk_wander=0.35,
    trunk_sides=16,
    flare=0.6,
    leaf=_WILLOW_LEAF,
    orders=(
        Order(
            number=17, length=0.42, length_spread=0.2, angle=(50, 16), lift=(0.5, -0.2), bend=0.4, wander=0.6,
            thickness=1.0, segments=9, sides=7,
        ),
        Order(
            number=210, start=0.25, length=0.42, length_spread=0.3, angle=(52, 36), divergence_spread=35,
            lift=(0.3, -1.2), bend=0.4, wander=0.5, thickness=1.05, segments=4, sides=3, foliage=0.5, leaf_start=0.4,
        ),
        Order(
            number=1350, start=0.2, length=0.95, length_spread=0.3, angle=(48, 34), lift=(-1.4, -2.6), bend=0.2,
            wander=0.25, thickness=0.9, segments=2, sides=3, foliage=1, leaf_start=0.05,
        ),
    ),
)  # fmt: skip
WILLOW: Final = Species(
    name="willow",
    latin="Salix fragilis",
    wood="bark_willow",
    foliage="leaf_willow",
    grown=_WILLOW,
    young=replace(
        _WILLOW,
        height=4,
        trunk_radius=0.011,
        leader=0.9,
        clear=0.6,
        crown_base=0.22,
        outline="spherical",
        trunk_segments=14,
        trunk_sides=8,
        flare=0.25,
        leaf=replace(_WILLOW_LEAF, number=5000, length=0.13, rounded=True),
        orders=(
            replace(_WILLOW.orders[0], number=20, length=0.36, angle=(48, 22), segments=6, sides=4),
            replace(_WILLOW.orders[1], number=130, segments=3, lift=(0.3, -0.8), foliage=1, leaf_start=0.1),
            replace(_WILLOW.orders[2], number=230, lift=(-0.8, -1.8), length=0.7),
        ),
    ),
    stand=in_stand(_WILLOW, crown_base=0.34, reach=0.75, slim=0.75, leaves=1.1, clear=1.9),
)
