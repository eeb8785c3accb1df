# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All plants by name. A new one is a `Species` in a family's file and a word here."""

from collections.abc import Mapping
from typing import Final

from fieldtruth.world.plants.broadleaves import BIRCH, LIME, OAK
from fieldtruth.world.plants.conifers import PINE, SPRUCE
from fieldtruth.world.plants.shrubs import BOX, BRAMBLE, GORSE, GREY_WILLOW, HAZEL, HEATHER, JUNIPER
from fieldtruth.world.plants.species import Species
from fieldtruth.world.plants.woodland import ALDER, BEECH, WILLOW

TREES: Final[Mapping[str, Species]] = {s.name: s for s in (LIME, BIRCH, OAK, BEECH, SPRUCE, PINE, ALDER, WILLOW)}
"""Trees by name."""

BUSHES: Final[Mapping[str, Species]] = {s.name: s for s in (BOX, HAZEL, JUNIPER, GORSE, BRAMBLE, GREY_WILLOW, HEATHER)}
"""Bushes by name."""
