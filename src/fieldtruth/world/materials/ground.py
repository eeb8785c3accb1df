# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the ground and the trails are covered with, and water; ``repeat`` is the length that the texture covers."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material

MATERIALS: Final = (
    Material(name="lawn", label=Label.GROUND, texture="lawn", repeat=1.5),
    Material(name="lawn_dry", label=Label.GROUND, texture="lawn_dry", repeat=1.5),
    Material(name="soil", label=Label.GROUND, texture="soil", repeat=1.5),
    Material(name="mulch", label=Label.GROUND, texture="mulch", repeat=1.5),
    Material(name="bed_edge", label=Label.GROUND, texture="concrete", tint=(0.5, 0.47, 0.43)),
    Material(name="litter", label=Label.GROUND, texture="litter", repeat=1.5),
    Material(name="meadow", label=Label.GROUND, texture="meadow", repeat=40.0),
    Material(name="rough_grass", label=Label.GROUND, texture="rough_grass", repeat=1.5),
    Material(name="mud", label=Label.GROUND, texture="mud", repeat=1.5, gloss=0.35),
    Material(name="pebbles", label=Label.GROUND, texture="pebbles", repeat=1.5),
    Material(name="water", label=Label.WATER, texture="water", gloss=0.6, mirror=0.02),
    Material(name="turf_dry", label=Label.GROUND, texture="turf_dry", repeat=1.5),
    Material(name="soil_stony", label=Label.GROUND, texture="soil_stony", repeat=1.5),
    Material(name="scree", label=Label.GROUND, texture="scree", repeat=2.5),
    Material(name="rock_face", label=Label.GROUND, texture="crags", repeat=9.0),
    Material(name="hillslope", label=Label.GROUND, texture="hillslope", repeat=12.0),
    Material(name="garrigue", label=Label.GROUND, texture="garrigue", repeat=40.0),
    Material(name="crags", label=Label.GROUND, texture="crags", repeat=40.0),
    Material(name="gravel", label=Label.TRAIL, texture="gravel", repeat=1.5),
    Material(name="setts", label=Label.TRAIL, texture="setts", repeat=0.5),
)
