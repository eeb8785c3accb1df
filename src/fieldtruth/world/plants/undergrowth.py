# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All grass and herbs by name. A new one is a `GrassSpecies` in one of the two files and a word here."""

from collections.abc import Mapping
from typing import Final

from fieldtruth.world.plants.grasses import CATTAIL, DRY, FOREST, MEADOW, REED, SEDGE
from fieldtruth.world.plants.herbs import BRACKEN, BUTTERCUP, DAISY, DOCK, FERN, NETTLE, YARROW
from fieldtruth.world.plants.tufts import GrassSpecies

GRASSES: Final[Mapping[str, GrassSpecies]] = {
    t.name: t
    for t in (MEADOW, DRY, REED, CATTAIL, SEDGE, FOREST, FERN, BRACKEN, NETTLE, DOCK, DAISY, BUTTERCUP, YARROW)
}
"""Grass and herbs by name, class high grass."""
