# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Barks are trunk and branch, leaves are treetop."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material

LEAF_TRANSLUCENCY: Final = 0.35
"""Transmitted over scattered light of a broad leaf in the visible: about 0.05 of 0.15 in red and green (Jacquemoud and
Baret 1990, PROSPECT)."""


NEEDLE_TRANSLUCENCY: Final = 0.08
"""Of a twig with its needles: they are thick and shade each other."""

BROADLEAVES: Final = ("lime", "birch", "oak", "beech", "alder", "willow")
CONIFERS: Final = ("spruce", "pine")


def bark(kind: str) -> Material:
    """Bark from the texture of the same name."""
    return Material(name=f"bark_{kind}", label=Label.TRUNK, texture=f"bark_{kind}")


def leaf(species: str, *, translucency: float = LEAF_TRANSLUCENCY, gloss: float = 0.15) -> Material:
    """Leaves or needles of a species of tree, from the texture of the same name."""
    name = f"leaf_{species}"
    return Material(name=name, label=Label.TREETOP, texture=name, translucency=translucency, gloss=gloss)


MATERIALS: Final = (
    *(bark(kind) for kind in (*BROADLEAVES, *CONIFERS, "pine_upper", "dead", "moss")),
    Material(name="bark_soil", label=Label.TRUNK, texture="soil"),  # between the roots of a fallen tree
    Material(name="bark_torn", label=Label.TRUNK, texture="bark_dead", tint=(0.62, 0.46, 0.33)),  # rotten heartwood
    *(leaf(species) for species in BROADLEAVES),
    *(leaf(species, translucency=NEEDLE_TRANSLUCENCY, gloss=0.08) for species in CONIFERS),
)
