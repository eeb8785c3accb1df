# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Generated plants: trees and bushes of trunk, branches and leaves; grass and herbs of blades; dead wood."""

from fieldtruth.world.plants.deadwood import clearance_circles, grow_log, grow_snag, grow_stump, grow_twigs
from fieldtruth.world.plants.grasses import grow_clump, grow_tuft
from fieldtruth.world.plants.species import BUSHES, GRASSES, TREES, GrassSpecies, GrownIn, Species
from fieldtruth.world.plants.trees import grow_bush, grow_tree

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
