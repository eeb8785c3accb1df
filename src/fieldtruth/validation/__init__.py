# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Every check that a careful user would make of a run, in one pass over its bag: see docs/validate.md."""

from fieldtruth.validation.check import Check, as_json, as_text
from fieldtruth.validation.passing import SAMPLES, validate

__all__ = ["SAMPLES", "Check", "as_json", "as_text", "validate"]
