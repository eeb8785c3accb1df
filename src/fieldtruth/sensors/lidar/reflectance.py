# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Reflectance of the world's materials at the wavelengths of LiDARs, 850 to 905 nm: ``reflectance.yaml``."""

from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple

from fieldtruth.core.yaml_io import parse_mapping
from fieldtruth.world.model import Material

FILE: Final = "reflectance.yaml"


class Reflectance(NamedTuple):
    """Share of the light that a surface reflects, and how much of that in a lobe about the mirrored direction."""

    value: float
    gloss: float = 0.0
    """Share ks of what is reflected that is in the lobe (Jutzi and Gross 2009)."""
    exponent: float = 1.0
    """Exponent n of the lobe |cos 2 theta|^n."""


@cache
def _table() -> dict[str, dict[str, Reflectance]]:
    text = (files("fieldtruth.sensors.lidar") / FILE).read_text(encoding="utf-8")
    return {
        section: {
            name: Reflectance(*(float(entry[key]) for key in ("value", "gloss", "exponent") if key in entry))
            for name, entry in entries.items()
        }
        for section, entries in parse_mapping(text, FILE).items()
    }


def reflectance_of(material: Material) -> Reflectance:
    """Reflectance of a material: its own; else of its ground type, of its texture, of its class."""
    table = _table()
    found = (
        table["materials"].get(material.name),
        table["ground_types"].get(material.ground_type),
        table["textures"].get(material.texture),
    )
    return next((each for each in found if each is not None), table["classes"][material.label.name.lower()])
