# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Stones and rocks."""

from typing import Final

from fieldtruth.world.model import Material

MATERIALS: Final[tuple[Material, ...]] = ()
