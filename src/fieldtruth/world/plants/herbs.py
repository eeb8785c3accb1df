# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Ferns and herbs as tufts: fronds in a rosette, leafy stems, flowers among grass."""

from typing import Final

from fieldtruth.world.plants.tufts import Blades, Flower, Frond, GrassSpecies, Leaves

FERN: Final = GrassSpecies(
    name="fern",
    latin="Dryopteris filix-mas",
    height=(0.45, 0.9),
    radius=0.06,
    lopsided=0.3,
    sorts=(
        Blades(
            material="frond_fern", number=7, length=(0.75, 1.1), width=0.010, lean=(18, 48), bend=(35, 85), drift=14,
            roll=0, twist=0, kite=True, organs=(Frond(material="frond_fern", pairs=15, length=0.19),),
        ),
    ),
)  # fmt: skip
"""Male fern, a rosette of fronds: 0.45 to 0.9 m."""

BRACKEN: Final = GrassSpecies(
    name="bracken",
    latin="Pteridium aquilinum",
    height=(0.6, 1.2),
    radius=0.3,
    lopsided=0.6,
    sorts=(
        Blades(
            material="frond_fern", number=4, length=(0.75, 1.1), width=0.010, lean=(2, 16), bend=(50, 110), drift=25,
            roll=0, twist=0, kite=True, organs=(Frond(material="frond_fern", pairs=17, length=0.3, start=0.42),),
        ),
        Blades(
            material="frond_dry", number=2, length=(0.4, 0.7), width=0.010, lean=(30, 60), bend=(40, 80), drift=25,
            roll=0, twist=0, kite=True, organs=(Frond(material="frond_dry", pairs=9, length=0.3, start=0.4),),
        ),
    ),
)  # fmt: skip
"""Bracken, single fronds on tall stalks: 0.6 to 1.2 m."""

NETTLE: Final = GrassSpecies(
    name="nettle",
    latin="Urtica dioica",
    height=(0.5, 1.1),
    radius=0.2,
    lopsided=0.4,
    sorts=(
        Blades(
            material="blade_green", number=7, length=(0.6, 1.0), width=0.007, lean=(1, 16), bend=(4, 25), drift=12,
            twist=0,
            kite=True,
            organs=(
                Leaves(
                    material="leaf_nettle", number=12, length=0.125, width=0.078, start=0.18, angle=70, droop=0.35,
                    arrangement="pairs", smallest=0.4,
                ),
            ),
        ),
    ),
)  # fmt: skip
"""Stinging nettle: 0.5 to 1.1 m."""

DOCK: Final = GrassSpecies(
    name="dock",
    latin="Rumex obtusifolius, Plantago major",
    height=(0.25, 0.6),
    radius=0.08,
    sorts=(
        Blades(
            material="leaf_nettle", number=9, length=(0.35, 0.7), width=0.075, lean=(20, 65), bend=(20, 80), roll=15,
            twist=15,
        ),
        Blades(
            material="blade_seed", number=2, length=(0.8, 1.1), width=0.008, lean=(2, 14), bend=(3, 20), rim=0.5,
            kite=True,
            organs=(Leaves(material="blade_seed", number=9, length=0.04, width=0.02, start=0.5, angle=30, droop=0.0),),
        ),
    ),
)  # fmt: skip
"""Dock, a rosette of broad leaves with brown fruit stalks: 0.25 to 0.6 m."""


def _flowering(name: str, latin: str, petals: str, radius: float, height: tuple[float, float]) -> GrassSpecies:
    """Flowers on thin stalks above a few leaves and grass blades."""
    return GrassSpecies(
        name=name,
        latin=latin,
        height=height,
        radius=0.17,
        sorts=(
            Blades(
                material="blade_green", number=6, length=(0.6, 1.0), width=0.0045, lean=(2, 22), bend=(5, 30),
                kite=True,
                organs=(
                    Flower(material=petals, radius=radius),
                    Leaves(material="leaf_nettle", number=3, length=0.05, width=0.014, start=0.1, end=0.6, angle=45),
                ),
            ),
            Blades(
                material="blade_green", number=8, length=(0.3, 0.7), width=0.0085, lean=(10, 45), bend=(25, 110),
                kite=True,
            ),
        ),
    )  # fmt: skip


DAISY: Final = _flowering("daisy", "Leucanthemum vulgare", "petal_daisy", 0.021, (0.25, 0.55))
BUTTERCUP: Final = _flowering("buttercup", "Ranunculus acris", "petal_buttercup", 0.013, (0.25, 0.55))
YARROW: Final = _flowering("yarrow", "Achillea millefolium, Daucus carota", "petal_yarrow", 0.032, (0.35, 0.7))
