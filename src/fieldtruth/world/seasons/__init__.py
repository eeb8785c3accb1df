# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Seasons: what a built world looks like in spring, autumn or winter, after drought, and below snow.

Environments build the world of summer; `change.in_season` turns it into that of another season by a table
(``seasons`` sections of the data files). Positions, stems and ground stay the same in all seasons.
"""

from fieldtruth.world.seasons.table import SEASONAL, Change, seasons

__all__ = ["SEASONAL", "Change", "seasons"]
