# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of the lake's shore."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Boolean, Number
from fieldtruth.world.environments.layout import Count, GroundConfig, Individuals, LengthCount


class Config(GroundConfig):
    """Layout of the lake's shore."""

    environment = "lake"
    grounds = ("meadow", "earth", "mud")

    water_level: Number = -3.0  # [m]
    edge: Number = -13.5  # [m], mean y of the water's edge; the lake lies east of it
    bends: Annotated[Number, Field(ge=0, le=6)] = 3.0  # [m], deviation of its points and coves
    bank: Annotated[Number, Field(ge=1, le=6)] = 3.4  # [m], the meadow's height above the water
    relief: Annotated[Number, Field(ge=0, le=1)] = 0.3  # [m], deviation of the meadow's swells
    line_y: Number = 17.5  # [m] of the power line
    pole_distance: Annotated[Number, Field(ge=20, le=80)] = 46.0  # [m]
    sag: Annotated[Number, Field(gt=0, le=0.05)] = 0.018  # of a wire, relative to its span
    waterside_trees: LengthCount = 13
    meadow_trees: Count = 30
    waterside_bushes: LengthCount = 12
    meadow_bushes: Count = 26
    individuals: Individuals = 3  # of each species
    grass: Annotated[Number, Field(ge=0, le=4)] = 1.0  # density of all high grass relative to the default
    beyond: Boolean = True  # land, water, wires and plants beyond the edge
