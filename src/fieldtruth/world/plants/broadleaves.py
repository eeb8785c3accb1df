# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Broadleaved park trees: lime (tall dense dome), birch (slim, airy, hanging twigs) and oak (low, wide, crooked).

Sizes of leaves are two to three times nature's where that is small (see `leaves`). Forms follow field guides; the
numbers were set by eye against them.
"""

from typing import Final

from fieldtruth.world.plants.species import Habit, Leaf, Order, Species

LIME: Final = Species(
    name="lime",
    latin="Tilia platyphyllos",
    wood="bark_lime",
    foliage="leaf_lime",
    grown=Habit(
        trunk_radius=0.0175,
        leader=0.9,
        clear=2.3,
        outline="domed",
        lopsided=0.16,
        leaf=Leaf(length=0.135, width=0.12, widest=0.36, droop=0.7),
        orders=(
            Order(
                spacing=0.34, start=0.0, length=0.37, length_spread=0.2, angle=(62, 22), lift=(0.1, 0.5), bend=0.35,
                wander=0.35, thickness=1.2, segments=9, sides=6,
            ),
            Order(
                spacing=0.26, start=0.2, length=0.55, length_spread=0.25, angle=(62, 38), divergence=180.0,
                divergence_spread=35.0, lift=(0.1, -0.1), bend=0.4, wander=0.4, thickness=1.1, segments=4, sides=4,
                leaf_spacing=0.06, leaf_start=0.5,
            ),
            Order(
                spacing=0.16, start=0.15, length=0.6, length_spread=0.25, angle=(60, 40), divergence=180.0,
                divergence_spread=35.0, lift=(0.1, -0.4), bend=0.4, wander=0.4, thickness=1.0, segments=2, sides=3,
                leaf_spacing=0.038, leaf_start=0.05,
            ),
        ),
    ),
)  # fmt: skip

BIRCH: Final = Species(
    name="birch",
    latin="Betula pendula",
    wood="bark_birch",
    foliage="leaf_birch",
    grown=Habit(
        trunk_radius=0.0115,
        leader=0.97,
        clear=2.3,
        outline="flame",
        lopsided=0.1,
        trunk_lean=3.0,
        trunk_wander=0.22,
        flare=0.35,
        leaf=Leaf(length=0.085, width=0.068, widest=0.33, droop=0.9, flatness=0.6),
        orders=(
            Order(
                spacing=0.22, start=0.0, length=0.23, length_spread=0.22, angle=(55, 28), lift=(0.3, -0.5), bend=0.3,
                wander=0.3, thickness=1.15, segments=7, sides=5,
            ),
            Order(
                spacing=0.17, start=0.18, length=0.5, length_spread=0.3, angle=(50, 40), divergence=137.5,
                lift=(0.2, -1.6), bend=0.3, wander=0.4, thickness=1.1, segments=4, sides=3,
                leaf_spacing=0.05, leaf_start=0.3,
            ),
            Order(
                spacing=0.15, start=0.15, length=0.75, length_spread=0.3, angle=(45, 35), divergence=137.5,
                lift=(-1.0, -2.2), bend=0.2, wander=0.3, thickness=1.0, segments=3, sides=3,
                leaf_spacing=0.036, leaf_start=0.05,
            ),
        ),
    ),
)  # fmt: skip

OAK: Final = Species(
    name="oak",
    latin="Quercus robur",
    wood="bark_oak",
    foliage="leaf_oak",
    grown=Habit(
        trunk_radius=0.026,
        leader=0.72,
        clear=2.4,
        outline="hemispherical",
        lopsided=0.2,
        trunk_lean=3.0,
        trunk_wander=0.3,
        flare=0.7,
        trunk_sides=16,
        leaf=Leaf(length=0.135, width=0.085, widest=0.6, fold=12.0, droop=0.1),
        orders=(
            Order(
                spacing=0.32, start=0.0, length=0.5, length_spread=0.25, angle=(75, 22), angle_spread=10,
                lift=(0.2, 0.5), bend=0.6, wander=0.9, thickness=1.0, segments=11, sides=7,
            ),
            Order(
                spacing=0.3, start=0.25, length=0.5, length_spread=0.3, angle=(60, 40), divergence=150.0,
                divergence_spread=40.0, lift=(0.2, 0.3), bend=0.5, wander=0.8, thickness=1.0, segments=5, sides=4,
                leaf_spacing=0.06, leaf_start=0.5,
            ),
            Order(
                spacing=0.17, start=0.2, length=0.55, length_spread=0.25, angle=(60, 40), divergence=137.5,
                lift=(0.3, 0.0), bend=0.5, wander=0.6, thickness=1.0, segments=2, sides=3,
                leaf_spacing=0.034, leaf_start=0.1,
            ),
        ),
    ),
)  # fmt: skip
