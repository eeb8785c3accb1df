# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""How fast this machine makes data, each sensor side by side with bare Embree on the same rays."""

from fieldtruth.bench.figures import FIGURES, Figure, table
from fieldtruth.bench.measure import Settings, run

__all__ = ["FIGURES", "Figure", "Settings", "run", "table"]
