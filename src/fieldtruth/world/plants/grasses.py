# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grasses, sedges and reeds as tufts. Blades are two to three times as wide as nature's, and fewer by as much."""

from typing import Final

from fieldtruth.world.plants.tufts import Blades, GrassSpecies, Leaves, Spike

MEADOW: Final = GrassSpecies(
    name="meadow",
    latin="Dactylis glomerata, Festuca pratensis",
    height=(0.3, 0.6),
    radius=0.17,
    sorts=(
        Blades(material="blade_green", number=10, length=(0.6, 1.15), width=0.0085, lean=(4, 34), bend=(35, 125)),
        Blades(
            material="blade_green", number=16, length=(0.45, 1.0), width=0.008, lean=(3, 40), bend=(15, 75), kite=True,
        ),
        Blades(
            material="blade_green", number=14, length=(0.2, 0.55), width=0.008, lean=(15, 60), bend=(10, 90), kite=True,
        ),
        Blades(
            material="blade_dry", number=8, length=(0.25, 0.65), width=0.007, lean=(30, 75), bend=(20, 90), kite=True,
        ),
        Blades(
            material="blade_dry", number=2, length=(0.95, 1.25), width=0.0035, lean=(2, 16), bend=(10, 40), rim=0.6,
            organs=(
                Leaves(
                    material="blade_seed", number=5, length=0.035, width=0.010, start=0.8, angle=25, droop=0.2,
                ),
            ),
        ),
    ),
)  # fmt: skip
"""Meadow grass, green with dead blades between: 0.3 to 0.6 m."""

DRY: Final = GrassSpecies(
    name="dry",
    latin="Calamagrostis arundinacea, Stipa capillata",
    height=(0.4, 0.9),
    radius=0.11,
    sorts=(
        Blades(material="blade_dry", number=10, length=(0.55, 1.05), width=0.0065, lean=(5, 38), bend=(40, 130)),
        Blades(
            material="blade_dry", number=18, length=(0.45, 0.95), width=0.006, lean=(4, 42), bend=(15, 80), kite=True,
        ),
        Blades(
            material="blade_dry", number=12, length=(0.2, 0.5), width=0.007, lean=(30, 75), bend=(20, 80), kite=True,
        ),
        Blades(
            material="blade_green", number=5, length=(0.2, 0.5), width=0.006, lean=(8, 35), bend=(30, 100), kite=True,
        ),
        Blades(
            material="blade_dry", number=4, length=(0.8, 1.15), width=0.0035, lean=(3, 20), bend=(12, 50), rim=0.7,
            kite=True,
            organs=(
                Leaves(
                    material="blade_seed", number=5, length=0.055, width=0.010, start=0.74, angle=20, droop=0.35,
                    smallest=0.6,
                ),
            ),
        ),
    ),
)  # fmt: skip
"""High dry grass with seed heads: 0.4 to 0.9 m."""

REED: Final = GrassSpecies(
    name="reed",
    latin="Phragmites australis",
    height=(1.1, 1.8),
    radius=0.28,
    lopsided=0.25,
    sorts=(
        Blades(
            material="blade_reed", number=9, length=(0.7, 1.0), width=0.011, lean=(1, 9), bend=(4, 18), drift=10,
            roll=60,
            twist=0, kite=True,
            organs=(
                Leaves(
                    material="blade_reed", number=6, length=0.36, width=0.024, start=0.25, end=0.92, angle=38,
                    droop=0.25, smallest=0.7, widest=0.3,
                ),
            ),
        ),
        Blades(
            material="blade_dry", number=3, length=(0.85, 1.05), width=0.009, lean=(1, 9), bend=(6, 25), drift=10,
            twist=0,
            kite=True,
            organs=(
                Leaves(
                    material="blade_plume", number=7, length=0.13, width=0.034, start=0.87, angle=22, droop=0.25,
                    arrangement="one side", smallest=0.6,
                ),
            ),
        ),
        Blades(material="blade_dry", number=5, length=(0.2, 0.5), width=0.016, lean=(20, 70), bend=(20, 80), kite=True),
    ),
)  # fmt: skip
"""Common reed with plumes, last year's stalks among it: 1.1 to 1.8 m."""

CATTAIL: Final = GrassSpecies(
    name="cattail",
    latin="Typha latifolia",
    height=(1.0, 1.7),
    radius=0.2,
    lopsided=0.25,
    sorts=(
        Blades(
            material="blade_reed", number=15, length=(0.65, 1.0), width=0.021, lean=(1, 13), bend=(5, 50), drift=12,
            twist=90,
        ),
        Blades(material="blade_dry", number=4, length=(0.3, 0.7), width=0.018, lean=(15, 60), bend=(30, 110)),
        Blades(
            material="blade_reed", number=2, length=(0.85, 0.98), width=0.009, lean=(1, 6), bend=(1, 8), rim=0.6,
            kite=True, organs=(Spike(material="spike_cattail", radius=0.013, start=0.80, end=0.95),),
        ),
    ),
)  # fmt: skip
"""Broadleaf cattail with brown spikes: 1.0 to 1.7 m."""

SEDGE: Final = GrassSpecies(
    name="sedge",
    latin="Carex acutiformis, Juncus effusus",
    height=(0.5, 1.0),
    radius=0.13,
    sorts=(
        Blades(material="blade_reed", number=11, length=(0.55, 1.0), width=0.0105, lean=(4, 34), bend=(35, 115)),
        Blades(
            material="blade_reed", number=18, length=(0.4, 0.95), width=0.0095, lean=(3, 36), bend=(15, 70), kite=True,
        ),
        Blades(
            material="blade_dry", number=9, length=(0.3, 0.75), width=0.010, lean=(25, 70), bend=(30, 110), kite=True,
        ),
        Blades(
            material="blade_reed", number=3, length=(0.85, 1.1), width=0.005, lean=(3, 18), bend=(5, 35), kite=True,
            organs=(
                Leaves(material="blade_seed", number=3, length=0.045, width=0.011, start=0.8, angle=20, droop=0.1),
            ),
        ),
    ),
)  # fmt: skip
"""Sedges and rushes at the water's edge: 0.5 to 1.0 m."""

FOREST: Final = GrassSpecies(
    name="forest",
    latin="Deschampsia flexuosa, Brachypodium sylvaticum",
    height=(0.25, 0.5),
    radius=0.11,
    sorts=(
        Blades(
            material="blade_fine", number=16, length=(0.55, 1.1), width=0.0055, lean=(6, 36), bend=(55, 145), drift=35,
        ),
        Blades(
            material="blade_fine", number=26, length=(0.25, 0.75), width=0.0055, lean=(15, 60), bend=(30, 110),
            kite=True,
        ),
        Blades(material="blade_dry", number=8, length=(0.3, 0.7), width=0.005, lean=(35, 80), bend=(20, 90), kite=True),
        Blades(
            material="blade_dry", number=1, length=(0.95, 1.2), width=0.003, lean=(4, 18), bend=(15, 50), rim=0.5,
            kite=True,
            organs=(
                Leaves(material="blade_seed", number=6, length=0.022, width=0.006, start=0.72, angle=45, droop=0.3),
            ),
        ),
    ),
)  # fmt: skip
"""Fine, arching forest grass: 0.25 to 0.5 m."""
