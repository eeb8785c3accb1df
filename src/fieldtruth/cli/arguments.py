# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Shared by the sub-commands: a parser that raises instead of printing, and converters of values.

The arguments of all sub-commands are in ``commands.toml``.
"""

import argparse
from collections.abc import Callable, Mapping
from math import inf, nan
from pathlib import Path
from typing import Any, Final, NoReturn

from fieldtruth.core.errors import FieldtruthError
from fieldtruth.core.parallel import cpu_count
from fieldtruth.experiment.environment_file import Chosen, is_environment_file, resolved, with_paths


class UsageError(FieldtruthError):
    """The command line itself is wrong."""


class Parser(argparse.ArgumentParser):
    """Raises UsageError instead of printing its usage and ending the process."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(message.removeprefix("argument ").replace(": must be ", " must be ", 1))


Command = Callable[[argparse.Namespace], int | None]
"""A sub-command; returns its exit code, None for 0."""


def changes(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the options of ``generate`` change in an experiment, or in each one of a campaign; None: nothing."""
    from fieldtruth.experiment.files import read_signal

    return {
        "seconds": options.seconds,
        "seed": options.seed,
        **dict.fromkeys(options.off or (), False),
        "extras": options.extras,
        "light": options.light,
        "signal": None if options.signal is None else read_signal(options.signal),
    }


def number(text: str) -> float:
    """Parse a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None


def seed(text: str) -> int:
    """Parse a seed."""
    return _integer(text, range(2**63), f"between 0 and {2**63 - 1}")


def count(text: str) -> int:
    """Parse an integer of at least 1."""
    return _integer(text, range(1, 2**63), "of at least 1")


def _integer(text: str, allowed: range, condition: str) -> int:
    try:
        value = int(text)
    except ValueError:
        value = None
    if value is None or value not in allowed:
        raise argparse.ArgumentTypeError(f"must be an integer {condition}, got {text!r}")
    return value


def checked_layout(environment: str, path: Path, base: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Read a file with changes to a layout, and check them over ``base``; raises as ``check_layout``."""
    from fieldtruth.core.yaml_io import parse_mapping, read_text
    from fieldtruth.world.build import check_layout

    layout = with_paths(parse_mapping(read_text(path), str(path)), path.parent)
    check_layout(environment, {**(base or {}), **layout}, str(path))
    return layout


def chosen(
    options: argparse.Namespace, default: Mapping[str, Any] | None = None, like: Mapping[str, Any] | None = None
) -> "Chosen":
    """Return the environment of a command, a name or a file, with its layout.

    From the lowest to the topmost that is ``default``, the file, ``like`` of an experiment, and ``--layout``.

    Raises:
        UnknownNameError, ConfigurationError: as ``check_layout``.
    """
    from fieldtruth.world.environments import find_environment

    if not is_environment_file(options.environment):
        find_environment(options.environment)  # what follows takes a second to load
    from fieldtruth.world.build import check_layout

    if options.layout is None or like or is_environment_file(options.environment):
        check_layout(options.environment, like)
    changes = {} if options.layout is None else checked_layout(options.environment, options.layout, like)
    environment, own = resolved(options.environment)
    return Chosen(environment, {**(default or {}), **own, **(like or {}), **changes})


def words(text: str) -> list[str]:
    """Split words separated by commas."""
    return [word.strip() for word in text.split(",")]


def numbers(text: str) -> list[float]:
    """Parse numbers separated by commas."""
    return [number(word) for word in words(text)]


def area(text: str) -> list[float]:
    """Parse a rectangle."""
    try:
        x0, y0, x1, y1 = map(float, text.split(","))
    except ValueError:
        x0 = y0 = x1 = y1 = nan
    if not (-inf < x0 < x1 < inf and -inf < y0 < y1 < inf):
        raise argparse.ArgumentTypeError(f"must be x0,y0,x1,y1 [m] with x0 < x1 and y0 < y1, got {text!r}")
    return [x0, y0, x1, y1]


_TYPES: Final = {
    "area": area,
    "count": count,
    "number": number,
    "numbers": numbers,
    "path": Path,
    "seed": seed,
    "words": words,
}


def add_arguments(parser: Parser, rows: Mapping[str, str | Mapping[str, Any]]) -> None:
    """Add the arguments of a sub-command, as ``commands.toml`` has them."""
    groups: dict[str | bool, Any] = {}
    for name, row in rows.items():
        given: dict[str, Any] = {"help": row} if isinstance(row, str) else dict(row)
        owner: Any = parser
        if title := given.pop("group", ""):
            owner = groups[title] = groups.get(title) or parser.add_argument_group(title)
        if given.pop("exclusive", False):
            owner = groups[True] = groups.get(True) or parser.add_mutually_exclusive_group()
        if "metavar" not in given:
            given.setdefault("action", "store_true")
        if "type" in given:
            given["type"] = _TYPES[given["type"]]
        if given.get("default") == "cores":
            given["default"] = cpu_count()
        owner.add_argument(name, **given)
