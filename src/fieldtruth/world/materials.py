# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Materials and ground types by name. They are sections of the data files.

A material belongs to exactly one class. Its texture, by default the one of its own name, has the albedo of the surface;
a tint only distinguishes materials that share a texture.

A ground type says how rough a kind of ground is, and how high the short grass, litter or crumbs on it. Roughness is a
class of ISO 8608:2016, table C.1: Gd(n0) at n0 = 0.1 cycles/m, A 16 to H 262,144 times 1e-6 m^3, a factor of 4 from
class to class (geometric means). Measured ground for comparison, converted to n0: smooth highway 6e-5 (waviness 2.1),
gravel highway 6e-4 (2.1), pasture 1.2e-2 (1.6), ploughed field 2.6e-2 (1.6) (Wong, Theory of Ground Vehicles, table of
spectra; quoted from memory), and a paddy field 6.5e-4 (1.2) (Hue University Journal of Science, Agriculture and Rural
Development, article 3072): B, D, F, F and D. So rolled gravel in a park is C and its mown lawn D. The trodden trail of
a forest lies between gravel and pasture in waviness.

A layer is made of what has no blades of its own in the world, and of the grains and crumbs of bare ground (random
roughness 2 to 6 mm of smooth to rolled soil: Zobeck and Onstad 1987, quoted from memory). Its statistics are chosen so
that range noise of a perfect LiDAR along its rings, between 4 and 15 m, is 8 to 20 mm on grass and 2 to 6 mm on bare
earth; a real one reads 12 mm in grass, its own 3.6 mm included.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from fieldtruth.core.classes import NOT_OF_WORLDS, Label
from fieldtruth.core.errors import ConfigurationError, suggestion
from fieldtruth.world.library import Entry, Section, validated
from fieldtruth.world.model import Material
from fieldtruth.world.textures import TEXTURES

REFERENCE_FREQUENCY: Final = 0.1
"""Spatial frequency n0 [cycles/m] of ISO 8608."""
ISO_CLASSES: Final[Mapping[str, float]] = {letter: 16e-6 * 4.0**k for k, letter in enumerate("ABCDEFGH")}
"""Unevenness Gd(n0) [m^3], the geometric mean of each class."""


@dataclass(frozen=True)
class Roughness:
    """Displacement spectrum Gd(n) = ``unevenness`` (n / n0)^-``waviness`` of profiles over a ground."""

    unevenness: float  # Gd(n0) [m^3]
    waviness: float = 2.0


@dataclass(frozen=True)
class Layer:
    """Short grass, litter or crumbs: mean and standard deviation of the height, correlation length [m]; normal."""

    mean: float
    deviation: float
    correlation: float = 0.03


@dataclass(frozen=True)
class GroundType:
    """A kind of ground, for relief and soil mechanics; paving, rock and mud have no ``layer``."""

    name: str
    iso_class: Literal["A", "B", "C", "D", "E", "F", "G", "H"]
    waviness: float = 2.0
    layer: Layer | None = None

    @property
    def roughness(self) -> Roughness:
        """Roughness of its class."""
        return Roughness(ISO_CLASSES[self.iso_class], self.waviness)


def _ground_type(name: str, entry: Entry, source: str) -> GroundType:
    return validated(GroundType, {**entry, "name": name}, source)


GROUND_TYPES: Final = Section("ground_types", _ground_type)
"""Every ground type by name; ``Material.ground_type`` refers to it."""


def roughness_of(name: str, classes: Mapping[str, str]) -> Roughness:
    """Roughness of a ground type in a world whose layout has ISO 8608 ``classes`` by ground type."""
    own = GROUND_TYPES[name].roughness
    return Roughness(ISO_CLASSES[classes[name]], own.waviness) if name in classes else own


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
