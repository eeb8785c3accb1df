# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout and corridors of the park."""

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


CORRIDORS: Final = (
    (  # park_1
        (-32.999974812154115, -5.999974544504729), (-26.000007087030646, -5.499999447091183),
        (-16.999954417766308, -3.0000142753608356), (-8.000011689755912, 0.49996562067011596),
        (1.000044017595883, 3.0000042406891345), (9.999988461456393, 3.999998964478449),
        (19.000042957825137, 2.999994206159849), (27.99998626133666, 0.9999963963212295),
        (35.99999832991257, -3.2151170614724833e-11), (43.50004460391669, 0.5000326799139421),
    ),
    (  # park_2
        (-40.50000530338069, -13.999984063722966), (-25.99998899275345, -15.000024617495916),
        (-12.999989377773082, -12.999980351768306), (1.821105711168066e-05, -14.000022391374372),
        (13.000021045589463, -12.999989387885567), (26.00002916075189, -14.000026595289835),
        (36.00000957196635, -11.000015850520073), (40.9999929146938, -2.9999819419243003),
        (39.000020165137094, 5.999966113333426), (29.99997477085212, 12.00002413985679),
        (16.99997140650365, 12.999979724987515), (3.9999636591124563, 12.000010273188533),
        (-9.000039178469219, 12.999970689140888), (-22.000046399430794, 11.999996405599028),
        (-32.999968865349885, 10.000005470781428), (-37.99997049252659, 3.0000259820373825),
        (-35.99999547449019, -3.000024867244946), (-26.000008411210448, -4.000025723276854),
        (-13.000004707932982, -2.0000080302948517), (2.39994794312552, 0.499964654422701),
    ),
)  # fmt: skip
"""Corners x, y [m] of the corridors' centre lines, joined by straight segments; the built-in experiments drive there.

Every layout keeps them free of obstacles. Changing a number changes every world of this environment.
"""
