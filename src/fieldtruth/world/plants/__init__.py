# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Generated plants: trees and bushes of trunk, branches and leaves; grass and herbs of blades; dead wood."""

from fieldtruth.world.plants.catalogue import BUSHES, GRASSES, TREES
from fieldtruth.world.plants.clumps import grow_clump
from fieldtruth.world.plants.deadwood import clearance_circles, grow_log, grow_snag, grow_stump
from fieldtruth.world.plants.grass_species import GrassSpecies
from fieldtruth.world.plants.plant import grow_bush, grow_tree
from fieldtruth.world.plants.species import GrownIn, Species
from fieldtruth.world.plants.tufts import grow_tuft
from fieldtruth.world.plants.twigs import grow_twigs

__all__ = [
    "BUSHES",
    "GRASSES",
    "TREES",
    "GrassSpecies",
    "GrownIn",
    "Species",
    "clearance_circles",
    "grow_bush",
    "grow_clump",
    "grow_log",
    "grow_snag",
    "grow_stump",
    "grow_tree",
    "grow_tuft",
    "grow_twigs",
]
