# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of the ground: erosion, slopes that a robot can drive, and the small unevenness of natural soil."""

from fieldtruth.world.relief.erosion import Eroded, collapsed, eroded
from fieldtruth.world.relief.gentle import gentled, slope_limit
from fieldtruth.world.relief.uneven import pits_and_mounds, root_swells

__all__ = ["Eroded", "collapsed", "eroded", "gentled", "pits_and_mounds", "root_swells", "slope_limit"]
