# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of a run, in one pass over its bag: see docs/validate.md."""

from fieldtruth.validation.check import Check, as_json, as_text

__all__ = ["Check", "as_json", "as_text"]
