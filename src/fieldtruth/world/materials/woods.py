# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The floor of a forest and its trails; and its roof as it is seen from afar, which is treetop."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material

MATERIALS: Final = (
    Material(name="needles", label=Label.GROUND, texture="needles", repeat=1.5),
    Material(name="moss", label=Label.GROUND, texture="moss", repeat=1.5),
    Material(name="path", label=Label.TRAIL, texture="path", repeat=1.5),
    Material(name="path_edge", label=Label.TRAIL, texture="needles", repeat=1.5, tint=(1.12, 1.1, 1.08)),
    Material(name="canopy", label=Label.TREETOP, texture="moss", repeat=16.0, tint=(0.55, 0.6, 0.6)),
)
