# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Layout and corridors of the lake's shore."""

from typing import Annotated, Final

from pydantic import Field

from fieldtruth.experiment.fields import Boolean, Number
from fieldtruth.world.environments.layout import Count, GroundConfig, Individuals, ShoreCount


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
    waterside_trees: ShoreCount = 13
    meadow_trees: Count = 30
    waterside_bushes: ShoreCount = 12
    meadow_bushes: Count = 26
    individuals: Individuals = 3  # of each species
    grass: Annotated[Number, Field(ge=0, le=4)] = 1.0  # density of all high grass relative to the default
    beyond: Boolean = True  # land, water, wires and plants beyond the edge


CORRIDORS: Final = (
    (  # lake_1
        (-42.99996332401504, -3.499997641991767), (-31.000000312511315, -5.500004557242578),
        (-19.00003726343079, -6.800020515416449), (-6.999965419129802, -5.800002452110969),
        (4.99999828508459, -7.200019194910066), (16.999959630275868, -6.500025784575239),
        (29.000032203408864, -5.500015079599732), (40.50002720844483, -3.500015179130801),
        (45.500020433987316, 2.500018782660751), (42.00004284982404, 9.000015996464747),
        (31.000018677086093, 12.299970370724836), (18.000009155646133, 10.50001759486561),
        (4.999998694888806, 7.499969104964348), (-8.000005766527117, 8.000024687768034),
        (-19.999961827974072, 11.200002062000479), (-32.0000333170077, 11.800002826162128),
        (-40.9999827464761, 8.499970586819838), (-44.4999732161523, 1.8000033943630167),
    ),
    (  # lake_2
        (-44.59996668075807, 0.4999690209894707), (-41.49994945738404, 8.000002643610557),
        (-32.000032425207436, 12.200034582443605), (-19.999960545657466, 11.799976513602903),
        (-8.000005000282545, 8.499990308562746), (4.999998694888806, 7.499969104964348),
        (18.000008578686074, 10.199996565178585), (29.999975677598176, 12.399979443283268),
        (41.49996701050091, 9.799997574288), (45.99998644693562, 2.5000185503942554),
        (40.99999371700588, -4.199989087280037), (29.000032964420342, -6.199990873729258),
        (16.99996025739605, -6.999989082600366), (4.999998556447791, -7.4000336977096115),
        (-6.999964857182674, -6.299967979765098), (-19.000036471949954, -7.399994855660395),
        (-30.99999977862302, -5.999972314700242), (-44.299985653283045, -3.9999674806522556),
    ),
)  # fmt: skip
"""Corners x, y [m] of the corridors' centre lines, joined by straight segments; the built-in experiments drive there.

Every layout keeps them free of obstacles. Changing a number changes every world of this environment.
"""
