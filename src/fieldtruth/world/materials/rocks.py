# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stones and rocks by what they are made of; lichen and weathering are drawn in their textures."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material

MATERIALS: Final = (
    Material(name="rock_granite", label=Label.ROCK, texture="rock_granite"),
    Material(name="rock_limestone", label=Label.ROCK, texture="rock_limestone"),
    Material(name="rock_fieldstone", label=Label.ROCK, texture="rock_fieldstone"),
    Material(name="rock_schist", label=Label.ROCK, texture="rock_schist"),
)
