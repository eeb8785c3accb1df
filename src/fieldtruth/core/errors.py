# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""All errors that a user can correct. The command line prints each as one line and exits with code 2."""

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class FieldtruthError(Exception):
    """Base of all errors that a user can correct; the text states what is wrong, where, and what is allowed."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Let another process have the error with its text; a subclass may be made from other arguments."""
        return _with_text, (type(self), str(self))


def _with_text(kind: type[FieldtruthError], text: str) -> FieldtruthError:
    error = kind.__new__(kind)
    error.args = (text,)
    return error


class FieldtruthWarning(UserWarning):
    """Something that a user should know and that stops nothing; the command line prints it as one line."""


@contextmanager
def warnings_in_one_line(source: str = "") -> Iterator[None]:
    """Print our warnings as ``warning: SOURCE: ...`` without the position in the code; others as usual."""
    where = f"warning: {source}:" if source else "warning:"
    with warnings.catch_warnings():
        warnings.simplefilter("default", FieldtruthWarning)  # the same words once
        usual = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, FieldtruthWarning):
                print(where, " ".join(str(message).split()), file=sys.stderr)
            else:
                usual(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        yield


class UnknownNameError(FieldtruthError):
    """A name that does not exist; the text suggests the closest one, lists all, and starts with the ``source``."""

    def __init__(self, kind: str, name: str, known: Iterable[str], source: str = "") -> None:
        where = f"{source}: " if source else ""
        super().__init__(f"{where}unknown {kind} {name!r}; {suggestion(name, known)}")


class ConfigurationError(FieldtruthError):
    """A configuration value that is not allowed; the text names the key, the value and the condition."""


class OutputError(FieldtruthError):
    """The output already exists, is in use, or cannot be written."""


class SliceError(FieldtruthError):
    """A worker failed while it made a part of a recording; the text names the time, the error and its line."""


class RouteError(FieldtruthError):
    """A route that cannot be driven or found; the text names the waypoint, its position and the obstacle."""


class DriveError(FieldtruthError):
    """The robot got stuck, tipped over, touched an obstacle, entered water or left the world, when and where."""


class TrackError(FieldtruthError):
    """A track file that cannot be read or followed; the text names the file, the line or time, and the condition."""


class ClusterError(FieldtruthError):
    """A scheduler that does not answer, a worker that differs from this machine, or work that ended its workers."""


class EngineError(FieldtruthError):
    """The installed Embree is not the version for which the kernels were written."""


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return "did you mean 'x'? Available: x, y, z", without the question if no known name is close."""
    names = list(known)
    close = {k.lower(): k for k in names}
    match = difflib.get_close_matches(name.lower(), close, n=1)
    question = f"did you mean {close[match[0]]!r}? " if match else ""
    return f"{question}Available: {', '.join(names)}"


def nearest_first(name: str, known: Iterable[str]) -> list[str]:
    """Sort ``known`` by similarity to ``name``, the most similar first."""
    return sorted(known, key=lambda k: (-difflib.SequenceMatcher(None, name.lower(), k.lower()).ratio(), k))
