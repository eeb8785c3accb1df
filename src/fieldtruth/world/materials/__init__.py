# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Materials: tables of name, class, texture and how light leaves the surface.

A material belongs to exactly one class. Textures carry the surface's own albedo; a tint only sets apart things that
share a texture.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fieldtruth.world.materials import ground, rocks, trees, undergrowth, woods, works
from fieldtruth.world.model import Material

_TABLES: Final = (ground, woods, trees, undergrowth, rocks, works)

MATERIALS: Final[Mapping[str, Material]] = MappingProxyType({m.name: m for table in _TABLES for m in table.MATERIALS})
"""Every material by name; a world holds those that it uses."""
