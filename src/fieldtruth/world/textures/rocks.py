# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Surfaces of stones and rocks."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from fieldtruth.world.textures.canvas import Recipe

RECIPES: Final[Mapping[str, Recipe]] = MappingProxyType({})
