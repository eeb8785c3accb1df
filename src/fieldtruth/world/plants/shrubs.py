# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shrubs with many stems from the ground, from gardens, hedges, heaths and shores.

Forms follow field guides; the numbers were set by eye.
"""

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
"""A dense evergreen cushion."""

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
"""Tall, loose and arching."""

JUNIPER: Final = Species(
    name="juniper",
    latin="Juniperus communis",
    wood="wood_bush",
    foliage="leaf_juniper",
    grown=Habit(
        height=2.2,
        trunk_radius=0.010,
        clear=0.03,
        crown_base=0.03,
        outline="flame",
        lopsided=0.25,
        trunk_lean=4,
        trunk_wander=0.2,
        trunk_segments=7,
        trunk_sides=4,
        leader=0.95,
        stems=9,
        stem_splay=11,
        stem_circle=0.26,
        leaf=Leaf(
            number=9800, length=0.07, width=0.4, widest=0.4, fold=30, stalk=0.0, droop=-0.2, arrangement=137.5,
            flatness=0.3, forward=1.2,
        ),
        orders=(
            Order(
                number=120, start=0.02, length=0.2, length_spread=0.25, angle=(48, 22), lift=(0.5, 0.3), bend=0.3,
                wander=0.35, thickness=1, segments=3, sides=3, foliage=1, leaf_start=0.1,
            ),
            Order(
                number=380, start=0.15, length=0.6, length_spread=0.25, angle=(48, 30), lift=(0.3, -0.2), bend=0.3,
                wander=0.4, thickness=1, segments=1, sides=3, foliage=1, leaf_start=0.0,
            ),
        ),
    ),
)  # fmt: skip
"""Dense and dark, an irregular column of several tops."""

GORSE: Final = Species(
    name="gorse",
    latin="Ulex europaeus",
    wood="wood_bush",
    foliage="leaf_gorse",
    bloom="petal_gorse",
    bloom_share=0.07,
    grown=Habit(
        height=1.3,
        trunk_radius=0.010,
        clear=0.03,
        crown_base=0.05,
        outline="spherical",
        lopsided=0.25,
        trunk_lean=10,
        trunk_wander=0.4,
        trunk_segments=6,
        trunk_sides=4,
        stems=17,
        stem_splay=50,
        stem_circle=0.2,
        leaf=Leaf(
            number=8500, length=0.07, width=0.2, widest=0.3, fold=20, stalk=0.0, droop=-0.5, arrangement=137.5,
            flatness=0.2, forward=0.8,
        ),
        orders=(
            Order(
                number=120, start=0.15, length=0.34, length_spread=0.3, angle=(45, 25), lift=(0.6, 0.5), bend=0.3,
                wander=0.3, thickness=1, segments=3, sides=3, foliage=1, leaf_start=0.25,
            ),
            Order(
                number=240, start=0.15, length=0.65, length_spread=0.3, angle=(45, 30), lift=(0.6, 0.3), bend=0.2,
                wander=0.3, thickness=1, segments=1, sides=3, foliage=1, leaf_start=0.05,
            ),
        ),
    ),
)  # fmt: skip
"""Upright spiny shoots in a broken cushion, some of them in yellow flower."""

BRAMBLE: Final = Species(
    name="bramble",
    latin="Rubus fruticosus",
    wood="wood_bush",
    foliage="leaf_bramble",
    grown=Habit(
        height=1.1,
        trunk_radius=0.0045,
        leader=1.55,
        clear=0.02,
        crown_base=0.08,
        outline="flame",
        lopsided=0.3,
        trunk_lean=14,
        trunk_wander=0.5,
        trunk_segments=11,
        trunk_sides=4,
        stems=19,
        stem_splay=46,
        stem_circle=0.35,
        stem_lift=(-0.3, -2.9),
        leaf=Leaf(
            number=3300, length=0.085, width=0.72, widest=0.4, stalk=0.03, droop=0.3, arrangement=137.5, flatness=1.4
        ),
        orders=(
            Order(
                number=95, start=0.08, length=0.34, length_spread=0.35, angle=(55, 40), lift=(0.5, -1.2), bend=0.4,
                wander=0.5, thickness=1, segments=4, sides=3, foliage=1, leaf_start=0.1,
            ),
            Order(
                number=260, start=0.2, length=0.42, length_spread=0.3, angle=(55, 40), lift=(0.2, -0.4), bend=0.3,
                wander=0.4, thickness=1, segments=2, sides=3, foliage=1, leaf_start=0.1,
            ),
        ),
    ),
)  # fmt: skip
"""A low mound of arching canes."""

GREY_WILLOW: Final = Species(
    name="grey_willow",
    latin="Salix cinerea",
    wood="wood_bush",
    foliage="leaf_willow_grey",
    grown=Habit(
        height=2.6,
        trunk_radius=0.0095,
        clear=0.04,
        crown_base=0.08,
        outline="spherical",
        lopsided=0.2,
        trunk_lean=8,
        trunk_wander=0.35,
        trunk_segments=8,
        trunk_sides=5,
        stems=15,
        stem_splay=48,
        stem_circle=0.3,
        leaf=Leaf(number=7800, length=0.105, width=0.42, widest=0.6, droop=0.1, stalk=0.01, arrangement=137.5),
        orders=(
            Order(
                number=130, start=0.12, length=0.3, length_spread=0.25, angle=(50, 30), lift=(0.3, 0.2), bend=0.3,
                wander=0.35, thickness=1, segments=4, sides=3, foliage=0.8, leaf_start=0.3,
            ),
            Order(
                number=420, start=0.15, length=0.5, length_spread=0.25, angle=(45, 30), lift=(0.3, 0.1), bend=0.3,
                wander=0.35, thickness=1, segments=2, sides=3, foliage=1, leaf_start=0.05,
            ),
        ),
    ),
)  # fmt: skip
"""A wide dome of rods with grey-green leaves, at the water's edge."""

HEATHER: Final = Species(
    name="heather",
    latin="Calluna vulgaris",
    wood="wood_bush",
    foliage="leaf_heather",
    bloom="petal_heather",
    bloom_share=0.22,
    grown=Habit(
        height=0.45,
        trunk_radius=0.010,
        clear=0.01,
        crown_base=0.05,
        outline="hemispherical",
        lopsided=0.3,
        trunk_lean=12,
        trunk_wander=0.5,
        trunk_segments=5,
        trunk_sides=3,
        stems=22,
        stem_splay=50,
        stem_circle=0.14,
        leaf=Leaf(
            number=5200, length=0.05, width=0.2, widest=0.4, fold=20, stalk=0.0, droop=-0.6, arrangement=137.5,
            flatness=0.4, forward=1.2,
        ),
        orders=(
            Order(
                number=110, start=0.15, length=0.36, length_spread=0.3, angle=(40, 22), lift=(0.7, 0.5), bend=0.3,
                wander=0.4, thickness=1, segments=2, sides=3, foliage=1, leaf_start=0.2,
            ),
            Order(
                number=420, start=0.2, length=0.5, length_spread=0.3, angle=(38, 25), lift=(0.5, 0.3), bend=0.3,
                wander=0.4, thickness=1, segments=1, sides=3, foliage=1, leaf_start=0.05,
            ),
        ),
    ),
)  # fmt: skip
"""A low cushion of upright twigs, in flower on top."""
