# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shapes of the ground: erosion, and slopes that a robot can drive."""

from fieldtruth.world.relief.erosion import Eroded, collapsed, eroded
from fieldtruth.world.relief.slopes import limit_slope, slope_limit

__all__ = ["Eroded", "collapsed", "eroded", "limit_slope", "slope_limit"]
