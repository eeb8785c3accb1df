# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout and corridors of the hillside."""

from typing import Annotated, Final

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


CORRIDORS: Final = (
    (  # hillside_1
        (-44.0000030218433, -6.999996584530727), (-34.000012900867134, -9.499967448131471),
        (-24.00003202949876, -5.499997403124418), (-12.99999836681317, -8.499998206086962),
        (-1.9999732491508202, -4.499972947382351), (8.999949725238167, -7.999999415831536),
        (19.999975986901376, -4.500026395124277), (31.000009846474157, -7.500004713221495),
        (37.50001091793564, -5.999967785831222), (42.00003569546829, -1.9999875895732537),
        (42.000036461917844, 3.500014203478422), (37.50001279941563, 7.499995654229825),
        (27.99999288137294, 8.500005290664795), (18.000001722753186, 5.500026322020399),
        (8.000019338312537, 9.000001015168955), (-1.9999717860531456, 6.0000118262200814),
        (-11.000023271138295, 8.4999950471252), (-17.70001453409614, 6.800018872748952),
    ),
    (  # hillside_2
        (-20.800025158764655, 7.399997330732133), (-11.000023271138295, 8.4999950471252),
        (-1.9999717860531456, 6.0000118262200814), (8.000019338312537, 9.000001015168955),
        (18.000001722753186, 5.500026322020399), (27.99999288137294, 8.500005290664795),
        (37.50001279941563, 7.499995654229825), (42.000036461917844, 3.500014203478422),
        (42.00003569546829, -1.9999875895732537), (37.50001091793564, -5.999967785831222),
        (31.000009846474157, -7.500004713221495), (19.999975986901376, -4.500026395124277),
        (8.999949725238167, -7.999999415831536), (-1.9999732491508202, -4.499972947382351),
        (-12.99999836681317, -8.499998206086962), (-24.00003202949876, -5.499997403124418),
        (-34.000012900867134, -9.499967448131471), (-44.499968964672775, -6.999997234796744),
    ),
)  # fmt: skip
"""Corners x, y [m] of the corridors' centre lines, joined by straight segments; the built-in experiments drive there.

Every layout keeps them free of obstacles. Changing a number changes every world of this environment.
"""
