# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of the ground: erosion, slopes that a robot can drive, microrelief, and what trees leave in it."""

from fieldtruth.world.relief.erosion import Eroded, collapsed, eroded
from fieldtruth.world.relief.roots import root_swells
from fieldtruth.world.relief.roughness import Axes, with_microrelief
from fieldtruth.world.relief.slopes import limit_slope, slope_limit
from fieldtruth.world.relief.uprooting import pits_and_mounds

__all__ = [
    "Axes",
    "Eroded",
    "collapsed",
    "eroded",
    "limit_slope",
    "pits_and_mounds",
    "root_swells",
    "slope_limit",
    "with_microrelief",
]
