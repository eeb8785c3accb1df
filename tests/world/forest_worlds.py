# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Forests for tests: the full layout, but with one individual of each species and age and without textures."""

from functools import cache
from typing import Any

from sense_worlds import without_textures

from fieldtruth.world.build import build_world
from fieldtruth.world.model import World


@cache
def forest_variant(seed: int, **changes: Any) -> World:
    """A quick forest; textures do not change its layout."""
    with without_textures():
        return build_world("forest", seed, {"individuals": 1, **changes})
