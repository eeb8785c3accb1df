# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Rocks made by fracture and noise, and their poses in the ground."""

from fieldtruth.world.rocks.laying import lay_rock, scatter_rocks
from fieldtruth.world.rocks.rock import ROCK_TYPES, RockType, make_rock

__all__ = ["ROCK_TYPES", "RockType", "lay_rock", "make_rock", "scatter_rocks"]
