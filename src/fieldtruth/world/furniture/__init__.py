# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Park furniture, modelled in full: each maker takes the number of a variant and returns a mesh with its colliders."""

from fieldtruth.world.furniture.bench import make_bench
from fieldtruth.world.furniture.lamp_post import make_lamp_post
from fieldtruth.world.furniture.table import make_table
from fieldtruth.world.furniture.trash_bin import make_trash_bin

__all__ = ["make_bench", "make_lamp_post", "make_table", "make_trash_bin"]
