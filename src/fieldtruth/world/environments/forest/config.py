# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of the forest."""

from collections.abc import Mapping

from pydantic import Field, field_validator

from fieldtruth.core.errors import suggestion
from fieldtruth.experiment.fields import Boolean, Positive
from fieldtruth.world.environments.layout import Count, Density, GroundConfig, Individuals, Share, Trails
from fieldtruth.world.plants import TREES


class Config(GroundConfig):
    """Layout of the forest."""

    environment = "forest"
    grounds = ("trodden_earth", "forest_floor")

    relief: Positive = 0.55  # [m], standard deviation of the ground's height
    trails: Trails = (
        ((-60, -15), (-42, -9), (-31, -11), (-19, -4), (-8, -5), (4, 1), (15, 7), (27, 4), (38, 8), (60, 2)),
        ((-27, 36), (-19, 20), (-13, 13), (-9, 4), (-8, -5), (-1, -12), (10, -14), (21, -10), (29, -16), (34, -36)),
    )  # [m]
    trail_width: Positive = 1.7  # [m]
    old_trees: Count = 205
    grown_trees: Count = 100
    young_trees: Count = 62
    snags: Count = 14
    fallen_trunks: Count = 13
    stumps: Count = 16
    bushes: Count = 38
    rocks: Count = 36
    stones_per_m2: Density = 0.35
    grass_per_m2: Density = 5.0
    ferns_per_m2: Density = 0.75
    seedlings_per_m2: Density = 0.6
    saplings_per_m2: Density = 0.08
    bilberries_per_m2: Density = 1.6
    brambles_per_m2: Density = 0.03
    twigs_per_m2: Density = 0.5
    individuals: Individuals = 4  # of each species and age
    species: Mapping[str, Share] = Field(
        default={"spruce": 0.36, "beech": 0.26, "pine": 0.16, "birch": 0.1, "oak": 0.12},
        description="shares by species, each from 0 up to 1",
    )
    """Shares of the trees."""
    beyond: Boolean = True  # land and trees beyond the edge

    @field_validator("species")
    @classmethod
    def _known(cls, species: Mapping[str, float]) -> Mapping[str, float]:
        unknown = [name for name in species if name not in TREES]
        if unknown:
            raise ValueError(f"unknown species {unknown[0]!r}; {suggestion(unknown[0], sorted(TREES))}")
        if not sum(species.values()) > 0:
            raise ValueError(f"at least one share must be above 0. Available: {', '.join(sorted(TREES))}")
        return species
