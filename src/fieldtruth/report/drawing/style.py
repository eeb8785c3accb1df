# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours and typeface of sheets, pages and workbooks."""

from typing import Final

from fieldtruth.core.classes import CLASSES

INK: Final = "#1d2733"
MUTED: Final = "#697586"
HAIRLINE: Final = "#d5dbe3"
NIGHT: Final = (30, 35, 43)
"""Background of clouds: dark enough for white benches, light enough for black tables."""
ROUTES: Final = ("#2f80ff", "#35d0ff", "#8f7bff")
RED: Final = "#ff3b30"
PIXELS: Final = "#2f6fde"
POINTS: Final = "#dc3f36"
FONT: Final = "DejaVu Sans"
_NO_CLASS: Final = (138, 138, 138)


def class_colour(label: int) -> str:
    """Colour of a class as ``#rrggbb``; grey for void."""
    return "#{:02x}{:02x}{:02x}".format(*(CLASSES[label].rgb or _NO_CLASS))
