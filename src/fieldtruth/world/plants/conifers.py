# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Conifers: Norway spruce (a spire of whorled, drooping branches) and Scots pine (bare red trunk, flat clumped crown).

A leaf is a small twig with its needles (see `Leaf.prongs`): single needles would be a million triangles. Forms follow
field guides; the numbers were set by eye.
"""

from dataclasses import replace
from typing import Final

from fieldtruth.world.plants.species import Habit, Leaf, Order, Species
from fieldtruth.world.plants.variation import in_stand

_SPRUCE_SPRAY: Final = Leaf(
    number=15500, length=0.21, width=0.165, size_spread=0.22, prongs=3, splay=40, stagger=0.3, fold=10, stalk=0.0,
    droop=0.35, flatness=1.6, forward=1.2,
)  # fmt: skip
_SPRUCE_LIMBS: Final = Order(
    number=130, length=0.2, length_spread=0.16, angle=(104, 52), angle_spread=6, whorl=5, divergence_spread=10,
    lift=(-0.35, 0.75), bend=0.12, wander=0.2, thickness=1.15, segments=6, sides=4, foliage=0.8, leaf_start=0.25,
)  # fmt: skip
_SPRUCE_TWIGS: Final = Order(
    number=1250, start=0.18, length=0.36, length_spread=0.3, angle=(64, 42), divergence=180, divergence_spread=22,
    lift=(-0.7, -1.1), bend=0.2, wander=0.3, thickness=1.0, segments=2, sides=3, foliage=1, drawn=0.7,
)  # fmt: skip
_SPRUCE_DEAD: Final = Order(
    number=90, start=0.05, length=0.075, length_spread=0.5, angle=(98, 88), angle_spread=10, whorl=4, lift=(-0.5, -0.2),
    bend=0.3, wander=0.4, thickness=1.05, segments=3, sides=3,
)  # fmt: skip
_SPRUCE: Final = Habit(
    height=13,
    trunk_radius=0.0135,
    leader=0.995,
    clear=0.35,
    crown_base=0.04,
    outline="spire",
    lopsided=0.08,
    vigour=(0.8, 1.05),
    dead_limbs=0.04,
    trunk_lean=1.0,
    lean_limit=2.5,
    trunk_wander=0.05,
    trunk_segments=22,
    trunk_sides=12,
    flare=0.5,
    leaf=_SPRUCE_SPRAY,
    orders=(_SPRUCE_LIMBS, _SPRUCE_TWIGS),
)
SPRUCE: Final = Species(
    name="spruce",
    latin="Picea abies",
    wood="bark_spruce",
    foliage="leaf_spruce",
    grown=_SPRUCE,
    young=replace(
        _SPRUCE,
        height=4,
        trunk_radius=0.01,
        clear=0.08,
        crown_base=0.03,
        trunk_segments=14,
        trunk_sides=8,
        flare=0.25,
        leaf=replace(_SPRUCE_SPRAY, number=4600, length=0.14),
        orders=(
            replace(_SPRUCE_LIMBS, number=75, length=0.27, angle=(92, 45), lift=(0.0, 0.5), segments=4),
            replace(_SPRUCE_TWIGS, number=380, lift=(-0.2, -0.3)),
        ),
    ),
    stand=replace(
        in_stand(_SPRUCE, crown_base=0.42, reach=0.72, slim=0.85, leaves=0.8, clear=1.6),
        dead=_SPRUCE_DEAD,
        dead_limbs=0.1,
    ),
)

_PINE_TUFT: Final = Leaf(
    number=15000, length=0.185, width=0.16, size_spread=0.2, prongs=3, splay=46, fold=26, stalk=0.0, droop=-0.3,
    flatness=0.6, forward=1.0, arrangement=137.5,
)  # fmt: skip
_PINE: Final = Habit(
    height=12,
    trunk_radius=0.0155,
    leader=0.93,
    clear=2.3,
    crown_base=0.42,
    outline="flat",
    lopsided=0.3,
    vigour=(0.85, 1.05),
    dead_limbs=0.08,
    dead=Order(
        number=9, start=0.22, length=0.06, length_spread=0.5, angle=(85, 70), whorl=2, lift=(-0.2, 0.2), wander=0.6,
        thickness=0.9, segments=3, sides=4,
    ),
    trunk_lean=2.0,
    lean_limit=5.0,
    trunk_wander=0.2,
    trunk_segments=22,
    trunk_sides=14,
    flare=0.35,
    leaf=_PINE_TUFT,
    orders=(
        Order(
            number=32, length=0.26, length_spread=0.25, angle=(82, 30), angle_spread=11, whorl=3, lift=(-0.1, 0.5),
            bend=0.5, wander=0.8, thickness=1.1, segments=8, sides=5,
        ),
        Order(
            number=230, start=0.38, length=0.4, length_spread=0.3, angle=(60, 40), divergence=180, divergence_spread=40,
            lift=(0.1, 0.6), bend=0.4, wander=0.7, segments=4, sides=3, foliage=0.35, leaf_start=0.7,
        ),
        Order(
            number=900, start=0.4, length=0.5, length_spread=0.25, angle=(52, 32), lift=(0.2, 0.7), bend=0.3,
            wander=0.4, thickness=1.0, segments=1, sides=3, foliage=1, leaf_start=0.35,
        ),
    ),
)  # fmt: skip
PINE: Final = Species(
    name="pine",
    latin="Pinus sylvestris",
    wood="bark_pine",
    foliage="leaf_pine",
    upper_wood="bark_pine_upper",
    upper_from=0.4,
    grown=_PINE,
    young=replace(
        _PINE,
        height=4,
        trunk_radius=0.011,
        leader=0.99,
        clear=0.5,
        crown_base=0.16,
        outline="flame",
        lopsided=0.12,
        dead_limbs=0.0,
        dead=None,
        trunk_segments=14,
        trunk_sides=8,
        flare=0.2,
        leaf=replace(_PINE_TUFT, number=4000, length=0.13, droop=-0.4),
        orders=(
            Order(
                number=44, length=0.24, length_spread=0.2, angle=(72, 35), whorl=5, lift=(0.1, 0.6), bend=0.2,
                wander=0.3, segments=5, sides=4, foliage=0.6, leaf_start=0.55,
            ),
            Order(
                number=210, start=0.35, length=0.45, length_spread=0.25, angle=(55, 38), divergence=180,
                divergence_spread=40, lift=(0.2, 0.7), bend=0.2, wander=0.3, segments=2, sides=3, foliage=1,
                leaf_start=0.3,
            ),
        ),
    ),
    stand=replace(
        in_stand(_PINE, crown_base=0.66, reach=0.72, slim=0.85, leaves=0.8, clear=2.3),
        trunk_wander=0.14,
    ),
    exposed=replace(
        _PINE,
        height=4.5,
        trunk_radius=0.024,
        leader=0.8,
        clear=0.45,
        crown_base=0.2,
        lopsided=0.45,
        trunk_lean=8.0,
        lean_limit=15.0,
        trunk_wander=0.7,
        flare=0.6,
        leaf=replace(_PINE_TUFT, number=10500, length=0.105),
        orders=(
            replace(_PINE.orders[0], number=17, length=0.36, whorl=2, wander=1.3, bend=0.8, lift=(-0.1, 0.6)),
            replace(_PINE.orders[1], number=120, start=0.3, wander=1.0),
            replace(_PINE.orders[2], number=420),
        ),
    ),
)  # fmt: skip
