# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, in one page. The command line turns each of these into one line and exit code 2."""

import difflib
from collections.abc import Iterable


class FieldtruthError(Exception):
    """Base of everything that a user can repair. Its text says what is wrong, where, and what would be right."""


class UnknownNameError(FieldtruthError):
    """A name that does not exist; the text lists those that do, the nearest first."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        ranked = nearest_first(name, known)
        super().__init__(f"no {kind} {name!r}; there is: {', '.join(ranked)}")


class ConfigurationError(FieldtruthError):
    """A value in a configuration that is not allowed; the text names key, value and what is allowed."""


class OutputError(FieldtruthError):
    """The output folder cannot be used: occupied, unwritable, or full."""


class RouteError(FieldtruthError):
    """A route that cannot be driven, or cannot be found; names the way-point, the place and what is in the way."""


class DriveError(FieldtruthError):
    """The robot is stuck, tipped, touched an obstacle, drove into water or left the world; says when and where."""


class EngineError(FieldtruthError):
    """The ray engine on this machine is not the one the kernels were written for."""


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """Sort ``known`` by likeness to ``name``, the most alike first."""
    return sorted(known, key=lambda k: (-difflib.SequenceMatcher(None, name.lower(), k.lower()).ratio(), k))
