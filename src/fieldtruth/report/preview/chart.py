# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Class shares as bars, pixels blue and points red (paper, Figure 21); a row's swatch is the legend of its colour."""

from collections.abc import Iterator
from typing import Final

from fieldtruth.core.classes import CLASSES, SemanticClass
from fieldtruth.report.drawing.style import HAIRLINE, INK, MUTED, PIXELS, POINTS
from fieldtruth.report.preview.paper import Paper
from fieldtruth.report.shares import ClassShares

_NAME: Final = 1.52  # [inch] of swatch and name before the bars
_VALUE: Final = 0.42  # [inch] kept for the number after the longest bar
_BAR: Final = 0.092  # [inch]


def draw_shares(paper: Paper, shares: ClassShares, left: float, top: float, width: float, height: float) -> None:
    """Fill a box with a row per class that is seen."""
    rows = list(seen_classes(shares))
    longest = max((max(share) for _, *share in rows), default=0.0) or 1.0
    pitch = min(height / max(len(rows), 1), 0.5)
    room = width - _NAME - _VALUE
    paper.box(left + _NAME, top, 0.006, pitch * len(rows), HAIRLINE)
    for k, (row, *share) in enumerate(rows):
        middle = top + (k + 0.5) * pitch
        colour = "#{:02x}{:02x}{:02x}".format(*(row.rgb or (0, 0, 0)))
        paper.box(left, middle - 0.085, 0.25, 0.17, colour, edgecolor=HAIRLINE, linewidth=0.6)
        paper.text(left + 0.36, middle + 0.042, row.name, 8.2)
        for value, ink, offset in zip(share, (PIXELS, POINTS), (-_BAR - 0.008, 0.008), strict=True):
            length = room * value / longest
            paper.box(left + _NAME, middle + offset, length, _BAR, ink)
            paper.text(
                left + _NAME + length + 0.06, middle + offset + 0.077, _percent(value), 5.9,
                color=INK if value else MUTED,
            )  # fmt: skip


def seen_classes(shares: ClassShares) -> Iterator[tuple[SemanticClass, float, float]]:
    """Classes of which a pixel or a point was counted, with their share of pixels and of points."""
    for row, pixels, points in zip(CLASSES, shares.pixel_share, shares.point_share, strict=True):
        if pixels or points:
            yield row, float(pixels), float(points)


def _percent(share: float) -> str:
    if share == 0.0:
        return "none"
    return f"{100 * share:.1f} %" if share >= 0.0005 else "< 0.1 %"
