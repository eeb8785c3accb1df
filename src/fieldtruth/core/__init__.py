# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shared helpers that know nothing of worlds, robots or bags: arrays, classes, errors, frames, files, cache."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["frames", "geodesy"])
