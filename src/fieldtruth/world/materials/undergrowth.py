# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bushes are bush, wood and leaves alike; grass and herbs are high grass."""

from typing import Final

from fieldtruth.classes import Label
from fieldtruth.world.materials.trees import LEAF_TRANSLUCENCY
from fieldtruth.world.model import Material


def bush_leaf(kind: str, *, gloss: float = 0.1) -> Material:
    """Leaves of a kind of bush, from the texture of the same name."""
    name = f"leaf_{kind}"
    return Material(name=name, label=Label.BUSH, texture=name, translucency=LEAF_TRANSLUCENCY, gloss=gloss)


MATERIALS: Final = (
    Material(name="wood_bush", label=Label.BUSH, texture="bark_bush"),
    bush_leaf("box", gloss=0.3),
    bush_leaf("hazel"),
)
