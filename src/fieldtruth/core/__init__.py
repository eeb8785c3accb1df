# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Helpers that do not depend on worlds, robots or bags: arrays, classes, errors, frames, files, cache."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, submodules=["geodesy", "transforms"])
