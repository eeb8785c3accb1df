# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What the sub-commands' arguments have in common: a parser that never prints by itself, and the types of values."""

import argparse
from collections.abc import Callable
from typing import NoReturn, Protocol

from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.parallel import cpu_count


class UsageError(FieldtruthError):
    """The command line itself is wrong."""


class Parser(argparse.ArgumentParser):
    """Reports a mistake as an exception instead of printing its usage and ending the process."""

    def error(self, message: str) -> NoReturn:
        """Report it."""
        raise UsageError(message)


Command = Callable[[argparse.Namespace], int | None]
"""A sub-command; it returns its exit code, None for 0."""


class AddCommand(Protocol):
    """Makes a sub-command."""

    def __call__(self, name: str, run: Command, help_text: str, epilog: str | None = None) -> Parser: ...  # noqa: D102


def available_cores() -> int:
    """Cores that this process may use."""
    return cpu_count()


def add_workers(parser: Parser, help_text: str) -> None:
    """Let the user choose the number of threads."""
    parser.add_argument("--workers", metavar="N", type=count, default=available_cores(), help=help_text)


def number(text: str) -> float:
    """A number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None


def whole_number(text: str) -> int:
    """A whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number") from None


def seed(text: str) -> int:
    """A seed of everything random."""
    number = whole_number(text)
    if not 0 <= number < 2**63:
        raise argparse.ArgumentTypeError(f"{text} is not allowed; allowed is a whole number from 0 up to 2^63 - 1")
    return number


def count(text: str) -> int:
    """A whole number from 1 up."""
    number = whole_number(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text} is below 1")
    return number


def words(text: str) -> list[str]:
    """Words between commas."""
    return [word.strip() for word in text.split(",")]
