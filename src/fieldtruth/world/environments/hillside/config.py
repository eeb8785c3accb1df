# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of the hillside."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.fields import Boolean, Number
from fieldtruth.world.environments.layout import Count, Density, GroundConfig, Individuals


class Config(GroundConfig):
    """Layout of the hillside."""

    environment = "hillside"
    grounds = ("dry_turf", "stony_soil", "scree", "rock")

    ruggedness: Annotated[Number, Field(ge=0, le=3)] = 1.3  # [m], deviation of the noise from which erosion starts
    gullies: Annotated[Number, Field(ge=0, le=4)] = 1.0  # relative depth of what streams cut
    steepest_deg: Annotated[Number, Field(ge=15, le=40)] = 36.0  # anywhere
    route_slope_deg: Annotated[Number, Field(ge=5, le=15)] = 13.0  # in the corridors
    crags: Count = 26  # outcrops of 2 to 3 m
    boulders: Count = 34  # 1 to 2 m
    blocks: Count = 44  # 0.4 to 1 m
    slabs: Count = 16  # sheets of granite
    stones: Density = 3.0  # per m^2 at most, 10 to 25 cm
    pebbles: Density = 5.0  # per m^2 at most, 3 to 9 cm
    junipers: Count = 18
    gorse: Count = 40
    cushions: Count = 60  # heather
    pines: Count = 6
    oaks: Count = 6
    snags: Count = 3
    grass: Density = 7.0  # tufts per m^2 at most
    individuals: Individuals = 3  # of each species and size
    beyond: Boolean = True  # land, plants and rocks beyond the edge
