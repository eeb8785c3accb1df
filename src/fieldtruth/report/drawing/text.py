# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Numbers and names as a reader wants them."""

from typing import Final

MINUS: Final = "\N{MINUS SIGN}"
TIMES: Final = "\N{MULTIPLICATION SIGN}"
TO: Final = "\N{EN DASH}"
LETTERS: Final = 160
"""At most so many letters of a name that the bag gives."""


def shortened(name: str) -> str:
    """A name that a bag gives, not longer than a page can bear, and without letters that cannot be seen."""
    name = "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in name[: LETTERS + 1])
    return name if len(name) <= LETTERS else name[: LETTERS - 1] + "…"


def count_text(count: int) -> str:
    """A whole number with its thousands apart."""
    return f"{count:,}"


def fixed(value: float, decimals: int) -> str:
    """A number with so many decimals; nought has no sign."""
    text = f"{value:.{decimals}f}"
    return (text if float(text) else text.lstrip("-")).replace("-", MINUS)


def trimmed(value: float, decimals: int) -> str:
    """A number with at most so many decimals."""
    text = fixed(value, decimals)
    return text.rstrip("0").rstrip(".") if "." in text else text


def size_text(byte: int) -> tuple[str, str]:
    """A file's size and its unit."""
    for unit, scale in (("GB", 1e9), ("MB", 1e6)):
        if byte >= scale:
            return f"{byte / scale:.3g}" if byte < 100 * scale else f"{byte / scale:.0f}", unit
    return f"{byte / 1e3:.3g}", "kB"
