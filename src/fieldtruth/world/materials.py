# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Materials by name, from the ``materials`` sections of the data files.

A material belongs to exactly one class. Its texture, by default the one of its own name, has the albedo of the surface;
a tint only distinguishes materials that share a texture.
"""

from typing import Final

from fieldtruth.core.classes import NOT_OF_WORLDS, Label
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.ground_types import GROUND_TYPES
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.model import Material
from fieldtruth.world.textures import TEXTURES

_FIRST: Final = """
    lawn lawn_dry soil mulch bed_edge litter meadow rough_grass mud pebbles water turf_dry soil_stony scree rock_face
    heath gravel setts needles moss path path_edge canopy
    bark_lime bark_birch bark_oak bark_beech bark_alder bark_willow bark_spruce bark_pine bark_pine_upper bark_dead
    bark_moss bark_soil bark_torn
    leaf_lime leaf_birch leaf_oak leaf_beech leaf_alder leaf_willow leaf_spruce leaf_pine
    wood_bush leaf_box leaf_hazel leaf_juniper leaf_gorse leaf_bramble leaf_willow_grey leaf_heather
    petal_gorse petal_heather
    blade_green blade_fine blade_dry blade_reed blade_seed blade_plume frond_fern frond_dry leaf_nettle
    petal_daisy petal_buttercup petal_yarrow spike_cattail
    rock_granite rock_limestone rock_fieldstone rock_schist
"""
"""Row order in stored worlds. It keeps existing worlds the same bytes; materials that are not listed follow."""


def _material(name: str, entry: Entry, source: str) -> Material:
    label = str(entry.get("label", "")).upper()
    allowed = [each.name for each in Label if each not in NOT_OF_WORLDS]
    if label not in allowed:
        names = ", ".join(name.lower() for name in allowed)
        raise ConfigurationError(f"{source}: label must be one of {names}, got {entry.get('label')!r}")
    material = validated(Material, {"texture": name, **entry, "name": name, "label": Label[label]}, source)
    for texture in material.images:
        if texture not in TEXTURES:
            raise ConfigurationError(f"{source}: unknown texture {texture!r}; {suggestion(texture, TEXTURES)}")
    if material.ground_type not in ("", *GROUND_TYPES):
        hint = suggestion(material.ground_type, GROUND_TYPES)
        raise ConfigurationError(f"{source}: unknown ground type {material.ground_type!r}; {hint}")
    return material


MATERIALS: Final = Section("materials", _material, tuple(_FIRST.split()))
"""Every material; a world holds those that it uses."""
