# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""The speed of this machine: each sensor against bare Embree on the same rays, recording, and memory."""

from fieldtruth.bench.measure import UNITS, Settings, measure, settings_of, table

__all__ = ["UNITS", "Settings", "measure", "settings_of", "table"]
