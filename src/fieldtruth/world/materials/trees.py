# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Barks are trunk and branch, leaves are treetop."""

from typing import Final

from fieldtruth.classes import Label
from fieldtruth.world.model import Material

LEAF_TRANSLUCENCY: Final = 0.35
"""Transmitted over scattered light of a broad leaf in the visible: about 0.05 of 0.15 in red and green (Jacquemoud and
Baret 1990, PROSPECT)."""


def bark(species: str) -> Material:
    """Bark of a species of tree, from the texture of the same name."""
    return Material(name=f"bark_{species}", label=Label.TRUNK, texture=f"bark_{species}")


def leaf(species: str) -> Material:
    """Leaves of a species of tree, from the texture of the same name."""
    name = f"leaf_{species}"
    return Material(name=name, label=Label.TREETOP, texture=name, translucency=LEAF_TRANSLUCENCY, gloss=0.15)


MATERIALS: Final = (
    *(bark(species) for species in ("lime", "birch", "oak")),
    *(leaf(species) for species in ("lime", "birch", "oak")),
)
