# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shrubs with many stems from the ground: box (a dense evergreen cushion) and hazel (tall, loose, arching)."""

from typing import Final

from fieldtruth.world.plants.species import Habit, Leaf, Order, Species

BOX: Final = Species(
    name="box",
    latin="Buxus sempervirens",
    wood="wood_bush",
    foliage="leaf_box",
    grown=Habit(
        height=1,
        trunk_radius=0.014,
        clear=0.03,
        crown_base=0.06,
        outline="spherical",
        lopsided=0.1,
        trunk_lean=5,
        trunk_wander=0.3,
        trunk_segments=5,
        trunk_sides=4,
        leader=1.0,
        stems=40,
        stem_splay=74,
        stem_circle=0.16,
        sheared=0.58,
        leaf=Leaf(
            number=13500, length=0.047, width=0.62, widest=0.5, fold=15, stalk=0.004, droop=-0.2, arrangement=90
        ),
        orders=(
            Order(
                number=300, start=0.2, length=0.42, angle=(65, 40), lift=(0.2, 0.3), bend=0.3, wander=0.4, thickness=1,
                segments=3, sides=3, foliage=0.5, leaf_start=0.4,
            ),
            Order(
                number=1200, start=0.3, length=0.6, angle=(50, 35), lift=(0.2, 0.3), bend=0.3, wander=0.4, thickness=1,
                segments=1, sides=3, foliage=1, leaf_start=0.1,
            ),
        ),
    ),
)  # fmt: skip

HAZEL: Final = Species(
    name="hazel",
    latin="Corylus avellana",
    wood="wood_bush",
    foliage="leaf_hazel",
    grown=Habit(
        height=2.4,
        trunk_radius=0.0085,
        clear=0.05,
        crown_base=0.1,
        outline="spherical",
        lopsided=0.15,
        trunk_lean=7,
        trunk_wander=0.35,
        trunk_segments=9,
        trunk_sides=5,
        stems=14,
        stem_splay=29,
        stem_circle=0.22,
        leaf=Leaf(number=5200, length=0.105, width=0.76, widest=0.45, droop=0.6),
        orders=(
            Order(
                number=110, start=0.15, length=0.3, length_spread=0.25, angle=(55, 35), lift=(0.2, -0.2), bend=0.3,
                wander=0.4, thickness=1, segments=4, sides=3, foliage=1, leaf_start=0.25,
            ),
            Order(
                number=360, start=0.2, length=0.5, length_spread=0.25, angle=(55, 40), divergence=180,
                divergence_spread=30, lift=(0.1, -0.3), bend=0.3, wander=0.4, thickness=1, segments=2, sides=3,
                foliage=1, leaf_start=0.1,
            ),
        ),
    ),
)  # fmt: skip
