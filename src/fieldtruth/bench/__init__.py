# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How fast this machine makes data, each sensor side by side with bare Embree on the same rays."""

from fieldtruth.bench.all import run_all
from fieldtruth.bench.figures import FIGURES, RATIOS, Figure, table, table_of_all
from fieldtruth.bench.measure import Settings, run, settings_of

__all__ = ["FIGURES", "RATIOS", "Figure", "Settings", "run", "run_all", "settings_of", "table", "table_of_all"]
