# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Grown plants: trees and bushes as meshes of trunk, branches and single leaves."""

from fieldtruth.world.plants.catalogue import BUSHES as BUSHES
from fieldtruth.world.plants.catalogue import SPECIES as SPECIES
from fieldtruth.world.plants.plant import grow_bush as grow_bush
from fieldtruth.world.plants.plant import grow_tree as grow_tree
from fieldtruth.world.plants.species import Species as Species
