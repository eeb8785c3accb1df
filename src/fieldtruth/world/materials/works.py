# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Furniture and the power line: the wood of a bench and that of a table are two materials, being two classes."""

from typing import Final

from fieldtruth.core.classes import Label
from fieldtruth.world.model import Material

MATERIALS: Final = (
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
    Material(name="post_wood", label=Label.POST, texture="pole"),
    Material(name="post_concrete", label=Label.POST, texture="concrete"),
    Material(name="post_steel", label=Label.POST, texture="steel", tint=(0.7, 0.72, 0.75), gloss=0.35),
    Material(name="post_brown", label=Label.POST, texture="glass", tint=(0.11, 0.045, 0.03), gloss=0.8),
    Material(name="post_grey", label=Label.POST, texture="glass", tint=(0.62, 0.65, 0.68), gloss=0.7),
    Material(name="post_yellow", label=Label.POST, texture="glass", tint=(1.0, 0.72, 0.06), gloss=0.3),
    Material(name="cable", label=Label.CABLE, texture="steel", tint=(0.45, 0.46, 0.47), gloss=0.3),
)
