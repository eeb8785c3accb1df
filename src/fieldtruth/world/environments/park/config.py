# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout of the park."""

from typing import Annotated, Final

from pydantic import Field, field_validator

from fieldtruth.experiment.fields import Boolean, Number, Positive
from fieldtruth.world.environments.layout import Count, GroundConfig, Individuals, Share, Trails

PLANTED_BEYOND: Final = 0.7


class Config(GroundConfig):
    """Layout of the park; the counts are those of the published world."""

    environment = "park"
    grounds = ("gravel", "lawn")

    relief: Number = 0.21  # [m], standard deviation of the ground's height
    trails: Trails = (
        ((-58, -7), (-33, -6), (-17, -3), (0, 3.5), (12, 8.5), (26, 12), (40, 14.5), (58, 20)),
        ((-31, 34), (-22, 18), (-12, 8), (-3.5, 1.2), (4, -6), (16, -12), (32, -15), (58, -18)),
    )  # [m]
    trail_width: Positive = 2.4  # [m]
    border_width: Positive = 0.14  # [m]
    large_trees: Count = 23
    small_trees: Count = 15
    bushes: Count = 34
    benches: Count = 16
    lamp_posts: Count = 15
    tables: Count = 11
    trash_bins: Count = 11
    individuals: Individuals = 4  # of each common species and size
    herbs: Share = 1.0  # of the flowers and the long grass
    beyond: Annotated[Share | Boolean, Field(description="a number between 0 and 1, or false")] = PLANTED_BEYOND
    """Share of the trees and bushes beyond the edge; False: nothing is there, no land either."""

    @field_validator("beyond")
    @classmethod
    def _with_land(cls, beyond: float | bool) -> float | bool:
        return PLANTED_BEYOND if beyond is True else beyond
