# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds: terrain, plants, furniture, materials, and the environments that put them together."""

from fieldtruth.world.build import build_world, load_world, world_of
from fieldtruth.world.model import World

__all__ = ["World", "build_world", "load_world", "world_of"]
