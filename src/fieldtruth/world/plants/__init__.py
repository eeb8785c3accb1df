# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grown plants: trees and bushes as meshes of trunk, branches and single leaves."""

from fieldtruth.world.plants.catalogue import BUSHES, SPECIES
from fieldtruth.world.plants.plant import grow_bush, grow_tree
from fieldtruth.world.plants.species import GrownIn, Species

__all__ = ["BUSHES", "SPECIES", "GrownIn", "Species", "grow_bush", "grow_tree"]
