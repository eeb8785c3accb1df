# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Bar chart of class shares (paper, Figure 21), with a swatch of each class as the legend of its colour."""

from collections.abc import Iterator
from typing import Final

from fieldtruth.core.classes import CLASSES, SemanticClass
from fieldtruth.report.drawing.style import HAIRLINE, INK, MUTED, PIXELS, POINTS, class_colour, percent
from fieldtruth.report.preview.paper import Paper
from fieldtruth.report.shares import ClassShares

_NAME: Final = 1.52  # [inch] for swatch and name
_VALUE: Final = 0.42  # [inch] for the number beside the longest bar
_BAR: Final = 0.092  # [inch]


def draw_shares(paper: Paper, shares: ClassShares, left: float, top: float, width: float, height: float) -> None:
    """Fill a box with a row for each class that occurs."""
    rows = list(occurring_classes(shares))
    longest = max((max(share) for _, *share in rows), default=0.0) or 1.0
    pitch = min(height / max(len(rows), 1), 0.5)
    paper.box(left + _NAME, top, 0.006, pitch * len(rows), HAIRLINE)
    for k, (row, *share) in enumerate(rows):
        middle = top + (k + 0.5) * pitch
        paper.box(left, middle - 0.085, 0.25, 0.17, class_colour(row.label), edgecolor=HAIRLINE, linewidth=0.6)
        paper.text(left + 0.36, middle + 0.042, row.name, 8.2)
        for value, colour, offset in zip(share, (PIXELS, POINTS), (-_BAR - 0.008, 0.008), strict=True):
            length = (width - _NAME - _VALUE) * value / longest
            end, ink = left + _NAME + length + 0.06, INK if value else MUTED
            paper.box(left + _NAME, middle + offset, length, _BAR, colour)
            paper.text(end, middle + offset + 0.077, percent(value, 1), 5.9, color=ink)


def occurring_classes(shares: ClassShares) -> Iterator[tuple[SemanticClass, float, float]]:
    """Classes with at least one pixel or point, each with its share of pixels and of points."""
    for row, pixels, points in zip(CLASSES, shares.pixel_share, shares.point_share, strict=True):
        if pixels or points:
            yield row, float(pixels), float(points)
