# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Lakes for tests: the full layout, but with one individual of each plant and without textures."""

from functools import cache

from sense_worlds import without_textures

from fieldtruth.world.build import build_world
from fieldtruth.world.model import World


@cache
def lake_variant(seed: int, **changes: float) -> World:
    """A quick lake; textures do not change its layout."""
    with without_textures():
        return build_world("lake", seed, {"individuals": 1, "grass": 0.5, **changes})
