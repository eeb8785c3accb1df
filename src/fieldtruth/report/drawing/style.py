# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Colours and typeface of sheets, pages and workbooks, and numbers and names as text for readers."""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from fieldtruth.core.classes import SemanticClass
from fieldtruth.experiment.sensor_config import SensorConfig

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
MINUS: Final = "\N{MINUS SIGN}"
TIMES: Final = "\N{MULTIPLICATION SIGN}"
TO: Final = "\N{EN DASH}"
LETTERS: Final = 160
"""Maximum length of a name from a bag."""


def class_colour(row: SemanticClass) -> str:
    """Colour of a class as ``#rrggbb``; grey for void."""
    return "#{:02x}{:02x}{:02x}".format(*(row.rgb or _NO_CLASS))


def shortened(name: str) -> str:
    """Cut a name from a bag to ``LETTERS`` and replace letters that are not printable."""
    name = "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in name[: LETTERS + 1])
    return name if len(name) <= LETTERS else name[: LETTERS - 1] + "…"


def sensor_nouns(sensors: Iterable[SensorConfig]) -> list[str]:
    """Count sensors by what they are called: ``2 LiDARs``, ``1 IMU``."""
    nouns = Counter(each.noun for each in sensors)
    return [noun if noun.endswith("s") else f"{n} {noun}{'s' * (n > 1)}" for noun, n in nouns.items()]


def fixed(value: float, decimals: int) -> str:
    """Format with a fixed number of decimals; zero has no sign."""
    text = f"{value:.{decimals}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", MINUS)


def trimmed(value: float, decimals: int) -> str:
    """Format with at most so many decimals, without trailing zeros."""
    text = fixed(value, decimals)
    return text.rstrip("0").rstrip(".") if "." in text else text


def percent(share: float, decimals: int) -> str:
    """Format a share of 1 as percent; "none" for zero, "< 0.01 %" for what would be rounded to zero."""
    if share == 0.0:
        return "none"
    least = 10.0**-decimals
    return f"< {least:g} %" if 100 * share < least / 2 else f"{100 * share:.{decimals}f} %"


def file_size(size: int) -> tuple[str, str]:
    """Size of a file, given in bytes, as a number of three digits and its unit."""
    for unit, scale in (("GB", 1e9), ("MB", 1e6)):
        if size >= scale:
            return f"{size / scale:.3g}" if size < 100 * scale else f"{size / scale:.0f}", unit
    return f"{size / 1e3:.3g}", "kB"
