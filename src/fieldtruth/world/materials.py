# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The park's materials: one table of name, class, texture and how light leaves the surface.

A material belongs to exactly one class, so the wood of a bench and that of a table are two materials.
Textures carry the surface's own albedo; a tint only sets apart things that share a texture.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fieldtruth.classes import Label
from fieldtruth.world.model import Material

TREE_SPECIES: Final = ("lime", "birch", "oak")
BUSH_KINDS: Final = ("box", "hazel")

LEAF_TRANSLUCENCY: Final = 0.35
"""Transmitted over scattered light of a broad leaf in the visible: about 0.05 of 0.15 in red and green (Jacquemoud and
Baret 1990, PROSPECT)."""

GROUND: Final = (
    Material(name="lawn", label=Label.GROUND, texture="lawn", repeat=1.5),
    Material(name="lawn_dry", label=Label.GROUND, texture="lawn_dry", repeat=1.5),
    Material(name="soil", label=Label.GROUND, texture="soil", repeat=1.5),
    Material(name="mulch", label=Label.GROUND, texture="mulch", repeat=1.5),
    Material(name="litter", label=Label.GROUND, texture="litter", repeat=1.5),
    Material(name="meadow", label=Label.GROUND, texture="meadow", repeat=40.0),
    Material(name="gravel", label=Label.TRAIL, texture="gravel", repeat=1.5),
    Material(name="setts", label=Label.TRAIL, texture="setts", repeat=0.5),
)

FURNITURE: Final = (
    Material(name="bench_wood", label=Label.BENCH, texture="wood", gloss=0.12),
    Material(name="bench_iron", label=Label.BENCH, texture="iron", gloss=0.3),
    Material(name="bench_concrete", label=Label.BENCH, texture="concrete"),
    Material(name="table_wood", label=Label.TABLE, texture="wood_grey", gloss=0.05),
    Material(name="table_steel", label=Label.TABLE, texture="steel", gloss=0.35),
    Material(name="table_concrete", label=Label.TABLE, texture="concrete", tint=(1.0, 0.98, 0.94)),
    Material(name="table_stone_light", label=Label.TABLE, texture="concrete", tint=(1.35, 1.33, 1.28), gloss=0.15),
    Material(name="table_stone_dark", label=Label.TABLE, texture="concrete", tint=(0.22, 0.21, 0.2), gloss=0.15),
    Material(name="lamp_iron", label=Label.LAMP_POST, texture="iron", tint=(0.9, 1.0, 0.95), gloss=0.35),
    Material(name="lamp_steel", label=Label.LAMP_POST, texture="steel", tint=(0.55, 0.57, 0.6), gloss=0.4),
    Material(name="lamp_glass", label=Label.LAMP_POST, texture="glass", gloss=0.7),
    Material(name="bin_iron", label=Label.TRASH_BIN, texture="iron", tint=(0.85, 1.15, 0.9), gloss=0.3),
    Material(name="bin_steel", label=Label.TRASH_BIN, texture="steel", gloss=0.35),
    Material(name="bin_inside", label=Label.TRASH_BIN, texture="steel", tint=(0.3, 0.3, 0.3)),
)


def _trees() -> tuple[Material, ...]:
    bark = [Material(name=f"bark_{s}", label=Label.TRUNK, texture=f"bark_{s}") for s in TREE_SPECIES]
    leaf = [
        Material(name=f"leaf_{s}", label=Label.TREETOP, texture=f"leaf_{s}", translucency=LEAF_TRANSLUCENCY, gloss=0.15)
        for s in TREE_SPECIES
    ]
    return (*bark, *leaf)


def _bushes() -> tuple[Material, ...]:
    gloss = {"box": 0.3}
    leaf = [
        Material(
            name=f"leaf_{b}",
            label=Label.BUSH,
            texture=f"leaf_{b}",
            translucency=LEAF_TRANSLUCENCY,
            gloss=gloss.get(b, 0.1),
        )
        for b in BUSH_KINDS
    ]
    return (Material(name="wood_bush", label=Label.BUSH, texture="bark_bush"), *leaf)


MATERIALS: Final[Mapping[str, Material]] = MappingProxyType(
    {m.name: m for m in (*GROUND, *_trees(), *_bushes(), *FURNITURE)}
)
"""Every material of the park by name; :func:`fieldtruth.world.textures.make_textures` makes the textures."""
