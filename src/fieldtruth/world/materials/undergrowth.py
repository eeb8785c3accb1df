# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bushes are bush, wood and leaves and flowers alike; grass and herbs are high grass."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.materials.trees import LEAF_TRANSLUCENCY
from fieldtruth.world.model import Material

DRY_TRANSLUCENCY: Final = 0.18
"""Dead tissue scatters more and transmits less: its cells are full of air."""


def bush_leaf(kind: str, *, gloss: float = 0.1) -> Material:
    """Leaves of a kind of bush, from the texture of the same name."""
    name = f"leaf_{kind}"
    return Material(name=name, label=Label.BUSH, texture=name, translucency=LEAF_TRANSLUCENCY, gloss=gloss)


def herb(name: str, *, translucency: float = LEAF_TRANSLUCENCY, gloss: float = 0.1) -> Material:
    """Blades, fronds and petals of grass and herbs, from the texture of the same name."""
    return Material(name=name, label=Label.HIGH_GRASS, texture=name, translucency=translucency, gloss=gloss)


MATERIALS: Final = (
    Material(name="wood_bush", label=Label.BUSH, texture="bark_bush"),
    bush_leaf("box", gloss=0.3),
    bush_leaf("hazel"),
    bush_leaf("juniper", gloss=0.05),
    bush_leaf("gorse", gloss=0.05),
    bush_leaf("bramble", gloss=0.25),
    bush_leaf("willow_grey"),
    bush_leaf("heather", gloss=0.0),
    *(
        Material(name=name, label=Label.BUSH, texture=name, translucency=LEAF_TRANSLUCENCY)
        for name in ("petal_gorse", "petal_heather")
    ),
    herb("blade_green", gloss=0.15),
    herb("blade_fine", gloss=0.15),
    herb("blade_dry", translucency=DRY_TRANSLUCENCY, gloss=0.05),
    herb("blade_reed"),
    herb("blade_seed", translucency=DRY_TRANSLUCENCY, gloss=0.0),
    herb("blade_plume", translucency=DRY_TRANSLUCENCY, gloss=0.0),
    herb("frond_fern"),
    herb("frond_dry", translucency=DRY_TRANSLUCENCY, gloss=0.0),
    herb("leaf_nettle"),
    herb("petal_daisy", gloss=0.0),
    herb("petal_buttercup", gloss=0.3),
    herb("petal_yarrow", gloss=0.0),
    herb("spike_cattail", translucency=0.0, gloss=0.0),
)
