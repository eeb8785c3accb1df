# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Street furniture and power lines: each function makes a mesh with its colliders."""

from fieldtruth.world.furniture.bench import make_bench
from fieldtruth.world.furniture.cables import hang, make_cable
from fieldtruth.world.furniture.lamp_post import make_lamp_post
from fieldtruth.world.furniture.power_pole import make_power_pole, wire_points
from fieldtruth.world.furniture.table import make_table
from fieldtruth.world.furniture.trash_bin import make_trash_bin

__all__ = [
    "hang",
    "make_bench",
    "make_cable",
    "make_lamp_post",
    "make_power_pole",
    "make_table",
    "make_trash_bin",
    "wire_points",
]
